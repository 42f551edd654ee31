//! The flat bounce operator and its solution: irradiance of one sender level's functions from their own
//! radiosity, iterated to convergence.
//!
//! Source: design of relight (section 6, bounces); the Neumann series is equation 15 of Lehtinen et al. 2008.
//! All weights are non-negative and every row sums to at most 1, so for reflectances below 1 the iteration is
//! a contraction in the maximum norm, by at least the largest reflectance a step.

use crate::sparse::Rows;
use glam::Vec3;

/// How the bounce series was solved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// A closed scene of `n` functions: rows sum to one.
    fn closed(n: usize) -> Rows {
        let mut s = Stream::new(31, 0, 0);
        let mut k = Rows::build(n, n, |_, _| {});
        k.offsets = vec![0];
        for _ in 0..n {
            for j in 0..n {
                k.entries.push((j as u32, s.uniform()));
            }
            k.offsets.push(k.entries.len() as u32);
        }
        k.normalise();
        k
    }

    #[test]
    fn a_closed_furnace_reaches_its_analytic_value() {
        // Uniform emission b = ρ: E = ρ/(1 − ρ) everywhere. The stopping rule allows 1 %.
        let k = closed(40);
        for rho in [0.0f32, 0.5, 0.9, 0.99] {
            let albedo = vec![Vec3::splat(rho); 40];
            let (e, solve) = solve(&k, &albedo, &albedo, None);
            let exact = rho / (1.0 - rho);
            for value in &e {
                assert!(
                    (value.x - exact).abs() <= 0.01 * exact,
                    "{rho}: {value} after {solve:?}"
                );
            }
        }
    }

    #[test]
    fn uneven_light_gives_the_dense_solution() {
        let n = 30;
        let k = closed(n);
        let mut s = Stream::new(32, 0, 0);
        let albedo: Vec<Vec3> = (0..n).map(|_| Vec3::splat(0.8 * s.uniform())).collect();
        let emitted: Vec<Vec3> = (0..n).map(|_| Vec3::splat(s.uniform())).collect();
        let (e, _) = solve(&k, &emitted, &albedo, None);
        // The series summed in double precision, 400 bounces: 0.8^400 is 1e-39.
        let dense: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                let mut row = vec![0.0; n];
                k.row(i).iter().for_each(|&(j, w)| row[j as usize] = f64::from(w));
                row
            })
            .collect();
        let mut exact = vec![0.0f64; n];
        for _ in 0..400 {
            let radiosity: Vec<f64> = (0..n)
                .map(|j| f64::from(emitted[j].x) + f64::from(albedo[j].x) * exact[j])
                .collect();
            exact = (0..n)
                .map(|i| (0..n).map(|j| dense[i][j] * radiosity[j]).sum())
                .collect();
        }
        for (value, exact) in e.iter().zip(&exact) {
            assert!((f64::from(value.x) - exact).abs() < 0.01 * exact);
        }
    }

    #[test]
    fn each_bounce_carries_less_than_the_one_before() {
        let k = closed(20);
        let albedo = vec![Vec3::splat(0.7); 20];
        let emitted: Vec<Vec3> = (0..20)
            .map(|j| Vec3::splat(if j == 3 { 1.0 } else { 0.0 }))
            .collect();
        let total = |bounces| {
            solve(&k, &emitted, &albedo, Some(bounces))
                .0
                .iter()
                .map(|e| e.x)
                .sum::<f32>()
        };
        let sums: Vec<f32> = (0..8).map(total).collect();
        let carried: Vec<f32> = sums.windows(2).map(|w| w[1] - w[0]).collect();
        assert_eq!(sums[0], 0.0);
        // In the maximum norm a bounce carries at most 0.7 of the last; the sum over functions of unequal
        // columns may exceed that for a step, but not 1.
        assert!(carried.windows(2).skip(1).all(|w| w[1] < w[0]), "{carried:?}");
    }
}
