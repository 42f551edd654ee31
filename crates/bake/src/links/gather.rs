//! One gather: which senders a receiver sees, and how strongly.
//!
//! Source: Lehtinen et al. 2008, equation 16, with the reflectance left to the senders' radiosity and 1/π
//! taken in: T′_ij = (1/π) ∫ B_j(r(x_i, ω)) ω dω over the hemisphere above the receiver.
//!
//! Deviation: senders are clusters of finest points (`relight_transport::senders`), so a ray counts for the
//! clusters of the finest point nearest to where it ended; one look-up finds those of all sender levels.

use crate::links::fitting::{Answers, ShortInTrials};
use crate::points::candidates::Candidate;
use crate::points::separation::on_same_side;
use glam::{Vec3, Vec3A};
use relight_scene::environment::luminance;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::basis::NearestPoint;
use relight_transport::pyramid::LevelRanges;
use relight_transport::sampling::{DirectionSet, Frame};
use relight_transport::senders::SenderTree;

/// Rays whose ends are looked up together.
const TOGETHER: usize = 64;

/// The senders as rays see them.
pub struct SenderField<'a> {
    /// The finest receiver level.
    pub points: NearestPoint<'a>,
    /// Which of them surfaces part from their neighbours ([`Separations::near`](crate::points::separation::Separations::near)).
    pub near_separated: &'a [bool],
    /// Its points' clusters.
    pub tree: &'a SenderTree,
    /// Its points' radiosity in trial lights.
    pub trials: &'a [ShortInTrials],
}

/// A dense row over all senders with a list of what is not zero.
#[derive(Debug)]
pub struct RowScratch {
    /// Vector irradiance per unit radiosity.
    pub sum: Vec<Vec3A>,
    /// Senders that were touched since the last [`RowScratch::clear`], in order of first touch.
    pub touched: Vec<u32>,
    is_touched: Vec<bool>,
}

impl RowScratch {
    /// A zero row.
    pub fn new(senders: usize) -> RowScratch {
        RowScratch {
            sum: vec![Vec3A::ZERO; senders],
            touched: Vec::new(),
            is_touched: vec![false; senders],
        }
    }

    /// Sets the row to zero again, at the cost of what was touched.
    pub fn clear(&mut self) {
        for &j in &self.touched {
            self.sum[j as usize] = Vec3A::ZERO;
            self.is_touched[j as usize] = false;
        }
        self.touched.clear();
    }

    /// Adds to one entry.
    #[inline]
    pub fn add(&mut self, sender: u32, vector: Vec3A) {
        let j = sender as usize;
        if !self.is_touched[j] {
            self.is_touched[j] = true;
            self.touched.push(sender);
        }
        self.sum[j] += vector;
    }
}

/// What a gather found besides the row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gathered {
    /// Rays that met a surface without a point anywhere near.
    pub lost: u32,
    /// Irradiance, for the smooth normal, if radiosity 1 came from everywhere above: 1 where the normals agree,
    /// (1 + cos θ)/2 where they are θ apart.
    pub full: f32,
}

/// Gathers over what is above `place` into `row`, all sender levels, and what that answers to trial lights into `answers`.
///
/// Above is what both normals say is: a direction below the smooth normal's horizon would count as negative, one below the
/// surface starts inside it. The BRDFs of `scene` hold it the same way.
pub fn gather(
    surfaces: &dyn Surfaces,
    field: &SenderField,
    place: &Candidate,
    directions: &DirectionSet,
    row: &mut RowScratch,
    answers: &mut Answers,
) -> Gathered {
    let frame = Frame::around(place.geometric_normal);
    // Uniform sampling: dω = 2π/N, and 1/π of equation 16. The set's own cosine integral is divided out, so
    // that a closed scene of radiosity 1 gives irradiance 1 exactly.
    let weight = 2.0 / (directions.directions.len() as f32 * directions.full);
    let finest = field.tree.ranges.range(field.tree.levels() - 1).start as u32;
    let mut found = Gathered::default();
    let mut rays = Vec::with_capacity(TOGETHER);
    let mut ways = [Vec3A::ZERO; TOGETHER];
    let mut ends = [(Vec3::ZERO, Vec3::ZERO); TOGETHER];
    let mut nearest = [None; TOGETHER];
    for directions in directions.directions.chunks(TOGETHER) {
        rays.clear();
        for &local in directions {
            let direction = frame.world_from_local(local);
            let cosine = place.normal.dot(direction);
            if cosine <= 0.0 {
                continue;
            }
            found.full += cosine * weight;
            rays.push(Ray {
                origin: place.origin,
                direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
            });
        }
        let mut hits = 0;
        surfaces.closest_hits(&rays, &mut |i, hit| {
            // Links have no colour: that of panes counts by its luminance.
            let passed = luminance(surfaces.tint(&rays[i], hit.t));
            ways[hits] = Vec3A::from(rays[i].direction * (weight * passed));
            ends[hits] = (hit.position, hit.normal);
            hits += 1;
        });
        field.points.at_each(&ends[..hits], &mut nearest[..hits]);
        for ((&vector, &end), &nearest) in ways.iter().zip(&ends).zip(&nearest[..hits]) {
            let Some(nearest) = nearest else {
                found.lost += 1;
                continue;
            };
            let point = on_same_side(surfaces, &field.points, field.near_separated, end, nearest);
            answers.add(vector, &field.trials[point as usize].wide());
            row.add(finest + field.tree.leaf_of_point[point as usize], vector);
        }
    }
    coarsen(field, row);
    found
}

/// Responses of the coarser sender levels: the sums of their children's.
fn coarsen(field: &SenderField, row: &mut RowScratch) {
    for level in (1..field.tree.levels()).rev() {
        let range = field.tree.ranges.range(level);
        let coarse = field.tree.ranges.range(level - 1).start as u32;
        for i in 0..row.touched.len() {
            let sender = row.touched[i] as usize;
            if range.contains(&sender) {
                let parent = coarse + field.tree.parents[level - 1][sender - range.start];
                row.add(parent, row.sum[sender]);
            }
        }
    }
}

/// Scalar irradiance responses of one sender level, for the bounce operator: (sender, response ≥ 0) in order
/// of sender, relative to that of light from everywhere, `full`.
///
/// Surfaces that are seen show the light that their two normals lose between them as missing, as other renderers do. In the
/// bounces it would be missing once per bounce: a sphere of facets 4° apart at albedo 0.999 would lose a tenth of
/// its light to them (`check --case furnace/sphere`). So rows of the bounce operator of a closed scene sum to 1.
pub fn scalar_row(
    row: &RowScratch,
    ranges: &LevelRanges,
    level: usize,
    normal: Vec3,
    full: f32,
) -> Vec<(u32, f32)> {
    let range = ranges.range(level);
    let normal = Vec3A::from(normal) / full.max(f32::MIN_POSITIVE);
    let mut out: Vec<(u32, f32)> = row
        .touched
        .iter()
        .filter(|&&j| range.contains(&(j as usize)))
        .map(|&j| (j - range.start as u32, row.sum[j as usize].dot(normal).max(0.0)))
        .collect();
    out.sort_unstable_by_key(|e| e.0);
    out
}

#[cfg(test)]
mod tests {
    use crate::links::operators::{Viewers, transport};
    use crate::params::BakeParams;
    use crate::points::relevance::Relevance;
    use crate::test_scenes::hollow;
    use crate::units::Units;
    use glam::{Quat, Vec3};
    use relight_transport::sparse::row;

    /// Truth: in a closed scene all of the light that leaves surfaces arrives. Smooth normals that lean by 20° would lose
    /// (1 − cos 20°)/2, 3 %, in every bounce. Tolerance: the rounding of a thousand rays' sum in f32.
    #[test]
    fn bounces_in_a_closed_scene_lose_nothing_where_smooth_normals_lean() {
        let (ball, mut points) = hollow(0.5);
        for place in points.levels.iter_mut().flat_map(|level| &mut level.points) {
            let axis = place.geometric_normal.any_orthonormal_vector();
            place.normal = Quat::from_axis_angle(axis, 20f32.to_radians()) * place.geometric_normal;
        }
        let params = BakeParams {
            levels: 3,
            rays: 256,
            ..BakeParams::default()
        };
        let made = transport(
            &ball,
            points,
            Viewers {
                relevance: &Relevance::even(&[Vec3::ZERO]),
                cameras: &[],
            },
            &params,
            |v| v,
            Units::none(),
            &|_| Ok(()),
        )
        .unwrap();
        assert!(made.bounce.rows() > 10);
        for i in 0..made.bounce.rows() {
            let sum: f32 = row(&made.bounce, i).map(|entry| entry.1).sum();
            assert!((sum - 1.0).abs() < 1e-4, "row {i}: {sum}");
        }
    }
}
