"use strict";
// Words are on the left and the first column stays where a wide table scrolls.
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  const rows = [...table.tBodies[0].rows];
  const number = (text) => parseFloat(text.replace("–", ""));
  heads.forEach((head, column) => {
    const cells = rows.map((row) => row.cells[column]);
    const words = cells.some((cell) => cell.textContent && cell.textContent !== "–" && isNaN(number(cell.textContent)));
    [head, ...cells].forEach((cell) => cell.classList.toggle("words", words));
    if (column === 0) [head, ...cells].forEach((cell) => cell.classList.add("fixed"));
  });
  // Sorted by the column whose head is pressed: numbers as numbers, the rest as text, what is missing last; again turns it round.
  const sort = (column) => {
    const up = heads[column].getAttribute("aria-sort") !== "ascending";
    heads.forEach((head) => head.removeAttribute("aria-sort"));
    heads[column].setAttribute("aria-sort", up ? "ascending" : "descending");
    const value = (row) => row.cells[column].textContent;
    const order = (a, b) => {
      const [x, y] = [number(value(a)), number(value(b))];
      if (isNaN(x) !== isNaN(y) && !heads[column].classList.contains("words")) return isNaN(x) ? 1 : -1;
      const by = !isNaN(x) && !isNaN(y) ? x - y : value(a).localeCompare(value(b));
      return up ? by : -by;
    };
    table.tBodies[0].append(...[...table.tBodies[0].rows].sort(order));
  };
  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => sort(column)));
}
// Words of a dot, wherever one points or steps to it.
const tip = document.getElementById("tip");
const tell = (dot) => {
  tip.textContent = dot.dataset.tip;
  tip.hidden = false;
  const at = dot.querySelector("circle").getBoundingClientRect();
  const box = tip.getBoundingClientRect();
  const room = document.documentElement.clientWidth - box.width - 4;
  tip.style.left = `${Math.max(4, Math.min(room, at.x + at.width / 2 - box.width / 2))}px`;
  tip.style.top = `${at.y > box.height + 12 ? at.y - box.height - 8 : at.bottom + 8}px`;
};
const hush = () => { tip.hidden = true; };
for (const dot of document.querySelectorAll(".plot .dot[data-tip]")) {
  // The page's own words come at once; the browser's, of the title, would come beside them.
  dot.querySelector("title")?.remove();
  dot.addEventListener("pointerenter", () => tell(dot));
  dot.addEventListener("pointerleave", hush);
  dot.addEventListener("focus", () => tell(dot));
  dot.addEventListener("blur", hush);
}
document.addEventListener("keydown", (event) => { if (event.key === "Escape") hush(); });
addEventListener("scroll", hush, { passive: true });
// Pictures flip between picture, reference and error map: one by pressing it, all by the keys 1 to 3.
const KINDS = ["picture", "reference", "error map"];
const show = (figure, at) => {
  const images = [...figure.querySelectorAll("img")];
  images.forEach((image, i) => image.classList.toggle("shown", i === at % images.length));
  figure.querySelector(".kind").textContent = KINDS[at % images.length];
};
const figures = [...document.querySelectorAll("figure.flip")];
for (const figure of figures) {
  figure.querySelector("button").addEventListener("click", () => {
    const at = [...figure.querySelectorAll("img")].findIndex((image) => image.classList.contains("shown"));
    show(figure, at + 1);
  });
}
document.addEventListener("keydown", (event) => {
  const at = "123".indexOf(event.key);
  if (event.key.length === 1 && at >= 0 && !event.ctrlKey && !event.metaKey && !event.altKey) {
    figures.forEach((figure) => show(figure, at));
  }
});
