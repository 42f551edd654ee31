//! The flat bounce operator and its solution: irradiance of one sender level's functions from their own
//! radiosity, iterated to convergence.
//!
//! Source: design of relight (section 6, bounces); the Neumann series is equation 15 of Lehtinen et al. 2008.
//! All weights are non-negative and every row sums to at most 1, so for reflectances below 1 the iteration is
//! a contraction in the maximum norm, by at least the largest reflectance a step.

use crate::sparse::Rows;
use glam::Vec3;

/// How the bounce series was solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solve {
    /// Products with the operator.
    pub iterations: u32,
    /// Largest remaining change relative to the largest irradiance.
    pub residual: f32,
}

/// Iterations after which the series is cut off whatever its residual: 0.999 needs some 11,500 to reach its
/// 1e-5, and a frame must end.
const MOST_ITERATIONS: u32 = 20_000;

/// Solves E = K (b + ρ E) for the irradiance E of all bounces from the first on: `k` the operator, `emitted`
/// the radiosity b that direct light causes, `albedo` ρ per function.
///
/// `bounces` limits the series to that many products with K; `None` iterates until the residual falls below
/// 0.01·(1 − ρ_max), which bounds the relative error of the sum by 1 % in the maximum norm.
pub fn solve(k: &Rows, emitted: &[Vec3], albedo: &[Vec3], bounces: Option<u32>) -> (Vec<Vec3>, Solve) {
    let mut irradiance = vec![Vec3::ZERO; k.rows()];
    let brightest = albedo.iter().fold(0.0f32, |m, a| m.max(a.max_element()));
    let target = 0.01 * (1.0 - brightest).max(0.0);
    let mut solve = Solve {
        iterations: 0,
        residual: 0.0,
    };
    let limit = bounces.unwrap_or(MOST_ITERATIONS).min(MOST_ITERATIONS);
    let mut radiosity = emitted.to_vec();
    while solve.iterations < limit {
        let next = k.apply(&radiosity);
        solve.iterations += 1;
        let largest = next.iter().fold(0.0f32, |m, e| m.max(e.abs().max_element()));
        let change = next
            .iter()
            .zip(&irradiance)
            .fold(0.0f32, |m, (a, b)| m.max((*a - *b).abs().max_element()));
        irradiance = next;
        solve.residual = if largest > 0.0 { change / largest } else { 0.0 };
        if bounces.is_none() && solve.residual <= target {
            break;
        }
        for (out, ((b, rho), e)) in radiosity
            .iter_mut()
            .zip(emitted.iter().zip(albedo).zip(&irradiance))
        {
            *out = *b + *rho * *e;
        }
    }
    (irradiance, solve)
}
