//! What a lit wall sends over open ground to an eye that looks along it.

use crate::gloss::baked_with;
use crate::stage::indirect;
use glam::{Vec3, dvec3};
use relight_bake::params::BakeParams;
use relight_data_generate::glb::{Glb, Material, Placement, matt};
use relight_data_generate::mesh::quad;
use relight_play::Integrator;
use relight_play::choice::Tracer;
use relight_play::scene::animated::Animated;
use relight_play::scene::light::{LightKind, LightTrack};

/// A wall at the far end of ground as most files have it: rough, and no metal.
fn square() -> Glb {
    let mut glb = Glb::new();
    let ground = glb.add_material(&Material {
        name: "Ground",
        base_color: [0.4, 0.4, 0.4, 1.0],
        roughness: 1.0,
        ..Material::default()
    });
    let paint = glb.add_material(&matt("Paint", [0.8; 3]));
    let floor = quad(
        dvec3(-8.0, 0.0, 8.0),
        dvec3(8.0, 0.0, 8.0),
        dvec3(8.0, 0.0, -8.0),
        dvec3(-8.0, 0.0, -8.0),
    );
    let wall = quad(
        dvec3(-5.0, 0.0, -8.0),
        dvec3(5.0, 0.0, -8.0),
        dvec3(5.0, 4.0, -8.0),
        dvec3(-5.0, 4.0, -8.0),
    );
    for (name, mesh, material) in [("floor", floor, ground), ("wall", wall, paint)] {
        let mesh = glb.add_mesh(name, &[(&mesh, material)]);
        glb.add_node(name, mesh, Placement::HERE);
    }
    glb.add_camera("eye", dvec3(0.0, 1.0, 9.0), dvec3(0.0, 0.3, 0.0), 40.0, 1.0);
    glb
}

/// Pixels of the picture along a side.
const SIDE: usize = 128;

/// Truth: the path tracer. The wall's light comes over the ground towards the eye, where a rough surface sends more of it by its lobe and less by its matt part than
/// it would of even light. Tolerance: a tenth for bands of sixteen rows across the middle, of which points and links are off by some per cent, and the lobes have
/// noise; with an even matt part beside the lobe the first band was too bright by 15 %.
/// No pixel is a dot, twice as bright as its row: of lobes that each show the wall by their own few rays many were, by six times.
#[test]
fn rough_ground_before_a_lit_wall_shines_where_it_should_and_has_no_dots() {
    let params = BakeParams {
        levels: 4,
        sender_levels: 3,
        coarse_radius: Some(0.8),
        ..BakeParams::default()
    };
    let player = baked_with(&square(), &params);
    let lamp = LightTrack {
        name: "lamp".into(),
        kind: LightKind::Point {
            position: Animated::Constant(Vec3::new(0.0, 2.0, -6.0)),
            intensity: Animated::Constant(Vec3::splat(5.0)),
        },
    };
    let truth = indirect(&player, &lamp, Tracer::default().into(), SIDE, 512);
    let found = indirect(&player, &lamp, Integrator::Transfer, SIDE, 16);
    let middle = SIDE / 4..3 * SIDE / 4;
    let mean = |picture: &[f32], rows: std::ops::Range<usize>| {
        let all: Vec<f32> = rows
            .flat_map(|y| picture[y * SIDE..][middle.clone()].to_vec())
            .collect();
        all.iter().sum::<f32>() / all.len() as f32
    };
    for first in (SIDE / 2 + 4..SIDE - 12).step_by(16) {
        let rows = first..first + 16;
        let [truth, band] = [&truth, &found].map(|picture| mean(picture, rows.clone()));
        println!("rows from {first}: {band} of {truth}, {}", band / truth);
        assert!(
            (band / truth - 1.0).abs() < 0.1,
            "rows from {first}: {band} of {truth}"
        );
        for y in rows {
            let row = mean(&found, y..y + 1);
            for &pixel in &found[y * SIDE..][middle.clone()] {
                assert!(pixel < 2.0 * row, "row {y}: {pixel} of {row}");
            }
        }
    }
}
