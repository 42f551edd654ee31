//! Rows that parents' rows give.

use super::work::{Receiver, Reconstructed, Refinement};
use crate::links::fitting::Answers;
use crate::links::gather::RowScratch;
use crate::links::test_lights::TEST_LIGHTS;
use glam::{Mat3, Vec3, Vec3A};
use relight_transport::pyramid::carry;
use relight_transport::sparse::row;

/// Entries of a reconstructed row below this share of ε are forgotten, except on the coarsest sender level, whose
/// sum is the row's answer to even light. Rows would else hold half of all senders: forgetting 2 % takes half of the
/// memory and a third of the time and changes errors by 1 %, 10 % of ε by 13 % (docs/notebook/transfer.md).
const NEGLIGIBLE: f32 = 0.04;

/// A row in the making, for one thread: first what its receiver's parents predict, then its own links, too.
pub(super) struct Predicted {
    /// Link coefficients.
    pub row: RowScratch,
    /// What they answer to the lights that links are chosen by.
    pub answers: Answers<TEST_LIGHTS>,
}

impl Predicted {
    /// Room for the rows of `r`.
    pub fn new(r: &Refinement) -> Predicted {
        Predicted {
            row: RowScratch::new(r.field.tree.ranges.total()),
            answers: Answers::default(),
        }
    }

    /// Nothing.
    pub fn clear(&mut self) {
        self.row.clear();
        self.answers = Answers::default();
    }

    /// Adds the row of receiver `i` that its parents' rows give.
    ///
    /// Reconstructed rows are long, and three quarters of those that are needed are on the level above the finest.
    /// They are not stored: such a parent stands for its own links and its parents' rows.
    pub fn predict(&mut self, r: &Refinement, i: usize, known: &[Receiver]) {
        let remembered = r.ranges.range(r.ranges.levels().saturating_sub(2)).start;
        let normal = |k: u32| r.places[k as usize].normal;
        let carried = |k: u32, i: u32, share: f32| carry(normal(k), normal(i)) * share;
        let mut terms: Vec<(u32, Mat3)> = Vec::new();
        for (k, share) in row(r.fine_from_coarse, i) {
            let m = carried(k, i as u32, share);
            if (k as usize) < remembered {
                terms.push((k, m));
                continue;
            }
            for &(j, vector) in &known[k as usize].links {
                self.add(r, j, m * vector);
            }
            let grandparents = row(r.fine_from_coarse, k as usize);
            terms.extend(grandparents.map(|(g, share)| (g, m * carried(g, k, share))));
        }
        terms.sort_by_key(|term| term.0);
        for same in terms.chunk_by(|a, b| a.0 == b.0) {
            let m: Mat3 = same.iter().map(|term| term.1).sum();
            let Reconstructed { row, answers } = &known[same[0].0 as usize].reconstructed;
            for &(j, vector) in row {
                self.row.add(j, Vec3A::from(m * vector));
            }
            // Carried, since to sum them up from a row's links would take as long as the gather.
            if let Some(answers) = answers {
                self.answers.add_carried(m, answers);
            }
        }
    }

    fn add(&mut self, r: &Refinement, j: u32, vector: Vec3) {
        let vector = Vec3A::from(vector);
        self.row.add(j, vector);
        self.answers.add(vector, &r.test_lights.coefficients[j as usize]);
    }

    /// Adds the receiver's own links, and returns the row as the file will have it.
    pub fn reconstruct(&mut self, r: &Refinement, links: &[(u32, Vec3)]) -> Reconstructed {
        for &(j, vector) in links {
            self.add(r, j, vector);
        }
        let coarse_senders = r.field.tree.ranges.range(0).len() as u32;
        let negligible = (r.epsilon * NEGLIGIBLE).powi(2);
        let row = (self.row.touched.iter())
            .map(|&j| (j, Vec3::from(self.row.sum[j as usize])))
            .filter(|link| link.0 < coarse_senders || link.1.length_squared() > negligible);
        Reconstructed {
            row: row.collect(),
            answers: Some(Box::new(self.answers)),
        }
    }
}
