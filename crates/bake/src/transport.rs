//! Points and operators of a scene: the bake without the file.

use crate::bounces::bounce_operator;
use crate::candidates::Candidate;
use crate::error::BakeError;
use crate::gather::SenderField;
use crate::importance::importance;
use crate::params::{BakeParams, Part};
use crate::points::PointLevels;
use crate::refine::{Refined, Refinement, Spared, refine};
use crate::seen::seen_by;
use crate::select::TypicalLight;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::camera::Camera;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::links::Links;
use relight_transport::pyramid::{LevelRanges, fine_from_coarse};
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere};
use relight_transport::senders::{PILOTS, SenderTree, Signed, nearest_seeds, weight};
use relight_transport::sparse::Rows;

/// All that the asset stores of a scene's transport.
#[derive(Debug)]
pub struct Transport {
    /// Points of every level.
    pub points: PointLevels,
    /// Senders.
    pub tree: SenderTree,
    /// T.
    pub links: Links,
    /// K: the flat bounce operator; empty where it is not needed.
    pub bounce: Rows,
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
/// Of 0, 0.5 and 1 the bias of sibenik_points is −2.4, −2.0 and −1.5 % (docs/transfer.md).
const NEAR: f32 = 1.0;

/// Radiosity in typical light of what no lamp lights, to 1 for what all light. With 0 the bias of dim scenes is
/// smaller by a tenth and errors larger by 3 % (docs/transfer.md).
const AMBIENT: f32 = 0.1;

/// Computes the operators over given points. `cameras`: those that alone will look; none for all.
pub fn transport(
    surfaces: &dyn Surfaces,
    points: PointLevels,
    viewpoints: &[Vec3],
    cameras: &[Camera],
    params: &BakeParams,
    quantised: impl Fn(Vec3) -> Vec3 + Sync,
    step: impl Fn(usize) -> Result<(), BakeError> + Sync,
) -> Result<Transport, BakeError> {
    let levels = levels_of(&points);
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let parents = fine_from_coarse(&levels);
    let finest = &levels[levels.len() - 1];
    let nearest_point = NearestPoint::new(finest);
    let near = NEAR * levels[0].disk_radius;
    let (importance, importance_rays) = importance(surfaces, &nearest_point, near, viewpoints, params.seed);
    let (tree, typical) = sender_tree(surfaces, &points, importance, params);
    let places: Vec<Candidate> = points
        .levels
        .iter()
        .flat_map(|l| l.points.iter().copied())
        .collect();
    let bounce_level = 1.min(tree.levels() - 1);
    let bounce_receivers = (bounce_level + 3).min(levels.len() - 1);
    let needs_bounces = params.needs_bounces();
    let (wanted, camera_rays) = match cameras {
        [] => (Vec::new(), 0),
        _ => {
            // With one bounce only pixels ask for receivers; further ones start from what all points reflect.
            let first = match params.bounces {
                Some(1) => 1,
                _ => bounce_receivers + 1,
            };
            seen_by(surfaces, cameras, &levels, &parents, first)
        }
    };
    let refinement = Refinement {
        surfaces,
        places: &places,
        ranges: &ranges,
        fine_from_coarse: &parents,
        field: SenderField {
            points: nearest_point,
            tree: &tree,
        },
        typical: &typical,
        coarse_positions: &levels[0].positions,
        rays: params.rays,
        epsilon: params.epsilon,
        bounce_level,
        bounce_receivers: needs_bounces.then_some(bounce_receivers),
        wanted: &wanted,
        seed: params.seed,
    };
    let Refined {
        links,
        bounce_rows,
        gathered,
        rays,
        lost,
        dropped,
        spared,
    } = refine(&refinement, quantised, step)?;
    let clusters = tree.ranges.range(bounce_level).len();
    let bounce = if needs_bounces {
        let receivers = &levels[bounce_receivers];
        averaged(&refinement, receivers, &bounce_rows, bounce_level)
    } else {
        Rows {
            columns: clusters as u32,
            offsets: vec![0; clusters + 1],
            entries: Vec::new(),
        }
    };
    let rays = rays + points.rays + importance_rays + camera_rays;
    let mut made = Transport {
        points,
        tree,
        links,
        bounce,
        bounce_level,
        gathered,
        rays,
        lost,
        dropped,
        spared,
        idle_senders: (0, 0),
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
    let least = if bounce.entries.is_empty() {
        0
    } else {
        *bounce_level
    };
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

/// The bounce operator from the gathers of `receivers`.
fn averaged(
    refinement: &Refinement,
    receivers: &Level,
    bounce_rows: &[Vec<(u32, f32)>],
    bounce_level: usize,
) -> Rows {
    let tree = refinement.field.tree;
    let cluster_of_point = tree.cluster_of_point(bounce_level);
    let nearest: Vec<usize> = (0..receivers.len())
        .map(|i| {
            refinement
                .field
                .points
                .at(receivers.positions[i], receivers.normals[i])
                .unwrap_or(0) as usize
        })
        .collect();
    let cluster_of_receiver: Vec<u32> = nearest.iter().map(|&p| cluster_of_point[p]).collect();
    let weights: Vec<f32> = nearest.iter().map(|&p| weight(tree.importance[p])).collect();
    let clusters = tree.ranges.range(bounce_level).len();
    bounce_operator(bounce_rows, &cluster_of_receiver, &weights, clusters)
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

fn signed(surfaces: &dyn Surfaces, places: &[Candidate], pilots: &[Vec3]) -> Vec<Signed> {
    places
        .par_iter()
        .with_min_len(64)
        .map_init(
            || (Vec::new(), vec![false; PILOTS]),
            |(rays, occluded): &mut (Vec<Ray>, Vec<bool>), place| {
                rays.clear();
                rays.extend(pilots.iter().map(|&pilot| Ray {
                    origin: place.origin,
                    direction: pilot - place.origin,
                    t_min: 0.0,
                    t_max: 1.0,
                }));
                surfaces.occluded_packet(rays, occluded);
                let mut signature = 0u128;
                for (bit, (ray, dark)) in rays.iter().zip(occluded.iter()).enumerate() {
                    if !dark && ray.direction.dot(place.geometric_normal) > 0.0 {
                        signature |= 1 << bit;
                    }
                }
                Signed {
                    position: place.position,
                    normal: place.normal,
                    signature,
                }
            },
        )
        .collect()
}

/// The senders, and how they are lit by the pilots in the mean.
fn sender_tree(
    surfaces: &dyn Surfaces,
    points: &PointLevels,
    importance: Vec<u8>,
    params: &BakeParams,
) -> (SenderTree, TypicalLight) {
    let pilots = pilots(surfaces, points, params.seed);
    let sending = params.sender_levels.min(points.levels.len());
    let finest = signed(surfaces, &points.levels[points.levels.len() - 1].points, &pilots);
    let seeds: Vec<Vec<Signed>> = points.levels[..sending]
        .iter()
        .map(|level| signed(surfaces, &level.points, &pilots))
        .collect();
    let spacing = |level: usize| points.levels[level].disk_radius;
    let leaf_of_point = nearest_seeds(&finest, &seeds[sending - 1], spacing(sending - 1));
    let parents = (1..sending)
        .map(|l| nearest_seeds(&seeds[l], &seeds[l - 1], spacing(l - 1)))
        .collect();
    let counts: Vec<usize> = seeds.iter().map(Vec::len).collect();
    let tree = SenderTree::new(&counts, leaf_of_point, parents, importance);
    let lit: Vec<f32> = finest
        .iter()
        .map(|place| AMBIENT + place.signature.count_ones() as f32 / PILOTS as f32)
        .collect();
    let typical = TypicalLight::new(&tree, &lit);
    (tree, typical)
}
