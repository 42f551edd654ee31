//! The page in a real browser: Chromium, spoken to by the DevTools protocol. Skipped, loudly, where there is none; with
//! `RELIGHT_BROWSER_REQUIRED` set it fails instead. `RELIGHT_SCREENSHOTS` names a folder for pictures of the page.

// Reports are tested with it, too.
#[allow(dead_code)]
mod chromium;
mod served;

use chromium::Chromium;
use relight_play::glam::Vec3;
use relight_play::scene::image::preview::tone_mapped;
use relight_play::scene::light::LightKind;
use relight_play::scene::sequence::{Sequence, parse_sequence, read_sequence};
use relight_play::{FrameSettings, Player, ShotSettings};
use relight_view::Exhibit;
use served::{Served, exhibit, player};
use std::path::Path;
use std::time::{Duration, Instant};

const LIGHTS: &str = r#"{ "relight_sequence": 1, "lights": [
    { "name": "lamp", "type": "point", "position": [0.2, 0.35, 0.1], "intensity": [0.5, 0.4, 0.3] },
    { "name": "blue", "type": "point", "position": [0.4, 0.2, 0.05], "intensity": [0.02, 0.05, 0.1] } ] }"#;

/// The box under [`LIGHTS`].
fn lit_box() -> Exhibit {
    Exhibit {
        sequence: parse_sequence(LIGHTS, Path::new(""), "lights").unwrap(),
        ..exhibit(player())
    }
}

/// What `relight play --png --exposure` shows of a sequence, RGBA.
fn played(player: &Player, sequence: &Sequence, exposure: f32) -> Vec<u8> {
    let camera = player.camera(sequence, None).unwrap();
    let lights = player.lights(&sequence.lights).unwrap();
    let shot = player.shot(&camera.at(0.0), &ShotSettings::default()).unwrap();
    let frame = player
        .frame(&shot, &lights, 0.0, &FrameSettings::default())
        .unwrap();
    let beauty = frame.layers.rgb("beauty").unwrap();
    tone_mapped(&beauty, exposure).rgba8.as_flattened().to_vec()
}

fn position(sequence: &Sequence, name: &str) -> Vec3 {
    let light = sequence.lights.iter().find(|light| light.name == name).unwrap();
    match &light.kind {
        LightKind::Point { position, .. } => position.at(0.0),
        _ => panic!("{name} is no point"),
    }
}

/// The largest difference of two pictures, of 255.
fn apart(a: &[u8], b: &[u8]) -> u8 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
}

fn mean(picture: &[u8]) -> f64 {
    let colours = picture.iter().enumerate().filter(|(i, _)| i % 4 != 3);
    colours.map(|(_, v)| f64::from(*v)).sum::<f64>() / (picture.len() as f64 * 0.75)
}

/// The file that the page saved.
fn saved(folder: &Path) -> Sequence {
    let file = folder.join("cornell.lights.json");
    let start = Instant::now();
    while !file.exists() {
        assert!(start.elapsed() < Duration::from_secs(30), "nothing was saved");
        std::thread::sleep(Duration::from_millis(30));
    }
    // The browser renames a whole file to this name.
    let sequence = read_sequence(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    sequence
}

/// A browser; `None`, said loudly, where there is none.
fn browser() -> Option<Chromium> {
    let page = Chromium::start();
    if page.is_none() {
        assert!(
            std::env::var_os("RELIGHT_BROWSER_REQUIRED").is_none(),
            "RELIGHT_BROWSER_REQUIRED is set, but there is no chromium"
        );
        println!("SKIPPED: no chromium in PATH: the page of relight view is NOT tested in a browser");
    }
    page
}

/// The exposure that the page has chosen, stops.
fn exposure(page: &mut Chromium) -> f32 {
    let exposure = page.evaluate("return JSON.parse(decodeURIComponent(location.hash.slice(1))).exposure");
    exposure.as_f64().unwrap() as f32
}

#[test]
fn lamps_are_dragged_muted_saved_and_kept_in_a_browser() {
    let Some(mut page) = browser() else { return };
    let shown = lit_box();
    let sequence = shown.sequence.clone();
    let mut served = Served::of(shown);
    let own = player();
    page.navigate(&served.url);
    page.rest();
    page.screenshot("opened");
    let first = page.picture();
    // The middle of what shines is a middle grey, 118 of 255; around the box it is black.
    assert!((40.0..180.0).contains(&mean(&first)), "{}", mean(&first));
    let stops = exposure(&mut page);
    // The browser may round where it decodes and draws.
    assert!(apart(&first, &played(&own, &sequence, stops)) <= 2);

    // Dragged to the right and up, the lamp is there in the file, and what the page shows is what that file plays.
    let [x, y] = page.middle_of("[aria-label^='Point lamp lamp '] .core");
    page.drag([x, y], [x + 60.0, y - 30.0]);
    page.rest();
    page.screenshot("dragged");
    let dragged = page.picture();
    assert!(apart(&first, &dragged) > 20, "the picture did not change");
    page.click("#save");
    let moved = saved(page.downloads());
    let (before, after) = (position(&sequence, "lamp"), position(&moved, "lamp"));
    assert!(
        after.y > before.y + 0.01 && after.distance(before) > 0.02,
        "{before} {after}"
    );
    assert_eq!(position(&moved, "blue"), position(&sequence, "blue"));
    assert!(apart(&dragged, &played(&own, &moved, stops)) <= 2);

    // Off, it is darker, and the file lacks it.
    page.click("[aria-label='Mute lamp']");
    page.rest();
    let muted = page.picture();
    assert!(
        mean(&muted) < 0.8 * mean(&dragged),
        "{} {}",
        mean(&muted),
        mean(&dragged)
    );
    page.click("#save");
    assert_eq!(saved(page.downloads()).lights.len(), 1);
    page.click("#undo");
    page.rest();
    assert!(apart(&dragged, &page.picture()) <= 2);

    // A picked wall turns red, and back.
    page.click_at("#stage canvas", [0.5, 0.5]);
    page.wait("document.querySelector('[aria-label=\"Roughness\"]') !== null");
    page.evaluate(
        "const c = document.querySelector('[aria-label=\"Base colour\"]'); c.value = '#ff2010';
         c.dispatchEvent(new Event('input')); c.dispatchEvent(new Event('change'))",
    );
    page.rest();
    page.screenshot("material");
    assert!(apart(&dragged, &page.picture()) > 20);
    page.click("#undo");
    page.rest();

    // What was done survives a reload.
    page.reload();
    page.rest();
    page.click("#save");
    assert!(position(&saved(page.downloads()), "lamp").distance(after) < 1e-5);
    // So does the page when nonsense is typed.
    for nonsense in ["1e20", "0", "NaN", "-5", ""] {
        page.evaluate(&format!(
            "const n = document.querySelector('[aria-label^=\"Intensity\"][type=number]'); n.value = '{nonsense}';
             n.dispatchEvent(new Event('change'))"
        ));
        page.rest();
    }
    assert_eq!(page.errors(), Vec::<String>::new());

    served.end();
    page.wait("document.getElementById('status').textContent.includes('has ended')");
    // A new one in the same place shows what was kept.
    let address = served.url.split('/').nth(2).unwrap().to_owned();
    let again = Served::at(&address, lit_box());
    page.navigate(&again.url);
    page.rest();
    page.click("#save");
    assert!(position(&saved(page.downloads()), "lamp").distance(after) < 1e-5);
}

/// A connection that is lost, nonsense, ten thousand messages at once, a map far too large, another tab: the page says what is wrong, and goes on.
#[test]
fn what_goes_wrong_is_survived_in_a_browser() {
    let Some(mut page) = browser() else { return };
    let served = Served::of(lit_box());
    page.before(
        "window.sockets = [];
         window.WebSocket = class extends WebSocket { constructor(address) { super(address); sockets.push(this); } }",
    );
    page.navigate(&served.url);
    page.rest();
    let first = page.picture();
    let mute = |page: &mut Chromium| {
        page.click("[aria-label='Mute lamp']");
        page.rest();
        assert!(mean(&page.picture()) < 0.8 * mean(&first));
        page.click("#undo");
        page.rest();
        assert!(apart(&first, &page.picture()) <= 2);
    };
    let says = |words: &str| format!("document.getElementById('status').textContent.includes('{words}')");

    page.evaluate("sockets[0].close()");
    page.wait("sockets.length === 2 && sockets[1].readyState === 1");
    mute(&mut page);

    page.evaluate("for (const text of ['', '{', '[]', '{\"show\": {}}', '\\u0000']) sockets[1].send(text)");
    page.wait("document.getElementById('status').classList.contains('bad')");
    mute(&mut page);

    page.evaluate(
        "for (let i = 0; i < 10000; i++) sockets[1].send(`{\"pick\": {\"id\": ${i}, \"x\": 0.5, \"y\": 0.5}}`)",
    );
    page.wait(&says(" m away"));
    mute(&mut page);

    // An answer that comes while a button is pressed doesn't take it away.
    let button = page.middle_of("[aria-label='Mute lamp']");
    page.mouse("mousePressed", button);
    page.evaluate("sockets[1].send('{\"pick\": {\"id\": 1, \"x\": 0.0, \"y\": 0.0}}')");
    page.wait(&says("Nothing is there"));
    page.mouse("mouseReleased", button);
    page.rest();
    assert!(mean(&page.picture()) < 0.8 * mean(&first));
    page.click("#undo");
    page.rest();

    page.evaluate(
        "const head = '#?RADIANCE\\nFORMAT=32-bit_rle_rgbe\\n\\n-Y 16384 +X 32768\\n';
         const dataTransfer = new DataTransfer();
         dataTransfer.items.add(new File([head], 'huge.hdr'));
         dispatchEvent(new DragEvent('drop', { dataTransfer, cancelable: true }))",
    );
    page.wait(&says("limit"));
    mute(&mut page);

    let mut other = Chromium::start().unwrap();
    other.navigate(&served.url);
    other.rest();
    mute(&mut page);
    assert!(apart(&first, &other.picture()) <= 2);
    mute(&mut other);
    assert_eq!(other.errors(), Vec::<String>::new());

    // The browser tells of every answer that is no.
    let errors = page.errors();
    assert!(errors.len() == 1 && errors[0].contains("huge.hdr"), "{errors:?}");
}

/// Truth: the sun stands overhead at noon in midsummer on the tropic, and in the west at six in the evening when day and night are
/// equal; what is drawn is there, and what is shown differs from path tracing by what the server says.
#[test]
fn suns_stand_by_date_and_pictures_are_compared_and_taken_apart_in_a_browser() {
    let Some(mut page) = browser() else { return };
    let served = Served::of(lit_box());
    page.screen(1440, 900, true);
    page.navigate(&served.url);
    page.rest();

    // Side by side: the reference lies over the picture, right of the border, which keys move.
    page.choose("#by", "both");
    page.wait("Number(document.body.dataset.beside) >= 4");
    let words = page.evaluate("return document.getElementById('apart').textContent");
    let words = words.as_str().unwrap();
    assert!(
        words.contains("samples a pixel") && words.contains("noise"),
        "{words}"
    );
    let clip = "return document.getElementById('reference').style.clipPath";
    let before = page.evaluate(clip);
    page.evaluate("document.getElementById('divider').focus()");
    page.press("ArrowLeft");
    assert_ne!(page.evaluate(clip), before);
    page.screenshot("beside");
    page.choose("#by", "asset");
    page.wait("document.getElementById('reference').hidden");
    page.rest();

    // What brings light to a wall, and the row through it.
    page.click_button("Points and links");
    page.click_button("Waveform");
    page.click_at("#picture", [0.5, 0.6]);
    page.wait("document.querySelectorAll('.transport .point').length > 2 && document.querySelectorAll('.transport .gives').length > 5");
    page.click_button("Light clusters");
    page.wait("document.querySelectorAll('.clusters polygon.indirect').length > 5 && document.querySelector('.clusters .direct') !== null");
    page.screenshot("clusters");
    page.click_button("Light clusters");
    page.wait("document.querySelector('.clusters polygon') === null");
    let painted = page.evaluate(
        "const c = document.getElementById('waveform');
         return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.filter((v, i) => i % 4 < 3 && v > 200).length",
    );
    assert!(painted.as_u64().unwrap() > 100, "{painted}");
    page.evaluate("document.getElementById('panel').scrollTop = 1e5");
    page.screenshot("links");

    // Other tones, another picture; a level alone, another one yet.
    let neutral = page.picture();
    page.choose("[aria-label='Tone mapping']", "filmic");
    page.rest();
    let filmic = page.picture();
    assert!(apart(&neutral, &filmic) > 5);
    page.choose("#layer", "level.0");
    page.rest();
    assert!(apart(&page.picture(), &filmic) > 5);
    page.choose("#layer", "beauty");
    page.choose("[aria-label='Model']", "phong");
    page.wait("document.querySelector('[aria-label=\"Specular\"]') !== null");
    page.rest();

    let sun = |page: &mut Chromium, day: &str, values: &[(&str, f64)]| {
        page.evaluate(&format!(
            "const d = document.querySelector('[aria-label=\"Date of day\"]'); d.value = '2025-{day}'; d.dispatchEvent(new Event('change'))"
        ));
        for (label, value) in values {
            page.evaluate(&format!(
                "const n = document.querySelector('[aria-label^=\"{label}\"][type=number]'); n.value = {value}; n.dispatchEvent(new Event('change'))"
            ));
        }
        page.click("#save");
        let saved = saved(page.downloads());
        let day = saved
            .lights
            .into_iter()
            .find(|light| light.name == "day")
            .unwrap();
        match day.kind {
            LightKind::SunSky { sun_direction, .. } => sun_direction.at(0.0).normalize(),
            other => panic!("{other:?}"),
        }
    };
    page.choose("[aria-label='Add a light']", "sun_sky");
    page.wait("document.querySelector('[aria-label=\"Date of day\"]') !== null");
    let noon = [
        ("Time h", 12.0),
        ("Latitude", 23.44),
        ("Longitude", 0.0),
        ("Time zone", 0.0),
        ("North", 0.0),
    ];
    let overhead = sun(&mut page, "06-21", &noon);
    assert!(overhead.y > 0.9998, "{overhead}");
    let evening = sun(&mut page, "03-21", &[("Time h", 18.0), ("Latitude", 0.0)]);
    assert!(evening.x < -0.999 && evening.y.abs() < 0.04, "{evening}");
    // North along +X: west is along −Z.
    let turned = sun(&mut page, "03-21", &[("North", 90.0)]);
    assert!(turned.z < -0.999, "{turned}");
    page.rest();

    // Small, light, and by touch.
    page.screen(1024, 700, false);
    page.reload();
    page.rest();
    page.screenshot("small");
    let wide = page.evaluate("return document.documentElement.scrollWidth <= innerWidth");
    assert_eq!(wide, true);
    // Zoomed, nothing is cut off, and all that can be pressed is within reach.
    for percent in [125, 150] {
        page.zoom(1280, 800, percent);
        page.rest();
        page.screenshot(&format!("zoomed_{percent}"));
        let cut_off = page.evaluate(
            "const seen = (e) => e.getClientRects().length && getComputedStyle(e).visibility !== 'hidden';
             return [...document.querySelectorAll('button, select, input, output')].filter(seen).filter((e) => {
               const r = e.getBoundingClientRect();
               const scrolls = e.closest('#panel') !== null;
               return r.left < -0.5 || r.right > innerWidth + 0.5 || (!scrolls && (r.top < -0.5 || r.bottom > innerHeight + 0.5))
                 || (e.tagName === 'BUTTON' && e.scrollWidth > e.clientWidth + 1);
             }).map((e) => e.outerHTML.slice(0, 90))",
        );
        assert_eq!(cut_off, serde_json::json!([]), "{percent} %");
        let stage = page.evaluate("const r = document.getElementById('stage').getBoundingClientRect(); return Math.min(r.width, r.height)");
        assert!(stage.as_f64().unwrap() > 250.0, "{percent} %: {stage}");
    }
    page.screen(1024, 700, false);
    let eye = "return decodeURIComponent(location.hash)";
    let before = page.evaluate(eye);
    page.pinch("#stage", 60.0);
    page.rest();
    assert_ne!(page.evaluate(eye), before, "two fingers come nearer");
    assert_eq!(page.errors(), Vec::<String>::new());
}
