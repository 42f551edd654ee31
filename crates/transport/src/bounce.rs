//! The flat bounce operator and its solution: irradiance of one sender level's functions from their own
//! radiosity, to convergence or for so many bounces.
//!
//! The Neumann series is equation 15 of Lehtinen et al. 2008.
//! All weights are non-negative and every row sums to at most 1, so that for reflectances below 1 the bounce is
//! a contraction in the maximum norm, by at least the largest reflectance.
//!
//! Deviation: to convergence GMRES ([`crate::krylov`]) takes the place of the series, which needs some 11,500 products
//! at a reflectance of 0.999 where GMRES needs a dozen; one bounce at the end makes of its result light that a series
//! could have (nowhere negative) and measures the residual that is left. docs/notebook/stability.md compares it with other
//! solvers. Iteration is in f64: the residual is a difference of sums that agree in up to six digits.

use crate::krylov::non_negative_solution;
use crate::sparse::{SparseMatrix, apply_double};
use glam::{DVec3, Vec3};

/// How the bounces were solved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solve {
    /// Products with the operator.
    pub iterations: u32,
    /// Largest change that one more bounce would make, relative to the largest irradiance; of the channel that is
    /// worst.
    pub residual: f32,
    /// Whether the residual is below [`TOLERANCE`]·(1 − ρ) in every channel; also after a given number of bounces.
    pub converged: bool,
}

/// Relative error of the sum, in the maximum norm, that the solution may have: the residual is
/// below this times 1 − ρ. A tenth of what layers of lights may miss of all lights together (10⁻⁴ of a pixel), since an iterative
/// solution is linear only as far as it has converged; a product gains about a digit, so that it costs no more than a few
/// over a hundredth (docs/notebook/stability.md).
pub const TOLERANCE: f64 = 1e-5;

/// Nothing reflects more: a closed white room would fill with light without end. Whatever reflects all light in a file
/// loses a ten-thousandth at each bounce.
pub const MOST_ALBEDO: f64 = 0.9999;

/// Solves E = K (b + ρ E) for the irradiance E of all bounces from the first on: `k` the operator, `emitted`
/// the radiosity b that direct light causes, `albedo` ρ per function, at most [`MOST_ALBEDO`] of it.
///
/// `bounces` limits the series to that many products with K; `None` solves until the residual of every channel falls
/// below [`TOLERANCE`]·(1 − ρ_max), which bounds the relative error of the sum by that in the maximum norm.
pub fn solve(
    k: &SparseMatrix,
    emitted: &[Vec3],
    albedo: &[Vec3],
    bounces: Option<u32>,
) -> (Vec<Vec3>, Solve) {
    let (e, solve) = solve_double(k, emitted, albedo, bounces, TOLERANCE);
    (e.into_iter().map(|e| e.as_vec3()).collect(), solve)
}

/// [`solve`] in f64, to a tolerance of the caller's.
pub fn solve_double(
    k: &SparseMatrix,
    emitted: &[Vec3],
    albedo: &[Vec3],
    bounces: Option<u32>,
    tolerance: f64,
) -> (Vec<DVec3>, Solve) {
    let system = BounceSystem::new(k, emitted, albedo, tolerance);
    match bounces {
        Some(bounces) => system.series(bounces),
        None => system.converged(),
    }
}

/// E = K (b + ρ E): one system of equations per channel.
struct BounceSystem<'a> {
    k: &'a SparseMatrix,
    emitted: Vec<DVec3>,
    albedo: Vec<DVec3>,
    /// Residual at which a channel has converged.
    target: DVec3,
}

/// Largest value of each channel.
fn largest(values: impl Iterator<Item = DVec3>) -> DVec3 {
    values.fold(DVec3::ZERO, |m, v| m.max(v.abs()))
}

impl<'a> BounceSystem<'a> {
    fn new(k: &'a SparseMatrix, emitted: &[Vec3], albedo: &[Vec3], tolerance: f64) -> BounceSystem<'a> {
        let most = DVec3::splat(MOST_ALBEDO);
        let albedo: Vec<DVec3> = albedo.iter().map(|a| a.as_dvec3().min(most)).collect();
        let brightest = largest(albedo.iter().copied());
        BounceSystem {
            k,
            emitted: emitted.iter().map(|b| b.as_dvec3()).collect(),
            albedo,
            target: (1.0 - brightest) * tolerance,
        }
    }

    /// K (ρ E).
    fn reflected(&self, irradiance: &[DVec3]) -> Vec<DVec3> {
        let sent: Vec<DVec3> = irradiance
            .iter()
            .zip(&self.albedo)
            .map(|(e, a)| *e * *a)
            .collect();
        apply_double(self.k, &sent)
    }

    /// Irradiance one bounce after `irradiance`: K (b + ρ E).
    fn next(&self, irradiance: &[DVec3]) -> Vec<DVec3> {
        let sent: Vec<DVec3> = (irradiance.iter().zip(&self.albedo))
            .zip(&self.emitted)
            .map(|((e, a), b)| *b + *e * *a)
            .collect();
        apply_double(self.k, &sent)
    }

    /// What a bounce changed, against what is allowed: largest relative change, and whether all channels are done.
    fn change(&self, before: &[DVec3], after: &[DVec3]) -> (f64, bool) {
        let size = largest(after.iter().copied());
        let change = largest(after.iter().zip(before).map(|(a, b)| *a - *b));
        let relative = DVec3::select(size.cmpgt(DVec3::ZERO), change / size, DVec3::ZERO);
        (relative.max_element(), relative.cmple(self.target).all())
    }

    /// So many terms of the series.
    fn series(&self, bounces: u32) -> (Vec<DVec3>, Solve) {
        let mut irradiance = vec![DVec3::ZERO; self.k.rows()];
        let mut solve = Solve::default();
        while solve.iterations < bounces {
            let next = self.next(&irradiance);
            solve.iterations += 1;
            let (residual, converged) = self.change(&irradiance, &next);
            (solve.residual, solve.converged) = (residual as f32, converged);
            irradiance = next;
            if residual == 0.0 {
                break; // no light, or none that comes back
            }
        }
        (irradiance, solve)
    }

    /// All bounces: GMRES until one more bounce changes nothing.
    fn converged(&self) -> (Vec<DVec3>, Solve) {
        let first = apply_double(self.k, &self.emitted);
        let spread = (self.k.rows() as f64).sqrt();
        let mut solve = Solve::default();
        let (irradiance, products) = non_negative_solution(
            first,
            |e| self.reflected(e),
            |e| self.target * largest(e.iter().copied()) * spread,
            |before, after| {
                let (residual, converged) = self.change(before, after);
                (solve.residual, solve.converged) = (residual as f32, converged);
                converged
            },
        );
        solve.iterations = products + 1;
        (irradiance, solve)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::sparse::{build, from_rows, normalise, row};

    /// A closed scene of `n` functions: rows sum to one.
    fn closed(n: usize) -> SparseMatrix {
        let mut s = Stream::new(31, 0, 0);
        let mut row = || (0..n as u32).map(|j| (j, s.uniform())).collect();
        let mut k = from_rows(&(0..n).map(|_| row()).collect::<Vec<_>>(), n);
        normalise(&mut k);
        k
    }

    #[test]
    fn a_closed_furnace_reaches_its_analytic_value() {
        // Uniform emission b = ρ: E = ρ/(1 − ρ) everywhere. Tolerance: weights in f32, whose sums miss 1 by
        // 10⁻⁷ and that times 1/(1 − ρ); the stopping rule allows 10⁻⁵.
        let k = closed(40);
        for rho in [0.0f32, 0.5, 0.9, 0.99] {
            let albedo = vec![Vec3::splat(rho); 40];
            let (e, solve) = solve(&k, &albedo, &albedo, None);
            let exact = rho / (1.0 - rho);
            for value in &e {
                assert!(
                    (value.x - exact).abs() <= 1e-4 * exact,
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
                let mut dense = vec![0.0; n];
                row(&k, i).for_each(|(j, w)| dense[j as usize] = f64::from(w));
                dense
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

    /// Eight rooms in a row of forty walls each; a hundredth of what a wall sees lies beyond each door.
    fn row_of_rooms() -> SparseMatrix {
        let (rooms, each, door) = (8usize, 40usize, 0.01f32);
        let of_wall = |i: usize| -> Vec<(u32, f32)> {
            let room = i / each;
            let seen = room.saturating_sub(1)..(room + 2).min(rooms);
            let beyond = seen.len() - 1;
            let share = |r: usize| {
                if r == room {
                    1.0 - door * beyond as f32
                } else {
                    door
                }
            };
            let walls = seen.flat_map(|r| (0..each).map(move |j| (r, j)));
            walls
                .map(|(r, j)| {
                    let uneven = 2.0 * (j + 1) as f32 / (each * (each + 1)) as f32;
                    ((r * each + j) as u32, share(r) * uneven)
                })
                .collect()
        };
        build(rooms * each, rooms * each, |i, row| row.extend(of_wall(i)))
    }

    /// The bound: a residual of 0.01·(1 − ρ) in at most 40 products at ρ = 0.999, under light from one wall
    /// of the first room. The series needs thousands. Truth: the same to 1e-9, which a dense sum confirms above.
    #[test]
    fn rooms_that_lose_a_thousandth_a_bounce_take_forty_products() {
        let k = row_of_rooms();
        let n = k.rows();
        let mut emitted = vec![Vec3::ZERO; n];
        emitted[5] = Vec3::new(1.0, 1e-20, 1e20);
        for rho in [0.9f32, 0.99, 0.999] {
            let albedo = vec![Vec3::splat(rho); n];
            let (exact, tight) = solve_double(&k, &emitted, &albedo, None, 1e-9);
            assert!(tight.converged, "{tight:?}");
            let (e, solve) = solve(&k, &emitted, &albedo, None);
            let allowed = TOLERANCE * f64::from(1.0 - rho);
            assert!(solve.converged && solve.iterations <= 40, "{rho}: {solve:?}");
            assert!(f64::from(solve.residual) <= allowed * 1.001, "{rho}: {solve:?}");
            for channel in 0..3 {
                let most = exact.iter().map(|e| e[channel]).fold(0.0, f64::max);
                for (a, b) in e.iter().zip(&exact) {
                    let off = (f64::from(a[channel]) - b[channel]).abs();
                    assert!(off <= 0.01 * most && a[channel] >= 0.0, "{rho}: {a} {b}");
                }
            }
        }
    }

    /// A closed white room has no answer; what it gets instead is finite, not negative and a lot.
    #[test]
    fn walls_that_reflect_everything_fill_a_room_to_ten_thousand_times_its_light() {
        let k = closed(40);
        let (e, solve) = solve(&k, &[Vec3::ONE; 40], &[Vec3::ONE; 40], None);
        assert!(solve.converged, "{solve:?}");
        // 1/(1 − 0.9999), less what rows of f32 weights miss of their sum of 1: 1e-7 of it, times 10⁴.
        assert!(e.iter().all(|e| (e.x / 1e4 - 1.0).abs() < 0.02), "{}", e[0]);
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
