//! From finest points to the light tree and the cuts of an asset.

use crate::cuts::light_samples::{LightLeaves, Lights, Ordered, order};
use crate::cuts::surface_lights::surface_lights;
use crate::cuts::visibility::{cut_ranges, cut_unit, site_cuts};
use crate::error::BakeError;
use crate::params::{CutMode, CutParams};
use crate::points::candidates::Candidate;
use crate::points::poisson::{PointLevels, levels_of};
use crate::progress::Progress;
use crate::units::Units;
use crate::units::key::Key;
use relight_format as format;
use relight_scene::surface::Surfaces;
use relight_scene::traced::TracedScene;
use std::ops::Range;

/// What cuts are made in.
pub struct World<'a> {
    /// Where surface samples are placed.
    pub scene: &'a TracedScene,
    /// The same, for rays.
    pub surfaces: &'a dyn Surfaces,
    /// The finest of them are the sites.
    pub points: &'a PointLevels,
}

/// Sections of an asset with visibility cuts.
pub struct CutSections {
    /// The lights.
    pub light_tree: format::LightTree,
    /// The cuts.
    pub cuts: format::Cuts,
    /// Their error, in the cuts' unit.
    pub estimates: format::Estimates,
    /// Rays cast.
    pub rays: u64,
}

/// Where cuts stand and what they cluster.
struct Layout<'a> {
    points: &'a [Candidate],
    leaves: LightLeaves,
    /// Hash of sites, lights and settings.
    inputs: u128,
}

fn layout<'a>(
    world: &World<'a>,
    params: &CutParams,
    seed: u64,
    units: Units,
) -> Result<Layout<'a>, BakeError> {
    let points = (world.points.levels.last()).map_or(&[][..], |level| &level.points);
    let finest = levels_of(world.points).pop();
    let lights = match (params.mode, &finest) {
        (CutMode::Indirect, Some(finest)) => {
            Lights::Surface(surface_lights(world.scene, finest, params.lights as usize, seed))
        }
        _ => Lights::directions(params.lights),
    };
    // Lights and sites follow from surfaces, points and these.
    let add_common = |key: &mut Key| {
        key.places(points);
        finest.iter().for_each(|level| {
            key.level(level);
        });
        key.u64s(&[params.mode as u64, u64::from(params.lights), seed])
            .f32s(&[params.beta]);
    };
    let ordered: Ordered =
        units.taken_or_made("light_tree", units.inputs(add_common), &(0..lights.len()), || {
            Ok(order(world.surfaces, points, &lights, params.beta))
        })?;
    let inputs = units.inputs(|key| {
        add_common(key);
        key.u64s(&[params.most as u64]).f32s(&[params.sigma]);
    });
    Ok(Layout {
        points,
        leaves: LightLeaves::new(&lights, &ordered),
        inputs,
    })
}

/// Makes the tree, and the units of cuts that are part `part.0` of `part.1`.
///
/// # Errors
/// As [`cut_sections`].
pub fn cut_part(
    world: &World,
    params: &CutParams,
    seed: u64,
    units: Units,
    part: Option<(usize, usize)>,
    progress: &dyn Progress,
) -> Result<(), BakeError> {
    let layout = layout(world, params, seed, units)?;
    let Some((index, of)) = part else { return Ok(()) };
    let ranges: Vec<Range<usize>> = cut_ranges(units, layout.points.len()).collect();
    let own = &ranges[index * ranges.len() / of..(index + 1) * ranges.len() / of];
    progress.stage("cuts", Some(own.iter().map(|r| r.len() as u64).sum()));
    let step = |done| watched(progress, done);
    let at = (units, layout.inputs);
    for range in own {
        cut_unit(
            world.surfaces,
            layout.points,
            &layout.leaves,
            params,
            at,
            range,
            &step,
        )?;
    }
    Ok(())
}

fn watched(progress: &dyn Progress, done: usize) -> Result<(), BakeError> {
    progress.advance(done as u64);
    if progress.stopped() {
        Err(BakeError::Stopped)
    } else {
        Ok(())
    }
}

/// Places lights, builds their tree and selects the cuts of the sites.
///
/// # Errors
/// `progress` said stop, a unit cannot be kept, or there are more elements than a file can count.
pub fn cut_sections(
    world: &World,
    params: &CutParams,
    seed: u64,
    units: Units,
    progress: &dyn Progress,
) -> Result<CutSections, BakeError> {
    progress.stage("light_tree", None);
    let Layout {
        points,
        leaves,
        inputs,
    } = layout(world, params, seed, units)?;
    progress.stage("cuts", Some(points.len() as u64));
    let step = |done| watched(progress, done);
    let at = (units, inputs);
    let made = site_cuts(world.surfaces, points, &leaves, params, at, step)?;
    // The largest means may not fit a narrow σ's steps: quantised, they do.
    let cuts = format::quantised_cuts(&format::Cuts {
        sigma: params.sigma(),
        unit: leaves.unit,
        row_offsets: made.cuts.offsets,
        heights: made.cuts.heights,
        values: made.cuts.values,
    });
    Ok(CutSections {
        light_tree: format::LightTree {
            lights: stored(leaves.lights),
        },
        cuts,
        estimates: format::Estimates {
            values: vec![("cut_rms_error".to_owned(), made.rms_error)],
        },
        rays: leaves.rays + made.rays,
    })
}

fn stored(lights: Lights) -> format::LightSamples {
    match lights {
        Lights::Directions { order, .. } => format::LightSamples::Environment { order },
        Lights::Surface(samples) => format::LightSamples::Surface {
            area: samples.area,
            positions: samples.positions.iter().map(|p| p.to_array()).collect(),
            normals: samples.normals.iter().map(|n| n.to_array()).collect(),
        },
    }
}
