//! Lights that are evaluated at every pixel: the few bright direct ones, whose shadows are sharp.
//!
//! Section 4 of the paper has "direct" and "approximate" lights chosen by hand. Here a direct light is exact if it gives
//! more than its share of the mean incident light.

use super::kinds::LitKind;
use super::view::{Point, View};
use crate::many_lights::PointLights;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::bsdf::{Incident, integrate};
use relight_scene::rays::Ray;
use relight_scene::surface::{Surfaces, ray_end};
use relight_scene::traced::TracedScene;
use std::sync::atomic::{AtomicU64, Ordering};

/// Share of the mean incident light from which on a light is exact: what is off by a cluster of a light below it is off
/// by a thousandth.
const EXACT_SHARE: f64 = 1e-3;
/// Light and point pairs that the mean incident light is estimated from, and the fewest and most points.
const PAIRS: usize = 1 << 24;
const SAMPLES: [usize; 2] = [16, 256];
/// Distances below this share of the diagonal count as that: a virtual light beside a sample would be all there is.
const NEAREST: f64 = 0.01;

/// The mean over the view's points of all unoccluded incident light (largest channel, W/m²), and the lights that are
/// exact, brightest first, at most `most`.
pub(super) fn choose(points: &PointLights, view: &View, most: u32) -> (f64, Vec<u32>) {
    if view.points.is_empty() || points.is_empty() {
        return (0.0, Vec::new());
    }
    let samples = (PAIRS / points.len())
        .clamp(SAMPLES[0], SAMPLES[1])
        .min(view.points.len());
    let nearest = f64::from(view.diagonal) * NEAREST;
    let most_factor = 1.0 / (nearest * nearest);
    let means: Vec<f64> = (0..points.len())
        .into_par_iter()
        .map(|i| {
            let light = &points.lights[i];
            let sum: f64 = (0..samples)
                .filter_map(|k| {
                    let at = (2 * k + 1) * view.points.len() / (2 * samples);
                    let arrival = points.arrival(i, view.points[at].hit.position)?;
                    Some(match arrival.distance {
                        f32::INFINITY => 1.0,
                        _ => f64::from(arrival.factor).min(most_factor),
                    })
                })
                .sum();
            f64::from(light.intensity.max_element()) * sum / samples as f64
        })
        .collect();
    let mean: f64 = means.iter().sum();
    let mut bright: Vec<u32> = (0..points.direct as u32)
        .filter(|&i| means[i as usize] > EXACT_SHARE * mean)
        .collect();
    bright.sort_by(|&a, &b| means[b as usize].total_cmp(&means[a as usize]).then(a.cmp(&b)));
    bright.truncate(most as usize);
    (if mean.is_finite() { mean } else { 0.0 }, bright)
}

/// Adds the light of `exact` lights to the parts, with a shadow ray for each at each point. Returns their number.
pub(super) fn evaluate(
    scene: &TracedScene,
    points: &PointLights,
    view: &View,
    exact: &[u32],
    parts: &mut [LitKind],
) -> u64 {
    let shadow_rays = AtomicU64::new(0);
    for part in parts.iter_mut().filter(|part| !part.virtual_lights) {
        let source = part.source;
        let own: Vec<usize> = exact
            .iter()
            .map(|&i| i as usize)
            .filter(|&i| source.is_none_or(|source| points.source[i] == source))
            .collect();
        if own.is_empty() {
            continue;
        }
        part.radiance.par_iter_mut().zip(&view.points).for_each_init(
            Arriving::default,
            |arriving, (radiance, point)| {
                arriving.clear();
                for &i in &own {
                    arriving.add(points, i, point);
                }
                shadow_rays.fetch_add(arriving.rays.len() as u64, Ordering::Relaxed);
                let reflected = arriving.reflected(scene, point);
                // What f32 cannot hold is dropped, as by all integrators.
                if reflected.is_finite() {
                    *radiance += reflected;
                }
            },
        );
    }
    shadow_rays.into_inner()
}

/// Light that arrives at a point but for what is in between, structure of arrays.
#[derive(Default)]
struct Arriving {
    rays: Vec<Ray>,
    direction: [Vec<f32>; 3],
    flux: [Vec<f32>; 3],
    occluded: Vec<bool>,
    weight: Vec<f32>,
}

impl Arriving {
    fn clear(&mut self) {
        self.rays.clear();
        self.direction
            .iter_mut()
            .chain(&mut self.flux)
            .for_each(Vec::clear);
    }

    fn add(&mut self, points: &PointLights, i: usize, point: &Point) {
        let light = &points.lights[i];
        let Some(arrival) = points.arrival(i, point.hit.position) else {
            return;
        };
        let shading = &point.shading;
        if shading.shading_normal.dot(arrival.direction) <= 0.0
            || shading.geometric_normal.dot(arrival.direction) <= 0.0
        {
            return;
        }
        // In f64: an intensity of 1e20 near by would overflow on the way.
        let flux = (light.intensity.as_dvec3() * f64::from(arrival.factor)).as_vec3();
        if !flux.is_finite() {
            return;
        }
        let Some(ray) = points.shadow_ray(i, &ray_end(&point.hit)) else {
            return;
        };
        self.rays.push(ray);
        for k in 0..3 {
            self.direction[k].push(arrival.direction[k]);
            self.flux[k].push(flux[k]);
        }
    }

    /// Radiance towards the eye.
    fn reflected(&mut self, scene: &TracedScene, point: &Point) -> Vec3 {
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
        scene.occluded_packet(&self.rays, &mut self.occluded);
        self.weight.clear();
        self.weight
            .extend(self.occluded.iter().map(|&o| if o { 0.0 } else { 1.0 }));
        if self.weight.iter().all(|&weight| weight == 0.0) {
            return Vec3::ZERO;
        }
        let incident = Incident {
            direction: [0, 1, 2].map(|k| self.direction[k].as_slice()),
            weight: &self.weight,
            flux: [0, 1, 2].map(|k| self.flux[k].as_slice()),
        };
        integrate(&point.shading, point.wo, &incident)
    }
}
