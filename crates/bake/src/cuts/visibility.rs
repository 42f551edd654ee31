//! Visibility cuts: which of many lights each site sees, and for surface samples how much of them.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.2 (selection) and 4.1.
//!
//! Deviations. σ² is relative to the mean of what a site sees above its horizon, the share of its hemisphere for
//! directions: where light comes in through a small window, a few directions more or less are much of it
//! (docs/notebook/cuts.md). What lies below a site's own horizon counts for nothing: its BRDF is zero there, and a cut that had
//! zeros there would darken the neighbours that a pixel interpolates with and follow the horizon with small nodes.
//! And not every light gets a ray: see [`Sampler`].

use crate::cuts::light_samples::LightLeaves;
use crate::error::BakeError;
use crate::params::CutParams;
use crate::points::candidates::Candidate;
use crate::units::Units;
use rayon::prelude::*;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::cuts::{Selector, SiteCuts};
use relight_transport::sight::{Sampler, Sight};
use std::ops::Range;

/// Cuts of all sites and what making them took.
#[derive(Debug, Default)]
pub struct Cuts {
    /// The cuts.
    pub cuts: SiteCuts,
    /// Rays cast.
    pub rays: u64,
    /// Root of the mean squared difference between what was found and the cuts, over all lights above the sites'
    /// horizons, in the unit of the leaves.
    pub rms_error: f64,
}

/// Sites per parallel task.
pub const TASK: usize = 64;

/// Sites per unit of work: a second or two. A whole number of tasks, whose sums are added up one by one.
const SITES_PER_UNIT: usize = 16 * TASK;

/// Selects the cut of every site through the tree of `leaves`. `inputs` is the hash of sites and lights where units are kept
/// (see [`Units::inputs`]).
///
/// # Errors
/// What `step`, called with each number of sites done, returns; a unit cannot be kept; more elements than a file can count.
pub fn site_cuts(
    surfaces: &dyn Surfaces,
    sites: &[Candidate],
    leaves: &LightLeaves,
    params: &CutParams,
    (units, inputs): (Units, u128),
    step: impl Fn(usize) -> Result<(), BakeError> + Sync,
) -> Result<Cuts, BakeError> {
    let mut all = Vec::new();
    for range in cut_ranges(units, sites.len()) {
        all.extend(cut_unit(surfaces, sites, leaves, params, (units, inputs), &range, &step)?.0);
    }
    joined(all)
}

/// The ranges of sites that are units.
pub fn cut_ranges(units: Units, sites: usize) -> impl Iterator<Item = Range<usize>> {
    units.ranges(0..sites, SITES_PER_UNIT)
}

/// The cuts of the sites in one range.
///
/// # Errors
/// As [`site_cuts`].
pub fn cut_unit(
    surfaces: &dyn Surfaces,
    sites: &[Candidate],
    leaves: &LightLeaves,
    params: &CutParams,
    (units, inputs): (Units, u128),
    range: &Range<usize>,
    step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
) -> Result<UnitCuts, BakeError> {
    if let Some(parts) = units.taken("cuts", inputs, range) {
        step(range.len())?;
        return Ok(parts);
    }
    let made = parts(surfaces, &sites[range.clone()], leaves, params, step)?;
    units.keep("cuts", inputs, range, &made)?;
    Ok(made)
}

fn parts(
    surfaces: &dyn Surfaces,
    sites: &[Candidate],
    leaves: &LightLeaves,
    params: &CutParams,
    step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
) -> Result<UnitCuts, BakeError> {
    sites
        .par_chunks(TASK)
        .map_init(
            || {
                let sampler = Sampler::new(leaves.lights.len());
                (sampler, Selector::default(), Vec::new())
            },
            |(sampler, selector, rays), sites| {
                let mut part = TaskCuts::default();
                for site in sites {
                    part.rays += sampler.sample(&mut SiteSight {
                        surfaces,
                        leaves,
                        site,
                        scale: 1.0 / leaves.unit,
                        rays,
                    });
                    let (count, squares) = selector.select(
                        sampler.seen(),
                        params.sigma() * sampler.mean_seen().sqrt(),
                        params.most,
                        &mut part.heights,
                        &mut part.values,
                    );
                    part.count += count;
                    part.squares += squares;
                    part.ends.push(part.heights.len());
                }
                step(sites.len())?;
                Ok(part)
            },
        )
        .collect::<Result<_, BakeError>>()
        .map(UnitCuts)
}

/// Cuts of some sites, [`TASK`] by [`TASK`].
pub struct UnitCuts(pub Vec<TaskCuts>);

/// Cuts of at most [`TASK`] sites.
#[derive(Default)]
pub struct TaskCuts {
    /// Where each site's elements end.
    pub ends: Vec<usize>,
    /// Heights of the nodes.
    pub heights: Vec<u8>,
    /// Their means.
    pub values: Vec<f32>,
    /// Rays cast.
    pub rays: u64,
    /// Lights above the sites' horizons.
    pub count: f64,
    /// Sum of their squared errors.
    pub squares: f64,
}

fn joined(parts: Vec<TaskCuts>) -> Result<Cuts, BakeError> {
    let elements: usize = parts.iter().map(|p| p.heights.len()).sum();
    if elements > u32::MAX as usize {
        return Err(BakeError::TooManyCutElements { elements });
    }
    let mut all = Cuts::default();
    all.cuts.offsets.push(0);
    let (mut count, mut squares) = (0.0, 0.0);
    for part in parts {
        let start = all.cuts.heights.len();
        all.cuts
            .offsets
            .extend(part.ends.iter().map(|&end| (start + end) as u32));
        all.cuts.heights.extend(part.heights);
        all.cuts.values.extend(part.values);
        all.rays += part.rays;
        count += part.count;
        squares += part.squares;
    }
    if count > 0.0 {
        all.rms_error = (squares / count).sqrt();
    }
    Ok(all)
}

/// What a site sees of the leaves of a tree.
struct SiteSight<'a> {
    surfaces: &'a dyn Surfaces,
    leaves: &'a LightLeaves,
    site: &'a Candidate,
    /// One over the unit in which lights count.
    scale: f32,
    rays: &'a mut Vec<Ray>,
}

impl Sight for SiteSight<'_> {
    fn factor(&self, light: usize) -> f32 {
        self.leaves.lights.factor(self.site, light) * self.scale
    }

    fn occluded(&mut self, lights: &[u32], dark: &mut [bool]) {
        self.rays.clear();
        let ray = |&light: &u32| self.leaves.lights.ray(self.site, light as usize);
        self.rays.extend(lights.iter().map(ray));
        self.surfaces.occluded_packet(self.rays, dark);
    }
}
