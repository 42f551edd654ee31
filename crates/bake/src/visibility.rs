//! Visibility cuts: which of many lights each site sees, and for surface samples how much of them.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.2 (selection) and 4.1.
//!
//! Deviations. σ² is relative to the mean of what a site sees above its horizon, the share of its hemisphere for
//! directions: where light comes in through a small window, a few directions more or less are much of it
//! (docs/cuts.md). What lies below a site's own horizon counts for nothing: its BRDF is zero there, and a cut that had
//! zeros there would darken the neighbours that a pixel interpolates with and follow the horizon with small nodes.
//! And not every light gets a ray: see [`Sampler`].

use crate::candidates::Candidate;
use crate::error::BakeError;
use crate::light_samples::{LightLeaves, Lights};
use crate::params::CutParams;
use crate::units::Units;
use rayon::prelude::*;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::cuts::{Selector, SiteCuts};
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

/// A place that looks at lights.
pub trait Site: Sync {
    /// What an unoccluded light counts for, as [`Lights::factor`] says; NaN for what counts for nothing.
    fn factor(&self, lights: &Lights, light: usize) -> f32;

    /// The shadow ray to a light whose factor is above 0.
    fn ray(&self, lights: &Lights, light: usize) -> Ray;
}

impl Site for Candidate {
    #[inline]
    fn factor(&self, lights: &Lights, light: usize) -> f32 {
        lights.factor(self, light)
    }

    #[inline]
    fn ray(&self, lights: &Lights, light: usize) -> Ray {
        lights.ray(self, light)
    }
}

/// Sites per parallel task.
pub const TASK: usize = 64;

/// Sites per unit of work: a second or two. A whole number of tasks, whose sums are added up one by one.
const SITES_PER_UNIT: usize = 16 * TASK;

/// Selects the cut of every site through the tree of `leaves`.
///
/// # Errors
/// What `step`, called with each number of sites done, returns.
pub fn site_cuts(
    surfaces: &dyn Surfaces,
    sites: &[impl Site],
    leaves: &LightLeaves,
    params: &CutParams,
    step: impl Fn(usize) -> Result<(), BakeError> + Sync,
) -> Result<Cuts, BakeError> {
    joined(parts(surfaces, sites, leaves, params, &step)?.0)
}

/// As [`site_cuts`], in units; `inputs` is the hash of sites and lights (see [`Units::inputs`]).
///
/// # Errors
/// As [`site_cuts`], or a unit cannot be kept.
pub fn site_cuts_in_units(
    surfaces: &dyn Surfaces,
    sites: &[impl Site],
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
/// As [`site_cuts_in_units`].
pub fn cut_unit(
    surfaces: &dyn Surfaces,
    sites: &[impl Site],
    leaves: &LightLeaves,
    params: &CutParams,
    (units, inputs): (Units, u128),
    range: &Range<usize>,
    step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
) -> Result<Parts, BakeError> {
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
    sites: &[impl Site],
    leaves: &LightLeaves,
    params: &CutParams,
    step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
) -> Result<Parts, BakeError> {
    sites
        .par_chunks(TASK)
        .map_init(
            || (Sampler::new(leaves, params.every_light), Selector::default()),
            |(sampler, selector), sites| {
                let mut part = Part::default();
                for site in sites {
                    part.rays += sampler.sample(surfaces, site);
                    let (count, squares) = selector.select(
                        &sampler.seen,
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
        .map(Parts)
}

/// Cuts of some sites, [`TASK`] by [`TASK`].
pub struct Parts(pub Vec<Part>);

/// Cuts of at most [`TASK`] sites.
#[derive(Default)]
pub struct Part {
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

fn joined(parts: Vec<Part>) -> Result<Cuts, BakeError> {
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

/// Height of the nodes that are looked at first: 64 neighbouring lights.
const FIRST_HEIGHT: u32 = 6;
/// Lights that get a ray in every node that is looked at: one in each of its 8 parts.
const RAYS_HEIGHT: u32 = 3;

/// Finds which lights a site sees, casting rays at some of them: a node of 64 lights gets 8 rays, spread over its parts.
/// If all end alike, so do those that were not cast; otherwise its halves get 8 rays each, those that were cast
/// included, and so on down to single lights. Edges of shadows so are found ray by ray, and what lies in the middle of
/// light or shadow costs an eighth. What is lost are occluders that fall between 8 rays (docs/cuts.md has the figures).
/// How much an unoccluded light counts for is known without rays.
struct Sampler<'a> {
    lights: &'a Lights,
    /// One over the unit in which lights count.
    scale: f32,
    every_light: bool,
    /// Per light: 1 for visible, 0 for occluded, times its factor once all are known; NaN for what lies below the
    /// horizon.
    seen: Vec<f32>,
    /// Per light what it counts for unoccluded, in units.
    factors: Vec<f32>,
    rays: Vec<Ray>,
    targets: Vec<u32>,
    occluded: Vec<bool>,
    /// Nodes of the present height that are still open, and those of the next.
    open: Vec<u32>,
    next: Vec<u32>,
}

/// In `seen`: above the horizon, not known yet.
const UNKNOWN: f32 = -1.0;
/// In `seen`: above the horizon, but facing away.
const AWAY: f32 = -2.0;

impl<'a> Sampler<'a> {
    fn new(leaves: &'a LightLeaves, every_light: bool) -> Sampler<'a> {
        Sampler {
            lights: &leaves.lights,
            scale: 1.0 / leaves.unit,
            every_light,
            seen: vec![0.0; leaves.lights.len()],
            factors: vec![0.0; leaves.lights.len()],
            rays: Vec::new(),
            targets: Vec::new(),
            occluded: Vec::new(),
            open: Vec::new(),
            next: Vec::new(),
        }
    }

    /// Fills `seen`; returns the number of rays cast.
    fn sample(&mut self, surfaces: &dyn Surfaces, site: &impl Site) -> u64 {
        for (light, (seen, factor)) in self.seen.iter_mut().zip(&mut self.factors).enumerate() {
            *factor = site.factor(self.lights, light) * self.scale;
            *seen = match *factor {
                f if f > 0.0 => UNKNOWN,
                0.0 => AWAY,
                _ => f32::NAN,
            };
        }
        let mut cast = 0;
        let first = if self.every_light {
            RAYS_HEIGHT
        } else {
            FIRST_HEIGHT
        };
        self.open.clear();
        self.open.extend(0..(self.lights.len() >> first) as u32);
        for height in (RAYS_HEIGHT..=first).rev() {
            self.aim(site, height);
            cast += self.cast(surfaces);
            self.next.clear();
            for i in 0..self.open.len() {
                self.settle(self.open[i], height);
            }
            std::mem::swap(&mut self.open, &mut self.next);
        }
        for (seen, factor) in self.seen.iter_mut().zip(&self.factors) {
            *seen = if *seen == AWAY { 0.0 } else { *seen * factor };
        }
        cast
    }

    /// Mean of what is seen of the lights above the horizon.
    fn mean_seen(&self) -> f32 {
        let (mut above, mut seen) = (0.0, 0.0);
        for light in self.seen.iter().filter(|s| !s.is_nan()) {
            above += 1.0;
            seen += light;
        }
        if above > 0.0 { seen / above } else { 0.0 }
    }

    /// Chooses a light that gets a ray in each part of the open nodes that has none yet.
    fn aim(&mut self, site: &impl Site, height: u32) {
        let part = 1usize << (height - RAYS_HEIGHT);
        for &node in &self.open {
            let start = (node as usize) << height;
            for first in (start..start + (1 << height)).step_by(part) {
                let lights = &self.seen[first..first + part];
                if lights.iter().any(|&s| s >= 0.0) {
                    continue;
                }
                // The first above the horizon from some place within the part on, not the same in every part.
                let turn = first.wrapping_mul(0x9e37_79b1) >> 7;
                let above = (0..part)
                    .map(|k| (turn + k) % part)
                    .find(|&k| lights[k] == UNKNOWN);
                if let Some(k) = above {
                    self.targets.push((first + k) as u32);
                    self.rays.push(site.ray(self.lights, first + k));
                }
            }
        }
    }

    fn cast(&mut self, surfaces: &dyn Surfaces) -> u64 {
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
        surfaces.occluded_packet(&self.rays, &mut self.occluded);
        for (&light, &dark) in self.targets.iter().zip(&self.occluded) {
            self.seen[light as usize] = if dark { 0.0 } else { 1.0 };
        }
        self.targets.clear();
        let cast = self.rays.len() as u64;
        self.rays.clear();
        cast
    }

    /// Fills a node whose rays agree, or puts its halves on the list.
    fn settle(&mut self, node: u32, height: u32) {
        let start = (node as usize) << height;
        let lights = &mut self.seen[start..start + (1 << height)];
        let mut known = lights.iter().copied().filter(|&s| s >= 0.0);
        let Some(first) = known.next() else {
            return; // wholly below the horizon, or facing away
        };
        if known.all(|s| s == first) {
            lights
                .iter_mut()
                .filter(|s| **s == UNKNOWN)
                .for_each(|s| *s = first);
        } else if height > RAYS_HEIGHT {
            self.next.extend([2 * node, 2 * node + 1]);
        }
    }
}
