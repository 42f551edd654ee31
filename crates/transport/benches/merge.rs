//! Nanoseconds per node of a merged cut, for one to six cuts at once.
//!
//! `cargo bench -p relight-transport --bench merge`
//!
//! Cuts of neighbouring sites are what a light tree of 32 768 even directions sees past the same few balls from places
//! that differ a little, selected with σ = 2. Rounds of all numbers of cuts take turns; medians are reported.

// Reason: it measures.
#![allow(clippy::disallowed_methods)]

use glam::Vec3;
use relight_transport::cuts::{Cut, MergeScratch, Selector, SiteCuts, merge, merge_any};
use relight_transport::light_tree::{Features, order, sphere_direction};
use relight_transport::random::Stream;
use std::hint::black_box;
use std::time::Instant;

const LIGHTS: u32 = 1 << 15;
const SIGMA: f32 = 2.0;
/// Cuts: enough for the caches of a core to be as busy as with a picture's.
const SITES: usize = 200;
const ROUNDS: usize = 5;
/// Times that a round merges all: Linux counts a thread's time in milliseconds.
const REPEATS: usize = 200;
/// How far sites are apart, of the distance of the nearest balls.
const STEP: f32 = 0.01;

/// What a round measured.
struct Round {
    /// Seconds where the number of cuts is known to the compiler.
    known: f64,
    /// Merged nodes.
    nodes: u64,
    /// Seconds where it is known at run time only.
    unknown: f64,
}

fn main() {
    // `cargo test --benches` passes no --bench: then there is nothing to measure.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let sites = sites();
    println!(
        "{} cuts of {:.0} nodes\n{:>5}{:>14}{:>12}{:>26}",
        sites.sites(),
        sites.heights.len() as f64 / sites.sites() as f64,
        "cuts",
        "merged nodes",
        "ns/node",
        "ns/node, number unknown"
    );
    let contestants: [fn(&SiteCuts) -> Round; 6] = [
        round::<1>, round::<2>, round::<3>, round::<4>, round::<5>, round::<6>,
    ];
    let mut measured = [const { Vec::new() }; 6];
    for _ in 0..ROUNDS {
        for (n, round) in contestants.iter().enumerate() {
            measured[n].push(round(&sites));
        }
    }
    for (n, rounds) in measured.iter().enumerate() {
        let median = |of: fn(&Round) -> f64| {
            let mut values: Vec<f64> = rounds.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values[ROUNDS / 2]
        };
        let nodes = rounds[0].nodes as f64;
        println!(
            "{:>5}{:>14.0}{:>12.2}{:>26.2}",
            n + 1,
            nodes / (REPEATS * (SITES - n)) as f64,
            1e9 * median(|r| r.known) / nodes,
            1e9 * median(|r| r.unknown) / nodes,
        );
    }
}

/// Merges each run of N neighbouring cuts, multiplying their values.
fn round<const N: usize>(sites: &SiteCuts) -> Round {
    let (mut nodes, mut sum) = (0, 0.0);
    let (clock, start) = began();
    for first in (0..REPEATS).flat_map(|_| 0..=SITES - N) {
        let cuts: [Cut; N] = std::array::from_fn(|k| sites.cut(first + k));
        merge(cuts, |node, values| {
            nodes += 1;
            sum += values.iter().product::<f32>() * node.len() as f32;
        });
    }
    let known = core_seconds(clock) - start;
    let (clock, start) = began();
    let mut scratch = MergeScratch::default();
    for first in (0..REPEATS).flat_map(|_| 0..=SITES - N) {
        let cuts: [Cut; N] = std::array::from_fn(|k| sites.cut(first + k));
        merge_any(&cuts, &mut scratch, |node, values| {
            sum += values.iter().product::<f32>() * node.len() as f32;
        });
    }
    black_box(sum);
    Round {
        known,
        nodes,
        unknown: core_seconds(clock) - start,
    }
}

fn sites() -> SiteCuts {
    let lattice: Vec<Vec3> = (0..LIGHTS).map(|i| sphere_direction(i, LIGHTS)).collect();
    let features = Features {
        positions: &lattice,
        normals: &lattice,
        visibility: &[],
        pilots: 0,
    };
    let directions: Vec<Vec3> = order(&features, 1.0)
        .iter()
        .map(|&i| lattice[i as usize])
        .collect();
    let mut random = Stream::new(1, 0, 0);
    let balls: Vec<(Vec3, f32)> = (0..12)
        .map(|i| {
            let away = sphere_direction(i, 12) * (1.0 + 2.0 * random.uniform());
            (away, 0.1 + 0.4 * random.uniform())
        })
        .collect();
    let mut cuts = SiteCuts {
        offsets: vec![0],
        ..SiteCuts::default()
    };
    let mut selector = Selector::default();
    for site in 0..SITES {
        let from = Vec3::new(STEP * (site % 16) as f32, 0.0, STEP * (site / 16) as f32);
        let hidden = |d: Vec3| {
            balls.iter().any(|&(middle, radius)| {
                let to = middle - from;
                let along = to.dot(d);
                along > 0.0 && to.length_squared() - along * along < radius * radius
            })
        };
        let seen: Vec<f32> = directions
            .iter()
            .map(|&d| if hidden(d) { 0.0 } else { 1.0 })
            .collect();
        selector.select(&seen, SIGMA, usize::MAX, &mut cuts.heights, &mut cuts.values);
        cuts.offsets.push(cuts.heights.len() as u32);
    }
    cuts
}

fn began() -> (Instant, f64) {
    let clock = Instant::now();
    (clock, core_seconds(clock))
}

/// Seconds that this thread has run on a core, where the system tells (Linux); else those of the clock. Other work on the
/// machine lengthens the latter only.
fn core_seconds(start: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |n| n * 1e-9)
}
