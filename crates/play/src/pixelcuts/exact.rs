//! Lights that are evaluated at every pixel: the few bright direct ones, whose shadows are sharp.
//!
//! Section 4 of the paper has "direct" and "approximate" lights chosen by hand. Here a direct light is exact if it gives
//! more than its share of the mean incident light.

use super::Part;
use super::view::View;
use crate::many_lights::PointLights;
use rayon::prelude::*;
use relight_scene::surface::Surfaces;
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
    let means: Vec<f64> = points
        .lights
        .par_iter()
        .map(|light| {
            let sum: f64 = (0..samples)
                .filter_map(|k| {
                    let at = (2 * k + 1) * view.points.len() / (2 * samples);
                    let arrival = light.arrival(view.points[at].hit.position)?;
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
    parts: &mut [Part],
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
            || (Vec::new(), Vec::new(), vec![false; own.len()]),
            |(rays, reached, occluded), (radiance, point)| {
                rays.clear();
                reached.clear();
                for &i in &own {
                    if let Some(light) = points.unoccluded(i, &point.hit, &point.shading, point.wo)
                        && let Some(ray) = points.shadow_ray(i, &point.hit)
                    {
                        rays.push(ray);
                        reached.push(light);
                    }
                }
                scene.occluded_packet(rays, &mut occluded[..rays.len()]);
                shadow_rays.fetch_add(rays.len() as u64, Ordering::Relaxed);
                for (light, occluded) in reached.iter().zip(occluded.iter()) {
                    if !occluded {
                        *radiance += *light;
                    }
                }
            },
        );
    }
    shadow_rays.into_inner()
}
