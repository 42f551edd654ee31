//! Statements about light that the two reference integrators must show. Truths are closed forms, or the other
//! integrator: `brute` knows neither BRDF samples, nor a choice among lights, nor recursion.

use super::render;
use crate::brute;
use crate::picture::Picture;
use crate::test_images::*;
use crate::test_scenes::*;
use crate::watch::{Cancelled, Watch};
use glam::Vec3;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light::LightTrack;
use relight_scene::material::Material;
use relight_scene::scene::Mesh;
use relight_scene::traced::TracedScene;
use std::f64::consts::PI;

/// A floor of the given half width around the origin, facing up.
fn floor(half: f32, material: u32) -> Mesh {
    level(half, 0.0, material)
}

/// The box from −`size` to `size`, fronts inwards, in 12 triangles.
fn closed(size: f32, albedo: f32) -> TracedScene {
    let walls = cuboid(Vec3::splat(-size), Vec3::splat(size), true, 0);
    traced(vec![walls], vec![matt(albedo, 1.0)])
}

/// Some of everything that has extent, above the floor.
fn area_lights() -> Vec<LightTrack> {
    vec![panel(), globe(), even_sky(0.3), glow()]
}

fn brute_forced(scene: &TracedScene, tracks: &[LightTrack], camera: &Camera, spp: u32) -> Layers {
    pictured(scene, tracks, camera, spp, |picture| {
        brute::render(&picture).unwrap()
    })
}

fn assert_close(found: f64, truth: f64, tolerance: f64, what: &str) {
    let error = (found / truth - 1.0).abs();
    assert!(
        error < tolerance,
        "{what}: found {found}, truth {truth}, relative error {error}"
    );
}

/// A floor with a small emissive quad that hangs over it, facing down.
fn staged() -> (TracedScene, Camera) {
    let eye = camera(Vec3::new(0.3, 1.5, 2.0), Vec3::new(0.0, 0.0, 0.0), 35.0);
    (stage(matt(0.0, 4.0)), eye)
}

/// Truth: L = (ρ/π) I cos θ / d². The view spans 0.1°, over which it varies by less than 1e-3.
#[test]
fn a_point_light_over_a_floor_obeys_lambert_and_the_inverse_square() {
    for scale in [1e-4f32, 1.0, 1e5] {
        let scene = traced(vec![floor(10.0 * scale, 0)], vec![matt(0.5, 0.0)]);
        let lights = [bulb(Vec3::new(3.0, 4.0, 0.0) * scale, 10.0 * scale * scale)];
        let view = camera(Vec3::new(0.0, 5.0, 1.0) * scale, Vec3::ZERO, 0.1);
        let truth = 0.5 / PI * 10.0 * 0.8 / 25.0;
        let layers = path_traced(&scene, &lights, &view, 4);
        assert_close(mean(&layers, "direct"), truth, 1e-3, "path");
        let brute = brute_forced(&scene, &lights, &view, 4);
        assert_close(mean(&brute, "direct"), truth, 1e-3, "brute");
        assert_eq!(mean(&layers, "indirect") + mean(&layers, "emission"), 0.0);
        assert_close(mean(&layers, "albedo"), 0.5, 1e-6, "albedo");
    }
}

/// Truth: under radiance 1 from everywhere a floor shows its albedo. With BRDF and light samples both nearly
/// proportional, 256 pixels × 64 samples have a standard error under 0.1 %.
#[test]
fn a_floor_under_a_constant_sky_shows_its_albedo() {
    let scene = traced(vec![floor(2.0, 0)], vec![matt(0.37, 0.0)]);
    let lights = [even_sky(1.0)];
    let view = camera(Vec3::new(0.0, 2.0, 1.0), Vec3::ZERO, 20.0);
    let path = path_traced(&scene, &lights, &view, 64);
    assert_close(mean(&path, "direct"), 0.37, 5e-3, "path");
    let brute = brute_forced(&scene, &lights, &view, 64);
    assert_close(mean(&brute, "direct"), 0.37, 1e-2, "brute");
}

/// Truth: E = π L (r/d)² sin(height) for a sphere; L_out = ρ E / π.
#[test]
fn a_sphere_light_over_a_floor_gives_the_closed_form() {
    let scene = traced(vec![floor(10.0, 0)], vec![matt(0.5, 0.0)]);
    let lights = [ball(Vec3::new(3.0, 4.0, 0.0), 2.0, Vec3::splat(7.0))];
    let view = camera(Vec3::new(0.0, 5.0, -3.0), Vec3::ZERO, 0.1);
    let truth = 0.5 * 7.0 * (2.0f64 / 5.0).powi(2) * 0.8;
    let path = path_traced(&scene, &lights, &view, 64);
    assert_close(mean(&path, "direct"), truth, 5e-3, "path");
}

/// Truth: radiosity in a closed room whose walls all emit 1 and reflect ρ: direct ρ, indirect ρ²/(1 − ρ).
/// Tolerance: five standard errors of 65,536 paths, whose indirect light has a relative deviation below
/// √(1/(1 − ρ)) by the geometric distribution of their lengths.
#[test]
fn closed_furnaces_have_the_analytic_indirect_light() {
    for (albedo, tolerance) in [(0.0, 0.0), (0.5, 0.01), (0.9, 0.02), (0.99, 0.06)] {
        // Scale cannot matter more for long paths than for short ones, and long ones take their time.
        let sizes: &[f32] = if albedo < 0.95 { &[1e-3, 1.0, 1e4] } else { &[1.0] };
        for &size in sizes {
            let scene = closed(size, albedo);
            let view = camera(
                Vec3::new(0.1, 0.2, 0.3) * size,
                Vec3::new(1.0, 0.1, -0.4) * size,
                60.0,
            );
            let layers = path_traced(&scene, &[emitted(1.0)], &view, 256);
            assert_close(mean(&layers, "emission"), 1.0, 1e-6, "emission");
            let rho = f64::from(albedo);
            if albedo == 0.0 {
                assert_eq!(mean(&layers, "direct") + mean(&layers, "indirect"), 0.0);
                continue;
            }
            assert_close(mean(&layers, "direct"), rho, 0.01, "direct");
            let found = mean(&layers, "indirect") / mean(&layers, "direct");
            assert_close(found, rho / (1.0 - rho), tolerance, "indirect over direct");
        }
    }
}

/// Truth: `brute`, which samples lights only. Standard errors of either are about 0.2 % at these counts.
#[test]
fn direct_light_of_path_and_brute_agree_light_by_light() {
    let (scene, view) = staged();
    for track in area_lights() {
        let tracks = [track];
        let layers = path_traced(&scene, &tracks, &view, 256);
        let brute = brute_forced(&scene, &tracks, &view, 256);
        let truth = mean(&brute, "direct");
        assert_close(mean(&layers, "direct"), truth, 0.01, &tracks[0].name);
        assert_eq!(mean(&layers, "emission"), mean(&brute, "emission"));
    }
}

/// Truth: `brute`, which samples every light. With more lights than are sampled together, one is drawn.
#[test]
fn drawing_one_of_many_lights_is_right_on_average() {
    let (scene, view) = staged();
    let mut tracks = area_lights();
    for i in 0..20 {
        let place = Vec3::new(
            i as f32 * 0.2 - 2.0,
            0.3 + 0.05 * i as f32,
            (i % 5) as f32 * 0.4 - 1.0,
        );
        tracks.push(bulb(place, 0.1 * (1 + i % 3) as f32));
    }
    let direct = mean(&path_traced(&scene, &tracks, &view, 512), "direct");
    let truth = mean(&brute_forced(&scene, &tracks, &view, 64), "direct");
    assert_close(direct, truth, 0.01, "direct");
}

/// Truth: transport is linear. The layers sum the same samples, so only f32 rounding is between them.
#[test]
fn light_layers_add_up_to_the_beauty() {
    let tracks = area_lights();
    let (scene, view) = staged();
    let layers = pictured(&scene, &tracks, &view, 16, |picture| {
        let light_layers = true;
        let picture = Picture {
            light_layers,
            ..picture
        };
        render(&picture, None).unwrap()
    });
    for (i, &value) in data(&layers, "beauty").iter().enumerate() {
        let parts = ["emission", "direct", "indirect"].map(|name| data(&layers, name)[i]);
        assert_eq!(value, parts[0] + parts[1] + parts[2]);
        let lights: f32 = (tracks.iter())
            .map(|t| data(&layers, &format!("light.{}", t.name))[i])
            .sum();
        assert!((value - lights).abs() <= 1e-5 * value, "{value} {lights}");
    }
}

/// Truth: transport is linear in intensity, and a power of two changes no mantissa.
#[test]
fn forty_decades_of_intensity_change_nothing_but_the_exponent() {
    let (scene, view) = staged();
    let render = |factor: f32| {
        let bulb = bulb(Vec3::new(0.5, 1.0, 0.5), factor);
        let layers = path_traced(&scene, &[bulb, even_sky(factor), emitted(factor)], &view, 4);
        data(&layers, "beauty").to_vec()
    };
    let base = render(1.0);
    for exponent in [-66, 66] {
        let factor = 2f32.powi(exponent);
        let scaled: Vec<f32> = base.iter().map(|v| v * factor).collect();
        assert_eq!(render(factor), scaled);
    }
}

/// Truth: the same panel without a ceiling, and its own radiance. A light that touches a surface is neither
/// hidden by it nor does it flicker.
#[test]
fn a_panel_that_lies_in_the_ceiling_shines_like_a_free_one() {
    for scale in [1e-3f32, 1.0, 1e4] {
        let at = |x: f32, z: f32| Vec3::new(x, 1.0, z) * scale;
        let ceiling = quad([at(-2.0, -2.0), at(2.0, -2.0), at(2.0, 2.0), at(-2.0, 2.0)], 0);
        let free = traced(vec![floor(2.0 * scale, 0)], vec![matt(0.5, 0.0)]);
        let held = traced(vec![floor(2.0 * scale, 0), ceiling], vec![matt(0.5, 0.0)]);
        let edges = [Vec3::X * scale, Vec3::Z * scale];
        let panel = [rect("panel", at(0.1, 0.2), edges, Vec3::splat(3.0))];
        let down = camera(Vec3::new(0.0, 0.9, 0.9) * scale, Vec3::ZERO, 40.0);
        let direct = |scene: &TracedScene| mean(&path_traced(scene, &panel, &down, 64), "direct");
        assert_close(direct(&held), direct(&free), 0.01, "floor");
        let up = camera(Vec3::new(0.3, 0.2, 0.1) * scale, at(0.1, 0.2), 20.0);
        let seen = path_traced(&held, &panel, &up, 16);
        assert!(data(&seen, "emission").iter().all(|&v| (v - 3.0).abs() < 1e-5));
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let ((scene, view), tracks) = (staged(), area_lights());
    same_on_any_threads(|| {
        let path = path_traced(&scene, &tracks, &view, 4);
        (path, brute_forced(&scene, &tracks, &view, 2))
    });
}

/// Truth: the error of an unbiased estimate falls at least as 1/√n: 16 times the samples, a quarter of it.
#[test]
fn error_falls_with_the_square_root_of_the_samples_or_faster() {
    let ((scene, view), tracks) = (staged(), area_lights());
    let truth = pictured(&scene, &tracks, &view, 8192, |picture| {
        render(&Picture { seed: 7, ..picture }, None).unwrap()
    });
    let rmse = |spp: u32| {
        let image = path_traced(&scene, &tracks, &view, spp);
        let (a, b) = (data(&image, "direct"), data(&truth, "direct"));
        let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
        (squares.sum::<f64>() / a.len() as f64).sqrt()
    };
    let (few, many) = (rmse(8), rmse(128));
    // A quarter, with a tenth of room for the deviation of an RMSE over 768 values.
    assert!(many < 0.275 * few, "{few} {many}");
}

#[test]
fn a_limit_of_reflections_cuts_exactly_there() {
    let scene = closed(1.0, 0.8);
    let view = camera(Vec3::ZERO, Vec3::X, 60.0);
    // Truth: ρ + ρ² + … up to the limit.
    for (limit, direct, indirect) in [
        (0, 0.0, 0.0),
        (1, 0.8, 0.0),
        (2, 0.8, 0.64),
        (3, 0.8, 0.64 + 0.512),
    ] {
        let layers = pictured(&scene, &[emitted(1.0)], &view, 128, |picture| {
            render(&picture, Some(limit)).unwrap()
        });
        for (name, truth) in [("direct", direct), ("indirect", indirect)] {
            let found = mean(&layers, name);
            assert!(
                (found - truth).abs() <= 0.01 * truth,
                "{limit} {name}: {found} {truth}"
            );
        }
    }
}

#[test]
fn unlit_materials_show_their_colour_and_light_nothing() {
    let unlit = Material {
        unlit: true,
        ..matt(0.25, 0.0)
    };
    let at = |x: f32, y: f32| Vec3::new(x, y, -1.0);
    let wall = quad([at(-1.0, 0.0), at(1.0, 0.0), at(1.0, 2.0), at(-1.0, 2.0)], 1);
    let scene = traced(vec![floor(2.0, 0), wall], vec![matt(0.5, 0.0), unlit]);
    let at_wall = camera(Vec3::new(0.0, 1.0, 1.0), Vec3::new(0.0, 1.0, -1.0), 10.0);
    let layers = path_traced(&scene, &[], &at_wall, 2);
    assert_close(mean(&layers, "beauty"), 0.25, 1e-6, "unlit");
    let at_floor = camera(Vec3::new(0.0, 1.0, 1.0), Vec3::ZERO, 10.0);
    let layers = path_traced(&scene, &[], &at_floor, 2);
    assert_eq!(mean(&layers, "beauty"), 0.0);
}

#[test]
fn an_empty_scene_shows_the_sky_and_a_cancelled_one_nothing() {
    let scene = traced(Vec::new(), Vec::new());
    let view = camera(Vec3::ZERO, Vec3::X, 60.0);
    let tracks = [even_sky(2.0)];
    let layers = path_traced(&scene, &tracks, &view, 1);
    assert_close(mean(&layers, "emission"), 2.0, 1e-6, "sky");
    assert!(data(&layers, "depth").iter().all(|&d| d == 0.0));

    struct Stopped;
    impl Watch for Stopped {
        fn stopped(&self) -> bool {
            true
        }
    }
    pictured(&scene, &tracks, &view, 1, |picture| {
        let watch = &Stopped;
        assert_eq!(render(&Picture { watch, ..picture }, None), Err(Cancelled));
    });
}
