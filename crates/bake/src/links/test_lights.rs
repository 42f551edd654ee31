//! Lights by which links are chosen: what a row makes of them says which of its links matter ([`crate::links::matching_pursuit`]).
//!
//! Lamps at pilots, suns, and light from all sides. Unlike trial lights ([`crate::links::fitting`]) each is a light of its own: what few
//! lamps tell apart, groups of them don't.

use crate::links::lamps::{Lamps, most_power, power};
use crate::points::candidates::Candidate;
use crate::points::seen::open_ways;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::surface::Surfaces;
use relight_transport::sampling::{r2, uniform_hemisphere};
use relight_transport::senders::{PILOTS, SenderTree};

/// Number of lights: even light, lamps, suns.
pub const TEST_LIGHTS: usize = 128;

/// The even light.
pub const EVEN: usize = 0;

/// Suns among them, from all sides. With 23 suns and 40 lamps, lamps err an eighth more (docs/notebook/transfer.md).
const SUNS: usize = 31;

/// Lamps at the first pilots: lights 1 to this.
pub const AT_PILOTS: usize = TEST_LIGHTS - 1 - SUNS;
const _: () = assert!(AT_PILOTS <= PILOTS);

/// A value in each light.
pub type InTestLights = [f32; TEST_LIGHTS];

/// Radiosity in the lights, relative to its mean over all finest points.
#[derive(Clone, Debug)]
pub struct TestLights {
    /// Coefficients of the senders (see [`SenderTree::coefficients`]).
    pub coefficients: Vec<InTestLights>,
    /// Means over the clusters of the finest sender level.
    pub leaf_means: Vec<InTestLights>,
}

impl TestLights {
    /// Lights of lamps at the pilots and of suns on the finest points, `places`.
    pub fn new(
        surfaces: &dyn Surfaces,
        tree: &SenderTree,
        places: &[Candidate],
        lamps: &Lamps,
    ) -> TestLights {
        let suns: Vec<Vec3> = (0..SUNS).map(|i| sphere(r2(i as u32, Vec2::ZERO))).collect();
        let sunlit = sunlit(surfaces, places, &suns);
        let light = |g: usize, p: usize| {
            if g == EVEN {
                return 1.0;
            }
            if g <= AT_PILOTS {
                return lamps.light(g - 1, p);
            }
            let sun = g - 1 - AT_PILOTS;
            if sunlit[p] >> sun & 1 == 1 {
                places[p].normal.dot(suns[sun]).max(0.0)
            } else {
                0.0
            }
        };
        TestLights::from_radiosity(tree, light)
    }

    /// From `light`, the radiosity in a light at a finest point: of lamps alike and of suns alike, for each light is scaled to a mean of 1, or
    /// as far as [`most_power`] lets it be.
    pub fn from_radiosity(tree: &SenderTree, light: impl Fn(usize, usize) -> f32 + Sync) -> TestLights {
        let points = tree.leaf_of_point.len();
        let means: Vec<f64> = (0..TEST_LIGHTS)
            .into_par_iter()
            .map(|g| (0..points).map(|p| f64::from(light(g, p))).sum::<f64>() / points as f64)
            .collect();
        let (lamps, suns) = means[1..].split_at(AT_PILOTS);
        let most = [most_power(&means[..1]), most_power(lamps), most_power(suns)];
        let kind = |g: usize| usize::from(g > EVEN) + usize::from(g > AT_PILOTS);
        let scales: InTestLights = std::array::from_fn(|g| power(means[g], most[kind(g)]) as f32);
        let (coefficients, leaf_means) = in_lights(tree, |first| {
            let channel = |c: usize, p: usize| match first + c {
                g if g < TEST_LIGHTS => light(g, p) * scales[g],
                _ => 0.0,
            };
            (0..points)
                .map(|p| Vec3::new(channel(0, p), channel(1, p), channel(2, p)))
                .collect()
        });
        TestLights {
            coefficients,
            leaf_means,
        }
    }
}

/// Coefficients of the senders (see [`SenderTree::coefficients`]) and means over the clusters of the finest sender level, in N
/// lights. `three_from`: radiosity at the finest points in a light and the two after it, as the channels of a colour; what is
/// beyond the last light counts for nothing.
pub fn in_lights<const N: usize>(
    tree: &SenderTree,
    three_from: impl Fn(usize) -> Vec<Vec3> + Sync,
) -> (Vec<[f32; N]>, Vec<[f32; N]>) {
    let firsts: Vec<usize> = (0..N).step_by(3).collect();
    let pulled: Vec<(Vec<Vec3>, Vec<Vec3>)> = (firsts.par_iter())
        .map(|&first| {
            let mut levels = tree.pulled(&three_from(first));
            let coefficients = tree.coefficients(&levels);
            (coefficients, levels.pop().unwrap_or_default())
        })
        .collect();
    let mut coefficients = vec![[0.0; N]; tree.ranges.total()];
    let mut leaf_means = vec![[0.0; N]; tree.ranges.range(tree.levels() - 1).len()];
    for (&first, (sent, means)) in firsts.iter().zip(&pulled) {
        let together = 3.min(N - first);
        for (rows, colours) in [(&mut coefficients, sent), (&mut leaf_means, means)] {
            for (row, colour) in rows.iter_mut().zip(colours) {
                row[first..first + together].copy_from_slice(&colour.to_array()[..together]);
            }
        }
    }
    (coefficients, leaf_means)
}

fn sphere(u: Vec2) -> Vec3 {
    uniform_hemisphere(Vec2::new(2.0 * u.x - 1.0, u.y))
}

/// Which suns places see, a bit each.
fn sunlit(surfaces: &dyn Surfaces, places: &[Candidate], suns: &[Vec3]) -> Vec<u128> {
    open_ways(surfaces, places, suns.len(), |_, sun| (suns[sun], f32::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::hollow;
    use relight_transport::random::Stream;

    /// Two coarse senders of two leaves of ten points each.
    fn tree() -> SenderTree {
        let leaves = (0..40).map(|p| p / 10).collect();
        SenderTree::new(&[2, 4], leaves, vec![vec![0, 0, 1, 1]], vec![9; 40])
    }

    /// Truth: means by hand of random light. Tolerance: f32 sums of forty numbers.
    #[test]
    fn every_light_has_a_mean_of_one_and_clusters_have_their_points_means() {
        let tree = tree();
        let mut s = Stream::new(1, 0, 0);
        let light: Vec<InTestLights> = (0..40).map(|_| std::array::from_fn(|_| s.uniform())).collect();
        // The last light reaches nothing.
        let lit = |g: usize, p: usize| if g == TEST_LIGHTS - 1 { 0.0 } else { light[p][g] };
        let test_lights = TestLights::from_radiosity(&tree, lit);
        for g in 0..TEST_LIGHTS {
            let mean = |points: std::ops::Range<usize>| {
                let n = points.len() as f32;
                points.map(|p| lit(g, p)).sum::<f32>() / n
            };
            let scale = if g == TEST_LIGHTS - 1 {
                0.0
            } else {
                1.0 / mean(0..40)
            };
            for leaf in 0..4 {
                let own = mean(10 * leaf..10 * leaf + 10) * scale;
                let parent = mean(20 * (leaf / 2)..20 * (leaf / 2) + 20) * scale;
                assert!((test_lights.leaf_means[leaf][g] - own).abs() < 1e-5);
                assert!((test_lights.coefficients[2 + leaf][g] - (own - parent)).abs() < 1e-5);
                assert!((test_lights.coefficients[leaf / 2][g] - parent).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn no_sun_shines_into_a_closed_ball_and_all_from_above_onto_its_outside() {
        let (ball, points) = hollow(0.5);
        let places = &points.levels[points.levels.len() - 1].points;
        let suns = [Vec3::X, Vec3::Y, Vec3::NEG_Z];
        assert!(sunlit(&ball, places, &suns).iter().all(|&bits| bits == 0));
        let outside: Vec<Candidate> = (places.iter())
            .map(|place| Candidate {
                normal: -place.normal,
                geometric_normal: -place.geometric_normal,
                origin: place.origin
                    - place.geometric_normal * (2.0 * place.origin.distance(place.position) + 1e-3),
                ..*place
            })
            .collect();
        for (place, bits) in outside.iter().zip(sunlit(&ball, &outside, &suns)) {
            for (sun, direction) in suns.iter().enumerate() {
                let cosine = direction.dot(place.geometric_normal);
                // Facets stand out by less than a tenth.
                if cosine.abs() > 0.1 {
                    assert_eq!(bits >> sun & 1 == 1, cosine > 0.0, "{cosine}");
                }
            }
        }
    }
}
