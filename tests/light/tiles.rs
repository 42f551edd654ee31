//! What a floor of black and white tiles that are smaller than points sends to a wall.

use crate::gloss::baked_with;
use crate::stage::indirect;
use glam::{DVec3, Vec3, dvec3};
use relight_bake::params::BakeParams;
use relight_data_generate::glb::{Glb, Placement, matt};
use relight_data_generate::mesh::{join, quad};
use relight_play::choice::Tracer;
use relight_play::scene::animated::Animated;
use relight_play::scene::light::{LightKind, LightTrack};
use relight_play::{Integrator, Player};
use relight_transport::random::Stream;

/// Tiles along a side of the floor, and their edge, m.
const TILES: usize = 40;
const EDGE: f64 = 0.1;

/// A black room with a grey wall, and a floor of tiles, each of one reflectance or the other at random.
fn bathroom(reflectances: [f64; 2]) -> Glb {
    let mut glb = Glb::new();
    let mut s = Stream::new(1, 0, 0);
    let half = 0.5 * EDGE * TILES as f64;
    let tile = |x: usize, z: usize| {
        let low = dvec3(EDGE * x as f64 - half, 0.0, EDGE * z as f64 - half);
        quad(
            low + DVec3::Z * EDGE,
            low + dvec3(EDGE, 0.0, EDGE),
            low + DVec3::X * EDGE,
            low,
        )
    };
    let (mut black, mut white) = (Vec::new(), Vec::new());
    for (x, z) in (0..TILES).flat_map(|x| (0..TILES).map(move |z| (x, z))) {
        if s.uniform() < 0.5 { &mut black } else { &mut white }.push(tile(x, z));
    }
    let corner = |x: f64, y: f64, z: f64| dvec3(half * x, 3.0 * y, half * z);
    let wall = |[a, b]: [[f64; 2]; 2]| {
        let at = |[x, z]: [f64; 2], y| corner(x, y, z);
        quad(at(a, 0.0), at(b, 0.0), at(b, 1.0), at(a, 1.0))
    };
    let around = [
        wall([[1.0, -1.0], [1.0, 1.0]]),
        wall([[1.0, 1.0], [-1.0, 1.0]]),
        wall([[-1.0, 1.0], [-1.0, -1.0]]),
        quad(
            corner(-1.0, 1.0, -1.0),
            corner(1.0, 1.0, -1.0),
            corner(1.0, 1.0, 1.0),
            corner(-1.0, 1.0, 1.0),
        ),
    ];
    let parts = [
        ("Black", reflectances[0], join(&black)),
        ("White", reflectances[1], join(&white)),
        ("Wall", 0.5, wall([[-1.0, -1.0], [1.0, -1.0]])),
        ("Around", 0.0, join(&around)),
    ];
    for (name, reflectance, mesh) in parts {
        let material = glb.add_material(&matt(name, [reflectance; 3]));
        let mesh = glb.add_mesh(name, &[(&mesh, material)]);
        glb.add_node(name, mesh, Placement::HERE);
    }
    glb.add_camera("eye", dvec3(0.0, 1.5, 1.9), dvec3(0.0, 1.5, -half), 30.0, 1.0);
    glb
}

/// Truth: the path tracer, for how much less the wall gets than from a floor that is white all over; the same points lie on both. Of a floor of some hundred
/// points, one tile each, that would be known to 9 %: tiles differ by nine tenths of their mean. Points that know their cells are right to 1.3 %, in the
/// root of the mean square over seeds, of which paths' noise is a part.
#[test]
fn a_floor_of_small_tiles_lights_a_wall_as_all_of_its_tiles_do() {
    let lamp = LightTrack {
        name: "lamp".into(),
        kind: LightKind::Point {
            position: Animated::Constant(Vec3::new(0.0, 2.0, 0.0)),
            intensity: Animated::Constant(Vec3::splat(5.0)),
        },
    };
    let scenes = [bathroom([0.05, 0.85]), bathroom([0.85; 2])];
    let players = |seed: u64| {
        let params = BakeParams {
            levels: 3,
            sender_levels: 2,
            coarse_radius: Some(0.8),
            seed,
            ..BakeParams::default()
        };
        scenes.each_ref().map(|scene| baked_with(scene, &params))
    };
    let left = |players: &[Player; 2], integrator: &Integrator, samples| {
        let [tiles, white] = players.each_ref().map(|player| {
            let picture = indirect(player, &lamp, integrator.clone(), 16, samples);
            picture.iter().sum::<f32>()
        });
        tiles / white
    };
    let truth = left(&players(0), &Tracer::default().into(), 1024);
    let errors: Vec<f32> = (0..8)
        .map(|seed| left(&players(seed), &Integrator::Transfer, 4) / truth - 1.0)
        .collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f32>() / errors.len() as f32).sqrt();
    println!("{rms}: {errors:?}");
    assert!(rms < 0.03, "{rms}: {errors:?}");
}
