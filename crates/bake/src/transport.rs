//! Points and operators of a scene: the bake without the file.

use crate::bounces::bounce_operator;
use crate::candidates::Candidate;
use crate::error::BakeError;
use crate::gather::SenderField;
use crate::params::BakeParams;
use crate::points::PointLevels;
use crate::refine::{Refined, Refinement, refine};
use crate::select::SenderTraits;
use glam::Vec3;
use relight_scene::surface::Surfaces;
use relight_transport::basis::Level;
use relight_transport::links::Links;
use relight_transport::pyramid::{LevelRanges, SenderPyramid, fine_from_coarse};
use relight_transport::sparse::Rows;

/// All that the asset stores of a scene's transport.
#[derive(Debug)]
pub struct Transport {
    /// Points of every level.
    pub points: PointLevels,
    /// T.
    pub links: Links,
    /// K: the flat bounce operator.
    pub bounce: Rows,
    /// Sender level on which K works.
    pub bounce_level: usize,
    /// Receivers gathered per level.
    pub gathered: Vec<usize>,
    /// Rays cast in all stages.
    pub rays: u64,
    /// Rays of the refinement that met a surface without points.
    pub lost: u64,
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

/// Computes the operators over given points.
pub fn transport(
    surfaces: &dyn Surfaces,
    points: PointLevels,
    params: &BakeParams,
    quantised: impl Fn(Vec3) -> Vec3 + Sync,
    step: impl Fn(usize) -> Result<(), BakeError> + Sync,
) -> Result<Transport, BakeError> {
    let levels = levels_of(&points);
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let parents = fine_from_coarse(&levels);
    let finest = &levels[levels.len() - 1];
    let senders = &levels[..params.sender_levels.min(levels.len())];
    let finest_sender = &senders[senders.len() - 1];
    let senders_at_points = finest_sender.covering(&finest.positions, &finest.normals);
    let areas = finest.areas();
    let pyramid = SenderPyramid::new(senders, &senders_at_points, &areas);
    let albedo: Vec<Vec3> = points.levels[levels.len() - 1]
        .points
        .iter()
        .map(|p| p.albedo)
        .collect();
    let traits = sender_traits(senders, &pyramid, &albedo);
    let places: Vec<Candidate> = points
        .levels
        .iter()
        .flat_map(|l| l.points.iter().copied())
        .collect();
    let bounce_level = 1.min(senders.len() - 1);
    let bounce_receivers = (bounce_level + 1).min(levels.len() - 1);
    let refinement = Refinement {
        surfaces,
        places: &places,
        ranges: &ranges,
        fine_from_coarse: &parents,
        field: SenderField {
            points: finest,
            senders_at_points: &senders_at_points,
            fine_from_coarse: &pyramid.fine_from_coarse,
            ranges: &pyramid.ranges,
        },
        senders: &traits,
        rays: params.rays,
        epsilon: params.epsilon,
        bounce_level,
        bounce_receivers,
        seed: params.seed,
    };
    let Refined {
        links,
        bounce_rows,
        gathered,
        rays,
        lost,
    } = refine(&refinement, quantised, step)?;
    let receivers = &levels[bounce_receivers];
    let functions = levels[bounce_level].covering(&receivers.positions, &receivers.normals);
    let bounce = bounce_operator(&bounce_rows, &functions, &receivers.areas());
    let rays = rays + points.rays;
    Ok(Transport {
        points,
        links,
        bounce,
        bounce_level,
        gathered,
        rays,
        lost,
    })
}

fn sender_traits(senders: &[Level], pyramid: &SenderPyramid, albedo: &[Vec3]) -> SenderTraits {
    let reflectance = pyramid
        .pulled(albedo)
        .into_iter()
        .flatten()
        .map(|a| a.max_element())
        .collect();
    let ranges = pyramid.ranges.clone();
    let level_of: Vec<u8> = (0..senders.len())
        .flat_map(|l| std::iter::repeat_n(l as u8, senders[l].len()))
        .collect();
    let neighbours = Rows::build(ranges.total(), ranges.total(), |j, row| {
        let level = level_of[j] as usize;
        if level == 0 {
            return;
        }
        let start = ranges.range(level).start;
        let own = &senders[level];
        own.weights_at(own.positions[j - start], own.normals[j - start], |k, w| {
            if k as usize != j - start {
                row.push((k + start as u32, w));
            }
        });
    });
    let coarse_positions = senders[0].positions.clone();
    SenderTraits {
        ranges,
        reflectance,
        neighbours,
        coarse_positions,
    }
}
