//! Environment maps, equirectangular Radiance `.hdr` oriented as sequences want them: the middle column looks to
//! +Z, a quarter from the left to +X, row 0 up.

use crate::texture::{fbm, mix, smoothstep};
use glam::{DVec3, dvec3};
use image::Rgb;
use image::codecs::hdr::HdrEncoder;
use std::f64::consts::{PI, TAU};

/// Writes the radiance of every pixel's direction, given also its (u, v).
fn map(width: usize, height: usize, radiance: impl Fn(DVec3, f64, f64) -> DVec3) -> Vec<u8> {
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
            // The inverse of u = atan2(d.x, −d.z)/2π, v = acos(d.y)/π.
            let d = dvec3(
                (TAU * u).sin() * (PI * v).sin(),
                (PI * v).cos(),
                -(TAU * u).cos() * (PI * v).sin(),
            );
            pixels.push(Rgb(radiance(d, u, v).as_vec3().to_array()));
        }
    }
    let mut bytes = vec![];
    HdrEncoder::new(&mut bytes)
        .encode(&pixels, width, height)
        .expect("a map written to memory cannot fail");
    bytes
}

/// A clear sky without its sun: deep blue overhead, pale towards the horizon, brighter in the south (+Z), with thin cloud;
/// a dull ground. Mean radiance of the upper half is about 1.
fn clear_sky() -> Vec<u8> {
    map(64, 32, |d, u, v| {
        if d.y < 0.0 {
            return dvec3(0.10, 0.09, 0.07);
        }
        let sky = mix(dvec3(1.25, 1.30, 1.35), dvec3(0.32, 0.62, 1.35), d.y.powf(0.55));
        let cloud = smoothstep(0.48, 0.75, fbm(u, v, 8, 3, 15)) * smoothstep(0.05, 0.3, d.y);
        mix(sky, dvec3(1.9, 1.85, 1.8), 0.6 * cloud) * (1.0 + 0.35 * d.z.max(0.0))
    })
}

/// A dim room with a bright window of four panes, up to the right of the middle, and a warm lamp opposite.
fn window() -> Vec<u8> {
    map(128, 64, |d, u, v| {
        let room = mix(dvec3(0.10, 0.085, 0.07), dvec3(0.22, 0.21, 0.20), 0.5 + 0.5 * d.y);
        let room = room * (0.9 + 0.2 * fbm(u, v, 6, 3, 5));
        let pane = |low: f64, high: f64, x: f64| low < x && x < high;
        // Columns 68 to 90 look to the front and −X side, rows 14 to 27 lie 14° to 50° above the horizon.
        let across = pane(68.0, 78.0, u * 128.0) || pane(80.0, 90.0, u * 128.0);
        let up = pane(14.0, 20.0, v * 64.0) || pane(21.0, 27.0, v * 64.0);
        if across && up {
            return mix(
                dvec3(14.0, 14.5, 15.0),
                dvec3(7.0, 10.0, 15.0),
                (27.0 - v * 64.0) / 13.0,
            );
        }
        let lamp = d.dot(dvec3(0.5, 0.35, -0.6).normalize());
        room + dvec3(6.0, 3.4, 1.4) * smoothstep(0.985, 0.995, lamp)
    })
}

/// The maps by file name.
pub fn maps() -> Vec<(&'static str, Vec<u8>)> {
    vec![("sky.hdr", clear_sky()), ("window.hdr", window())]
}
