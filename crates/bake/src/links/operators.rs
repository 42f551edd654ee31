//! Points and operators of a scene: the bake without the file.

use crate::error::BakeError;
use crate::links::bounces::BounceSums;
use crate::links::fitting::TrialLights;
use crate::links::gather::SenderField;
use crate::links::refinement::{Refinement, RowWatch, Spared, most_rays, refine};
use crate::links::test_lights::Lamps;
use crate::params::{BakeParams, Part};
use crate::points::candidates::Candidate;
use crate::points::poisson::PointLevels;
use crate::points::seen::{open_ways, seen_by};
use crate::points::separation::{self, Parted};
use crate::senders::importance::importance;
use crate::units::Units;
use glam::{Vec2, Vec3};
use relight_scene::camera::Camera;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::links::Links;
use relight_transport::pyramid::LevelRanges;
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere};
use relight_transport::senders::{PILOTS, SenderTree, Signed, nearest_seeds, weight};
use relight_transport::sparse::SparseMatrix;

/// All that the asset stores of a scene's transport.
#[derive(Debug)]
pub struct Transport {
    /// Points of every level.
    pub points: PointLevels,
    /// Senders.
    pub tree: SenderTree,
    /// Points that surfaces part from each other.
    pub parted: Parted,
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

/// The basis of the points.
pub fn levels_of(points: &PointLevels) -> Vec<Level> {
    points
        .levels
        .iter()
        .map(|level| {
            Level::new(
                level.points.iter().map(|p| p.position).collect(),
                level.points.iter().map(|p| p.normal).collect(),
                level.disk_radius,
                level.support_radius,
            )
        })
        .collect()
}

/// Length, in distances of the coarsest points, of the ways from receiver to sender that count in clusters' means.
/// At 1 a cluster of the coarsest level fills some tenth of a hemisphere, and its children have links of their own.
/// Of 0, 0.5 and 1 the bias of sibenik_points is −2.4, −2.0 and −1.5 % (docs/notebook/transfer.md).
const NEAR: f32 = 1.0;

/// How near lamps of trial lights come to surfaces, in distances of the coarsest points.
const SOFTNESS: f32 = 1.0;

/// The same of the lamps that links are chosen by: each is alone, and a lamp near a surface is what links are for.
const LAMP_SOFTNESS: f32 = 0.5;

/// Computes the operators over given points. `cameras`: those that alone will look; none for all. `step` is told of rays as they are cast and may stop the bake.
///
/// # Errors
/// What `step` returns.
pub fn transport(
    surfaces: &dyn Surfaces,
    points: PointLevels,
    viewpoints: &[Vec3],
    cameras: &[Camera],
    params: &BakeParams,
    quantised: impl Fn(Vec3) -> Vec3 + Sync,
    step: impl Fn(usize) -> Result<(), BakeError> + Sync,
) -> Result<Transport, BakeError> {
    let viewers = (viewpoints, cameras);
    transport_in_units(surfaces, points, viewers, params, quantised, Units::none(), &step)
}

/// As [`transport`], in units.
///
/// # Errors
/// `watch` stops the bake, or a unit cannot be kept.
pub fn transport_in_units(
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
        parted,
        rays,
    } = made;
    let mut made = Transport {
        rays: refined.rays + points.rays + rays,
        points,
        tree,
        parted,
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
    if !params.keeps(Part::Senders) {
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
    let used = (0..tree.levels()).find(|&l| last < tree.ranges.range(l).end);
    let levels = used.unwrap_or(0).max(least) + 1;
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

/// Where light is carried to, and the cameras that alone will look, if it is they alone.
pub type Viewers<'a> = (&'a [Vec3], &'a [Camera]);

/// What came of a refinement that was prepared.
pub struct Refining<T> {
    /// What was wanted of it.
    pub outcome: T,
    /// The senders.
    pub tree: SenderTree,
    /// Points that surfaces part.
    pub parted: Parted,
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
    (viewpoints, cameras): Viewers,
    params: &BakeParams,
    units: Units,
    work: impl FnOnce(&Refinement, &[Level]) -> Result<T, BakeError>,
) -> Result<Refining<T>, BakeError> {
    let levels = levels_of(points);
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let (parted, parents) = separation::find(surfaces, &levels);
    let nearest_point = NearestPoint::new(&levels[levels.len() - 1]);
    let near = NEAR * levels[0].disk_radius;
    let (importance, mut rays) = importance(surfaces, &nearest_point, near, viewpoints, params.seed, units)?;
    let (tree, trials, lamps) = sender_tree(surfaces, points, importance, params, units)?;
    let places: Vec<Candidate> = points
        .levels
        .iter()
        .flat_map(|l| l.points.iter().copied())
        .collect();
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
        parted_pairs: &parted.pairs,
        field: SenderField {
            points: nearest_point,
            near_parted: &parted.near,
            tree: &tree,
            trials: &trials.at_points,
        },
        trials: &trials,
        lamps: &lamps,
        coarse_positions: &levels[0].positions,
        rays: params.rays,
        epsilon: params.epsilon,
        bounce_level,
        bounce_receivers: params.needs_bounces().then_some(bounce_receivers),
        worthwhile: &worthwhile,
        short_links: params.short_links(),
        seed: params.seed,
    };
    let outcome = work(&refinement, &levels)?;
    Ok(Refining {
        outcome,
        tree,
        parted,
        rays,
    })
}

/// The sender level on which bounces are made, and the receiver level whose gathers make their operator, of so many levels
/// of receivers and senders.
pub fn bounce_levels(receivers: usize, senders: usize) -> (usize, usize) {
    let level = 1.min(senders.saturating_sub(1));
    (level, (level + 3).min(receivers.saturating_sub(1)))
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
    let places = r.bounce_receivers.map_or(Vec::new(), |level| {
        let Level {
            positions, normals, ..
        } = &levels[level];
        positions
            .iter()
            .zip(normals)
            .map(|(&p, &n)| place(p, n))
            .collect()
    });
    BounceSums::new(places, clusters)
}

/// Stage number of the pilots' random stream.
const STAGE_PILOTS: u32 = 4;

/// Places in open space: on straight ways between surfaces that importance particles take.
fn pilots(surfaces: &dyn Surfaces, points: &PointLevels, seed: u64) -> Vec<Vec3> {
    let places = &points.levels[points.levels.len() - 1].points;
    (0..PILOTS)
        .map(|i| {
            let mut s = Stream::new(seed, STAGE_PILOTS, i as u64);
            let place = &places[((s.uniform() * places.len() as f32) as usize).min(places.len() - 1)];
            let direction = Frame::around(place.geometric_normal)
                .world_from_local(cosine_hemisphere(Vec2::new(s.uniform(), s.uniform())));
            let ray = Ray {
                origin: place.origin,
                direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            let reach = surfaces
                .closest_hit(&ray)
                .map_or(points.levels[0].disk_radius, |hit| hit.t);
            place.origin + direction * (reach * s.uniform())
        })
        .collect()
}

/// Places per unit of work: 128 rays each, a second or so.
const PLACES_PER_UNIT: usize = 1 << 15;

/// Which pilots places see, a bit each.
pub struct Signatures(pub Vec<u128>);

fn signed(
    surfaces: &dyn Surfaces,
    places: &[Candidate],
    pilots: &[Vec3],
    units: Units,
) -> Result<Vec<Signed>, BakeError> {
    let inputs = units.inputs(|key| {
        key.places(places).vectors(pilots.iter());
    });
    let mut signed = Vec::with_capacity(places.len());
    for range in units.ranges(0..places.len(), PLACES_PER_UNIT) {
        let places = &places[range.clone()];
        let Signatures(seen) = units.taken_or_made("pilots", inputs, &range, || {
            Ok(signatures(surfaces, places, pilots))
        })?;
        signed.extend(places.iter().zip(seen).map(|(place, signature)| Signed {
            position: place.position,
            normal: place.normal,
            signature,
        }));
    }
    Ok(signed)
}

fn signatures(surfaces: &dyn Surfaces, places: &[Candidate], pilots: &[Vec3]) -> Signatures {
    let to_pilot = |place: &Candidate, k: usize| (pilots[k] - place.origin, 1.0);
    Signatures(open_ways(surfaces, places, PILOTS, to_pilot))
}

/// The senders, and how lamps at the pilots light them.
fn sender_tree(
    surfaces: &dyn Surfaces,
    points: &PointLevels,
    importance: Vec<u8>,
    params: &BakeParams,
    units: Units,
) -> Result<(SenderTree, TrialLights, Lamps), BakeError> {
    let pilots = pilots(surfaces, points, params.seed);
    let sending = params.sender_levels.min(points.levels.len());
    let finest = signed(
        surfaces,
        &points.levels[points.levels.len() - 1].points,
        &pilots,
        units,
    )?;
    let seeds: Vec<Vec<Signed>> = points.levels[..sending]
        .iter()
        .map(|level| signed(surfaces, &level.points, &pilots, units))
        .collect::<Result<_, BakeError>>()?;
    let spacing = |level: usize| points.levels[level].disk_radius;
    let leaf_of_point = nearest_seeds(&finest, &seeds[sending - 1], spacing(sending - 1));
    let parents = (1..sending)
        .map(|l| nearest_seeds(&seeds[l], &seeds[l - 1], spacing(l - 1)))
        .collect();
    let counts: Vec<usize> = seeds.iter().map(Vec::len).collect();
    let tree = SenderTree::new(&counts, leaf_of_point, parents, importance);
    let trials = TrialLights::new(&tree, &finest, &pilots, SOFTNESS * points.levels[0].disk_radius);
    let places = &points.levels[points.levels.len() - 1].points;
    let softness = LAMP_SOFTNESS * points.levels[0].disk_radius;
    let lamps = Lamps::new(surfaces, &tree, places, &finest, &pilots, softness);
    Ok((tree, trials, lamps))
}
