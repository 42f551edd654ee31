//! Many lights as the leaves of a complete binary tree.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.2 (properties of cuts) and 3.4 (construction). Because the tree
//! is complete, it needs no memory: node j of height h holds the leaves j·2^h .. (j+1)·2^h. What is stored is the order of
//! the lights along the leaves.

use glam::Vec3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Heights of trees that are built: from 256 lights to 2²⁰.
pub const HEIGHTS: std::ops::RangeInclusive<u32> = 8..=20;

/// A node of a complete binary tree: the leaves `index`·2^`height` .. (`index` + 1)·2^`height`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// 0 for leaves.
    pub height: u8,
    /// Place among the nodes of its height, from the left.
    pub index: u32,
}

impl Node {
    /// The root of a tree of 2^`height` leaves.
    pub fn root(height: u8) -> Node {
        Node { height, index: 0 }
    }

    /// Number of leaves below it, |C|.
    #[inline]
    pub fn len(self) -> u32 {
        1 << self.height
    }

    /// No node is empty.
    pub fn is_empty(self) -> bool {
        false
    }

    /// Its leftmost leaf.
    #[inline]
    pub fn first(self) -> u32 {
        self.index << self.height
    }

    /// One past its rightmost leaf.
    #[inline]
    pub fn end(self) -> u32 {
        (self.index + 1) << self.height
    }

    /// Its children; of a leaf, `None`.
    pub fn children(self) -> Option<[Node; 2]> {
        let height = self.height.checked_sub(1)?;
        Some([0, 1].map(|side| Node {
            height,
            index: 2 * self.index + side,
        }))
    }

    /// Its place in arrays over all nodes of a tree of 2^`tree_height` leaves, heights one after another, root at 1,
    /// leaves at 2^`tree_height`. The descendants of one height are neighbours.
    #[inline]
    pub fn slot(self, tree_height: u8) -> usize {
        (1usize << (tree_height - self.height)) + self.index as usize
    }

    /// The node in a slot (1 or more) of a tree of 2^`tree_height` leaves.
    #[inline]
    pub fn in_slot(slot: usize, tree_height: u8) -> Node {
        let depth = slot.ilog2();
        Node {
            height: tree_height - depth as u8,
            index: (slot - (1 << depth)) as u32,
        }
    }
}

/// Sums over all nodes from values at the leaves, by [`Node::slot`]; entry 0 is a default.
pub fn sums<T: Copy + Default + std::ops::Add<Output = T>>(leaves: &[T]) -> Vec<T> {
    let n = leaves.len();
    let mut all = vec![T::default(); n];
    all.extend_from_slice(leaves);
    for slot in (1..n).rev() {
        all[slot] = all[2 * slot] + all[2 * slot + 1];
    }
    all
}

/// Point `i` of `n` of the spherical Fibonacci lattice: unit directions, each standing for 4π/n.
///
/// Source: Marques et al. 2013; y falls evenly, the longitude turns by the golden ratio.
pub fn sphere_direction(i: u32, n: u32) -> Vec3 {
    const TURN: f64 = 0.618_033_988_749_894_8;
    let y = 1.0 - f64::from(2 * i + 1) / f64::from(n);
    let (sin, cos) = (TAU * (f64::from(i) * TURN).fract()).sin_cos();
    let radius = (1.0 - y * y).sqrt();
    Vec3::new((radius * cos) as f32, y as f32, (radius * sin) as f32)
}

/// What a tree is built from, one entry per light.
pub struct Features<'a> {
    /// Positions, or for distant lights unit directions.
    pub positions: &'a [Vec3],
    /// Unit normals; for distant lights the same directions.
    pub normals: &'a [Vec3],
    /// What pilots see of each light, `pilots` entries per light: −1 occluded, 1 visible, 0 below the horizon, scaled
    /// to ±127.
    pub visibility: &'a [i8],
    /// Pilots per light; 0 for a purely geometric tree.
    pub pilots: usize,
}

/// K of equation 10: how much positions count against normals.
const K: f32 = 30.0;

/// Rounds of moving the two centres of a node and splitting anew: a choice, others were not measured.
const ROUNDS: usize = 4;

/// Pairs of lights from which the two metrics' means are taken.
const PAIRS: usize = 4096;

/// The order of the lights along the leaves: top-down, every node is split in two halves around two centres
/// (section 3.4) under d = (1 − β) d_v + β d_g (equation 12).
///
/// Deviation: d_v as printed (equation 11) is some six orders below d_g, and β would do nothing. Both are scaled to the
/// same mean over pairs of lights (a median may be zero where most lights look alike).
///
/// # Panics
/// Lengths contradict each other, or their number is no power of two.
pub fn order(features: &Features, beta: f32) -> Vec<u32> {
    let n = features.positions.len();
    assert!(n.is_power_of_two() && features.normals.len() == n);
    assert_eq!(features.visibility.len(), n * features.pilots);
    let metric = Metric::new(features, beta);
    let mut order: Vec<u32> = (0..n as u32).collect();
    split(&metric, &mut order);
    order
}

/// Squared distances between lights as one weighted scalar product.
struct Metric<'a> {
    features: &'a Features<'a>,
    /// Factors of positions, normals and visibility in the squared distance.
    position: f32,
    normal: f32,
    visibility: f32,
}

/// A centre, or a difference of two, in the space of features.
struct Vector {
    position: Vec3,
    normal: Vec3,
    visibility: Vec<f32>,
}

impl<'a> Metric<'a> {
    fn new(features: &'a Features<'a>, beta: f32) -> Metric<'a> {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for &p in features.positions {
            (low, high) = (low.min(p), high.max(p));
        }
        let diagonal2 = (high - low).length_squared();
        let mut metric = Metric {
            features,
            position: if diagonal2 > 0.0 { K * K / diagonal2 } else { 0.0 },
            normal: 1.0,
            visibility: 0.0,
        };
        if features.pilots == 0 {
            return metric;
        }
        let geometric = metric.mean(|m, a, b| m.geometric(a, b));
        let driven = metric.mean(|m, a, b| m.driven(a, b));
        if driven > 0.0 && geometric > 0.0 {
            metric.position *= beta / geometric;
            metric.normal *= beta / geometric;
            metric.visibility = (1.0 - beta) / driven;
        }
        metric
    }

    fn mean(&self, distance: impl Fn(&Self, usize, usize) -> f32) -> f32 {
        let n = self.features.positions.len();
        let mut stream = crate::random::Stream::new(0, 0, n as u64);
        let mut pick = || ((stream.uniform() * n as f32) as usize).min(n - 1);
        (0..PAIRS)
            .map(|_| distance(self, pick(), pick()) / PAIRS as f32)
            .sum()
    }

    /// d_g, equation 10.
    fn geometric(&self, a: usize, b: usize) -> f32 {
        let f = self.features;
        self.position * f.positions[a].distance_squared(f.positions[b])
            + self.normal * f.normals[a].distance_squared(f.normals[b])
    }

    /// d_v, equation 11, without its constant.
    fn driven(&self, a: usize, b: usize) -> f32 {
        (self.seen(a).iter().zip(self.seen(b)))
            .map(|(&a, &b)| (f32::from(a) - f32::from(b)).powi(2))
            .sum()
    }

    fn seen(&self, light: usize) -> &[i8] {
        &self.features.visibility[light * self.features.pilots..][..self.features.pilots]
    }

    /// The difference of the sums of two sets of lights.
    fn difference(&self, a: &[u32], b: &[u32]) -> Vector {
        let pilots = if self.visibility > 0.0 {
            self.features.pilots
        } else {
            0
        };
        let mut sum = vec![0i32; pilots];
        let (mut position, mut normal) = (Vec3::ZERO, Vec3::ZERO);
        for (lights, sign) in [(a, 1), (b, -1)] {
            for &light in lights {
                let light = light as usize;
                position += self.features.positions[light] * sign as f32;
                normal += self.features.normals[light] * sign as f32;
                if pilots > 0 {
                    for (sum, &seen) in sum.iter_mut().zip(self.seen(light)) {
                        *sum += i32::from(seen) * sign;
                    }
                }
            }
        }
        Vector {
            position: position * self.position,
            normal: normal * self.normal,
            visibility: sum.into_iter().map(|s| s as f32 * self.visibility).collect(),
        }
    }

    /// How far a light lies along a difference of centres: d(s, c₁) − d(s, c₂) falls linearly with it.
    fn along(&self, light: u32, v: &Vector) -> f32 {
        let light = light as usize;
        let near =
            self.features.positions[light].dot(v.position) + self.features.normals[light].dot(v.normal);
        if v.visibility.is_empty() {
            return near;
        }
        // Lanes, so that the order of the sum is fixed and the compiler can take several at a time.
        let mut lanes = [0.0f32; 16];
        let seen = self.seen(light).chunks_exact(16);
        let weights = v.visibility.chunks_exact(16);
        let rest: f32 = (seen.remainder().iter().zip(weights.remainder()))
            .map(|(&s, &w)| f32::from(s) * w)
            .sum();
        for (seen, weights) in seen.zip(weights) {
            for lane in 0..16 {
                lanes[lane] += f32::from(seen[lane]) * weights[lane];
            }
        }
        near + lanes.iter().sum::<f32>() + rest
    }
}

fn split(metric: &Metric, lights: &mut [u32]) {
    let n = lights.len();
    if n <= 1 {
        return;
    }
    // Two far lights: the farthest from the first, and the farthest from that.
    let farthest = |from: u32| {
        let distance = |a: u32| {
            metric.geometric(from as usize, a as usize)
                + metric.visibility
                    * if metric.visibility > 0.0 {
                        metric.driven(from as usize, a as usize)
                    } else {
                        0.0
                    }
        };
        let best = lights.par_iter().with_min_len(256).map(|&a| (distance(a), a));
        best.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
            .map_or(from, |found| found.1)
    };
    let first = farthest(lights[0]);
    let second = farthest(first);
    let mut direction = metric.difference(&[first], &[second]);
    let half = n / 2;
    let mut keyed: Vec<(f32, u32)> = lights.iter().map(|&l| (0.0, l)).collect();
    for _ in 0..ROUNDS {
        keyed
            .par_iter_mut()
            .with_min_len(256)
            .for_each(|entry| entry.0 = -metric.along(entry.1, &direction));
        keyed.select_nth_unstable_by(half, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (light, entry) in lights.iter_mut().zip(&keyed) {
            *light = entry.1;
        }
        if n == 2 {
            break;
        }
        let (a, b) = lights.split_at(half);
        direction = metric.difference(a, b);
    }
    let (a, b) = lights.split_at_mut(half);
    // The order within a half is whatever the selection left: sorted, it depends on nothing but the set.
    a.sort_unstable();
    b.sort_unstable();
    rayon::join(|| split(metric, a), || split(metric, b));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_nodes(height: u8) -> Vec<Node> {
        (0..=height)
            .flat_map(|h| (0..1u32 << (height - h)).map(move |index| Node { height: h, index }))
            .collect()
    }

    #[test]
    fn slots_number_all_nodes_and_sums_are_over_their_leaves() {
        let leaves: Vec<u64> = (0..64).map(|i| i * i + 3).collect();
        let all = sums(&leaves);
        let mut seen = [false; 128];
        for node in all_nodes(6) {
            let slot = node.slot(6);
            assert!(!std::mem::replace(&mut seen[slot], true));
            let expected: u64 = leaves[node.first() as usize..node.end() as usize].iter().sum();
            assert_eq!(all[slot], expected);
        }
        assert!(!seen[0] && seen[1..].iter().all(|s| *s));
    }

    /// Truth: the mean of any quadratic form of directions over the sphere; a lattice of n points is off by some 1/n.
    #[test]
    fn the_lattice_is_even() {
        let n = 4096;
        let mut squares = Vec3::ZERO;
        let mut mean = Vec3::ZERO;
        for i in 0..n {
            let d = sphere_direction(i, n);
            assert!((d.length() - 1.0).abs() < 1e-6);
            squares += d * d / n as f32;
            mean += d / n as f32;
        }
        assert!((squares - Vec3::splat(1.0 / 3.0)).abs().max_element() < 1e-3);
        assert!(mean.length() < 1e-3);
    }

    fn directions(n: u32) -> Vec<Vec3> {
        (0..n).map(|i| sphere_direction(i, n)).collect()
    }

    #[test]
    fn a_geometric_tree_gathers_neighbours() {
        let directions = directions(4096);
        let features = Features {
            positions: &directions,
            normals: &directions,
            visibility: &[],
            pilots: 0,
        };
        let order = order(&features, 1.0);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, &o)| i as u32 == o));
        // A cluster of 16 of 4096 even directions, if round, lies within 7.2° of its middle; clusters made by halving
        // are up to twice as long as wide.
        let spread: f32 = order
            .chunks(16)
            .map(|cluster| {
                let mean: Vec3 = cluster.iter().map(|&i| directions[i as usize]).sum::<Vec3>() / 16.0;
                let far = |&i: &u32| mean.angle_between(directions[i as usize]);
                cluster.iter().map(far).fold(0.0, f32::max)
            })
            .sum::<f32>()
            / 256.0;
        assert!(spread.to_degrees() < 11.0, "{}", spread.to_degrees());
    }

    #[test]
    fn beta_moves_the_split_to_where_visibility_changes() {
        // One pilot that sees the directions with x > 0.5 only: a quarter of the sphere.
        let directions = directions(1024);
        let visibility: Vec<i8> = directions
            .iter()
            .map(|d| if d.x > 0.5 { 127 } else { -127 })
            .collect();
        let features = |pilots| Features {
            positions: &directions,
            normals: &directions,
            visibility: if pilots > 0 { &visibility } else { &[] },
            pilots,
        };
        // Nodes of 64 leaves that hold both visible and occluded directions.
        let mixed = |order: &[u32]| {
            order
                .chunks(64)
                .filter(|c| {
                    let seen = c.iter().filter(|&&i| visibility[i as usize] > 0).count();
                    seen != 0 && seen != 64
                })
                .count()
        };
        let geometric = mixed(&order(&features(0), 1.0));
        let half = mixed(&order(&features(1), 0.45));
        let driven = mixed(&order(&features(1), 0.0));
        assert!(driven <= 1 && half < geometric, "{geometric} {half} {driven}");
    }
}
