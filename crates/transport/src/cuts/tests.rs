use super::*;
use crate::random::Stream;

const HEIGHT: u8 = 8;
const N: usize = 1 << HEIGHT;

struct Owned {
    heights: Vec<u8>,
    values: Vec<f32>,
}

impl Owned {
    fn cut(&self) -> Cut<'_> {
        Cut {
            heights: &self.heights,
            values: &self.values,
        }
    }

    /// The function that the cut stands for.
    fn dense(&self) -> Vec<f64> {
        let mut all = Vec::new();
        for (node, value) in self.cut().nodes() {
            assert_eq!(node.first() as usize, all.len());
            all.extend((0..node.len()).map(|_| f64::from(value)));
        }
        assert_eq!(all.len(), N);
        all
    }
}

/// A function of smooth parts and jumps, so that cuts have nodes of all heights.
fn function(seed: u64) -> Vec<f32> {
    let mut s = Stream::new(seed, 7, 0);
    let (a, b, c) = (s.uniform() * 6.0, s.uniform(), s.uniform());
    (0..N)
        .map(|i| {
            let x = i as f32 / N as f32;
            let jump = if (b.min(c)..b.max(c)).contains(&x) {
                1.0
            } else {
                0.0
            };
            jump + 0.3 * (a * x).sin().abs() + 0.05 * s.uniform()
        })
        .collect()
}

/// A cut of random depth: now and then a single root or all leaves.
fn random_cut(seed: u64) -> Owned {
    let mut s = Stream::new(seed, 8, 0);
    let sigma = match seed % 5 {
        0 => f32::INFINITY,
        1 => -1.0,
        _ => 0.02 + s.uniform() * 2.0,
    };
    selected(&function(seed), if sigma < 0.0 { 0.0 } else { sigma }, N)
}

fn selected(values: &[f32], sigma: f32, most: usize) -> Owned {
    let mut cut = Owned {
        heights: Vec::new(),
        values: Vec::new(),
    };
    Selector::default().select(values, sigma, most, &mut cut.heights, &mut cut.values);
    cut
}

fn check_against_dense<const K: usize>(seed: u64) {
    let owned: [Owned; K] = std::array::from_fn(|j| random_cut(seed * 7 + j as u64));
    let dense: Vec<Vec<f64>> = owned.iter().map(Owned::dense).collect();
    let weights: [f64; K] = std::array::from_fn(|j| 0.1 + j as f64);
    let (mut sum, mut product, mut mixture) = (0.0, 0.0, 0.0);
    let mut visits = Vec::new();
    merge(owned.each_ref().map(Owned::cut), |node, values| {
        let size = f64::from(node.len());
        sum += size * values.iter().map(|&v| f64::from(v)).sum::<f64>();
        product += size * values.iter().map(|&v| f64::from(v)).product::<f64>();
        mixture += size
            * values
                .iter()
                .zip(&weights)
                .map(|(&v, w)| f64::from(v) * w)
                .sum::<f64>();
        visits.push((node, *values));
    });
    let over = |f: &dyn Fn(usize) -> f64| (0..N).map(f).sum::<f64>();
    let dense_sum = over(&|i| dense.iter().map(|d| d[i]).sum());
    let dense_product = over(&|i| dense.iter().map(|d| d[i]).product());
    let dense_mixture = over(&|i| dense.iter().zip(&weights).map(|(d, w)| d[i] * w).sum());
    // f64 sums of the same f32 values in another order.
    for (found, truth) in [
        (sum, dense_sum),
        (product, dense_product),
        (mixture, dense_mixture),
    ] {
        assert!(
            (found - truth).abs() <= 1e-9 * truth.abs().max(1.0),
            "{found} {truth}"
        );
    }

    // The merged cut tiles the leaves with the deepest node of any cut.
    for pair in visits.windows(2) {
        assert_eq!(pair[0].0.end(), pair[1].0.first());
    }
    let deepest = |leaf: u32| {
        let at = |o: &Owned| {
            o.cut()
                .nodes()
                .find(|(n, _)| (n.first()..n.end()).contains(&leaf))
                .unwrap()
                .0
                .height
        };
        owned.iter().map(at).min().unwrap()
    };
    assert!(
        visits
            .iter()
            .all(|(node, _)| node.height == deepest(node.first()))
    );
}

#[test]
fn one_to_six_cuts_merge_to_what_dense_vectors_give() {
    for seed in 0..60 {
        check_against_dense::<1>(seed);
        check_against_dense::<2>(seed);
        check_against_dense::<3>(seed);
        check_against_dense::<4>(seed);
        check_against_dense::<5>(seed);
        check_against_dense::<6>(seed);
    }
}

#[test]
fn a_cut_ends_where_every_node_is_within_its_threshold_and_no_parent_is() {
    for seed in 0..20 {
        let values = function(seed);
        let sigma = 0.3;
        let cut = selected(&values, sigma, N);
        assert!(is_cut(&cut.heights, HEIGHT));
        // Sum of squared differences to the mean, in f64 from the leaves themselves.
        let error = |node: Node| {
            let leaves = &values[node.first() as usize..node.end() as usize];
            let mean = leaves.iter().map(|&v| f64::from(v)).sum::<f64>() / leaves.len() as f64;
            leaves.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>()
        };
        let limit = f64::from(sigma * sigma);
        for (node, value) in cut.cut().nodes() {
            // The selector's f32 sums of up to 256 squares.
            assert!(error(node) <= limit * 1.0001 + 1e-5);
            let leaves = &values[node.first() as usize..node.end() as usize];
            let mean = leaves.iter().sum::<f32>() / leaves.len() as f32;
            assert!((mean - value).abs() < 1e-5);
            if node.height < HEIGHT {
                let parent = Node {
                    height: node.height + 1,
                    index: node.index / 2,
                };
                assert!(error(parent) > limit * 0.9999 - 1e-5);
            }
        }
    }
}

#[test]
fn the_largest_size_is_kept_and_the_worst_nodes_are_split_first() {
    let values = function(3);
    for most in [1, 2, 3, 10, 50, 200] {
        let cut = selected(&values, 0.0, most);
        assert!(cut.heights.len() <= most && is_cut(&cut.heights, HEIGHT));
        assert!(cut.heights.len() == most, "{} of {most}", cut.heights.len());
    }
}

#[test]
fn leaves_that_are_nan_neither_split_nodes_nor_change_means() {
    let mut values = vec![1.0f32; N];
    values[..N / 2].fill(f32::NAN);
    let cut = selected(&values, 0.1, N);
    assert_eq!((cut.heights, cut.values), (vec![HEIGHT], vec![1.0]));
    let dark = selected(&[f32::NAN; N], 0.1, N);
    assert_eq!((dark.heights, dark.values), (vec![HEIGHT], vec![0.0]));
}

/// Equation 8: over a node P of the merged cut's coarser cut, the double product is off
/// by at most √(|P| var a · |P| var b), variances over P of the functions themselves.
#[test]
fn the_error_of_a_double_product_is_within_its_bound() {
    let mut tightest = 0.0f64;
    for seed in 0..40 {
        let (a, b) = (function(seed), function(seed + 1000));
        let (cut_a, cut_b) = (selected(&a, 0.5, N), selected(&b, 1.0, N));
        let (mean_a, mean_b) = (cut_a.dense(), cut_b.dense());
        for coarse in [&cut_a, &cut_b] {
            for (node, _) in coarse.cut().nodes() {
                let leaves = node.first() as usize..node.end() as usize;
                // Only where the other cut is as deep or deeper: the coarser of the two nodes.
                let other = if std::ptr::eq(coarse, &cut_a) {
                    &cut_b
                } else {
                    &cut_a
                };
                let deeper = (other.cut().nodes())
                    .filter(|(n, _)| n.first() as usize <= leaves.start && n.end() as usize >= leaves.end)
                    .all(|(n, _)| n.height <= node.height);
                if !deeper {
                    continue;
                }
                let size = leaves.len() as f64;
                let exact: f64 = leaves.clone().map(|i| f64::from(a[i]) * f64::from(b[i])).sum();
                let cut: f64 = leaves.clone().map(|i| mean_a[i] * mean_b[i]).sum();
                let spread = |v: &[f32]| {
                    let mean = leaves.clone().map(|i| f64::from(v[i])).sum::<f64>() / size;
                    leaves
                        .clone()
                        .map(|i| (f64::from(v[i]) - mean).powi(2))
                        .sum::<f64>()
                };
                let bound = (spread(&a) * spread(&b)).sqrt();
                // Means are f32.
                assert!((exact - cut).abs() <= bound + 1e-4, "{exact} {cut} {bound}");
                if bound > 1e-3 {
                    tightest = tightest.max((exact - cut).abs() / bound);
                }
            }
        }
    }
    // A bound that nothing comes near would say little.
    assert!(tightest > 0.5, "{tightest}");
}

/// Equation 9 and its approximation by covariances, over nodes where three functions are replaced by their means. No
/// bound holds; the approximation leaves out the third moment, which is smallest where nodes are small.
#[test]
fn the_error_of_a_triple_product_is_about_what_covariances_say() {
    let (mut errors, mut missed) = (0.0, 0.0);
    for seed in 0..40 {
        let f = [function(seed), function(seed + 1000), function(seed + 2000)];
        let cut = selected(&f[0], 0.5, N);
        for (node, _) in cut.cut().nodes() {
            let leaves = node.first() as usize..node.end() as usize;
            let mean = |g: &dyn Fn(usize) -> f64| leaves.clone().map(g).sum::<f64>() / leaves.len() as f64;
            let at = |k: usize, i: usize| f64::from(f[k][i]);
            let m: [f64; 3] = std::array::from_fn(|k| mean(&|i| at(k, i)));
            let covariance = |a: usize, b: usize| mean(&|i| (at(a, i) - m[a]) * (at(b, i) - m[b]));
            let error = mean(&|i| at(0, i) * at(1, i) * at(2, i)) - m[0] * m[1] * m[2];
            let about = m[0] * covariance(1, 2) + m[1] * covariance(0, 2) + m[2] * covariance(0, 1);
            errors += error.abs() * leaves.len() as f64;
            missed += (error - about).abs() * leaves.len() as f64;
        }
    }
    let share = missed / errors;
    assert!(share < 0.1, "{share}");
}

/// A variance does not mind a constant: cuts of large values that are nearly alike have the nodes of the same values
/// without the constant, and the error that is stated for them is theirs. Sums in f32 gave other nodes from 10³ on.
/// Tolerance of the error: a dozen f64 roundings of a sum of squares of 4e13, against 128.
#[test]
fn a_constant_beside_all_values_changes_no_node_and_no_error() {
    let with = |base: f32| {
        let leaves: Vec<f32> = (0..4096).map(|i| base + (i % 5) as f32 * 0.125).collect();
        let (mut heights, mut values) = (Vec::new(), Vec::new());
        let (_, squares) = Selector::default().select(&leaves, 4.0, 4096, &mut heights, &mut values);
        (heights, squares)
    };
    let (plain, squares) = with(0.0);
    for base in [1e3, 1e5] {
        let (heights, there) = with(base);
        assert_eq!(heights, plain, "{base}");
        assert!((there / squares - 1.0).abs() < 5e-4, "{there} {squares}");
    }
}
