//! What refinement works on, receiver by receiver, and how many rays each casts.

use crate::links::fitting::{Answers, TrialLights};
use crate::links::gather::SenderField;
use crate::links::test_lights::{TEST_LIGHTS, TestLights};
use crate::points::candidates::Candidate;
use glam::Vec3;
use relight_scene::surface::Surfaces;
use relight_transport::pyramid::LevelRanges;
use relight_transport::sparse::SparseMatrix;

/// What refinement works on.
pub struct Refinement<'a> {
    /// The scene.
    pub surfaces: &'a dyn Surfaces,
    /// All points, level by level.
    pub places: &'a [Candidate],
    /// Levels of `places`.
    pub ranges: &'a LevelRanges,
    /// Parents of every point (rows and columns: all points).
    pub fine_from_coarse: &'a SparseMatrix,
    /// What is missing among them because surfaces part it ([`Separations::pairs`](crate::points::separation::Separations::pairs)).
    pub separated_pairs: &'a [[u32; 2]],
    /// What rays see.
    pub field: SenderField<'a>,
    /// Lights that rows are fitted to.
    pub trials: &'a TrialLights,
    /// Lights by which links are chosen.
    pub test_lights: &'a TestLights,
    /// Positions of the senders of the coarsest level.
    pub coarse_positions: &'a [Vec3],
    /// Rays per receiver of the finest level.
    pub rays: usize,
    /// ε at the finest level.
    pub epsilon: f32,
    /// Sender level of the bounce operator.
    pub bounce_level: usize,
    /// Receiver level whose gathers make the bounce operator; `None`: it is not needed.
    pub bounce_receivers: Option<usize>,
    /// Receivers that finer levels inherit; empty: none.
    pub handed_down: &'a [bool],
    /// Receivers that are worth a gather; empty: all.
    pub worthwhile: &'a [bool],
    /// Whether links are stored in their short form.
    pub short_links: bool,
    /// Seed of the direction sets.
    pub seed: u64,
}

impl Refinement<'_> {
    pub(super) fn is_worthwhile(&self, i: usize) -> bool {
        self.worthwhile.get(i).copied().unwrap_or(true)
    }

    /// Whether the response at a receiver of a level goes into the bounce operator: at those of one level, and at coarser ones that have no
    /// finer ones around them.
    pub fn serves_bounces(&self, level: usize, i: usize) -> bool {
        self.bounce_receivers.is_some_and(|serving| {
            !self.places[i].inherited
                && (level == serving || level < serving && self.handed_down.get(i) == Some(&true))
        })
    }
}

/// Most rays a receiver gets: the coarsest rows are few, and all others rest on them.
const MOST_RAYS: usize = 1 << 14;

/// A row as the file will have it, kept for finer levels.
#[derive(Clone, Debug, Default)]
pub struct Reconstructed {
    /// Link coefficients by sender, in no order.
    pub row: Vec<(u32, Vec3)>,
    /// What they answer to the lights that links are chosen by; nothing where no row is kept.
    pub answers: Option<Box<Answers<TEST_LIGHTS>>>,
}

/// One receiver's outcome.
#[derive(Clone, Debug, Default)]
pub struct Receiver {
    /// Links as stored, by ascending sender.
    pub links: Vec<(u32, Vec3)>,
    /// Scalar irradiance responses of the bounce sender level, on the bounce receiver level; empty once they are added up.
    pub bounce: Vec<(u32, f32)>,
    /// Whether it cast rays.
    pub gathered: bool,
    /// Rays that met a surface without points.
    pub lost: u32,
    /// Links that were dropped as too weak.
    pub dropped: u32,
    /// Reconstructed row for finer levels; empty on the two finest. It follows from the others.
    pub reconstructed: Reconstructed,
}

impl Receiver {
    pub(super) fn row_bytes(&self) -> u64 {
        let Reconstructed { row, answers } = &self.reconstructed;
        (size_of_val(&row[..]) + answers.as_deref().map_or(0, size_of_val)) as u64
    }

    /// Gives back what its lists have room for: all receivers stay until the last is done.
    pub(super) fn shrink(&mut self) {
        self.links.shrink_to_fit();
        self.bounce.shrink_to_fit();
        self.reconstructed.row.shrink_to_fit();
    }
}

/// Receivers of a range.
pub struct Receivers(pub Vec<Receiver>);

/// Whether finer levels are predicted from a level's reconstructed rows: all but the two finest are.
pub(super) fn is_remembered(r: &Refinement, level: usize) -> bool {
    level + 2 < r.ranges.levels()
}

/// Rays of all receivers of all levels, if all cast some.
pub fn most_rays(levels: impl ExactSizeIterator<Item = usize>, rays: usize) -> u64 {
    let count = levels.len();
    levels
        .enumerate()
        .map(|(level, receivers)| (receivers * rays_at(rays, count - 1 - level)) as u64)
        .sum()
}

/// Rays of each receiver of a level.
pub(super) fn rays_of(r: &Refinement, level: usize) -> usize {
    rays_at(r.rays, r.ranges.levels() - 1 - level)
}

fn rays_at(finest: usize, above_finest: usize) -> usize {
    (finest << above_finest.min(20)).min(MOST_RAYS.max(finest))
}
