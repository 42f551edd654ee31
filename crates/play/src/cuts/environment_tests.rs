//! Environments that turn, fade and brighten, as cuts take them. Truth: the dense sum over maps that were turned and
//! scaled pixel by pixel.

use super::cells::Cells;
use super::illumination::Illumination;
use super::shade::{Fragments, shade};
use super::tests::{LIGHTS, World, cuts, dense, fragments, world};
use glam::Vec3;
use relight_scene::animated::{Animated, Interpolation};
use relight_scene::environment::uv_from_direction;
use relight_scene::light::{EnvironmentMap, LightKind, LightTrack};
use relight_scene::light_set::{LightRig, NoEmitters};
use std::sync::Arc;

const WIDTH: usize = 64;
const HEIGHT: usize = 32;

/// A map without a sun: brighter in its first columns and towards its foot.
fn map(colour: Vec3, columns: usize) -> EnvironmentMap {
    let pixel = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let stripe = if x < columns { 2.0 } else { 0.5 };
        colour * (stripe + 0.05 * y as f32)
    };
    EnvironmentMap {
        width: WIDTH,
        height: HEIGHT,
        pixels: (0..WIDTH * HEIGHT).map(pixel).collect(),
    }
}

/// The map turned counter-clockwise, seen from above, by so many columns: its middle column looks along +Z, the
/// column a quarter to the left of it along +X, so that what stood in column x + n now stands in x.
fn turned(map: &EnvironmentMap, columns: usize) -> EnvironmentMap {
    let pixels = (0..WIDTH * HEIGHT).map(|i| map.pixels[i / WIDTH * WIDTH + (i % WIDTH + columns) % WIDTH]);
    EnvironmentMap {
        pixels: pixels.collect(),
        ..*map
    }
}

fn keys<T>(first: T, last: T) -> Animated<T> {
    Animated::Keys {
        keys: vec![(0.0, first), (10.0, last)],
        interpolation: Interpolation::Linear,
    }
}

fn environment(map: &EnvironmentMap, scale: Animated<Vec3>, rotation_deg: Animated<f32>) -> LightTrack {
    LightTrack {
        name: String::new(),
        kind: LightKind::Environment {
            maps: Arc::new(map.clone()).into(),
            file: String::new().into(),
            scale,
            rotation_deg,
        },
    }
}

/// Largest difference of what fragments reflect of `lights` at `frame` to the dense sum under `radiance`, relative to
/// the brighter of the fragment and a twentieth of the mean.
fn error(lights: &[LightTrack], frame: f64, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> f64 {
    let world = world();
    let cells = Cells::new(&world.lights);
    let rig = LightRig::new(&NoEmitters, lights).unwrap();
    let distant = (rig.at(frame)).take_distant(|light| rig.split(light, frame, LIGHTS).map(Arc::new));
    let played = cells.flux(&cells.parts(|d| distant.iter().flatten().map(|light| light.radiance(d)).sum()));
    let (sites, points, views) = fragments();
    let cuts = cuts(&world, 0.0);
    let shaded = shade(
        &cuts,
        &Illumination::of_directions(cuts.directions().unwrap(), &played, LIGHTS as usize),
        &Fragments {
            sites: &sites,
            points: &points,
            views: &views,
            narrow: &[],
            matt: true,
        },
    );
    let expected = World {
        flux: cells.flux(&cells.parts(radiance)),
        ..world
    };
    let truth = dense(&expected, &sites, &points, &views);
    let mean = truth.iter().map(|t| t.max_element()).sum::<f64>() / truth.len() as f64;
    assert!(mean > 0.0);
    (shaded.radiance.iter().zip(&truth))
        .map(|(f, t)| (f.as_dvec3() - *t).abs().max_element() / t.max_element().max(0.05 * mean))
        .fold(0.0, f64::max)
}

/// f32 sums of a thousand terms, and of radiances scaled before or after they are looked up.
const ROUNDING: f64 = 1e-4;

#[test]
fn maps_that_fade_into_each_other_while_they_turn_are_their_weighted_sum() {
    let (day, night) = (
        map(Vec3::new(1.0, 0.8, 0.5), 8),
        map(Vec3::new(0.1, 0.2, 0.4), 16),
    );
    let lights = [
        environment(&day, keys(Vec3::ONE, Vec3::ZERO), keys(0.0, 90.0)),
        environment(
            &night,
            keys(Vec3::ZERO, Vec3::splat(3.0)),
            Animated::Constant(-22.5),
        ),
    ];
    // −22.5° is 4 columns the other way.
    let night_now = turned(&night, WIDTH - 4);
    for (frame, columns, day_share) in [(0.0, 0, 1.0), (2.5, 4, 0.75), (5.0, 8, 0.5), (10.0, 16, 0.0)] {
        let day_now = turned(&day, columns);
        let truth = |d: Vec3| {
            let uv = uv_from_direction(d);
            day_now.at(uv) * day_share + night_now.at(uv) * (3.0 * (1.0 - day_share))
        };
        let found = error(&lights, frame, truth);
        assert!(found < ROUNDING, "frame {frame}: {found}");
    }
    // Turned the other way, it is another light.
    let other_way = turned(&day, WIDTH - 8);
    let wrong = |d: Vec3| {
        let uv = uv_from_direction(d);
        other_way.at(uv) * 0.5 + night_now.at(uv) * 1.5
    };
    assert!(error(&lights, 5.0, wrong) > 0.05);
}

#[test]
fn the_scale_of_a_map_is_that_of_what_it_lights_at_any_power() {
    let sky = map(Vec3::new(0.3, 0.5, 1.0), 4);
    for scale in [1e-20, 1e-3, 7.0, 1e20] {
        let lights = [environment(
            &sky,
            Animated::Constant(Vec3::splat(scale)),
            Animated::Constant(45.0),
        )];
        let now = turned(&sky, 8);
        let found = error(&lights, 3.0, |d| now.at(uv_from_direction(d)) * scale);
        assert!(found < ROUNDING, "scale {scale}: {found}");
    }
}
