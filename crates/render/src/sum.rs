//! Sums of light of several lights.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::AddAssign;
use std::sync::{Mutex, PoisonError};

/// Places that are summed together.
const TASK: usize = 4096;

/// A sum over lights at many places: in f64 from the second part on, since a faint light beside a bright one, or each of a
/// million, would be lost or rounded the same way every time (docs/notebook/stability.md). Most scenes have one light, which is
/// kept as it is.
pub enum Sum {
    /// At so many places.
    Nothing(usize),
    /// Of one light.
    One(Vec<Vec3>),
    /// Of several.
    Several(Vec<DVec3>),
}

impl Sum {
    /// Adds a light's part at every place, or an empty one, nothing, times its colour.
    pub fn add(&mut self, part: &[Vec3], color: Vec3) {
        if part.is_empty() {
            return;
        }
        let part = part.par_iter().map(|&part| part * color);
        *self = match std::mem::replace(self, Sum::Nothing(0)) {
            Sum::Nothing(_) => Sum::One(part.with_min_len(TASK).collect()),
            Sum::One(first) => {
                let both = first.into_par_iter().zip(part).with_min_len(TASK);
                Sum::Several(both.map(|(a, b)| a.as_dvec3() + b.as_dvec3()).collect())
            }
            Sum::Several(mut sums) => {
                (sums.par_iter_mut().zip(part).with_min_len(TASK))
                    .for_each(|(sum, part)| *sum += part.as_dvec3());
                Sum::Several(sums)
            }
        };
    }

    /// The sum, rounded once.
    pub fn rounded(self) -> Vec<Vec3> {
        match self {
            Sum::Nothing(places) => vec![Vec3::ZERO; places],
            Sum::One(part) => part,
            Sum::Several(sums) => (sums.into_par_iter().with_min_len(TASK))
                .map(|sum| sum.as_vec3())
                .collect(),
        }
    }
}

/// What worker threads count together; in integers, so that their order does not matter.
#[derive(Default)]
pub(crate) struct Total<T>(Mutex<T>);

impl<T: AddAssign> Total<T> {
    pub fn add(&self, part: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) += part;
    }

    pub fn sum(self) -> T {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: sums in f64. A light of 1 beside one of 2^24 is lost in f32 as often as it is added.
    #[test]
    fn many_faint_lights_beside_a_bright_one_are_not_lost() {
        let mut sum = Sum::Nothing(2);
        sum.add(&[Vec3::splat(16_777_216.0), Vec3::ZERO], Vec3::ONE);
        for _ in 0..64 {
            sum.add(&[Vec3::splat(0.5); 2], Vec3::splat(2.0));
        }
        sum.add(&[], Vec3::ONE);
        assert_eq!(sum.rounded(), [Vec3::splat(16_777_280.0), Vec3::splat(64.0)]);
    }

    #[test]
    fn one_light_stays_as_it_is_and_none_is_dark() {
        let mut one = Sum::Nothing(1);
        one.add(&[Vec3::new(0.1, 1e-30, 1e30)], Vec3::ONE);
        assert_eq!(one.rounded(), [Vec3::new(0.1, 1e-30, 1e30)]);
        assert_eq!(Sum::Nothing(2).rounded(), [Vec3::ZERO; 2]);
    }
}
