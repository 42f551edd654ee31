//! GMRES for three linear systems at once, one per colour channel, that share a sparse product.
//!
//! Source: Saad and Schultz 1986, with modified Gram-Schmidt and Givens rotations. Vectors are of [`DVec3`], and all
//! coefficients are too: each channel has its own operator, basis and Hessenberg matrix, component by component.
//! Sums run in index order, so that results do not depend on threads.
//!
//! The bounce operator is not symmetric (its clusters count by importance, its rows are estimates), which rules out
//! conjugate gradients; docs/notebook/stability.md compares GMRES with what else could do it.

use glam::{BVec3, DVec3};

/// A new direction below this share of the vector that it was left of is rounding: the Krylov space is complete.
const COMPLETE: f64 = 1e-14;

/// One cycle of GMRES for x = A x + f from a given residual: grows by one product a step.
#[derive(Debug, Default)]
pub struct Cycle {
    /// Orthonormal directions, one more than columns of `r`.
    basis: Vec<Vec<DVec3>>,
    /// Columns of the triangular factor.
    r: Vec<Vec<DVec3>>,
    /// Rotations (cosine, sine).
    rotations: Vec<(DVec3, DVec3)>,
    /// Rotated right-hand side, one more than columns.
    rhs: Vec<DVec3>,
}

/// Σ a_i b_i, channel by channel.
fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    a.iter().zip(b).map(|(a, b)| *a * *b).sum()
}

/// a / b where b is not zero, and zero elsewhere.
fn over(a: DVec3, b: DVec3) -> DVec3 {
    let some = b.cmpne(DVec3::ZERO);
    DVec3::select(some, a / DVec3::select(some, b, DVec3::ONE), DVec3::ZERO)
}

/// Square root of each channel.
fn root(v: DVec3) -> DVec3 {
    DVec3::new(v.x.sqrt(), v.y.sqrt(), v.z.sqrt())
}

impl Cycle {
    /// A cycle that starts from residual f + A x₀ − x₀.
    pub fn new(residual: Vec<DVec3>) -> Cycle {
        let norm = root(dot(&residual, &residual));
        let first = residual.into_iter().map(|v| over(v, norm)).collect();
        Cycle {
            basis: vec![first],
            rhs: vec![norm],
            ..Cycle::default()
        }
    }

    /// Number of steps taken.
    pub fn len(&self) -> usize {
        self.r.len()
    }

    /// Whether no step has been taken.
    pub fn is_empty(&self) -> bool {
        self.r.is_empty()
    }

    /// One step; `apply` is v ↦ A v. Returns the Euclidean norm of the residual that is left in each channel.
    pub fn step(&mut self, apply: impl Fn(&[DVec3]) -> Vec<DVec3>) -> DVec3 {
        let j = self.r.len();
        let last = &self.basis[j];
        let mut w: Vec<DVec3> = last.iter().zip(apply(last)).map(|(v, a)| *v - a).collect();
        let before = root(dot(&w, &w));
        let mut column = Vec::with_capacity(j + 2);
        for v in &self.basis {
            let h = dot(&w, v);
            w.iter_mut().zip(v).for_each(|(w, v)| *w -= h * *v);
            column.push(h);
        }
        let mut next = root(dot(&w, &w));
        next = DVec3::select(next.cmpgt(before * COMPLETE), next, DVec3::ZERO);
        for (i, &(c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[i], column[i + 1]);
            column[i] = c * a + s * b;
            column[i + 1] = c * b - s * a;
        }
        let diagonal = root(column[j] * column[j] + next * next);
        let some = diagonal.cmpne(DVec3::ZERO);
        let c = DVec3::select(some, over(column[j], diagonal), DVec3::ONE);
        let s = over(next, diagonal);
        column[j] = diagonal;
        let rhs = self.rhs[j];
        self.rhs[j] = c * rhs;
        self.rhs.push(-s * rhs);
        self.rotations.push((c, s));
        self.r.push(column);
        self.basis.push(w.into_iter().map(|v| over(v, next)).collect());
        self.rhs[j + 1].abs()
    }

    /// Adds the correction that minimises the residual to `x`.
    pub fn correct(&self, x: &mut [DVec3]) {
        let n = self.r.len();
        let mut y = self.rhs[..n].to_vec();
        for j in (0..n).rev() {
            // A channel whose space is complete has a zero column: nothing to add.
            y[j] = over(y[j], self.r[j][j]);
            let yj = y[j];
            for i in 0..j {
                y[i] -= self.r[j][i] * yj;
            }
        }
        for (v, y) in self.basis.iter().zip(&y) {
            if y.cmpne(DVec3::ZERO) != BVec3::FALSE {
                x.iter_mut().zip(v).for_each(|(x, v)| *x += *y * *v);
            }
        }
    }
}

/// Steps after which GMRES starts anew from what it has: rooms with a door need some twenty (docs/notebook/stability.md), and
/// this many vectors are still less memory than the operator.
const CYCLE: usize = 40;

/// Products after which the solution is cut off whatever its residual, because a frame must end.
const MOST_PRODUCTS: u32 = 2_000;

/// Share of the allowed residual at which a solution is first tried.
const TRIED: f64 = 0.5;

/// Solves x = f + A x, A and f without negative entries, in three channels at once. Returns a solution that a series
/// could have (x = f + A x′ with x′ nowhere negative) and the number of products with A.
///
/// `apply` is v ↦ A v; `allowed` says of an x which Euclidean norm of its residual may do, channel by channel; `accept`
/// decides on an x and on f + A x.
pub fn non_negative_solution(
    f: Vec<DVec3>,
    apply: impl Fn(&[DVec3]) -> Vec<DVec3>,
    allowed: impl Fn(&[DVec3]) -> DVec3,
    mut accept: impl FnMut(&[DVec3], &[DVec3]) -> bool,
) -> (Vec<DVec3>, u32) {
    let mut x = vec![DVec3::ZERO; f.len()];
    let mut after = f.clone();
    let mut products = 0;
    let mut tried = TRIED;
    while !accept(&x, &after) && products < MOST_PRODUCTS {
        let start = x;
        let residual = after.iter().zip(&start).map(|(after, x)| *after - *x).collect();
        let mut cycle = Cycle::new(residual);
        loop {
            let left = cycle.step(&apply);
            products += 1;
            x = start.clone();
            cycle.correct(&mut x);
            let ends = cycle.len() >= CYCLE || products >= MOST_PRODUCTS;
            if ends || left.cmple(allowed(&x) * tried).all() {
                // Light is nowhere negative; nearly dark places may be by the error that is allowed.
                x.iter_mut().for_each(|x| *x = x.max(DVec3::ZERO));
                after = apply(&x);
                after.iter_mut().zip(&f).for_each(|(after, f)| *after += *f);
                products += 1;
                tried *= 0.5;
                if ends || accept(&x, &after) {
                    break;
                }
            }
        }
    }
    (after, products)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// n steps of GMRES solve n equations, in every channel, to rounding, and its own residual is the true one.
    #[test]
    fn as_many_steps_as_unknowns_solve_the_system() {
        let n = 12;
        let mut s = Stream::new(51, 0, 0);
        let mut number = || f64::from(s.uniform()) - 0.5;
        let a: Vec<DVec3> = (0..n * n)
            .map(|_| 0.3 * DVec3::new(number(), number(), number()))
            .collect();
        // Light in two channels only: the third must stay zero, not become NaN.
        let f: Vec<DVec3> = (0..n).map(|_| DVec3::new(number(), number(), 0.0)).collect();
        let apply = |v: &[DVec3]| -> Vec<DVec3> { (0..n).map(|i| dot(&a[i * n..(i + 1) * n], v)).collect() };
        let mut cycle = Cycle::new(f.clone());
        for _ in 0..n + 3 {
            let left = cycle.step(apply);
            let mut x = vec![DVec3::ZERO; n];
            cycle.correct(&mut x);
            let r: Vec<DVec3> = (apply(&x).iter().zip(&x).zip(&f))
                .map(|((a, x), f)| *f + *a - *x)
                .collect();
            assert!(
                (root(dot(&r, &r)) - left).abs().max_element() < 1e-12,
                "{left} {}",
                cycle.len()
            );
            assert!(x.iter().all(|x| x.z == 0.0 && x.is_finite()));
        }
        let mut x = vec![DVec3::ZERO; n];
        cycle.correct(&mut x);
        let left = (apply(&x).iter().zip(&x).zip(&f))
            .map(|((a, x), f)| (*f + *a - *x).abs().max_element())
            .fold(0.0, f64::max);
        assert!(left < 1e-13, "{left}");
    }
}
