//! Clusters of lights that are hidden for sure.
//!
//! Beyond Walter et al. 2005, whose bounds take every light as seen: where a flat convex piece of opaque surface stops
//! a shadow ray, all of a cluster's box may lie in its shadow, and then the cluster sends nothing. What is hidden
//! takes no refinement and no further rays; the bound on the error stays one.

use glam::{Vec3, Vec3A};
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::{BULGE, FlatPiece, TracedScene};
use relight_transport::light_bounds::LightBox;

/// How far inside of the shadow's sides a box must lie, relative to its distance: some hundred roundings of f32, and
/// corners left out on straight edges.
const SIDE: f32 = 1e-5;
/// How far behind the piece, relative to the larger distance of both: ends of shadow rays keep clear of surfaces by
/// less, and the piece is flat but for [`BULGE`].
const BEHIND: f32 = 1e-4;
const _: () = assert!(BULGE < 0.5 * BEHIND);
/// How far the piece lies from the place, in units of what rays keep clear of the place's own surface.
const APART: f32 = 16.0;

/// Whether the opaque `triangle`, with the flat piece it is part of, hides all of a box from a place.
pub(super) fn hides(scene: &TracedScene, triangle: u32, hit: &SurfaceHit, seen: &LightBox) -> bool {
    scene.with_flat_piece(triangle, |piece| is_behind(&piece, hit, seen))
}

fn is_behind(piece: &FlatPiece<'_>, hit: &SurfaceHit, seen: &LightBox) -> bool {
    let corners = piece.corners;
    let x = Vec3A::from(hit.position);
    let to = |corner: Vec3| Vec3A::from(corner) - x;
    let (a, b, c) = (to(corners[0]), to(corners[1]), to(corners[2]));
    let normal = (b - a).cross(c - a);
    let side = normal.dot(a).signum();
    let distance = seen.centre.length() + seen.half.length();
    // The least of n · p over the box.
    let least = |n: Vec3A| n.dot(seen.centre) - n.abs().dot(seen.half);
    let mut from = to(corners[corners.len() - 1]);
    for &corner in corners {
        let to = to(corner);
        let inwards = from.cross(to) * side;
        // An edge off by the slack is off by the angle at which that is seen: slack |to − from| / |inwards|.
        let margin = SIDE * inwards.length() + piece.slack * from.distance(to);
        if least(inwards) < margin * distance {
            return false;
        }
        from = to;
    }
    let Some(normal) = (normal * side).try_normalize() else {
        return false;
    };
    let (mut nearest, mut deepest, mut farthest) = (f32::INFINITY, 0.0f32, distance);
    for &corner in corners {
        let corner = to(corner);
        let depth = normal.dot(corner);
        (nearest, deepest) = (nearest.min(depth), deepest.max(depth));
        farthest = farthest.max(corner.length());
    }
    nearest > APART * hit.position_error.max_element()
        && (seen.unit || least(normal) >= deepest + BEHIND * farthest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, quad, room, traced};
    use relight_scene::rays::Ray;
    use relight_scene::surface::{Surfaces, ray_between, ray_from};
    use relight_scene::traced::Stop;
    use relight_transport::random::Stream;

    /// Truth: shadow rays to places all over the box.
    #[test]
    fn no_light_of_a_box_that_is_hidden_is_seen() {
        let screen = |x: f32, low: f32, high: f32| {
            let corner = |y: f32, z: f32| Vec3::new(x, y, z);
            quad(
                [
                    corner(-1.0, low),
                    corner(0.6, low),
                    corner(0.6, high),
                    corner(-1.0, high),
                ],
                0,
            )
        };
        let meshes = vec![
            room(0),
            level(0.5, -0.2, 0),
            screen(0.3, -0.7, 0.2),
            screen(-0.4, -0.1, 0.9),
        ];
        let scene = traced(meshes, vec![matt(0.5, 0.0)]);
        let mut s = Stream::new(8, 0, 0);
        let mut cube = || Vec3::new(s.uniform(), s.uniform(), s.uniform()) * 2.0 - 1.0;
        let (mut hidden, mut stopped) = ([0, 0], [0, 0]);
        for case in 0..40_000 {
            let unit = case % 2 == 1;
            let Some(hit) = scene.closest_hit(&Ray::endless(cube() * 0.95, cube())) else {
                continue;
            };
            let half = cube().abs() * 10f32.powf(2.0 * cube().x - 2.0);
            let centre = if unit {
                cube().normalize()
            } else {
                cube() * 0.95 - hit.position
            };
            let to = |v: Vec3| {
                if unit {
                    ray_from(&hit, v.normalize())
                } else {
                    ray_between(&hit, hit.position + v)
                }
            };
            let Some(Stop::Opaque(triangle)) = scene.stop(&to(centre)) else {
                continue;
            };
            stopped[usize::from(unit)] += 1;
            let seen = LightBox {
                centre: centre.into(),
                half: half.into(),
                unit,
            };
            if !hides(&scene, triangle, &hit, &seen) {
                continue;
            }
            hidden[usize::from(unit)] += 1;
            for corner in 0..24 {
                // Corners first, then anywhere.
                let v = if corner < 8 {
                    Vec3::new(
                        (corner & 1) as f32,
                        (corner >> 1 & 1) as f32,
                        (corner >> 2) as f32,
                    ) * 2.0
                        - 1.0
                } else {
                    cube()
                };
                assert!(
                    scene.occluded(&to(centre + half * v)),
                    "{case}: {seen:?} {v} from {}",
                    hit.position
                );
            }
        }
        // Nothing would be shown if nearly nothing were hidden for sure.
        for (hidden, stopped) in hidden.into_iter().zip(stopped) {
            assert!(stopped > 2000 && hidden > stopped / 4, "{hidden} of {stopped}");
        }
    }
}
