//! The page of a report in a real browser, as people look at it: on a phone, a laptop and a wide screen, light and dark.

use crate::chromium::Chromium;
use crate::report::shared;
use serde_json::Value;

/// What must hold of any size and theme; what doesn't is returned.
const HOLDS: &str = r##"
const wrong = [];
const check = (holds, what) => { if (!holds) wrong.push(what); };
const root = document.documentElement;
check(root.scrollWidth <= root.clientWidth, `the page scrolls sideways: ${root.scrollWidth} in ${root.clientWidth}`);
const channels = (text) => text.match(/[\d.]+/g).map(Number);
const light = (color) => {
  const [r, g, b] = channels(color).map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const contrast = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
const paper = getComputedStyle(document.body).backgroundColor;
const dark = matchMedia("(prefers-color-scheme: dark)").matches;
check(dark ? light(paper) < 0.05 : light(paper) > 0.9, `paper ${paper}`);
for (const selector of ["body", ".note", ".facts dt", "th button", "td", "figcaption", ".kind"]) {
  const style = getComputedStyle(document.querySelector(selector));
  check(contrast(style.color, paper) >= 4.5, `${selector}: ${style.color} on ${paper}`);
}
for (const plot of document.querySelectorAll(".plot")) {
  const svg = plot.querySelector("svg");
  check(getComputedStyle(svg.querySelector(".paper")).fill === paper, `${plot.id}: paper`);
  const ink = getComputedStyle(svg.querySelector(".ink")).fill;
  check(contrast(ink, paper) >= 4.5, `${plot.id}: ink ${ink}`);
  for (const dot of svg.querySelectorAll(".dot")) {
    const color = getComputedStyle(dot).stroke;
    check(contrast(color, paper) >= 2, `${plot.id}: ${dot.className.baseVal} ${color} on ${paper}`);
  }
  const texts = [...svg.querySelectorAll("text")].map((text) => [text.textContent, text.getBoundingClientRect()]);
  const box = svg.getBoundingClientRect();
  texts.forEach(([words, a], i) => {
    const size = (parseFloat(getComputedStyle(svg.querySelectorAll("text")[i]).fontSize) * box.width) / svg.viewBox.baseVal.width;
    check(size >= 8 && a.left >= box.left - 1 && a.right <= box.right + 1, `${plot.id}: ${words} is small or cut`);
    for (const [others, b] of texts.slice(i + 1)) {
      const over = Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 3;
      check(!over, `${plot.id}: ${words} over ${others}`);
    }
  });
  const percents = texts.filter(([words]) => words.endsWith(" %")).length;
  const numbers = texts.filter(([words, r]) => /^[\d.]+$/.test(words) && r.top > box.top + 0.85 * box.height).length;
  check(percents >= 3 && numbers >= 2, `${plot.id}: ${percents} and ${numbers} ticks`);
}
for (const wide of document.querySelectorAll(".wide")) {
  const table = wide.querySelector("table");
  check(wide.clientWidth <= root.clientWidth, "a table is wider than the page");
  wide.scrollLeft = 10000;
  const [last, first] = [table.rows[0].cells[table.rows[0].cells.length - 1], table.rows[1].cells[0]];
  const frame = wide.getBoundingClientRect();
  check(last.getBoundingClientRect().right <= frame.right + 1, `${last.textContent} can't be reached`);
  check(first.getBoundingClientRect().left >= frame.left - 1, "the first column goes away");
  wide.scrollLeft = 0;
}
return wrong.slice(0, 12).join("\n");
"##;

/// Clicks and keys, and what must come of them.
const WORKS: &str = r##"
const wrong = [];
const check = (holds, what) => { if (!holds) wrong.push(what); };
const table = document.querySelector("table.sortable");
const column = (at) => [...table.tBodies[0].rows].map((row) => parseFloat(row.cells[at].textContent));
const rises = (list) => list.every((value, i) => i === 0 || list[i - 1] <= value);
const head = [...table.tHead.rows[0].cells].findIndex((cell) => cell.textContent === "Frame, ms");
const button = table.tHead.rows[0].cells[head].querySelector("button");
button.click();
check(rises(column(head)), "ascending");
button.click();
check(rises(column(head).reverse()) && !rises(column(head)), "descending");
check(table.tHead.rows[0].cells[head].getAttribute("aria-sort") === "descending", "aria-sort");
for (const head of document.querySelectorAll("th button")) check(!/_/.test(head.textContent) && head.title, `head ${head.textContent}`);
const figures = [...document.querySelectorAll("figure.flip")];
const shown = (figure) => [...figure.querySelectorAll("img")].findIndex((image) => image.offsetHeight > 0);
check(figures.length > 5 && figures.every((figure) => shown(figure) === 0), "pictures first");
figures[0].querySelector("button").click();
check(shown(figures[0]) === 1 && shown(figures[1]) === 0, "one reference after a click");
check(figures[0].querySelector(".kind").textContent === "reference", "its kind is said");
document.dispatchEvent(new KeyboardEvent("keydown", { key: "3" }));
check(figures.every((figure) => shown(figure) === 2), "error maps after 3");
document.dispatchEvent(new KeyboardEvent("keydown", { key: "1" }));
check([...document.images].every((image) => image.complete && image.naturalWidth === 24), "pictures load");
const pictures = figures.map((figure) => figure.querySelector("img").alt);
check(new Set(pictures).size === pictures.length, "pictures are told apart by their texts");
check([...document.images].every((image) => image.alt.length > 20), "texts say something");
const tips = [...document.querySelectorAll("#error_time .dot")].map((dot) => dot.getAttribute("aria-label"));
check(tips.length > 5 && new Set(tips).size === tips.length && tips.every((tip) => tip.includes("error")), "dots have words of their own");
document.querySelector("#error_time .dot").focus();
const tip = document.getElementById("tip");
check(!tip.hidden && tip.textContent === tips[0], "a dot in focus tells its words");
const [box, dot] = [tip.getBoundingClientRect(), document.activeElement.querySelector("circle").getBoundingClientRect()];
check(box.bottom <= dot.top || box.top >= dot.bottom, "beside the dot");
check(box.left >= 0 && box.right <= innerWidth, "within the screen");
return wrong.join("\n");
"##;

#[test]
fn in_a_browser_the_page_is_readable_on_any_screen_and_works_by_keyboard() {
    let Some(mut browser) = Chromium::start() else {
        assert!(
            std::env::var_os("RELIGHT_BROWSER_REQUIRED").is_none(),
            "no Chromium, though it is required"
        );
        eprintln!("SKIPPED: no Chromium on this machine: the report's page was NOT tested in a browser");
        return;
    };
    let (report, _) = shared();
    let page = format!("file://{}", report.join("report.html").display());
    let nothing = Value::from("");
    for (width, height) in [(390, 844), (1280, 800), (1920, 1080)] {
        for dark in [false, true] {
            browser.screen(width, height, dark);
            let theme = if dark { "dark" } else { "light" };
            browser.navigate(&format!("{page}?{width}{theme}"));
            browser.wait(&format!(
                "location.search === '?{width}{theme}' && document.readyState === 'complete'"
            ));
            assert_eq!(browser.evaluate(HOLDS), nothing, "{width} pixels, {theme}");
            assert_eq!(browser.evaluate(WORKS), nothing, "{width} pixels, {theme}");
            browser.screenshot_of(&format!("report_{width}_{theme}"), true);
        }
    }
    // From one dot to the next by the keyboard, as a user does.
    let tip = "return document.getElementById('tip').textContent";
    let before = browser.evaluate(tip);
    browser.press("Tab");
    let after = browser.evaluate(tip);
    assert_ne!(before, after);
    assert!(after.as_str().unwrap().contains("error"), "{after}");
    assert_eq!(browser.errors(), Vec::<String>::new());
}
