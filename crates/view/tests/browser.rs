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

/// What `relight play --png` shows of a sequence, RGBA.
fn played(player: &Player, sequence: &Sequence) -> Vec<u8> {
    let camera = player.camera(sequence, None).unwrap();
    let lights = player.lights(&sequence.lights).unwrap();
    let shot = player.shot(&camera.at(0.0), &ShotSettings::default()).unwrap();
    let frame = player
        .frame(&shot, &lights, 0.0, &FrameSettings::default())
        .unwrap();
    let beauty = frame.layers.rgb("beauty").unwrap();
    tone_mapped(&beauty, 0.0).rgba8.as_flattened().to_vec()
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

#[test]
fn lamps_are_dragged_muted_saved_and_kept_in_a_browser() {
    let Some(mut page) = Chromium::start() else {
        assert!(
            std::env::var_os("RELIGHT_BROWSER_REQUIRED").is_none(),
            "RELIGHT_BROWSER_REQUIRED is set, but there is no chromium"
        );
        println!("SKIPPED: no chromium in PATH: the page of relight view is NOT tested in a browser");
        return;
    };
    let sequence = parse_sequence(LIGHTS, Path::new(""), "lights").unwrap();
    let mut served = Served::of(Exhibit {
        sequence: sequence.clone(),
        ..exhibit(player())
    });
    let own = player();
    page.navigate(&served.url);
    page.rest();
    page.screenshot("opened");
    let first = page.picture();
    assert!(mean(&first) > 5.0, "the first picture is black");
    // The browser may round where it decodes and draws.
    assert!(apart(&first, &played(&own, &sequence)) <= 2);

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
    assert!(apart(&dragged, &played(&own, &moved)) <= 2);

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
}
