//! Points and operators of a scene: the bake without the file.

use crate::error::BakeError;
use crate::links::bounces::BounceSums;
use crate::links::fitting::TrialLights;
use crate::links::gather::SenderField;
use crate::links::lamps::Lamps;
use crate::links::refinement::{Refinement, RowWatch, Spared, most_rays, refine};
use crate::links::solution::{Solution, solution};
use crate::links::test_lights::TestLights;
use crate::params::{BakeParams, Omittable};
use crate::points::candidates::Candidate;
use crate::points::poisson::{PointLevels, levels_of};
use crate::points::relevance::Relevance;
use crate::points::seen::seen_by;
use crate::points::separation::{self, Separations};
use crate::senders::clusters::{SenderClusters, sender_clusters};
use crate::senders::importance::importance;
use crate::units::Units;
use glam::Vec3;
use relight_scene::camera::Camera;
use relight_scene::surface::Surfaces;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::links::Links;
use relight_transport::pyramid::LevelRanges;
use relight_transport::senders::{SenderTree, weight};
use relight_transport::sparse::{SparseMatrix, row};

/// All that the asset stores of a scene's transport.
#[derive(Debug)]
pub struct Transport {
    /// Points of every level.
    pub points: PointLevels,
    /// Senders.
    pub tree: SenderTree,
    /// Points that surfaces part from each other.
    pub separations: Separations,
    /// T.
    pub links: Links,
    /// K: the flat bounce operator; empty where it is not needed.
    pub bounce: SparseMatrix,
    /// Sender level on which K works.
    pub bounce_level: usize,
    /// Receivers gathered per level.
    pub gathered: Vec<usize>,
    /// Rays cast in all stages.
    pub rays: u64,
    /// Rays of the refinement that met a surface without points.
    pub lost: u64,
    /// Links that were dropped as too weak.
    pub dropped: u64,
    /// Gathers that were not made.
    pub spared: Spared,
    /// Finest sender levels that were left out, because no link leads to them, and their clusters.
    pub idle_senders: (usize, usize),
    /// Memory that reconstructed rows took, bytes.
    pub row_bytes: u64,
}

impl Transport {
    /// S: the bounces solved with the points' reflectances.
    ///
    /// # Errors
    /// What `step`, called with each number of rows done, returns, or a unit cannot be kept.
    pub fn solved(
        &self,
        params: &BakeParams,
        units: Units,
        step: impl Fn(usize) -> Result<(), BakeError> + Sync,
    ) -> Result<Solution, BakeError> {
        let finest = self.points.levels.last();
        let albedo: Vec<Vec3> = finest.map_or_else(Vec::new, |l| l.points.iter().map(|p| p.albedo).collect());
        solution(
            &self.bounce,
            self.bounce_level,
            &self.tree,
            &albedo,
            // T carries the last bounce.
            params.bounces.map(|n| n.saturating_sub(2)),
            params.epsilon,
            units,
            &step,
        )
    }
}

/// Length, in distances of the coarsest points, of the ways from receiver to sender that count in clusters' means.
/// At 1 a cluster of the coarsest level fills some tenth of a hemisphere, and its children have links of their own.
/// Of 0, 0.5 and 1 the bias of sibenik_points is −2.4, −2.0 and −1.5 % (docs/notebook/transfer.md).
const NEAR: f32 = 1.0;

/// How near lamps of trial lights come to surfaces, in distances of the coarsest points.
const SOFTNESS: f32 = 1.0;

/// The same of the lamps that links are chosen by: each is alone, and a lamp near a surface is what links are for.
const LAMP_SOFTNESS: f32 = 0.5;

/// Computes the operators over given points. `quantised` is what the file makes of a link.
///
/// # Errors
/// `watch` stops the bake, or a unit cannot be kept.
pub fn transport(
    surfaces: &dyn Surfaces,
    points: PointLevels,
    viewers: Viewers,
    params: &BakeParams,
    quantised: impl Fn(Vec3) -> Vec3 + Sync,
    units: Units,
    watch: &impl RowWatch,
) -> Result<Transport, BakeError> {
    let made = with_refinement(surfaces, &points, viewers, params, units, |r, levels| {
        watch.begin(most_rays(levels.iter().map(Level::len), r.rays));
        let mut bounces = bounce_sums(r, levels);
        let refined = refine(r, quantised, &mut bounces, units, watch)?;
        Ok((refined, bounces.operator(), r.bounce_level))
    })?;
    let Refining {
        outcome: (refined, bounce, bounce_level),
        tree,
        separations,
        rays,
    } = made;
    let mut made = Transport {
        rays: refined.rays + points.rays + rays,
        points,
        tree,
        separations,
        links: refined.links,
        bounce,
        bounce_level,
        gathered: refined.gathered,
        lost: refined.lost,
        dropped: refined.dropped,
        spared: refined.spared,
        idle_senders: (0, 0),
        row_bytes: refined.row_bytes,
    };
    if !params.keeps(Omittable::Senders) {
        leave_out_idle_senders(&mut made);
    }
    Ok(made)
}

/// Leaves out the finest sender levels to which no link leads: nothing ever asks for their clusters' means.
fn leave_out_idle_senders(made: &mut Transport) {
    let Transport {
        tree,
        links,
        bounce,
        bounce_level,
        idle_senders,
        ..
    } = made;
    let least = if bounce.nnz() == 0 { 0 } else { *bounce_level };
    let last = links.columns.iter().max().map_or(0, |&j| j as usize);
    let levels = tree.ranges.level_of(last).max(least) + 1;
    if levels >= tree.levels() || links.is_empty() {
        return;
    }
    let kept = tree.ranges.range(levels - 1).end;
    *idle_senders = (tree.levels() - levels, tree.ranges.total() - kept);
    let counts: Vec<usize> = (0..levels).map(|l| tree.ranges.range(l).len()).collect();
    links.senders = kept as u32;
    let parents = tree.parents[..levels - 1].to_vec();
    *tree = SenderTree::new(
        &counts,
        tree.cluster_of_point(levels - 1),
        parents,
        tree.importance.clone(),
    );
}

/// Who will look.
#[derive(Clone, Copy)]
pub struct Viewers<'a> {
    /// Where light is carried to.
    pub relevance: &'a Relevance,
    /// The cameras that alone will look; none: anybody may, from anywhere.
    pub cameras: &'a [Camera],
}

/// What came of a refinement that was prepared.
pub struct Refining<T> {
    /// What was wanted of it.
    pub outcome: T,
    /// The senders.
    pub tree: SenderTree,
    /// Points that surfaces part.
    pub separations: Separations,
    /// Rays cast to prepare it.
    pub rays: u64,
}

/// Prepares all that rows depend on, and does `work` with it.
///
/// # Errors
/// Those of `work`, or a unit cannot be kept.
pub fn with_refinement<T>(
    surfaces: &dyn Surfaces,
    points: &PointLevels,
    Viewers { relevance, cameras }: Viewers,
    params: &BakeParams,
    units: Units,
    work: impl FnOnce(&Refinement, &[Level]) -> Result<T, BakeError>,
) -> Result<Refining<T>, BakeError> {
    let levels = levels_of(points);
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let (separations, parents) = separation::find(surfaces, &levels);
    let nearest_point = NearestPoint::new(&levels[levels.len() - 1]);
    let near = NEAR * levels[0].disk_radius;
    let (importance, mut rays) = importance(surfaces, &nearest_point, near, relevance, params.seed, units)?;
    let SenderClusters { tree, pilots, finest } =
        sender_clusters(surfaces, points, importance, params, units)?;
    let lamps = |softness| Lamps {
        pilots: &pilots,
        places: &finest,
        coarse: levels[0].disk_radius,
        finest: levels[levels.len() - 1].disk_radius,
        softness,
    };
    let trials = TrialLights::new(&tree, &lamps(SOFTNESS));
    let finest_points = &points.levels[points.levels.len() - 1].points;
    let test_lights = TestLights::new(surfaces, &tree, finest_points, &lamps(LAMP_SOFTNESS));
    let places: Vec<Candidate> = points
        .levels
        .iter()
        .flat_map(|l| l.points.iter().copied())
        .collect();
    let handed_down = handed_down(&places, &parents);
    let (bounce_level, bounce_receivers) = bounce_levels(levels.len(), tree.levels());
    let mut worthwhile = Vec::new();
    if !cameras.is_empty() {
        // With one bounce only pixels ask for receivers; further ones start from what all points reflect.
        let first = match params.bounces {
            Some(1) => 1,
            _ => bounce_receivers + 1,
        };
        let (seen, cast) = seen_by(surfaces, cameras, &levels, &parents, first);
        worthwhile = seen;
        rays += cast;
    }
    let refinement = Refinement {
        surfaces,
        places: &places,
        ranges: &ranges,
        fine_from_coarse: &parents,
        separated_pairs: &separations.pairs,
        field: SenderField {
            points: nearest_point,
            near_separated: &separations.near,
            tree: &tree,
            trials: &trials.at_points,
        },
        trials: &trials,
        test_lights: &test_lights,
        coarse_positions: &levels[0].positions,
        rays: params.rays,
        epsilon: params.epsilon,
        bounce_level,
        bounce_receivers: params.needs_bounces().then_some(bounce_receivers),
        handed_down: &handed_down,
        worthwhile: &worthwhile,
        short_links: params.short_links(),
        seed: params.seed,
    };
    let outcome = work(&refinement, &levels)?;
    Ok(Refining {
        outcome,
        tree,
        separations,
        rays,
    })
}

/// The sender level on which bounces are made, and the receiver level whose gathers make their operator, of so many levels
/// of receivers and senders.
pub fn bounce_levels(receivers: usize, senders: usize) -> (usize, usize) {
    let level = 1.min(senders.saturating_sub(1));
    (level, (level + 3).min(receivers.saturating_sub(1)))
}

/// Of each point whether a finer level has it, too; empty where none is.
fn handed_down(places: &[Candidate], parents: &SparseMatrix) -> Vec<bool> {
    let mut handed_down = Vec::new();
    for (i, _) in places.iter().enumerate().filter(|place| place.1.inherited) {
        handed_down.resize(places.len(), false);
        for (parent, _) in row(parents, i) {
            handed_down[parent as usize] = true;
        }
    }
    handed_down
}

/// What makes K of the responses at the points of the bounce receiver level; of no points where it is not needed.
fn bounce_sums(r: &Refinement, levels: &[Level]) -> BounceSums {
    let tree = r.field.tree;
    let clusters = tree.ranges.range(r.bounce_level).len();
    let cluster_of_point = tree.cluster_of_point(r.bounce_level);
    let place = |position: Vec3, normal: Vec3| {
        let nearest = r.field.points.at(position, normal).unwrap_or(0) as usize;
        (cluster_of_point[nearest], weight(tree.importance[nearest]))
    };
    let points = levels
        .iter()
        .take(r.bounce_receivers.map_or(0, |level| level + 1))
        .enumerate();
    let places = points.flat_map(|(level, points)| {
        let first = r.ranges.range(level).start;
        (0..points.len()).map(move |point| {
            r.serves_bounces(level, first + point)
                .then(|| place(points.positions[point], points.normals[point]))
        })
    });
    BounceSums::new(places.collect(), clusters)
}
