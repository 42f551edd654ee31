//! Statements about light and solid glass: nothing is made, lost or counted twice.

use crate::brute;
use crate::lightcuts::{self, LightcutSettings};
use crate::many_lights::{PointLights, PointSettings};
use crate::test_images::*;
use crate::test_scenes::*;
use glam::Vec3;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light::LightTrack;
use relight_scene::material::{AlphaMode, Extensions, Material};
use relight_scene::scene::Mesh;
use relight_scene::traced::{Shading, TracedScene};
use std::f32::consts::{PI, TAU};

/// Clear, smooth; of index 1 it mirrors nothing and is not there.
fn glass(ior: f32) -> Material {
    Material {
        roughness: 0.0,
        alpha_mode: AlphaMode::Pane { transmission: 1.0 },
        extensions: Some(Box::new(Extensions {
            ior,
            specular: if ior == 1.0 { 0.0 } else { 1.0 },
            thickness: 1.0,
            ..Extensions::default()
        })),
        ..matt(1.0, 0.0)
    }
}

fn ball(center: Vec3, radius: f32, material: u32) -> Mesh {
    const RINGS: u32 = 48;
    const SIDES: u32 = 2 * RINGS;
    let mut mesh = Mesh::default();
    for ring in 0..=RINGS {
        let (sin, cos) = (PI * ring as f32 / RINGS as f32).sin_cos();
        for side in 0..SIDES {
            let (z, x) = (TAU * side as f32 / SIDES as f32).sin_cos();
            let pole = ring == 0 || ring == RINGS;
            let around = if pole {
                Vec3::ZERO
            } else {
                Vec3::new(x, 0.0, z) * sin
            };
            mesh.normals.push(around + Vec3::Y * cos);
        }
    }
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let at = |ring: u32, side: u32| ring * SIDES + side % SIDES;
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh.positions = mesh.normals.iter().map(|&n| center + n * radius).collect();
    Mesh { material, ..mesh }
}

fn full(meshes: Vec<Mesh>, materials: Vec<Material>) -> TracedScene {
    let scene = traced_with(meshes, materials, Shading::Full);
    assert!(scene.bends());
    scene
}

fn by_lightcuts(scene: &TracedScene, tracks: &[LightTrack], view: &Camera) -> Layers {
    pictured(scene, tracks, view, 64, |picture| {
        let points = PointLights::new(scene, picture.lights, &PointSettings::default());
        let clusters = lightcuts::trees(scene, &points, None, false, 0);
        let settings = LightcutSettings::default();
        lightcuts::render(&picture, &points, &clusters, &settings)
            .unwrap()
            .0
    })
}

fn assert_near(found: f64, truth: f64, tolerance: f64, what: &str) {
    let error = (found / truth - 1.0).abs();
    assert!(
        error < tolerance,
        "{what}: found {found}, truth {truth}, error {error}"
    );
}

/// Truth: clear glass in even light shows it as if it were not there, whatever the way through it. A way of more than 64 surfaces is lost; noise comes
/// from the lobe of what mirrors.
#[test]
fn a_ball_of_clear_glass_in_a_furnace_is_not_seen() {
    let view = camera(Vec3::new(0.3, 0.2, 4.0), Vec3::ZERO, 20.0);
    for ior in [1.1, 1.5, 2.4] {
        let scene = full(vec![ball(Vec3::ZERO, 1.0, 0)], vec![glass(ior)]);
        let path = path_traced(&scene, &[even_sky(1.0)], &view, 64);
        assert_near(mean(&path, "beauty"), 1.0, 5e-3, &format!("path, index {ior}"));
        let values = data(&path, "beauty");
        let worst = values.iter().fold(0.0f32, |worst, v| worst.max((v - 1.0).abs()));
        assert!(worst < 0.2, "{worst}");
        let mirrors = by_lightcuts(&scene, &[even_sky(1.0)], &view);
        assert_near(
            mean(&mirrors, "beauty"),
            1.0,
            5e-3,
            &format!("lightcuts, index {ior}"),
        );
    }
}

/// Truth: the same room without the ball. Its walls shine alike and reflect alike, so that its light is as even as that of the sky.
#[test]
fn glass_in_a_room_that_shines_takes_nothing() {
    let view = camera(Vec3::new(0.5, 0.4, 0.9), Vec3::ZERO, 60.0);
    let walls = || cuboid(Vec3::splat(-1.0), Vec3::ONE, true, 0);
    let materials = || vec![matt(0.5, 1.0), glass(1.5)];
    let room = traced_with(vec![walls()], materials(), Shading::Full);
    let truth = mean(&path_traced(&room, &[emitted(1.0)], &view, 256), "beauty");
    let scene = full(vec![walls(), ball(Vec3::ZERO, 0.5, 1)], materials());
    let path = path_traced(&scene, &[emitted(1.0)], &view, 256);
    assert_near(mean(&path, "beauty"), truth, 0.01, "path");
}

/// A lamp over a slab over a floor, with a mirror at the side.
fn under_a_slab(slab: Option<Material>, floor: Material) -> (TracedScene, Camera, Vec<LightTrack>) {
    let view = camera(Vec3::new(0.0, 0.5, 2.0), Vec3::new(0.0, 0.0, 0.0), 60.0);
    let mut parts = vec![level(1.5, 0.0, 0)];
    if slab.is_some() {
        parts.push(cuboid(
            Vec3::new(-3.0, 0.8, -3.0),
            Vec3::new(3.0, 1.1, 3.0),
            false,
            1,
        ));
    }
    let materials = vec![floor, slab.unwrap_or_default()];
    let scene = traced_with(parts, materials, Shading::Full);
    let edges = [Vec3::X * 1.2, Vec3::Z * 1.2];
    let lamps = vec![
        rect("panel", Vec3::Y * 2.0, edges, Vec3::splat(3.0)),
        even_sky(0.1),
    ];
    (scene, view, lamps)
}

/// Truth: the same without the glass, of index 1, which is there for the renderer alone: each way of the light counts once, over matt surfaces, mirrors
/// and what is both.
#[test]
fn glass_that_is_not_there_changes_no_light() {
    let floors = [
        ("matt", matt(0.6, 0.0)),
        (
            "polished",
            Material {
                roughness: 0.1,
                ..matt(0.4, 0.0)
            },
        ),
        (
            "mirror",
            Material {
                metallic: 1.0,
                roughness: 0.05,
                ..matt(0.8, 0.0)
            },
        ),
    ];
    for (name, floor) in floors {
        let (scene, view, lamps) = under_a_slab(None, floor.clone());
        let truth = path_traced(&scene, &lamps, &view, 256);
        let (scene, view, lamps) = under_a_slab(Some(glass(1.0)), floor);
        assert!(scene.bends());
        let found = path_traced(&scene, &lamps, &view, 256);
        for layer in ["emission", "direct", "beauty"] {
            assert_near(
                mean(&found, layer),
                mean(&truth, layer),
                0.01,
                &format!("{name}, {layer}"),
            );
        }
    }
}

/// Truth: `brute`, whose light samples go straight on: what lights a matt floor through glass counts once.
#[test]
fn a_floor_behind_glass_gets_what_goes_straight_on() {
    let parts = vec![level(2.0, 0.0, 0), ball(Vec3::new(0.0, 0.8, 0.0), 0.5, 1)];
    let scene = full(parts, vec![matt(0.6, 0.0), glass(1.5)]);
    let edges = [Vec3::X, Vec3::Z];
    let panel = [rect("panel", Vec3::Y * 2.0, edges, Vec3::splat(3.0))];
    // Beside the ball, onto what it stands over.
    let view = camera(Vec3::new(0.9, 0.2, 0.0), Vec3::ZERO, 20.0);
    let path = path_traced(&scene, &panel, &view, 256);
    let brute = pictured(&scene, &panel, &view, 64, |picture| {
        brute::render(&picture).unwrap()
    });
    assert_near(mean(&path, "direct"), mean(&brute, "direct"), 0.01, "direct");
}

/// Truth: over a mirror that takes nothing a lamp behind a slab is as bright as without: what the slab mirrors back comes up again. Of
/// one surface too few or too many 4 % would be missing.
#[test]
fn mirrors_show_lamps_through_glass_once() {
    let mirror = Material {
        metallic: 1.0,
        roughness: 0.0,
        ..matt(1.0, 0.0)
    };
    let slab = cuboid(Vec3::new(-3.0, 0.8, -3.0), Vec3::new(3.0, 1.1, 3.0), false, 1);
    let scene = full(vec![level(1.0, 0.0, 0), slab], vec![mirror, glass(1.5)]);
    let edges = [Vec3::X * 4.0, Vec3::Z * 4.0];
    let panel = [rect("panel", Vec3::Y * 2.0, edges, Vec3::splat(3.0))];
    let view = camera(Vec3::new(0.0, 0.7, 0.02), Vec3::ZERO, 10.0);
    let path = path_traced(&scene, &panel, &view, 64);
    assert_near(mean(&path, "beauty"), 3.0, 0.01, "path");
    let lightcuts = by_lightcuts(&scene, &panel, &view);
    assert_near(mean(&lightcuts, "beauty"), 3.0, 0.01, "lightcuts");
}
