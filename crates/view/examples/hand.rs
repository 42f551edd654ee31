//! How long a hand waits for the page of `relight view`, in Chromium:
//!
//! `cargo run --release -p relight-view --example hand -- ASSET LIGHTS [WIDTHxHEIGHT]`
//!
//! The camera is turned, then the first lamp of LIGHTS that is a point is dragged: single moves, each waited for; four seconds of moves as often as a
//! screen is drawn; then the hand rests. Browser and player share the machine, as they do for most.

#[allow(dead_code, reason = "tests take the other parts")]
#[path = "../tests/chromium/mod.rs"]
mod chromium;
#[path = "../tests/served/mod.rs"]
mod served;

use chromium::Chromium;
use relight_play::Player;
use relight_play::scene::light::LightKind;
use relight_play::scene::sequence::read_sequence;
use relight_view::Exhibit;
use serde_json::Value;
use served::Served;
use std::path::Path;
use std::time::{Duration, Instant};

/// Moves that are waited for.
const SINGLE: usize = 22;
/// How long the hand moves without waiting.
const STEADY: Duration = Duration::from_secs(4);
/// Between moves: a screen's picture.
const TICK: Duration = Duration::from_millis(16);
/// Between a picture and the next single move: less than after which the page takes the hand to rest.
const PAUSE: Duration = Duration::from_millis(80);

/// Notes when the mouse moves and when the picture that was asked for then is on the canvas.
const WATCH: &str = "
    const hand = window.hand = { moved: null, asked: null, waits: [], shown: [], last: 0 };
    addEventListener('pointermove', (event) => { hand.moved ??= event.timeStamp; hand.last = event.timeStamp; }, true);
    new MutationObserver((changes) => {
        const { wanted, shown, stage } = document.body.dataset, now = performance.now();
        const names = changes.map((change) => change.attributeName);
        if (names.includes('data-shown')) {
            hand.shown.push([now, stage, document.getElementById('stages').title]);
            if (hand.asked && Number(shown) >= hand.asked.id) {
                hand.waits.push(now - hand.asked.at);
                hand.asked = null;
            }
        }
        if (names.includes('data-wanted') && wanted !== '' && hand.moved !== null && !hand.asked) {
            hand.asked = { id: Number(wanted), at: hand.moved };
            hand.moved = null;
        }
    }).observe(document.body, { attributes: true })";

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (Some(asset), Some(lights)) = (words.first(), words.get(1)) else {
        println!("usage: cargo run --release -p relight-view --example hand -- ASSET LIGHTS [WIDTHxHEIGHT]");
        return;
    };
    let size = words.get(2).map_or("640x360", String::as_str);
    let Some(mut page) = Chromium::start() else {
        println!("no chromium in PATH");
        return;
    };
    let player = Player::open(asset).unwrap_or_else(|error| panic!("{error}"));
    let sequence = read_sequence(Path::new(lights)).unwrap_or_else(|error| panic!("{error}"));
    let lamp = (sequence.lights.iter())
        .find(|light| matches!(light.kind, LightKind::Point { .. }))
        .map(|light| light.name.clone());
    let served = Served::of(Exhibit {
        player,
        sequence,
        asset: asset.clone(),
        lights_file: None,
        seed: 0,
    });
    page.screen(1600, 1000, true);
    page.navigate(&served.url);
    page.rest();
    page.choose("#size", size);
    page.rest();
    page.evaluate(WATCH);

    println!("{asset}, {size}");
    // Beside what lies in the middle: handles of lamps are dragged themselves.
    let stage = page.within("#stage canvas", [0.3, 0.8]);
    measure(&mut page, "turn", stage, [1.5, 0.0]);
    let Some(lamp) = lamp else {
        return;
    };
    let handle = page.middle_of(&format!("[aria-label^='Point lamp {lamp} '] .core"));
    measure(&mut page, "lamp", handle, [1.5, 0.5]);
    assert_eq!(page.errors(), Vec::<String>::new());
}

/// Moves the mouse, pressed, to and fro by steps of so many pixels.
fn measure(page: &mut Chromium, name: &str, from: [f64; 2], step: [f64; 2]) {
    let at = |k: usize| {
        // There and back within thirty steps.
        let k = (k % 60) as f64;
        [0, 1].map(|i| from[i] + step[i] * k.min(60.0 - k))
    };
    page.evaluate("hand.waits = []");
    page.mouse("mousePressed", from);
    for k in 1..=SINGLE {
        page.evaluate("hand.asked = null; hand.moved = null");
        let before = count(page, "hand.waits.length");
        page.mouse("mouseMoved", at(k));
        let start = Instant::now();
        while count(page, "hand.waits.length") == before && start.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(Duration::from_millis(10));
        }
        std::thread::sleep(PAUSE);
    }
    let mut waits = numbers(&page.evaluate("const { waits } = hand; hand.waits = []; return waits"));
    waits.sort_by(f64::total_cmp);

    page.evaluate("hand.shown = []");
    let start = Instant::now();
    let mut k = SINGLE;
    while start.elapsed() < STEADY {
        k += 1;
        page.mouse("mouseMoved", at(k));
        std::thread::sleep(TICK);
    }
    let steady = start.elapsed().as_secs_f64();
    let shown = count(page, "hand.shown.length");
    // It ends elsewhere than any picture before.
    page.mouse("mouseMoved", [0, 1].map(|i| from[i] + 40.5 * step[i]));
    page.mouse("mouseReleased", [0, 1].map(|i| from[i] + 40.5 * step[i]));
    page.rest();
    let after = page.evaluate(
        "const last = (stage) => hand.shown.findLast((shown) => shown[1] === stage && shown[0] > hand.last);
         return ['middle', 'final'].map(last).map((shown) => [(shown?.[0] - hand.last) / 1000, shown?.[2]])",
    );
    let part = |share: f64| {
        let index = (share * waits.len() as f64) as usize;
        waits.get(index.min(waits.len().saturating_sub(1))).copied()
    };
    println!(
        "{name}: from event to canvas {:.0} ms (95 %: {:.0}, of {}); {:.1} pictures a second",
        part(0.5).unwrap_or(f64::NAN),
        part(0.95).unwrap_or(f64::NAN),
        waits.len(),
        shown as f64 / steady,
    );
    for (what, k) in [("all pixels", 0), ("final", 1)] {
        let [seconds, stages] = [0, 1].map(|i| &after[k][i]);
        println!(
            "  {what} {:.2} s after the last event. {}",
            seconds.as_f64().unwrap_or(f64::NAN),
            stages.as_str().unwrap_or("")
        );
    }
}

fn count(page: &mut Chromium, what: &str) -> u64 {
    page.evaluate(&format!("return {what}")).as_u64().unwrap_or(0)
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_f64)
        .collect()
}
