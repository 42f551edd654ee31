//! Lightmaps in a real page of three.js, in Chromium. Skipped, loudly, where one of the two is absent; `RELIGHT_THREE` names the folder of
//! the package three, and with `RELIGHT_THREE_REQUIRED` set it fails instead.

use crate::chromium::Chromium;
use crate::lightmap::export;
use crate::stage::{TINY, bake_json, data, folder, relight};
use glam::Vec3;
use relight_scene::image::{Limits, read_exr};
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};

const PAGE: &str = include_str!("lightmap.html");
const SIZE: usize = 128;

/// Serves the page, three.js under /three and a folder under /out, for as long as the test runs; its address.
fn served(three: PathBuf, out: PathBuf) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let (three, out) = (three.clone(), out.clone());
            std::thread::spawn(move || answer(stream, &three, &out));
        }
    });
    address
}

fn answer(mut stream: TcpStream, three: &Path, out: &Path) -> Option<()> {
    let mut reader = BufReader::new(stream.try_clone().ok()?);
    let mut first = String::new();
    reader.read_line(&mut first).ok()?;
    let mut line = String::new();
    while reader.read_line(&mut line).ok()? > 2 {
        line.clear();
    }
    let path = first.split(' ').nth(1)?.split('?').next()?;
    let file = match path.split_at(path.len().min(5)) {
        ("/out/", name) => std::fs::read(out.join(name)).ok(),
        _ => path
            .strip_prefix("/three/")
            .and_then(|name| std::fs::read(three.join(name)).ok()),
    };
    let (status, kind, body) = match (path, file) {
        ("/", _) => ("200 OK", "text/html", PAGE.as_bytes().to_vec()),
        ("/favicon.ico", _) => ("200 OK", "image/png", Vec::new()),
        (path, Some(body)) if path.ends_with(".js") => ("200 OK", "text/javascript", body),
        (_, Some(body)) => ("200 OK", "application/octet-stream", body),
        _ => ("404 Not Found", "text/plain", Vec::new()),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).ok()?;
    stream.write_all(&body).ok()
}

/// The package three, and a browser; `None`, said loudly, where one is absent.
fn three_and_browser() -> Option<(PathBuf, Chromium)> {
    let required = std::env::var_os("RELIGHT_THREE_REQUIRED").is_some();
    let three = std::env::var_os("RELIGHT_THREE").map(PathBuf::from);
    let three = three.filter(|folder| folder.join("build/three.module.js").is_file());
    let Some((three, browser)) = three.and_then(|three| Some((three, Chromium::start()?))) else {
        assert!(
            !required,
            "no three.js in RELIGHT_THREE, or no Chromium, though they are required"
        );
        eprintln!(
            "SKIPPED: no three.js in RELIGHT_THREE, or no Chromium: lightmaps are NOT tested in a page of three.js"
        );
        return None;
    };
    Some((three, browser))
}

/// What three.js draws with a map, radiance from the top row down; again where a browser that has just started loses it.
fn drawn(browser: &mut Chromium, url: &str, map: &str) -> Vec<Vec3> {
    for attempt in 0..4 {
        browser.navigate(&format!("{url}?{map}{attempt}"));
        browser.wait("window.ready");
        browser.evaluate(&format!(
            "window.result = undefined; window.drawn('{map}', {SIZE}, {SIZE}).then((r) => {{ window.result = r; }}, \
             (e) => {{ window.result = String(e.stack); }})"
        ));
        browser.wait("window.result !== undefined");
        let result = browser.evaluate("return window.result");
        let Some(numbers) = result.as_array() else {
            assert!(result.is_null(), "{map}: {result}");
            continue;
        };
        let pixels: Vec<Vec3> = (numbers.chunks(4))
            .map(|p| Vec3::from([0, 1, 2].map(|k| p[k].as_f64().unwrap() as f32)))
            .collect();
        return pixels.chunks(SIZE).rev().flatten().copied().collect();
    }
    panic!("{map}: the browser draws nothing");
}

/// The Cornell box under its own lamp. Truth: the frame that `play` makes of the same asset. three.js has one ray per pixel and no lobes;
/// where two surfaces share a pixel the two differ.
#[test]
fn three_js_draws_a_room_with_its_lightmap_as_play_does() {
    let Some((three, mut browser)) = three_and_browser() else {
        return;
    };
    let folder = folder();
    let asset = folder.path().join("box.relight");
    bake_json(
        &data("cornell.glb"),
        &asset,
        &[&TINY[..], &["--lambert"]].concat(),
    );
    let lights = data("cornell.lights.json");
    let out = folder.path().join("out");
    export(
        &asset,
        &out,
        &["--size", "256", "--lights", lights.to_str().unwrap()],
    );
    let frame = folder.path().join("frame.exr");
    let mut play = relight();
    play.arg("play").arg(&asset).arg("--lights").arg(&lights);
    play.args([
        "--integrator",
        "transfer",
        "--layers",
        "beauty,emission",
        "--size",
        &format!("{SIZE}x{SIZE}"),
        "-o",
    ])
    .arg(&frame);
    play.assert().success();
    let layers = read_exr(&frame, &Limits::default()).unwrap();
    let (truth, emission) = (layers.rgb("beauty").unwrap(), layers.rgb("emission").unwrap());
    let url = served(three, out);
    let mean = truth.pixels.iter().flatten().sum::<f32>() / (3.0 * truth.pixels.len() as f32);
    // The picture has 255 steps.
    for (map, within) in [("ktx2", 0.9), ("exr", 0.9), ("picture", 0.85)] {
        let pixels = drawn(&mut browser, &url, map);
        let (mut sums, mut near, mut count) = ([0.0; 2], 0, 0);
        for (i, drawn) in pixels.iter().enumerate() {
            let played = Vec3::from(truth.pixels[i]);
            // The lamp itself, ten times as bright as all else, has an edge of its own.
            if emission.pixels[i] != [0.0; 3] || drawn.max_element() > 5.0 {
                continue;
            }
            sums[0] += f64::from(drawn.element_sum());
            sums[1] += f64::from(played.element_sum());
            let off = (*drawn - played).abs().max_element();
            near += usize::from(off < 0.1 * (played.max_element() + 0.05 * mean));
            count += 1;
        }
        let (bias, share) = (sums[0] / sums[1] - 1.0, near as f64 / f64::from(count));
        println!("{map}: bias {bias:.4}, {share:.3} of the pixels within 10 %");
        assert!(bias.abs() < 0.03, "{map}: {bias}");
        assert!(share > within, "{map}: {share}");
    }
    assert_eq!(browser.errors(), Vec::<String>::new());
}
