//! A lamp's light that reaches the eye over two glossy surfaces, one after the other.

use crate::gloss::baked_with;
use crate::stage;
use glam::{Vec3, dvec3};
use relight_bake::params::BakeParams;
use relight_data_generate::glb::{Glb, Placement, matt, metal};
use relight_data_generate::mesh::quad;
use relight_play::choice::Tracer;
use relight_play::scene::animated::Animated;
use relight_play::scene::light::{LightKind, LightTrack};
use relight_play::{Integrator, Player};
use std::sync::OnceLock;

/// A floor and a wall behind it, both of rough metal, and a matt wall before them.
fn corner() -> Glb {
    let mut glb = Glb::new();
    let metal = glb.add_material(&metal("Metal", 0.8, 0.4));
    let paint = glb.add_material(&matt("Paint", [0.5; 3]));
    let floor = quad(
        dvec3(-2.0, 0.0, 2.0),
        dvec3(2.0, 0.0, 2.0),
        dvec3(2.0, 0.0, -2.0),
        dvec3(-2.0, 0.0, -2.0),
    );
    let upright = |z: f64, way: f64| {
        quad(
            dvec3(-2.0 * way, 0.0, z),
            dvec3(2.0 * way, 0.0, z),
            dvec3(2.0 * way, 2.0, z),
            dvec3(-2.0 * way, 2.0, z),
        )
    };
    for (name, mesh, material) in [
        ("floor", floor, metal),
        ("back", upright(-2.0, 1.0), metal),
        ("front", upright(2.0, -1.0), paint),
    ] {
        let mesh = glb.add_mesh(name, &[(&mesh, material)]);
        glb.add_node(name, mesh, Placement::HERE);
    }
    glb.add_camera("eye", dvec3(0.5, 1.6, 1.5), dvec3(0.0, 1.0, -2.0), 60.0, 1.0);
    glb
}

fn player() -> &'static Player {
    static PLAYER: OnceLock<Player> = OnceLock::new();
    PLAYER.get_or_init(|| {
        let params = BakeParams {
            levels: 4,
            sender_levels: 3,
            coarse_radius: Some(0.8),
            ..BakeParams::default()
        };
        baked_with(&corner(), &params)
    })
}

/// A small lamp over the floor.
fn lamp(intensity: f32) -> LightTrack {
    LightTrack {
        name: "lamp".into(),
        kind: LightKind::Point {
            position: Animated::Constant(Vec3::new(-0.4, 1.2, -0.6)),
            intensity: Animated::Constant(Vec3::splat(intensity)),
        },
    }
}

/// A globe in its place.
fn globe() -> LightTrack {
    LightTrack {
        name: "globe".into(),
        kind: LightKind::Sphere {
            center: Animated::Constant(Vec3::new(-0.4, 1.2, -0.6)),
            radius: Animated::Constant(0.1),
            radiance: Animated::Constant(Vec3::splat(30.0)),
        },
    }
}

/// Pixels of the picture along a side, and of a block.
const SIDE: usize = 32;
const BLOCK: usize = 4;

/// Indirect light in a picture of the wall at the back: means of blocks of pixels, green.
fn indirect(track: &LightTrack, integrator: Integrator, samples: u32) -> Vec<f64> {
    let pixels = stage::indirect(player(), track, integrator, SIDE, samples);
    let mut blocks = vec![0.0; (SIDE / BLOCK) * (SIDE / BLOCK)];
    for (i, pixel) in pixels.iter().enumerate() {
        let (x, y) = (i % SIDE / BLOCK, i / SIDE / BLOCK);
        blocks[y * (SIDE / BLOCK) + x] += f64::from(*pixel) / (BLOCK * BLOCK) as f64;
    }
    blocks
}

fn mean(blocks: &[f64]) -> f64 {
    blocks.iter().sum::<f64>() / blocks.len() as f64
}

/// Root of the mean squared error over the mean, and the relative error of the mean.
fn off(found: &[f64], truth: &[f64]) -> [f64; 2] {
    let squares: Vec<f64> = found.iter().zip(truth).map(|(f, t)| (f - t).powi(2)).collect();
    [
        mean(&squares).sqrt() / mean(truth),
        mean(found) / mean(truth) - 1.0,
    ]
}

/// Truth: the path tracer, which knows no points; its own noise is a hundredth. Bounds: a block's highlight is told by some of 512 rays, a fifth of it as the
/// root of their squares says; if the floor were matt, that would be 1.27. The mean is to be right within three standard errors of the blocks' mean.
fn shows_what_the_floor_mirrors(track: &LightTrack) {
    let truth = indirect(track, Tracer::default().into(), 1024);
    let found = indirect(track, Integrator::Transfer, 16);
    let [error, bias] = off(&found, &truth);
    println!("{}: error {error:.3}, bias {bias:+.4}", track.name);
    assert!(error < 0.25, "{error}");
    let standard_error = error / (truth.len() as f64).sqrt();
    assert!(bias.abs() < 3.0 * standard_error, "{bias}");
}

#[test]
fn a_metal_wall_shows_what_a_metal_floor_sends_of_a_lamp() {
    shows_what_the_floor_mirrors(&lamp(1.0));
}

#[test]
fn a_metal_wall_shows_what_a_metal_floor_sends_of_a_globe() {
    shows_what_the_floor_mirrors(&globe());
}

/// Truth: transport is linear, and random numbers are the same however bright a light is: powers of two change no bit.
#[test]
fn what_is_seen_over_two_lobes_goes_with_the_lamp() {
    let one = indirect(&lamp(1.0), Integrator::Transfer, 1);
    let bright = indirect(&lamp(1024.0), Integrator::Transfer, 1);
    assert!(mean(&one) > 0.0);
    for (one, bright) in one.iter().zip(&bright) {
        assert_eq!(1024.0 * one, *bright);
    }
}
