//! Pixelcuts: many lights by trees of pixels, each light sending its light to clusters of them.
//!
//! Source: Khungurn et al., *Pixelcuts: Scalable Approximate Illumination from Many Point Lights*. Eye rays give the
//! pixels' points; lights are split at random into ℓ groups with a randomly rotated tree of the points each
//! ([`relight_transport::pixel_tree`]); for every light a cut of its group's tree is chosen, a shadow ray cast to a random
//! pixel of each cluster, and what arrives there entered as incident light of the whole cluster
//! ([`relight_transport::pixel_scatter`]); incident light is filtered (`filter`) and reflected (`shade`). Bright direct
//! lights get a shadow ray at every pixel (`exact`), the paper's section 4.
//!
//! **Deviations.** Clusters of pixels with one normal take irradiance from the exact cosine at the representative, not
//! from harmonics, which would be off by up to 0.09 of a light's strength near the horizon: so matt, flat surfaces are
//! exact but for what changes within a cluster. Light that comes from behind the representative is left out, since it
//! does not reach the surface, and thin ones would be lit from the wrong side. Virtual lights are clamped as in
//! [`crate::brute`], by the light that a first, coarse pass without the clamp finds at the representative.
//!
//! Approximate light changes in steps of clusters: contact shadows and sharp glossy reflections are lost, as the paper
//! says of itself. Memory: some 700 bytes a point beside 44 bytes a tree node, whatever the number of lights.

mod exact;
mod filter;
mod incident;
mod kinds;
mod shade;
mod stats;
#[cfg(test)]
mod tests;
mod view;

use crate::many_lights::{PointLights, clamp_limit};
use crate::picture::Picture;
use crate::watch::Cancelled;
use glam::Vec3;
use incident::{Gather, Job, Target};
use kinds::LitKind;
use rayon::prelude::*;
use relight_scene::image::Layers;
use relight_scene::traced::Look;
use relight_transport::sh::MAX_DEGREE;
use stats::lap;
pub use stats::{PixelcutsStats, PixelcutsTimes};
use std::time::Instant;
use view::View;

/// How to render with pixelcuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelcutsSettings {
    /// Clusters of a light's random cut, k.
    pub clusters: u32,
    /// Trees, and groups of lights, ℓ.
    pub trees: u32,
    /// Highest degree of the spherical harmonics that incident light is kept in, 0 to 3.
    pub degree: usize,
    /// Whether incident light is filtered.
    pub filter: bool,
    /// Whether clusters of one normal take irradiance exactly.
    pub flat: bool,
    /// Most direct lights that get a shadow ray at every pixel.
    pub exact: u32,
    /// Clusters are refined where a light varies by more than this share of the mean incident light.
    pub threshold: f32,
}

impl Default for PixelcutsSettings {
    fn default() -> Self {
        PixelcutsSettings {
            // Figure 6's caption.
            clusters: 2048,
            // The paper has 16; more than 4 gain nothing (docs/notebook/pixelcuts.md).
            trees: 4,
            degree: MAX_DEGREE,
            filter: true,
            flat: true,
            exact: 64,
            // The paper's number, made relative.
            threshold: 0.01,
        }
    }
}

/// Samples per pixel where no number is asked for.
pub const SPP: u32 = 1;

/// The first pass, which finds what virtual lights are clamped by, has so many times fewer clusters.
const COARSER: u32 = 8;
/// Highest degree of its harmonics: it says how bright a place is, not more.
const CLAMP_DEGREE: usize = 1;

/// Renders an image: what shines directly is the `direct` layer, virtual lights the `indirect` one. Where no number of samples
/// is asked for there is one per pixel; each is a pixel of its own to the trees.
///
/// # Errors
/// [`Cancelled`] if the picture's watch says so.
pub fn render(
    picture: &Picture<'_>,
    points: &PointLights,
    settings: &PixelcutsSettings,
) -> Result<(Layers, PixelcutsStats), Cancelled> {
    let scene = picture.scene;
    let mut stats = PixelcutsStats::default();
    let mut clock = Instant::now();
    let spp = picture.spp.unwrap_or(SPP).max(1);
    let view = View::new(picture, spp);
    stats.points = view.points.len();
    lap(&mut clock, &mut stats.times.eye);

    let (mean, exact_lights) = exact::choose(points, &view, settings.exact);
    let mut parts = parts(points, picture.light_layers, view.points.len());
    stats.exact = exact_lights.len();
    stats.exact_rays = exact::evaluate(scene, points, &view, &exact_lights, &mut parts);
    lap(&mut clock, &mut stats.times.exact);

    let mut exactly = vec![false; points.len()];
    exact_lights.iter().for_each(|&i| exactly[i as usize] = true);
    let approximate: Vec<u32> = (0..points.len() as u32)
        .filter(|&i| !exactly[i as usize] && points.lights[i as usize].intensity != Vec3::ZERO)
        .collect();
    let mut gather = Gather {
        scene,
        points,
        view: &view,
        mean,
        flat: settings.flat,
        targets: view.points.par_iter().map(Target::new).collect(),
        seed: picture.seed,
        watch: picture.watch,
    };
    let clamps = points.clamp.is_finite() && (points.direct..points.len()).any(|i| points.is_clamped(i));
    if clamps && !approximate.is_empty() && mean > 0.0 {
        let job = Job {
            clusters: (settings.clusters / COARSER).max(1),
            trees: 1,
            // Nothing exceeds it: no refinement.
            threshold: 1.0,
            degree: settings.degree.min(CLAMP_DEGREE),
            coarse: true,
        };
        let incident = gather.incident(&job, &approximate, &[|_: u32| true], &mut stats)?;
        let mut total: Vec<Vec3> = vec![Vec3::ZERO; view.points.len()];
        for part in &parts {
            total.iter_mut().zip(&part.radiance).for_each(|(t, r)| *t += *r);
        }
        let reflected = shade::reflected(&view, &incident[0], job.degree, false);
        total.iter_mut().zip(reflected).for_each(|(t, r)| *t += r);
        (gather.targets.par_iter_mut().zip(&view.points).zip(total)).for_each(|((target, point), total)| {
            target.limited(point, clamp_limit(total, points.clamp));
        });
        stats.shadow_rays = 0;
        stats.clusters = 0;
        stats.times = PixelcutsTimes {
            eye: stats.times.eye,
            exact: stats.times.exact,
            ..PixelcutsTimes::default()
        };
        lap(&mut clock, &mut stats.times.estimate);
    }

    if !approximate.is_empty() && mean > 0.0 {
        let job = Job {
            clusters: settings.clusters.max(1),
            trees: settings.trees.max(1),
            threshold: settings.threshold,
            degree: settings.degree.min(MAX_DEGREE),
            coarse: false,
        };
        let belongs: Vec<_> = parts
            .iter()
            .map(|part| {
                let (virtual_lights, source) = (part.virtual_lights, part.source);
                move |i: u32| {
                    points.is_virtual(i as usize) == virtual_lights
                        && source.is_none_or(|source| points.source[i as usize] == source)
                }
            })
            .collect();
        let incident = gather.incident(&job, &approximate, &belongs, &mut stats)?;
        clock = Instant::now();
        for (part, incident) in parts.iter_mut().zip(&incident) {
            if !incident.is_empty() {
                let reflected = shade::reflected(&view, incident, job.degree, settings.filter);
                part.radiance
                    .iter_mut()
                    .zip(reflected)
                    .for_each(|(sum, r)| *sum += r);
            }
        }
        lap(&mut clock, &mut stats.times.shade);
    }
    stats.shadow_rays += stats.exact_rays;

    let layers = picture.by_samples(
        spp,
        || (),
        |(), pixel, sample, sums| {
            let point = view.at(pixel, sample);
            let eye = picture.eye_ray(pixel, sample).0;
            if picture.scene.bends() {
                picture.see(&eye, sums);
            } else {
                let hit = point.map(|point| view.points[point].hit);
                picture.met(&eye, &Look::straight(&eye, hit), sums);
            }
            if let Some(point) = point {
                for part in &parts {
                    // Without light layers the light's index is not used.
                    let light = part.source.map(|source| source as usize);
                    let radiance = part.radiance[point] * view.points[point].tint;
                    sums.add(light, 1 + u32::from(part.virtual_lights), radiance);
                }
            }
        },
    )?;
    lap(&mut clock, &mut stats.times.resolve);
    Ok((layers, stats))
}

/// The layers that any light goes to.
fn parts(points: &PointLights, light_layers: bool, pixels: usize) -> Vec<LitKind> {
    let mut kinds: Vec<(bool, Option<u32>)> = (0..points.len())
        .map(|i| (points.is_virtual(i), light_layers.then(|| points.source[i])))
        .collect();
    kinds.sort_unstable();
    kinds.dedup();
    kinds
        .into_iter()
        .map(|(virtual_lights, source)| LitKind {
            virtual_lights,
            source,
            radiance: vec![Vec3::ZERO; pixels],
        })
        .collect()
}
