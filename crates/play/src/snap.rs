//! Finding the surfaces on which an asset's places lie, as of which it has only rounded positions.

use glam::Vec3;
use rayon::prelude::*;
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces};

/// How far above and below its stored place a point's surface is looked for, in radii (R of SPEC 6.6.1): the file's
/// rounding is 1/256 of that.
const SNAP: f32 = 0.125;

/// The same at first: four times the file's rounding, so that a surface close above, another fold of a curtain, is not taken
/// for the point's own.
const SNAP_FIRST: f32 = 1.0 / 64.0;

/// Cosine between a point's stored normal and the surface found there, below which it is another surface.
const SNAP_FACING: f32 = 0.7;

/// Finds the surfaces on which places of a file lie, stored to 1/256 of `radius`.
pub(crate) fn snapped(
    surfaces: &dyn Surfaces,
    positions: &[Vec3],
    normals: &[Vec3],
    radius: f32,
) -> Vec<Option<SurfaceHit>> {
    (positions.par_iter().zip(normals))
        .with_min_len(256)
        .map(|(&position, &normal)| {
            let within = |reach: f32| {
                let ray = Ray {
                    origin: position + normal * reach,
                    direction: -normal,
                    t_min: 0.0,
                    t_max: 2.0 * reach,
                };
                surfaces
                    .closest_hit(&ray)
                    .filter(|hit| hit.normal.dot(normal) > SNAP_FACING)
            };
            let found = within(radius * SNAP_FIRST).or_else(|| within(radius * SNAP));
            // Points on rims and in folds may miss: they are lit where they are stored, from a rounding
            // error's height.
            found.or(Some(SurfaceHit {
                t: 0.0,
                position,
                position_error: Vec3::splat(radius / 128.0),
                geometric_normal: normal,
                normal,
                front: true,
                primitive: u32::MAX,
                barycentric: [0.0; 2],
            }))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, traced};

    #[test]
    fn a_place_finds_its_own_sheet_and_not_the_one_close_above() {
        // Two sheets a twentieth of a radius apart; places stored up to the file's rounding beside the lower one.
        let (radius, gap) = (0.2, 0.01);
        let scene = traced(vec![level(1.0, 0.0, 0), level(1.0, gap, 0)], vec![matt(0.5, 0.0)]);
        let rounding = radius / 256.0;
        let stored: Vec<Vec3> = (-4..=4)
            .map(|i| Vec3::new(0.1, i as f32 * 0.25 * rounding, 0.05 * i as f32))
            .collect();
        let found = snapped(&scene, &stored, &vec![Vec3::Y; stored.len()], radius);
        for hit in found {
            let hit = hit.expect("a surface");
            assert!(
                hit.primitive != u32::MAX && hit.position.y.abs() < 1e-6,
                "{hit:?}"
            );
        }
    }

    #[test]
    fn a_place_beside_its_surface_is_looked_for_farther_off_and_one_in_the_air_stays() {
        let scene = traced(vec![level(1.0, 0.0, 0)], vec![matt(0.5, 0.0)]);
        let stored = [Vec3::new(0.1, 0.02, 0.3), Vec3::new(0.1, 0.1, 0.3)];
        let found = snapped(&scene, &stored, &[Vec3::Y; 2], 0.2);
        let height = |i: usize| found[i].as_ref().expect("a place").position.y;
        assert!(height(0).abs() < 1e-6, "{}", height(0));
        assert_eq!(height(1), 0.1);
    }
}
