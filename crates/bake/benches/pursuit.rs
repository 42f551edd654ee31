//! Milliseconds of one core that choosing the links of one row takes, by the number of choices.
//!
//! `cargo bench -p relight-bake`
//!
//! Every choice is worth its link (a gain of 0), which is the most that a row can cost. From the bounds on choices and links taken on,
//! it must not grow but by looking at each choice once.

// Reason: it measures.
#![allow(clippy::disallowed_methods)]

use glam::{Vec3, Vec3A};
use relight_bake::links::fitting::Answers;
use relight_bake::links::matching_pursuit::{
    Choice, Family, NO_FAMILY, PursuitScratch, Residual, Weights, pursue,
};
use relight_bake::links::test_lights::{InTestLights, TEST_LIGHTS, TestLights};
use relight_transport::random::Stream;
use std::hint::black_box;
use std::time::Instant;

const ROUNDS: usize = 9;

/// Children of a cluster.
const CHILDREN: usize = 4;

fn main() {
    // `cargo test --benches` passes no --bench: then there is nothing to measure.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    println!("choices    links    ms (median of {ROUNDS})");
    for choices in [32, 128, 512, 1024, 2048, 8192, 32768] {
        let mut links = Vec::new();
        let mut rounds: Vec<f64> = (0..ROUNDS).map(|_| milliseconds(choices, &mut links)).collect();
        rounds.sort_by(f64::total_cmp);
        println!("{choices:>7}  {:>7}  {:>8.2}", links.len(), rounds[ROUNDS / 2]);
    }
}

/// What a row of so many choices takes, an eighth of them on the coarsest level.
fn milliseconds(choices: usize, links: &mut Vec<(u32, Vec3)>) -> f64 {
    let mut s = Stream::new(1, 0, 0);
    let coarse = choices / 8;
    let test_lights = TestLights {
        coefficients: (0..choices)
            .map(|j| std::array::from_fn(|_| s.uniform() - if j < coarse { 0.0 } else { 0.5 }))
            .collect(),
        leaf_means: Vec::new(),
    };
    let mut vector = || Vec3A::new(s.uniform() - 0.5, s.uniform(), s.uniform() - 0.5);
    let (mut missing, mut answers) = (Answers::default(), Answers::default());
    for g in 0..TEST_LIGHTS {
        let one: InTestLights = std::array::from_fn(|h| if g == h { 1.0 } else { 0.0 });
        missing.add(0.3 * vector(), &one);
        answers.add(vector(), &one);
    }
    let mut room = PursuitScratch::default();
    for sender in 0..choices {
        let family = sender.checked_sub(coarse).map(|child| child / CHILDREN);
        let (share, deviation) = match family {
            Some(_) => (1.0 / (CHILDREN + 1) as f32, 0.1 * vector()),
            None => (1.0, 0.1 * vector()),
        };
        if let Some(family) = family {
            // One child of each is no choice.
            room.families.resize(
                family + 1,
                Family {
                    squares: share,
                    deviation: Vec3A::ZERO,
                },
            );
            room.families[family].deviation += share * deviation;
        }
        room.choices.push(Choice {
            sender: sender as u32,
            family: family.map_or(NO_FAMILY, |family| family as u32),
            share,
            deviation,
        });
    }
    let residual = Residual {
        test_lights: &test_lights,
        missing: &missing,
        weights: &Weights::of(&answers),
        gain: 0.0,
    };
    links.clear();
    let start = Instant::now();
    pursue(&residual, |v| v.length_squared(), &mut room, black_box(links));
    1000.0 * start.elapsed().as_secs_f64()
}
