//! Truths: the lights' own samples, closed forms, and the path tracer.

use super::*;
use crate::picture::Picture;
use crate::test_images::*;
use crate::test_scenes::*;
use glam::DVec3;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light::LightTrack;
use relight_scene::light_set::SceneEmitters;
use relight_transport::random::Stream;

/// A floor, and over it a small plate that emits on both sides and lets a quarter of all rays pass.
fn over_floor() -> TracedScene {
    stage(blended(Vec3::splat(0.5), 0.75, 4.0))
}

/// The middle of a closed room.
fn within() -> Camera {
    camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 0.1, -0.4), 60.0)
}

fn points_of(scene: &TracedScene, tracks: &[LightTrack], settings: &PointSettings) -> PointLights {
    let emitters = SceneEmitters::new(scene);
    let lights = LightSet::new(&emitters, tracks, 0.0).unwrap();
    PointLights::new(scene, &lights, settings)
}

fn rendered(
    scene: &TracedScene,
    tracks: &[LightTrack],
    view: &Camera,
    settings: &PointSettings,
    spp: u32,
) -> Layers {
    pictured(scene, tracks, view, spp, |picture| {
        by_points(&Picture { seed: 3, ..picture }, settings)
    })
}

/// Truth: the mean over the light's own samples, at random places and normals. Averaged over 32 sets of points of
/// different seeds, since single sets are close, but not exact, near lights with extent.
#[test]
fn points_give_the_irradiance_of_the_lights_own_samples() {
    let scene = over_floor();
    let emitters = SceneEmitters::new(&scene);
    for track in [
        bulb(Vec3::new(0.3, 1.0, 0.2), 2.0),
        spot(Vec3::new(0.2, 1.5, 0.1), 40.0),
        sun(),
        panel(),
        globe(),
        sky(),
        day(),
        glow(),
        measured(Vec3::new(0.2, 1.5, 0.1), 4.0),
    ] {
        let tracks = [track];
        let lights = LightSet::new(&emitters, &tracks, 0.0).unwrap();
        let sets: Vec<PointLights> = (0..32)
            .map(|seed| {
                let settings = PointSettings {
                    area_samples: Some(256),
                    environment: 400,
                    sun: 8,
                    sky: 400,
                    seed,
                    ..PointSettings::default()
                };
                PointLights::new(&scene, &lights, &settings)
            })
            .collect();
        let mut stream = Stream::new(5, 0, 0);
        let mut uniform = || stream.uniform() * 2.0 - 1.0;
        for _ in 0..6 {
            let x = Vec3::new(uniform() * 2.0, uniform() * 0.5 + 0.5, uniform() * 2.0);
            let normal = Vec3::new(uniform(), uniform(), uniform()).normalize();
            let n = 60_000;
            let mut exact = DVec3::ZERO;
            for i in 0..n {
                let random = [0.754_877_67, 0.569_840_29, 0.819_172_51]
                    .map(|s| ((f64::from(i) + 0.5) * s).fract() as f32);
                if let Some(s) = lights.sample(0, x, random) {
                    exact += s.radiance_over_pdf.as_dvec3()
                        * f64::from(normal.dot(s.direction).max(0.0) / n as f32);
                }
            }
            let mut found = DVec3::ZERO;
            for points in &sets {
                for (i, point) in points.lights.iter().enumerate() {
                    if let Some(a) = points.arrival(i, x) {
                        let cos = f64::from(normal.dot(a.direction).max(0.0));
                        found += point.intensity.as_dvec3() * (f64::from(a.factor) * cos / sets.len() as f64);
                    }
                }
            }
            let scale = exact.max_element();
            let error = (found - exact).abs().max_element();
            assert!(
                error <= 0.015 * scale + 1e-9,
                "{} at {x}: {found}, not {exact}",
                tracks[0].name
            );
        }
    }
}

#[test]
fn area_lights_share_the_number_that_was_asked_for() {
    let scene = over_floor();
    let tracks = [panel(), globe(), glow(), sun()];
    for total in [3, 100, 4608] {
        let settings = PointSettings {
            area_samples: Some(total),
            ..PointSettings::default()
        };
        let points = points_of(&scene, &tracks, &settings);
        assert_eq!(points.len(), total as usize + 1);
        let facing = |up: f32| {
            let plate = points
                .lights
                .iter()
                .zip(&points.source)
                .filter(|(_, source)| **source == 2);
            plate.filter(|(light, _)| light.axis.y * up > 0.0).count()
        };
        let (backs, fronts) = (facing(1.0), facing(-1.0));
        // Rounding of one point for each side of both triangles.
        let even = total < 100 || backs.abs_diff(fronts) <= 4;
        assert!(even, "{backs} up, {fronts} down");
    }
}

/// Truth: the path tracer's direct light. Its noise and that of 4000 points are below 0.5 % over 256 pixels.
#[test]
fn brute_over_points_gives_the_direct_light_of_a_path_tracer() {
    let (scene, view) = (over_floor(), camera(Vec3::new(0.3, 1.5, 2.0), Vec3::ZERO, 35.0));
    for track in [panel(), globe(), sky(), day(), glow()] {
        let tracks = [track];
        let settings = PointSettings {
            area_samples: Some(4000),
            ..PointSettings::default()
        };
        let found = mean(&rendered(&scene, &tracks, &view, &settings, 1), "direct");
        let truth = mean(&path_traced(&scene, &tracks, &view, 512), "direct");
        assert!(
            (found / truth - 1.0).abs() < 0.015,
            "{}: {found}, not {truth}",
            tracks[0].name
        );
    }
}

/// Truth: in a closed room whose walls emit 1 and reflect ρ, indirect light is ρ²/(1 − ρ) everywhere. Unclamped, for the
/// clamp takes light: virtual lights near a pixel's corner are worth more than 1 %. The noise left by 30,000 lights over
/// 256 pixels is dominated by those near the walls that are seen: 3 %.
#[test]
fn virtual_lights_fill_a_closed_furnace() {
    for albedo in [0.5f32, 0.9] {
        let scene = traced(vec![room(0)], vec![matt(albedo, 1.0)]);
        let settings = PointSettings {
            area_samples: Some(4000),
            vpls: 30_000,
            clamp: f32::INFINITY,
            ..PointSettings::default()
        };
        let layers = rendered(&scene, &[emitted(1.0)], &within(), &settings, 1);
        let rho = f64::from(albedo);
        let found = mean(&layers, "indirect") / (rho * rho / (1.0 - rho));
        assert!((found - 1.0).abs() < 0.03, "{albedo}: {found}");
        let beauty = mean(&layers, "beauty") * (1.0 - rho);
        assert!((beauty - 1.0).abs() < 0.03, "{albedo}: {beauty}");
    }
}

/// Truth: the path tracer, with a blended plate in the way of the light, and a small light that lies in the ceiling.
#[test]
fn virtual_lights_give_the_indirect_light_of_a_path_tracer() {
    let blind = blended(Vec3::new(0.8, 0.6, 0.4), 0.4, 0.0);
    let scene = traced(vec![room(0), level(0.5, 0.3, 1)], vec![matt(0.6, 0.0), blind]);
    let edges = [Vec3::X * 0.6, Vec3::Z * 0.6];
    let view = camera(Vec3::new(0.1, -0.2, 0.9), Vec3::new(0.0, -0.5, -1.0), 60.0);
    for track in [
        rect("panel", Vec3::new(0.2, 1.0, 0.0), edges, Vec3::new(9.0, 6.0, 3.0)),
        spot_inside(),
        ball(Vec3::new(0.4, 0.6, 0.1), 0.2, Vec3::ONE),
        measured(Vec3::new(0.2, 0.8, 0.1), 1.0),
    ] {
        let tracks = [track];
        let settings = PointSettings {
            area_samples: Some(1000),
            vpls: 30_000,
            clamp: f32::INFINITY,
            ..PointSettings::default()
        };
        let found = rendered(&scene, &tracks, &view, &settings, 1);
        let truth = path_traced(&scene, &tracks, &view, 512);
        // A single light through the blind is a coin toss for each sample: 16,384 of them are within 0.6 %.
        let none = PointSettings { vpls: 0, ..settings };
        let direct = rendered(&scene, &tracks, &view, &none, 64);
        for (layer, found) in [("direct", &direct), ("indirect", &found)] {
            let (found, truth) = (mean(found, layer), mean(&truth, layer));
            assert!(
                (found / truth - 1.0).abs() < 0.03,
                "{} {layer}: {found}, not {truth}",
                tracks[0].name
            );
        }
    }
}

#[test]
fn as_many_virtual_lights_are_stored_as_were_asked_for() {
    for scene in [traced(vec![room(0)], vec![matt(0.5, 0.0)]), over_floor()] {
        for vpls in [1, 100, 20_000] {
            let settings = PointSettings {
                vpls,
                ..PointSettings::default()
            };
            let points = points_of(&scene, &[bulb(Vec3::new(0.1, 0.6, 0.3), 1.0)], &settings);
            assert_eq!((points.direct, points.len()), (1, vpls as usize + 1));
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_points_on_any_number_of_threads() {
    let settings = PointSettings {
        area_samples: Some(100),
        vpls: 1000,
        ..PointSettings::default()
    };
    let tracks = [panel(), globe(), glow(), day()];
    let first = same_on_any_threads(|| points_of(&over_floor(), &tracks, &settings).lights);
    let other = PointSettings { seed: 1, ..settings };
    assert_ne!(first, points_of(&over_floor(), &tracks, &other).lights);
}

/// Truth: what virtual lights may have at most, by hand: 1 % of all the light there.
#[test]
fn no_virtual_light_gives_more_than_its_share() {
    let c = Vec3::new(2.0, 1.0, 0.5);
    let limit = clamp_limit(Vec3::new(40.0, 100.0, 7.0), 0.01);
    assert_eq!(clamped(c, limit), Vec3::new(1.0, 0.5, 0.25));
    assert_eq!(clamped(c * 0.4, limit), c * 0.4);
    assert_eq!(clamped(c, f32::INFINITY), c);
    // One light alone, of all the light there is, keeps a hundredth.
    let scene = traced(vec![room(0)], vec![matt(0.5, 0.0)]);
    let tracks = [bulb(Vec3::ZERO, 1.0)];
    let settings = |clamp| PointSettings {
        vpls: 1,
        clamp,
        ..PointSettings::default()
    };
    let free = rendered(&scene, &tracks, &within(), &settings(f32::INFINITY), 1);
    let held = rendered(&scene, &tracks, &within(), &settings(0.01), 1);
    let [free, held, direct] = [(&free, "indirect"), (&held, "indirect"), (&held, "direct")]
        .map(|(layers, name)| data(layers, name));
    for ((free, held), direct) in free.iter().zip(held).zip(direct) {
        let limit = 0.01 * (free + direct);
        assert!(
            (held - free.min(limit)).abs() <= 1e-6 * limit,
            "{held}: {free} with {direct}"
        );
    }
}

#[test]
fn extreme_lights_give_finite_and_right_images() {
    let scene = traced(vec![room(0)], vec![matt(0.5, 0.0)]);
    let settings = PointSettings {
        vpls: 200,
        ..PointSettings::default()
    };
    let render = |tracks: &[LightTrack]| rendered(&scene, tracks, &within(), &settings, 1);
    let finite = |layers: &Layers| {
        assert!(layers.layers.iter().all(|l| {
            l.data
                .iter()
                .all(|v| v.is_finite() && (*v >= 0.0 || l.name == "normal"))
        }));
    };
    // None, and one that is dark.
    for tracks in [vec![], vec![bulb(Vec3::ZERO, 0.0)]] {
        let layers = render(&tracks);
        finite(&layers);
        assert_eq!(mean(&layers, "beauty"), 0.0);
    }
    // One; and a thousand in one place, which are a thousand times as bright.
    let one = render(&[bulb(Vec3::new(0.2, 0.1, 0.0), 1.0)]);
    let many: Vec<LightTrack> = (0..1000).map(|_| bulb(Vec3::new(0.2, 0.1, 0.0), 1.0)).collect();
    let many = render(&many);
    finite(&many);
    assert!((mean(&many, "direct") / mean(&one, "direct") / 1000.0 - 1.0).abs() < 1e-5);
    assert!(mean(&one, "indirect") > 0.0 && mean(&many, "indirect") > 0.0);
    // In a wall, where nothing but the wall itself is met: seen from inside or not at all, but finite.
    finite(&render(&[bulb(Vec3::new(1.0, 0.1, 0.0), 1.0)]));
    // Behind the wall.
    let behind = render(&[bulb(Vec3::new(1.5, 0.1, 0.0), 1.0)]);
    assert_eq!(mean(&behind, "beauty"), 0.0);
    // Of all strengths at once: the strongest is all that counts.
    let place = Vec3::new(0.2, 0.1, 0.0);
    let mixed = render(&[
        bulb(Vec3::Y * 0.5, 0.0),
        bulb(Vec3::X * 0.5, 1e-20),
        bulb(place, 1e20),
        bulb(Vec3::ZERO, 1.0),
    ]);
    finite(&mixed);
    assert!((mean(&mixed, "direct") / mean(&one, "direct") / 1e20 - 1.0).abs() < 1e-5);
    let faint = render(&[bulb(place, 1e-20)]);
    assert!((mean(&faint, "direct") / mean(&one, "direct") / 1e-20 - 1.0).abs() < 1e-4);
    assert!((mean(&faint, "indirect") / mean(&one, "indirect") / 1e-20 - 1.0).abs() < 1e-4);
    // The middle of a large sphere sees nothing of it, as the lights' own samples have it.
    finite(&render(&[ball(Vec3::ZERO, 0.9, Vec3::ONE)]));
}
