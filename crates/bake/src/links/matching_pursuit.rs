//! Links by what lights make of them: greedy least squares over all that a row lacks.
//!
//! Source: what a row lacks is equation 17 of Lehtinen et al. 2008; there, each link that exceeds a threshold is kept. What lights
//! make of a row is many small differences together, so links are taken one after the other, each time the one that takes away
//! most of the squared error with all values solved anew, until none takes away enough (orthogonal least squares: Chen, Billings
//! and Luo 1989, "Orthogonal least squares methods and their application to non-linear system identification").
//!
//! Cost: of n choices, m are taken in n·m·(128 + m/2) products of two numbers and n·m numbers of memory. The gain asked for shrinks
//! with every receiver level above the finest, so that with enough levels all choices would be worth their links: [`MOST_CHOICES`]
//! and [`MOST_TAKEN`] bound both, whatever the levels and ε. What a row leaves for them, the rows below it lack and may take.
//!
//! The error is what the row answers otherwise than its gather: to the lights of [`crate::links::test_lights`], to the row's own mix of them
//! ([`Weights`]), and to each cluster alone, as far as that differs from its share of its parent's.

use crate::links::fitting::{Answers, LONGEST};
use crate::links::test_lights::{EVEN, InTestLights, TEST_LIGHTS, TestLights};
use glam::{Vec3, Vec3A};

/// A link that may be taken.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Its sender.
    pub sender: u32,
    /// Its place in the list of families; [`NO_FAMILY`] on the coarsest sender level.
    pub family: u32,
    /// Its sender's share of its parent.
    pub share: f32,
    /// What the row lacks of the cluster's response, less its share of what is lacked of its parent's; of the coarsest, all of
    /// it.
    pub deviation: Vec3A,
}

/// The family of a sender of the coarsest level, which has no siblings.
pub const NO_FAMILY: u32 = u32::MAX;

/// What all children of a cluster have in common.
#[derive(Clone, Copy, Debug, Default)]
pub struct Family {
    /// Sum of the squares of their shares.
    pub squares: f32,
    /// Sum of their deviations, each times its share.
    pub deviation: Vec3A,
}

/// How much squared errors in the lights count.
#[derive(Clone, Debug)]
pub struct Weights {
    /// In each light.
    pub each: InTestLights,
    /// The row's own mix: the sum of its lights, each times its weight and the row's answer, scaled to an answer of 1.
    ///
    /// What least squares leave out has a part of what is answered in it, never the opposite: a tenth of error in each light loses
    /// a hundredth of the light. The mix is where that adds up, so it counts as a light of its own.
    pub mix: InTestLights,
}

/// Answer, relative to even light of the lights' mean radiosity, above which a lamp's errors count relative to what is answered.
/// Of 0.25, 0.35 and 1 it has the least error for its links (docs/notebook/transfer.md).
const BRIGHT: f32 = 0.35;

/// How much even light counts: as 30 lamps, since all bounces rest on it.
const EVEN_WEIGHT: f32 = 30.0;

/// How much the mix counts. At 30 the Sponza with leaves is still 0.5 % darker (docs/notebook/transfer.md).
const MIX_WEIGHT: f32 = 200.0;

/// How much each cluster alone counts: what small lights next to a receiver make of it, which no lamp in the open shows.
const CLUSTER_WEIGHT: f32 = 10.0;

/// Part of [`CLUSTER_WEIGHT`] by which a child counts beside its siblings. One that is nearly all of its family differs from its parent by
/// nearly nothing, in every light and in the cluster's own: without this its link could be any number. On the rooms of
/// docs/notebook/openness.md it changes nothing that can be measured.
const ALONE: f32 = 1.0 / 16.0;

impl Weights {
    /// For a row that answers `answers`.
    pub fn of(answers: &Answers<TEST_LIGHTS>) -> Weights {
        let squared = BRIGHT * BRIGHT;
        let strength: InTestLights = std::array::from_fn(|g| answers.at(g).length());
        let mut each = strength.map(|a| squared / (a * a + squared));
        each[EVEN] = EVEN_WEIGHT;
        let mut mix: InTestLights =
            std::array::from_fn(|g| if g == EVEN { 0.0 } else { each[g] * strength[g] });
        let whole = dot(&mix, &strength);
        let scale = if whole > 0.0 { 1.0 / whole } else { 0.0 };
        mix.iter_mut().for_each(|part| *part *= scale);
        Weights { each, mix }
    }
}

/// What links are to make up for.
#[derive(Clone, Copy, Debug)]
pub struct Residual<'a> {
    /// The lights.
    pub test_lights: &'a TestLights,
    /// What the row lacks in them.
    pub missing: &'a Answers<TEST_LIGHTS>,
    /// How much that counts.
    pub weights: &'a Weights,
    /// Squared error that a link takes away at least.
    pub gain: f32,
}

/// Room to work in, for one thread.
#[derive(Debug, Default)]
pub struct PursuitScratch {
    /// Links that may be taken.
    pub choices: Vec<Choice>,
    /// Their families.
    pub families: Vec<Family>,
    /// Per choice its effect on the lights, each times the root of its weight.
    effects: Vec<InTestLights>,
    /// Per choice its effect on the mix, times the root of its weight.
    on_mix: Vec<f32>,
    /// Per choice its squared effect on everything.
    squares: Vec<f32>,
    /// Per choice what is left of its squared effect beside those of the links taken.
    own: Vec<f32>,
    /// Per choice the product of that part of its effect with what is lacked; of a link taken, over the length of the former.
    along: Vec<Vec3A>,
    /// Links taken, in order: their choices.
    taken: Vec<usize>,
    /// Per link taken the products of its own part, of length 1, with the effects of all choices: rows of the transposed Cholesky factor of all
    /// products.
    products: Vec<f32>,
    /// Per choice what the links taken explain of its product with the one at hand.
    explained: Vec<f32>,
}

/// Most choices of a row: those that take away most when taken alone. Rows of `data/atrium.glb` by `standard` have 540 at most and take
/// 200, so that neither bound changes them; at both, a row takes some 50 ms (`cargo bench -p relight-bake`).
pub const MOST_CHOICES: usize = 1024;

/// Most links that a row takes. The lights are [`TEST_LIGHTS`] and the mix: so many links can follow them all, and three times as
/// many are there for what clusters answer alone.
pub const MOST_TAKEN: usize = 4 * TEST_LIGHTS;

/// Part of a choice's squared effect that must be its own for it to be taken: what is nearly a sum of those taken would get a value
/// that hangs on rounding.
const LEAST_OWN: f32 = 1e-3;

/// Takes links from `room.choices` until none gains enough, and adds them to `links`: senders and vectors, in no order.
/// `strength_squared` is how much a vector error counts.
pub fn pursue(
    residual: &Residual,
    strength_squared: impl Fn(Vec3A) -> f32,
    room: &mut PursuitScratch,
    links: &mut Vec<(u32, Vec3)>,
) {
    room.begin(residual);
    room.narrow(&strength_squared);
    while room.taken.len() < MOST_TAKEN {
        let Some(s) = room.best(residual.gain, &strength_squared) else {
            break;
        };
        room.take(s);
    }
    let mut count = room.taken.len();
    let mut values = room.solved(count);
    // The last ones taken gain least: without them what cancelled each other is gone.
    while values.iter().any(|value| value.length() > LONGEST) {
        count -= count.div_ceil(4);
        values = room.solved(count);
    }
    let senders = room.taken.iter().map(|&s| room.choices[s].sender);
    links.extend(senders.zip(values.into_iter().map(Vec3::from)));
}

impl PursuitScratch {
    fn begin(&mut self, residual: &Residual) {
        let Residual {
            test_lights,
            missing,
            weights,
            ..
        } = *residual;
        let roots = weights.each.map(f32::sqrt);
        let mix_root = MIX_WEIGHT.sqrt();
        let mut weighted = *missing;
        weighted.scale(&roots);
        let missing_mix = missing.along(&weights.mix) * mix_root;
        self.taken.clear();
        self.products.clear();
        self.effects.clear();
        self.on_mix.clear();
        self.squares.clear();
        self.along.clear();
        for choice in &self.choices {
            let coefficients = &test_lights.coefficients[choice.sender as usize];
            let effect: InTestLights = std::array::from_fn(|g| coefficients[g] * roots[g]);
            let on_mix = dot(coefficients, &weights.mix) * mix_root;
            let on_clusters = match self.families.get(choice.family as usize) {
                Some(family) => choice.deviation * (1.0 + ALONE) - family.deviation,
                None => choice.deviation,
            } * CLUSTER_WEIGHT;
            self.along
                .push(weighted.along(&effect) + missing_mix * on_mix + on_clusters);
            self.effects.push(effect);
            self.on_mix.push(on_mix);
        }
        for k in 0..self.choices.len() {
            self.squares.push(self.product(k, k));
        }
    }

    /// Leaves the [`MOST_CHOICES`] that take away most when taken alone, in the order that they had.
    fn narrow(&mut self, strength_squared: impl Fn(Vec3A) -> f32) {
        if self.choices.len() > MOST_CHOICES {
            let mut gains: Vec<(f32, usize)> = (self.along.iter().zip(&self.squares).enumerate())
                .map(|(k, (&along, &square))| (strength_squared(along) / square.max(f32::MIN_POSITIVE), k))
                .collect();
            gains.select_nth_unstable_by(MOST_CHOICES, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            gains.truncate(MOST_CHOICES);
            gains.sort_unstable_by_key(|gain| gain.1);
            for (to, &(_, from)) in gains.iter().enumerate() {
                self.choices[to] = self.choices[from];
                self.effects[to] = self.effects[from];
                self.on_mix[to] = self.on_mix[from];
                self.squares[to] = self.squares[from];
                self.along[to] = self.along[from];
            }
            self.choices.truncate(MOST_CHOICES);
            self.effects.truncate(MOST_CHOICES);
            self.on_mix.truncate(MOST_CHOICES);
            self.squares.truncate(MOST_CHOICES);
            self.along.truncate(MOST_CHOICES);
        }
        self.own.clone_from(&self.squares);
    }

    /// Product of two choices' effects.
    ///
    /// Those on clusters: a child's coefficient takes from its siblings by their shares what it adds to its own cluster, so
    /// within a family effects are columns of 1 − s 1ᵀ, and across families they have nothing in common.
    fn product(&self, a: usize, b: usize) -> f32 {
        let on_lights = dot(&self.effects[a], &self.effects[b]) + self.on_mix[a] * self.on_mix[b];
        let same = if a == b { 1.0 } else { 0.0 };
        let (a, b) = (&self.choices[a], &self.choices[b]);
        let on_clusters = match self.families.get(a.family as usize) {
            Some(family) if a.family == b.family => same * (1.0 + ALONE) - a.share - b.share + family.squares,
            Some(_) => 0.0,
            None => same,
        };
        on_lights + on_clusters * CLUSTER_WEIGHT
    }

    /// The choice that takes away most, if that is more than `least`.
    fn best(&self, least: f32, strength_squared: impl Fn(Vec3A) -> f32) -> Option<usize> {
        let mut best = (least, None);
        for (k, (&along, &own)) in self.along.iter().zip(&self.own).enumerate() {
            // 0 of those taken.
            if own > LEAST_OWN * self.squares[k] {
                let gain = strength_squared(along) / own;
                if gain > best.0 {
                    best = (gain, Some(k));
                }
            }
        }
        best.1
    }

    fn take(&mut self, s: usize) {
        let choices = self.choices.len();
        let scale = 1.0 / self.own[s].sqrt();
        let along = self.along[s] * scale;
        self.explained.clear();
        self.explained.resize(choices, 0.0);
        for of_taken in self.products.chunks_exact(choices) {
            let with = of_taken[s];
            for (explained, product) in self.explained.iter_mut().zip(of_taken) {
                *explained += product * with;
            }
        }
        for k in 0..choices {
            let product = (self.product(k, s) - self.explained[k]) * scale;
            self.products.push(product);
            self.along[k] -= along * product;
            self.own[k] -= product * product;
        }
        self.along[s] = along;
        self.own[s] = 0.0;
        self.taken.push(s);
    }

    /// Values of the first `count` links taken without the others, by back substitution from the last on.
    fn solved(&self, count: usize) -> Vec<Vec3A> {
        let choices = self.choices.len();
        let taken = &self.taken[..count];
        let mut values = vec![Vec3A::ZERO; count];
        for (n, &s) in taken.iter().enumerate().rev() {
            let products = &self.products[n * choices..][..choices];
            let later = taken[n + 1..].iter().zip(&values[n + 1..]);
            let explained: Vec3A = later.map(|(&t, &value)| value * products[t]).sum();
            values[n] = (self.along[s] - explained) / products[s];
        }
        values
    }
}

/// Sum of products, in sixteen parts so that they can go side by side.
#[inline]
fn dot(a: &InTestLights, b: &InTestLights) -> f32 {
    let mut sums = [0.0f32; 16];
    for (a, b) in a.chunks_exact(16).zip(b.chunks_exact(16)) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::random::Stream;

    /// A row's choices spelled out: every effect, and what is lacked, as a vector of numbers in f64.
    struct Spelled {
        effects: Vec<Vec<f64>>,
        lacked: Vec<[f64; 3]>,
    }

    /// Three coarse senders and two families of four, of which the last child is no choice.
    fn problem(seed: u64) -> (TestLights, Answers<TEST_LIGHTS>, Weights, PursuitScratch, Spelled) {
        let mut s = Stream::new(seed, 0, 0);
        let mut uniform = move || s.uniform();
        let mut coefficients: Vec<InTestLights> = Vec::new();
        for j in 0..11 {
            let even = if j < 3 { 1.0 } else { 0.0 };
            let offset = if j < 3 { 0.0 } else { 0.5 };
            coefficients.push(std::array::from_fn(|g| {
                if g == EVEN { even } else { uniform() - offset }
            }));
        }
        let test_lights = TestLights {
            coefficients,
            leaf_means: Vec::new(),
        };
        let mut vector = |size: f32| Vec3A::new(uniform() - 0.5, uniform(), uniform() - 0.5) * size;
        let (mut missing, mut answers) = (Answers::default(), Answers::default());
        for g in 0..TEST_LIGHTS {
            let one: InTestLights = std::array::from_fn(|h| if g == h { 1.0 } else { 0.0 });
            missing.add(vector(0.3), &one);
            answers.add(vector(1.0), &one);
        }
        let weights = Weights::of(&answers);
        let mut room = PursuitScratch::default();
        // Rows of numbers: the lights, the mix, one per cluster, and one per child.
        let rows = TEST_LIGHTS + 1 + 11 + 11;
        let mut lacked = vec![Vec3A::ZERO; rows];
        for g in 0..TEST_LIGHTS {
            lacked[g] = missing.at(g) * weights.each[g].sqrt();
            lacked[TEST_LIGHTS] += missing.at(g) * weights.mix[g] * MIX_WEIGHT.sqrt();
        }
        let mut on_clusters = vec![[0.0f64; 22]; 11];
        let cluster_root = f64::from(CLUSTER_WEIGHT).sqrt();
        let alone_root = (CLUSTER_WEIGHT * ALONE).sqrt();
        let mut add = |sender: u32, family: u32, share: f32, deviation: Vec3A, room: &mut PursuitScratch| {
            lacked[TEST_LIGHTS + 1 + sender as usize] = deviation * CLUSTER_WEIGHT.sqrt();
            if family != NO_FAMILY {
                lacked[TEST_LIGHTS + 12 + sender as usize] = deviation * alone_root;
            }
            if sender != 6 && sender != 10 {
                room.choices.push(Choice {
                    sender,
                    family,
                    share,
                    deviation,
                });
            }
        };
        for j in 0..3 {
            on_clusters[j as usize][j as usize] = cluster_root;
            add(j, NO_FAMILY, 1.0, vector(0.1), &mut room);
        }
        for (family, first) in [(0, 3u32), (1, 7)] {
            let shares = [0.4f32, 0.3, 0.2, 0.1];
            let responses: Vec<Vec3A> = (0..4).map(|_| vector(0.1)).collect();
            let whole: Vec3A = responses.iter().sum();
            let mut common = Family::default();
            for c in 0..4usize {
                let deviation = responses[c] - whole * shares[c];
                common.squares += shares[c] * shares[c];
                common.deviation += deviation * shares[c];
                let sender = first + c as u32;
                add(sender, family, shares[c], deviation, &mut room);
                on_clusters[sender as usize][11 + sender as usize] = alone_root.into();
                for other in 0..4usize {
                    let own = if other == c { 1.0 } else { 0.0 };
                    on_clusters[sender as usize][first as usize + other] =
                        (own - f64::from(shares[other])) * cluster_root;
                }
            }
            room.families.push(common);
        }
        let effects = (room.choices.iter())
            .map(|choice| {
                let j = choice.sender as usize;
                let c = &test_lights.coefficients[j];
                let mut effect: Vec<f64> = (0..TEST_LIGHTS)
                    .map(|g| f64::from(c[g]) * f64::from(weights.each[g]).sqrt())
                    .collect();
                let on_mix: f64 = (0..TEST_LIGHTS)
                    .map(|g| f64::from(c[g]) * f64::from(weights.mix[g]))
                    .sum();
                effect.push(on_mix * f64::from(MIX_WEIGHT).sqrt());
                effect.extend(on_clusters[j]);
                effect
            })
            .collect();
        let lacked = lacked.iter().map(|v| v.to_array().map(f64::from)).collect();
        (test_lights, missing, weights, room, Spelled { effects, lacked })
    }

    impl Spelled {
        /// What squared error the best values of these choices leave: by Gram and Schmidt.
        fn left(&self, choices: &[usize]) -> f64 {
            let mut basis: Vec<Vec<f64>> = Vec::new();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for &k in choices {
                let mut v = self.effects[k].clone();
                for b in &basis {
                    let along = dot(&v, b);
                    v.iter_mut().zip(b).for_each(|(v, b)| *v -= along * b);
                }
                let length = dot(&v, &v).sqrt();
                basis.push(v.iter().map(|v| v / length).collect());
            }
            let of_component = |c: usize| {
                let lacked: Vec<f64> = self.lacked.iter().map(|v| v[c]).collect();
                dot(&lacked, &lacked) - basis.iter().map(|b| dot(b, &lacked).powi(2)).sum::<f64>()
            };
            (0..3).map(of_component).sum()
        }

        /// What squared error these links leave.
        fn with(&self, choices: &[usize], values: &[Vec3]) -> f64 {
            let mut left = self.lacked.clone();
            for (&k, value) in choices.iter().zip(values) {
                for (left, effect) in left.iter_mut().zip(&self.effects[k]) {
                    for c in 0..3 {
                        left[c] -= effect * f64::from(value[c]);
                    }
                }
            }
            left.as_flattened().iter().map(|v| v * v).sum()
        }
    }

    fn pursued(seed: u64, gain: f32) -> (Vec<usize>, Vec<Vec3>, Spelled) {
        let (test_lights, missing, weights, mut room, spelled) = problem(seed);
        let residual = Residual {
            test_lights: &test_lights,
            missing: &missing,
            weights: &weights,
            gain,
        };
        let mut links = Vec::new();
        pursue(&residual, |v| v.length_squared(), &mut room, &mut links);
        (
            room.taken.clone(),
            links.iter().map(|link| link.1).collect(),
            spelled,
        )
    }

    /// Truth: Gram and Schmidt in f64 on effects spelled out cluster by cluster. Tolerance: sums of 140 products in f32.
    #[test]
    fn each_link_taken_is_the_one_that_leaves_least_and_none_that_gains_enough_is_left() {
        for seed in 1..20 {
            let gain = 0.02;
            let (taken, _, spelled) = pursued(seed, gain);
            assert!(!taken.is_empty());
            for n in 0..=taken.len() {
                let before = spelled.left(&taken[..n]);
                let gains = (0..spelled.effects.len())
                    .filter(|k| !taken[..n].contains(k))
                    .map(|k| {
                        let mut with = taken[..n].to_vec();
                        with.push(k);
                        before - spelled.left(&with)
                    });
                let most = gains.fold(0.0, f64::max);
                if n < taken.len() {
                    let own = before - spelled.left(&taken[..=n]);
                    assert!(
                        own > f64::from(gain) * 0.999 && own > most - 1e-4 * before,
                        "{own} {most}"
                    );
                } else {
                    assert!(most < f64::from(gain) * 1.001 + 1e-4 * before, "{most}");
                }
            }
        }
    }

    #[test]
    fn links_have_the_values_that_leave_least() {
        for seed in 1..20 {
            for gain in [0.3, 0.02, 0.0] {
                let (taken, values, spelled) = pursued(seed, gain);
                let (least, found) = (spelled.left(&taken), spelled.with(&taken, &values));
                // Of values that are off by 1e-4 of themselves the square is left.
                assert!((found - least).abs() < 1e-5 * (1.0 + least), "{found} {least}");
            }
        }
    }

    /// 3000 clusters that are all worth their links, of which a third answer a thousand times as much as the others.
    #[test]
    fn of_however_many_choices_the_best_are_looked_at_and_so_many_taken() {
        let mut s = Stream::new(5, 0, 0);
        let test_lights = TestLights {
            coefficients: (0..3000)
                .map(|_| std::array::from_fn(|_| s.uniform() - 0.5))
                .collect(),
            leaf_means: Vec::new(),
        };
        let is_strong = |sender: u32| sender % 3 == 1;
        let mut room = PursuitScratch::default();
        for sender in 0..3000 {
            room.choices.push(Choice {
                sender,
                family: NO_FAMILY,
                share: 1.0,
                // So little that no link is too long.
                deviation: Vec3A::Y * if is_strong(sender) { 1e-2 } else { 1e-5 },
            });
        }
        let nothing = Answers::default();
        let residual = Residual {
            test_lights: &test_lights,
            missing: &nothing,
            weights: &Weights::of(&nothing),
            gain: 0.0,
        };
        let mut links = Vec::new();
        pursue(&residual, |v| v.length_squared(), &mut room, &mut links);
        assert_eq!(room.choices.len(), MOST_CHOICES);
        assert!(room.choices.windows(2).all(|w| w[0].sender < w[1].sender));
        let strong = room.choices.iter().filter(|choice| is_strong(choice.sender));
        assert_eq!(strong.count(), 1000);
        assert_eq!(links.len(), MOST_TAKEN);
        assert!(links.iter().all(|link| link.1.is_finite()));
    }

    /// Nine links cannot follow 128 lights; what they leave of the sum that the mix is must be little all the same.
    #[test]
    fn a_row_keeps_the_sum_of_its_lights_times_their_answers() {
        for seed in 1..20 {
            let (taken, values, spelled) = pursued(seed, 0.0);
            let lacked = &spelled.lacked;
            let size = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
            let left_of = |row: usize| {
                let mut left = lacked[row];
                for (&k, value) in taken.iter().zip(&values) {
                    (0..3).for_each(|c| left[c] -= spelled.effects[k][row] * f64::from(value[c]));
                }
                size(left)
            };
            let of_lights: f64 = (1..TEST_LIGHTS).map(left_of).sum::<f64>()
                / (1..TEST_LIGHTS).map(|g| size(lacked[g])).sum::<f64>();
            let of_mix = left_of(TEST_LIGHTS) / size(lacked[TEST_LIGHTS]);
            // Most of each light stays, and a third as much of their sum at most, which counts as 200 of them.
            assert!(
                of_lights > 0.5 && of_mix < 0.35 * of_lights,
                "{of_lights} {of_mix}"
            );
        }
    }
}
