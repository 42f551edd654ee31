//! Where a scene's origin should be.
//!
//! Everything after the import counts in 32-bit floats, which have 24 bits: four million metres from the origin they tell
//! places a quarter of a metre apart, and a georeferenced house falls to pieces. So a scene that lies far from its
//! origin for its size is moved to its own middle.
//!
//! The middle is one of several medians of its triangles, which no stray object moves: weighted by area, which many tiny
//! triangles elsewhere don't move either; each triangle counting the same, which a huge ground or dome doesn't move; and by
//! detail (1 over size). The one is taken from where the fewest triangles and the least area are [`blurred`].

use crate::scene::{Instance, Mesh};
use glam::{DMat3, DVec3};

/// Farther than this many times its size from the origin, a triangle's corners are rounded by more than a 16,384th of
/// its size: from there on contacts, shadows' ends and the normals of flat parts begin to show it.
const REACH: f64 = 1024.0;

/// Farther than this many times its size, by more than a 256th: it is a triangle no longer. What is blurred a little is not to be broken
/// for something else.
const BROKEN: f64 = 64.0 * REACH;

/// Distances from the origin that count as far, in sizes of the scene: nearer, rounding moves nothing by more than a
/// 500,000th of that size, so scenes around or beside their origin stay where they are.
const FAR: f64 = 32.0;

/// Share of what is blurred that must be cured, so that there is a reason to move.
const CURED: f64 = 0.75;

/// Share of all area or triangles that may become blurred for that.
const PRICE: f64 = 0.1;

/// Triangles looked at, evenly chosen: medians need no more.
const SAMPLES: usize = 200_000;

struct Sample {
    place: DVec3,
    size: f64,
    area: f64,
}

/// What to take away from all positions so that the scene is well resolved in 32 bits: zero for most scenes. Round
/// numbers in the scene's own unit.
pub(super) fn far_middle(meshes: &[Mesh], instances: &[Instance]) -> DVec3 {
    let samples = samples(meshes, instances);
    let blurred_here = blurred(&samples, DVec3::ZERO);
    let weights: [fn(&Sample) -> f64; 3] = [|s| s.area, |_| 1.0, |s| 1.0 / s.size];
    let candidates = weights.map(|weight| {
        let middle =
            DVec3::from_array([0, 1, 2].map(|axis| median(&samples, |s| s.place[axis], weight, 0.5)));
        let size = median(&samples, |s| reach(s.place - middle).max(s.size), weight, 0.75);
        let far = middle.to_array().map(|x| {
            if x.abs() > FAR * size {
                rounded(x, size)
            } else {
                0.0
            }
        });
        DVec3::from_array(far)
    });
    let mends = |there: &Blurred| {
        let pairs = || blurred_here.iter().zip(there);
        pairs().any(|(here, there)| *there < (1.0 - CURED) * here)
            && pairs().all(|(here, there)| *there <= here + PRICE)
    };
    let middles = candidates.map(|middle| (blurred(&samples, middle), middle));
    let better = middles.into_iter().filter(|(there, _)| mends(there));
    let sum = |shares: Blurred| shares.iter().sum::<f64>();
    let best = better.reduce(|best, next| if sum(next.0) < sum(best.0) { next } else { best });
    best.map_or(DVec3::ZERO, |best| best.1)
}

fn samples(meshes: &[Mesh], instances: &[Instance]) -> Vec<Sample> {
    let total: usize = (instances.iter())
        .map(|i| meshes[i.mesh as usize].triangles.len())
        .sum();
    let step = total.div_ceil(SAMPLES).max(1);
    let mut samples = Vec::with_capacity(total.div_ceil(step));
    let mut skip = 0;
    for instance in instances {
        let mesh = &meshes[instance.mesh as usize];
        let m = instance.world_from_mesh;
        let linear = DMat3::from_cols_array(&m.matrix3.to_cols_array().map(f64::from));
        let translation = glam::Vec3::from(m.translation).as_dvec3();
        let chosen = mesh.triangles.iter().skip(skip).step_by(step);
        for t in chosen {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize].as_dvec3());
            // Edges without the translation, which may leave nothing of them.
            let (ab, ac) = (linear * (b - a), linear * (c - a));
            let size = ab.length().max(ac.length()).max((ac - ab).length());
            let place = linear * ((a + b + c) / 3.0) + translation;
            if size > 0.0 && size.is_finite() && place.is_finite() {
                let area = 0.5 * ab.cross(ac).length();
                samples.push(Sample { place, size, area });
            }
        }
        // The next mesh goes on counting where this one ends.
        let count = mesh.triangles.len();
        skip = if count > skip {
            (step - (count - skip) % step) % step
        } else {
            skip - count
        };
    }
    samples
}

/// Shares of the area and of the number of triangles that are too far from an origin for their size, and that are [`BROKEN`].
type Blurred = [f64; 4];

/// See [`Blurred`].
fn blurred(samples: &[Sample], origin: DVec3) -> Blurred {
    let total = samples.iter().map(|s| s.area).sum::<f64>().max(f64::MIN_POSITIVE);
    let beyond = |sizes: f64| {
        let blurred = samples
            .iter()
            .filter(|s| reach(s.place - origin) > sizes * s.size);
        let (area, count) = blurred.fold((0.0, 0.0), |(area, count), s| (area + s.area, count + 1.0));
        [area / total, count / (samples.len() as f64).max(1.0)]
    };
    let ([area, count], [broken_area, broken_count]) = (beyond(REACH), beyond(BROKEN));
    [area, count, broken_area, broken_count]
}

/// The coordinate that decides how f32 rounds.
fn reach(v: DVec3) -> f64 {
    v.abs().max_element()
}

/// The value that has a share of all weight below it; 0 of nothing.
fn median(
    samples: &[Sample],
    value: impl Fn(&Sample) -> f64,
    weight: impl Fn(&Sample) -> f64,
    share: f64,
) -> f64 {
    let mut values: Vec<(f64, f64)> = samples.iter().map(|s| (value(s), weight(s))).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = share * values.iter().map(|v| v.1).sum::<f64>();
    for &(value, weight) in &values {
        left -= weight;
        if left <= 0.0 {
            return value;
        }
    }
    values.last().map_or(0.0, |v| v.0)
}

/// To a power of ten of at most `size`.
fn rounded(x: f64, size: f64) -> f64 {
    let digits = size.log10().floor();
    if digits >= 0.0 {
        let step = 10f64.powf(digits);
        (x / step).round() * step
    } else {
        let steps = 10f64.powf(-digits);
        (x * steps).round() / steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine3A, Vec3};

    /// `count` squares of a size, spread over `spread`, about a place.
    fn squares(at: DVec3, count: usize, size: f32, spread: f32) -> (Mesh, Instance) {
        let mut mesh = Mesh::default();
        for i in 0..count {
            let turn = i as f32 * 2.4;
            let middle = spread
                * (i as f32 / count as f32).sqrt()
                * Vec3::new(turn.cos(), 0.3 * turn.sin(), turn.sin());
            let first = mesh.positions.len() as u32;
            for (x, z) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
                mesh.positions.push(middle + size * Vec3::new(x, 0.0, z));
            }
            mesh.triangles
                .extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|v| v + first)));
        }
        let world_from_mesh = Affine3A::from_translation(at.as_vec3());
        (
            mesh,
            Instance {
                mesh: 0,
                world_from_mesh,
            },
        )
    }

    fn middle(parts: &[(Mesh, Instance)]) -> DVec3 {
        let instances: Vec<Instance> = (parts.iter().enumerate())
            .map(|(i, part)| Instance {
                mesh: i as u32,
                ..part.1
            })
            .collect();
        let meshes: Vec<Mesh> = parts.iter().map(|part| part.0.clone()).collect();
        far_middle(&meshes, &instances)
    }

    #[test]
    fn scenes_near_their_origin_stay() {
        for at in [
            DVec3::ZERO,
            DVec3::new(3.0, 1.0, -2.0),
            DVec3::new(20.0, 0.0, 20.0),
        ] {
            for (count, size) in [(1, 4.0), (20, 1.0), (2000, 0.01)] {
                let room = squares(at, count, size, 3.0);
                assert_eq!(middle(std::slice::from_ref(&room)), DVec3::ZERO, "{at} {count}");
                // On a ground, under far mountains, and with something lost in space, coarse or fine.
                let ground = squares(DVec3::ZERO, 1, 1e4, 0.0);
                assert_eq!(middle(&[room.clone(), ground]), DVec3::ZERO, "{at} {count}");
                for lost in [
                    squares(DVec3::splat(1e8), 1, 2.0, 0.0),
                    squares(DVec3::splat(1e8), 900, 1e-3, 0.1),
                ] {
                    assert_eq!(middle(&[room.clone(), lost]), DVec3::ZERO, "{at} {count}");
                }
            }
        }
        assert_eq!(middle(&[]), DVec3::ZERO);
    }

    #[test]
    fn far_scenes_are_moved_to_their_middle_whatever_else_is_there() {
        for at in [
            DVec3::new(4e5, 0.0, 0.0),
            DVec3::new(4e6, 0.0, -1e5),
            DVec3::new(6.4e6, 6.4e6, 6.4e6),
            DVec3::new(0.0, -1e7, 0.0),
        ] {
            let room = squares(at, 30, 1.0, 3.0);
            let ground = squares(at, 1, 1e4, 0.0);
            let wide = squares(DVec3::ZERO, 1, 1e8, 0.0);
            let stray = squares(DVec3::splat(1e8), 1, 2.0, 0.0);
            let home = squares(DVec3::ZERO, 1, 2.0, 0.0);
            // Many tiny triangles elsewhere, and a sky full of them around.
            let dust = squares(DVec3::splat(1e8), 900, 1e-3, 0.1);
            let dome = squares(at, 2000, 40.0, 500.0);
            for others in [
                vec![],
                vec![ground],
                vec![wide],
                vec![stray],
                vec![home],
                vec![dust],
                vec![dome],
            ] {
                let found = middle(&[vec![room.clone()], others].concat());
                // A fifth of the sky's 500 m, or nearer.
                assert!(found.distance(at) < 100.0, "{at}: {found}");
                assert_eq!(found, found.round(), "whole metres");
                // An axis along which it is near the origin stays.
                assert!((0..3).all(|i| at[i] != 0.0 || found[i] == 0.0), "{found}");
            }
        }
    }

    #[test]
    fn offsets_are_round_in_the_scenes_unit() {
        assert_eq!(rounded(4_000_123.7, 2.0), 4_000_124.0);
        assert_eq!(rounded(-4_000_123.7, 2500.0), -4_000_000.0);
        assert_eq!(rounded(12.345_678, 0.003), 12.346);
    }
}
