//! Sums that would lose digits in f32.

use super::case::{Case, Measure, Measured};
use super::stage::Stage;
use glam::Vec3;
use relight_transport::cuts::Selector;
use relight_transport::senders::{SenderTree, weight};

/// A cluster of a million points of which few count much: ones average to one, and every point counts.
fn clusters(stage: &Stage) -> Measured {
    stage.at("transport: means of clusters");
    let (few, many) = (400usize, 1_000_000usize);
    let importance: Vec<u8> = (0..few + many).map(|p| if p < few { 255 } else { 0 }).collect();
    let tree = SenderTree::new(&[1], vec![0; few + many], Vec::new(), importance);
    let ones = f64::from(tree.pulled(&vec![Vec3::ONE; few + many])[0][0].x);
    let small: Vec<Vec3> = (0..few + many)
        .map(|p| if p < few { Vec3::ZERO } else { Vec3::ONE })
        .collect();
    let exact = many as f64 / (f64::from(weight(255)) * few as f64 + many as f64);
    let found = f64::from(tree.pulled(&small)[0][0].x);
    let why = "rounding of the stored weights; f32 sums lost 4 % of the mass and 2 % of the small ones";
    Ok(vec![
        Measure::new("mean of ones", (ones - 1.0).abs(), 1e-6, why),
        Measure::new("mean of the small ones", (found / exact - 1.0).abs(), 1e-6, why),
    ])
}

/// Variance within nodes whose values are large and nearly alike.
fn variance(stage: &Stage) -> Measured {
    stage.at("transport: selection of cuts");
    let n = 4096;
    let mut selector = Selector::default();
    let mut lengths = Vec::new();
    let mut off: f64 = 0.0;
    for base in [0.0f32, 1e3, 1e5] {
        // Steps of 1/8 stay exact in f32 up to 2^20.
        let leaves: Vec<f32> = (0..n).map(|i| base + (i % 5) as f32 * 0.125).collect();
        let (mut heights, mut values) = (Vec::new(), Vec::new());
        let (count, squares) = selector.select(&leaves, 4.0, n, &mut heights, &mut values);
        lengths.push(heights.len());
        let mut at = 0;
        let mut exact = 0.0f64;
        for &height in &heights {
            let node = &leaves[at..at + (1 << height)];
            let mean = node.iter().map(|&v| f64::from(v)).sum::<f64>() / node.len() as f64;
            exact += node.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>();
            at += node.len();
        }
        off = off.max((squares - exact).abs() / (exact + count * 1e-6));
    }
    let differing = lengths.iter().filter(|&&l| l != lengths[0]).count();
    Ok(vec![
        Measure::none("cuts that depend on a constant", differing, "variance does not"),
        Measure::new(
            "stated error against the true one",
            off,
            1e-3,
            "f64 sums; rounded to f32's means",
        ),
    ])
}

/// All of them.
pub fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "sums/clusters",
            true,
            "means of clusters of a million points",
            clusters,
        ),
        Case::new(
            "sums/variance",
            true,
            "cuts of large values that are nearly alike",
            variance,
        ),
    ]
}
