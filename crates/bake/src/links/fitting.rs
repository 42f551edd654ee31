//! Trial lights: what rows of T are fitted to.
//!
//! A row that drops weak links, and whose senders are means over clusters, errs to the dark side: receivers and lamps
//! share the open, so that what a receiver sees of a cluster is what is lit of it. A gather knows what each of its rays
//! would see in any light, so every row learns its exact answers to a few lights, and the coarse links that it keeps are
//! changed a little to answer alike.
//!
//! Light from all sides is the first of the lights; the others are lamps at the pilots, in groups, each in a part of the
//! open.

use crate::links::lamps::{Lamps, most_power, power};
use crate::links::test_lights::in_lights;
use glam::{DVec3, Mat3, Vec3, Vec3A};
use relight_transport::senders::SenderTree;

/// Number of trial lights: the even one and the groups of pilots. What a point is in all of them fills half a cache line, which
/// every ray loads.
pub const TRIALS: usize = 16;

/// Which of them is even.
const EVEN: usize = 0;

/// A value in each trial light.
pub type InTrials = [f32; TRIALS];

/// [`InTrials`], each number as the upper half of an f32, rounded to nearest: within 1/256 of itself. Rows are fitted to
/// whatever these lights are, so nothing is lost by that.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub struct ShortInTrials([u16; TRIALS]);

impl ShortInTrials {
    fn of(light: InTrials) -> ShortInTrials {
        // Half a unit of the last place that is kept; finite numbers below 2¹²⁷ stay finite.
        ShortInTrials(light.map(|b| ((b.to_bits() + (1 << 15)) >> 16) as u16))
    }

    /// The numbers as f32.
    #[inline]
    pub fn wide(&self) -> InTrials {
        self.0.map(|b| f32::from_bits(u32::from(b) << 16))
    }
}

/// Radiosity in the trial lights, relative to its mean over all finest points.
#[derive(Clone, Debug)]
pub struct TrialLights {
    /// At the finest points.
    pub at_points: Vec<ShortInTrials>,
    /// Coefficients of the senders (see [`SenderTree::coefficients`]).
    pub coefficients: Vec<InTrials>,
    /// Means over the clusters of the finest sender level.
    pub leaf_means: Vec<InTrials>,
    /// Per pilot the light that its lamp is part of.
    pub group_of_pilot: Vec<usize>,
}

/// A vector in each trial light, component by component.
#[derive(Clone, Copy, Debug)]
pub struct Answers<const N: usize = TRIALS>([[f32; N]; 3]);

impl<const N: usize> Default for Answers<N> {
    fn default() -> Answers<N> {
        Answers([[0.0; N]; 3])
    }
}

impl<const N: usize> Answers<N> {
    /// Adds what `other` answers, carried by `m`.
    pub fn add_carried(&mut self, m: Mat3, other: &Answers<N>) {
        for (r, sums) in self.0.iter_mut().enumerate() {
            let row = m.row(r);
            for (g, sum) in sums.iter_mut().enumerate() {
                *sum += row.x * other.0[0][g] + row.y * other.0[1][g] + row.z * other.0[2][g];
            }
        }
    }

    /// Takes off what `other` answers.
    pub fn subtract(&mut self, other: &Answers<N>) {
        for (sums, other) in self.0.iter_mut().zip(&other.0) {
            sums.iter_mut().zip(other).for_each(|(sum, other)| *sum -= other);
        }
    }

    /// Each light's times a factor.
    pub fn scale(&mut self, factors: &[f32; N]) {
        for sums in &mut self.0 {
            sums.iter_mut()
                .zip(factors)
                .for_each(|(sum, factor)| *sum *= factor);
        }
    }

    /// Sum over the lights of a factor times what is answered.
    pub fn along(&self, factors: &[f32; N]) -> Vec3A {
        let mut sums = [[0.0f32; 8]; 3];
        for (sums, answers) in sums.iter_mut().zip(&self.0) {
            for (a, b) in answers.chunks_exact(8).zip(factors.chunks_exact(8)) {
                for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
                    *sum += a * b;
                }
            }
        }
        Vec3A::from_array(sums.map(|sums| sums.iter().sum()))
    }

    /// Adds what a link, or a ray, `vector` carries of radiosity `light`.
    #[inline]
    pub fn add(&mut self, vector: Vec3A, light: &[f32; N]) {
        for (sums, v) in self.0.iter_mut().zip(vector.to_array()) {
            for (sum, b) in sums.iter_mut().zip(light) {
                *sum += v * b;
            }
        }
    }

    /// In each light, how many times what `other` answers this is, along that: from a half to twice.
    pub fn gains_over(&self, other: &Answers<N>) -> [f32; N] {
        std::array::from_fn(|g| {
            let (own, other) = (self.at(g), other.at(g));
            let squared = other.length_squared();
            if squared > 0.0 {
                (own.dot(other) / squared).clamp(0.5, 2.0)
            } else {
                1.0
            }
        })
    }

    /// In light number `g`.
    pub fn at(&self, g: usize) -> Vec3A {
        Vec3A::new(self.0[0][g], self.0[1][g], self.0[2][g])
    }
}

impl TrialLights {
    /// Lights of lamps at the pilots.
    pub fn new(tree: &SenderTree, lamps: &Lamps) -> TrialLights {
        let group = groups(lamps.pilots);
        let mut at_points: Vec<InTrials> = (0..lamps.places.len())
            .map(|p| {
                let mut light = [0.0; TRIALS];
                light[EVEN] = 1.0;
                for (k, &g) in group.iter().enumerate() {
                    light[g] += lamps.light(k, p);
                }
                light
            })
            .collect();
        let most = most_power(&lamps.means());
        for g in 1..TRIALS {
            let sum: f64 = at_points.iter().map(|b| f64::from(b[g])).sum();
            let scale = power(sum / at_points.len() as f64, most);
            at_points
                .iter_mut()
                .for_each(|b| b[g] = (f64::from(b[g]) * scale) as f32);
        }
        TrialLights {
            group_of_pilot: group,
            ..TrialLights::from_radiosity(tree, at_points.into_iter())
        }
    }

    /// From radiosity at the finest points.
    pub fn from_radiosity(tree: &SenderTree, at_points: impl Iterator<Item = InTrials>) -> TrialLights {
        let at_points: Vec<ShortInTrials> = at_points.map(ShortInTrials::of).collect();
        let (coefficients, leaf_means) = in_lights(tree, |first| {
            (at_points.iter().map(ShortInTrials::wide))
                .map(|light| Vec3::from_array(std::array::from_fn(|c| light[(first + c).min(TRIALS - 1)])))
                .collect()
        });
        TrialLights {
            at_points,
            coefficients,
            leaf_means,
            group_of_pilot: Vec::new(),
        }
    }
}

/// For each pilot its light, 1 to [`TRIALS`] − 1: that of the nearest of as many pilots far from each other.
fn groups(pilots: &[Vec3]) -> Vec<usize> {
    let mut seeds: Vec<Vec3> = pilots.first().copied().into_iter().collect();
    let distance = |seeds: &[Vec3], place: Vec3| {
        let squared = seeds.iter().map(|seed| seed.distance_squared(place));
        squared.fold(f32::INFINITY, f32::min)
    };
    while seeds.len() < TRIALS - 1 {
        let farthest = pilots
            .iter()
            .max_by(|a, b| distance(&seeds, **a).total_cmp(&distance(&seeds, **b)));
        let Some(farthest) = farthest else { break };
        seeds.push(*farthest);
    }
    let nearest = |place: &Vec3| {
        let to = |seed: usize| seeds[seed].distance_squared(*place);
        (0..seeds.len()).min_by(|&a, &b| to(a).total_cmp(&to(b)))
    };
    pilots
        .iter()
        .map(|place| 1 + nearest(place).unwrap_or(0))
        .collect()
}

/// What keeps links as they were found, as a share of the mean strength of a light in the fit. Twenty times as much leaves the
/// Sponza with leaves 1.6 % darker; half as much gains 0.2 % there, and finer rows keep more links (docs/notebook/transfer.md).
const RIDGE: f64 = 0.1;

/// Longest link that is made: a hemisphere full of radiosity 1 sends irradiance 1. Longer ones cancel each other in the lights that made
/// them, and in no others (links of 116 were found).
pub const LONGEST: f32 = 1.0;

/// What is left of the say of a link that the fit made too long or let others cancel, and how often: after that it hardly changes.
/// Of two neighbours, which most lamps light alike, one got −0.45 and the other 0.6, and the ground before them negative light. Holding all of a
/// row's links together instead leaves Crytek's Sponza 1 % darker (docs/notebook/openness.md).
const HELD: f32 = 0.125;
const MOST_TRIES: u32 = 6;

/// Changes `links` (sender, vector) so that they answer to even light as they should, and to lamps more nearly; `missing` is
/// what they lack. `whole(sender)` is how strong the receiver's answer to a sender is altogether: of no change the others take
/// back more than that, or than the link itself.
///
/// Ridge regression: of all changes, measured in units of each link's strength, the one that leaves least of both itself
/// and what lamps lack; solved for one multiplier per light. That of even light has no ridge: what is lit alike keeps
/// its energy.
pub fn fit(links: &mut [(u32, Vec3)], whole: impl Fn(u32) -> f32, lights: &TrialLights, missing: &Answers) {
    // How far each link may change.
    let mut strengths: Vec<f32> = links.iter().map(|link| link.1.length()).collect();
    let mut gram = gram(links, &strengths, lights);
    let ridge = RIDGE * (0..TRIALS).map(|g| gram[g][g]).sum::<f64>() / TRIALS as f64;
    let wanted = std::array::from_fn(|g| Vec3::from(missing.at(g)).as_dvec3());
    for _ in 0..MOST_TRIES {
        // Links to clusters without points, or none.
        if gram[EVEN][EVEN] <= 0.0 {
            return;
        }
        (0..TRIALS)
            .filter(|&g| g != EVEN)
            .for_each(|g| gram[g][g] += ridge);
        let multipliers = solved(gram, wanted);
        let changes: Vec<DVec3> = (links.iter().zip(&strengths))
            .map(|(&(j, _), &strength)| {
                let light = lights.coefficients[j as usize].iter().zip(multipliers);
                let change: DVec3 = light.map(|(&b, m)| m * f64::from(b)).sum();
                change * f64::from(strength)
            })
            .collect();
        let sum: DVec3 = changes.iter().sum();
        let mut any_wrong = false;
        for ((&(j, vector), change), strength) in links.iter().zip(&changes).zip(&mut strengths) {
            let own = vector.length();
            let is_long = (vector.as_dvec3() + *change).length() > LONGEST.max(own).into();
            // What the others take back of it.
            let size = change.length();
            let cancelled = (-change.dot(sum - *change) / size).min(size);
            if is_long || cancelled > whole(j).max(own).into() {
                *strength *= HELD;
                any_wrong = true;
            }
        }
        if !any_wrong {
            for (link, change) in links.iter_mut().zip(changes) {
                link.1 = (link.1.as_dvec3() + change).as_vec3();
            }
            return;
        }
        gram = self::gram(links, &strengths, lights);
    }
}

/// Products of what each two lights make of links of these strengths.
fn gram(links: &[(u32, Vec3)], strengths: &[f32], lights: &TrialLights) -> [[f64; TRIALS]; TRIALS] {
    let mut gram = [[0.0f32; TRIALS]; TRIALS];
    for (&(j, _), strength) in links.iter().zip(strengths) {
        let light = &lights.coefficients[j as usize];
        for (row, b) in gram.iter_mut().zip(light) {
            let b = b * strength;
            row.iter_mut()
                .zip(light)
                .for_each(|(sum, other)| *sum += b * other);
        }
    }
    gram.map(|row| row.map(f64::from))
}

/// Solves a positive definite system by Cholesky's method.
fn solved(mut a: [[f64; TRIALS]; TRIALS], mut x: [DVec3; TRIALS]) -> [DVec3; TRIALS] {
    for g in 0..TRIALS {
        for h in 0..=g {
            let sum = a[g][h] - (0..h).map(|k| a[g][k] * a[h][k]).sum::<f64>();
            // What is left of the diagonal is the ridge at least, the first one the whole strength: never near zero.
            a[g][h] = if g == h { sum.sqrt() } else { sum / a[h][h] };
        }
    }
    for g in 0..TRIALS {
        let known: DVec3 = (0..g).map(|k| x[k] * a[g][k]).sum();
        x[g] = (x[g] - known) / a[g][g];
    }
    for g in (0..TRIALS).rev() {
        let known: DVec3 = (g + 1..TRIALS).map(|k| x[k] * a[k][g]).sum();
        x[g] = (x[g] - known) / a[g][g];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::random::Stream;
    use relight_transport::senders::{PILOTS, Signed};

    /// Four coarse senders of ten points each, lit at random.
    fn lights(s: &mut Stream) -> TrialLights {
        let leaves = (0..40).map(|p| p / 10).collect();
        let tree = SenderTree::new(&[4], leaves, Vec::new(), vec![9; 40]);
        let lit = (0..40).map(|_| std::array::from_fn(|_| s.uniform()));
        TrialLights::from_radiosity(&tree, lit)
    }

    fn answered(links: &[(u32, Vec3)], lights: &TrialLights) -> Answers {
        let mut answers = Answers::default();
        links
            .iter()
            .for_each(|&(j, v)| answers.add(v.into(), &lights.coefficients[j as usize]));
        answers
    }

    #[test]
    fn short_numbers_are_within_half_a_unit_of_eight_bits_and_even_light_is_exact() {
        let mut s = Stream::new(4, 0, 0);
        for _ in 0..1000 {
            let light = std::array::from_fn(|g| {
                if g == EVEN {
                    1.0
                } else {
                    20.0 * s.uniform().powi(4)
                }
            });
            let short = ShortInTrials::of(light).wide();
            assert_eq!(short[EVEN], 1.0);
            assert!(short.iter().zip(&light).all(|(a, b)| (a - b).abs() <= b / 256.0));
        }
        assert_eq!(ShortInTrials::of([0.0; TRIALS]).wide(), [0.0; TRIALS]);
    }

    #[test]
    fn a_senders_coefficient_in_each_light_is_the_mean_of_its_points() {
        let lights = lights(&mut Stream::new(1, 0, 0));
        for (j, coefficient) in lights.coefficients.iter().enumerate() {
            for g in 0..TRIALS {
                let mean = (10 * j..10 * j + 10)
                    .map(|p| lights.at_points[p].wide()[g])
                    .sum::<f32>()
                    / 10.0;
                assert!((coefficient[g] - mean).abs() < 1e-6, "{coefficient:?} {mean}");
            }
        }
    }

    #[test]
    fn links_that_lack_nothing_stay_and_others_lack_less_in_the_sum_of_squares() {
        for seed in 2..30 {
            let mut s = Stream::new(seed, 0, 0);
            let lights = lights(&mut s);
            let mut number = || s.uniform() - 0.3;
            let links: Vec<(u32, Vec3)> = (0..4)
                .map(|j| (j, Vec3::new(number(), number(), number())))
                .collect();
            let mut same = links.clone();
            fit(&mut same, |_| 0.0, &lights, &Answers::default());
            assert_eq!(same, links);
            let wanted: Vec<(u32, Vec3)> = links
                .iter()
                .map(|&(j, v)| (j, v * (0.8 + 0.5 * number())))
                .collect();
            let lack = |links: &[(u32, Vec3)]| {
                let mut missing = answered(&wanted, &lights);
                links
                    .iter()
                    .for_each(|&(j, v)| missing.add(-Vec3A::from(v), &lights.coefficients[j as usize]));
                missing
            };
            let sum = |a: &Answers| (0..TRIALS).map(|g| a.at(g).length_squared()).sum::<f32>();
            let mut fitted = links.clone();
            fit(&mut fitted, |_| 0.0, &lights, &lack(&links));
            let (before, after) = (sum(&lack(&links)), sum(&lack(&fitted)));
            assert!(after < before, "{before} {after}");
        }
    }

    /// Truth: no correction takes more light than there is. Two clusters that most lamps light alike, one of which is to have more than it has, and the
    /// other less than nothing; the sum stays.
    #[test]
    fn links_that_cancel_each_other_change_by_no_more_than_what_is_there() {
        for (seed, whole) in (0..30).flat_map(|seed| [(seed, 0.0), (seed, 0.06)]) {
            let mut s = Stream::new(seed, 0, 0);
            let tree = SenderTree::new(&[2], (0..40).map(|p| p / 20).collect(), Vec::new(), vec![9; 40]);
            let lit =
                (0..40).map(|_| std::array::from_fn(|g| if g == EVEN { 1.0 } else { 1.0 + s.uniform() }));
            let lights = TrialLights::from_radiosity(&tree, lit);
            let links = [(0, Vec3::Y * 0.3), (1, Vec3::Y * 0.05)];
            let missing = answered(&[(0, Vec3::Y), (1, -Vec3::Y)], &lights);
            let mut fitted = links;
            fit(&mut fitted, |_| whole, &lights, &missing);
            let change = fitted[1].1.y - links[1].1.y;
            assert!(change < 0.0 && -change <= 0.0501f32.max(whole), "{change}");
            // Even light is answered as before, to within rounding.
            assert!((fitted[0].1.y + fitted[1].1.y - 0.35).abs() < 1e-6, "{fitted:?}");
        }
    }

    #[test]
    fn a_system_of_known_solution_is_solved() {
        let mut s = Stream::new(5, 0, 0);
        let factor: Vec<InTrials> = (0..TRIALS)
            .map(|_| std::array::from_fn(|_| s.uniform()))
            .collect();
        let a: [[f64; TRIALS]; TRIALS] = std::array::from_fn(|g| {
            std::array::from_fn(|h| {
                let product: f32 = factor.iter().map(|row| row[g] * row[h]).sum();
                f64::from(product) + if g == h { 1.0 } else { 0.0 }
            })
        });
        let x: [DVec3; TRIALS] = std::array::from_fn(|g| DVec3::new(g as f64, 1.0, -(g as f64)));
        let b = std::array::from_fn(|g| (0..TRIALS).map(|h| x[h] * a[g][h]).sum());
        for (found, truth) in solved(a, b).iter().zip(&x) {
            // 16 unknowns of a condition number below 1e3.
            assert!((*found - *truth).length() < 1e-10, "{found} {truth}");
        }
    }

    #[test]
    fn every_group_of_pilots_is_a_light_of_its_own_and_one_everywhere_in_the_mean() {
        let mut s = Stream::new(3, 0, 0);
        let pilots: Vec<Vec3> = (0..PILOTS)
            .map(|_| Vec3::new(s.uniform(), 0.5 + s.uniform(), s.uniform()) * 4.0)
            .collect();
        let places: Vec<Signed> = (0..200)
            .map(|_| Signed {
                widening: 0,
                position: Vec3::new(s.uniform(), 0.0, s.uniform()) * 4.0,
                normal: Vec3::Y,
                signature: u128::MAX,
            })
            .collect();
        let tree = SenderTree::new(&[1], vec![0; 200], Vec::new(), vec![0; 200]);
        let lamps = Lamps {
            pilots: &pilots,
            places: &places,
            coarse: 1.0,
            finest: 0.1,
            softness: 0.5,
        };
        let lights = TrialLights::new(&tree, &lamps);
        for g in 0..TRIALS {
            let mean = lights
                .at_points
                .iter()
                .map(|b| f64::from(b.wide()[g]))
                .sum::<f64>()
                / 200.0;
            // Each is rounded by up to 1/256 of itself.
            assert!((mean - 1.0).abs() < 1.0 / 256.0, "{g}: {mean}");
        }
        // A lamp in a corner of the room lights that corner most.
        let spread = |g: usize| {
            lights
                .at_points
                .iter()
                .map(|b| b.wide()[g])
                .fold(0.0f32, f32::max)
        };
        assert!(spread(EVEN) == 1.0 && (1..TRIALS).all(|g| spread(g) > 1.1));
    }
}
