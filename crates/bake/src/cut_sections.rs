//! From finest points to the light tree and the cuts of an asset.

use crate::bake::Progress;
use crate::convert;
use crate::error::BakeError;
use crate::light_samples::{Lights, in_tree};
use crate::params::{CutMode, CutParams, CutSites};
use crate::points::PointLevels;
use crate::surface_lights::surface_lights;
use crate::transport::levels_of;
use crate::vertex_sites::vertex_sites;
use crate::visibility::site_cuts;
use relight_format as format;
use relight_scene::surface::Surfaces;
use relight_scene::traced::TracedScene;

/// What cuts are made in.
pub struct World<'a> {
    /// Where surface samples are placed.
    pub scene: &'a TracedScene,
    /// The same, for rays.
    pub surfaces: &'a dyn Surfaces,
    /// The finest of them are the sites, or say which sides of vertices are.
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

impl World<'_> {
    /// Meshes as they will be stored, as far as sites depend on them.
    fn geometry(&self) -> format::Geometry {
        convert::geometry(self.scene.scene())
    }
}

/// Places lights, builds their tree and selects the cuts of the sites.
///
/// # Errors
/// `progress` said stop, or there are more elements than a file can count.
pub fn cut_sections(
    world: &World,
    params: &CutParams,
    seed: u64,
    progress: &dyn Progress,
) -> Result<CutSections, BakeError> {
    let sites = (world.points.levels.last()).map_or(&[][..], |level| &level.points);
    let finest = levels_of(world.points).pop();
    let vertices = match (params.sites, &finest) {
        (CutSites::Vertices, Some(finest)) => Some(vertex_sites(world.scene, &world.geometry(), finest)),
        _ => None,
    };
    let count = vertices.as_ref().map_or(sites.len(), Vec::len);
    progress.stage("cuts", Some(count as u64));
    let lights = match (params.mode, &finest) {
        (CutMode::Indirect, Some(finest)) => {
            Lights::Surface(surface_lights(world.scene, finest, params.lights as usize, seed))
        }
        _ => Lights::directions(params.lights),
    };
    let leaves = in_tree(world.surfaces, sites, &lights, params.beta);
    let step = |done| {
        progress.advance(done as u64);
        if progress.stopped() {
            Err(BakeError::Stopped)
        } else {
            Ok(())
        }
    };
    let made = match &vertices {
        Some(vertices) => site_cuts(world.surfaces, vertices, &leaves, params, step)?,
        None => site_cuts(world.surfaces, sites, &leaves, params, step)?,
    };
    // The largest means may not fit a narrow σ's steps: quantised, they do.
    let cuts = format::quantised_cuts(&format::Cuts {
        sites: match vertices {
            Some(_) => format::CutSites::Vertices,
            None => format::CutSites::Points,
        },
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
