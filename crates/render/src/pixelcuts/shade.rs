//! Incident light, reflected: the BRDF against spherical harmonics.
//!
//! The diffuse part reflects irradiance: what was kept of it exactly, and that of the harmonics. The specular part is
//! projected as a lobe around its mean direction: a Gaussian on the sphere of the lobe's width, whose degrees fade as
//! exp(−l (l + 1) σ²/2), times its directional albedo. Harmonics of degree 3 are some 60° wide: a narrower lobe shows
//! what they hold, a blurred reflection (the paper's limit, too).

use super::filter::filtered;
use super::view::{Point, View};
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_transport::pixel_scatter::stride;
use relight_transport::sh::{self, Coefficients};
use std::f32::consts::FRAC_1_PI;

/// Radiance towards the eye by point of the view, not negative.
pub(super) fn reflected(view: &View, incident: &[f32], degree: usize, filter: bool) -> Vec<Vec3> {
    let stride = stride(degree);
    view.points
        .par_iter()
        .enumerate()
        .map_init(
            || vec![0.0; stride],
            |light, (i, point)| {
                if filter {
                    filtered(view, incident, i, light);
                } else {
                    light.copy_from_slice(&incident[i * stride..][..stride]);
                }
                let radiance = reflect(point, light).max(Vec3::ZERO);
                // What f32 cannot hold is dropped, as by all integrators.
                if radiance.is_finite() {
                    radiance
                } else {
                    Vec3::ZERO
                }
            },
        )
        .collect()
}

/// Σ over the light's harmonics of `factors`.
fn weighed(light: &[f32], factors: &Coefficients) -> Vec3 {
    light[3..]
        .chunks_exact(3)
        .zip(factors)
        .map(|(c, f)| Vec3::new(c[0], c[1], c[2]) * *f)
        .sum()
}

fn reflect(point: &Point, light: &[f32]) -> Vec3 {
    let shading = &point.shading;
    let normal = shading.shading_normal;
    let exact = Vec3::new(light[0], light[1], light[2]);
    let irradiance = (exact + weighed(light, &sh::irradiance_factors(normal))).max(Vec3::ZERO);
    let cos = normal.dot(point.wo);
    let mut radiance = irradiance * bsdf::diffuse_reflectance(shading, cos) * FRAC_1_PI;
    if let Some(lobe) = bsdf::lobe(shading, point.wo) {
        let share = if shading.gloss.is_ggx() {
            bsdf::lobe_albedo(shading, point.wo)
        } else {
            shading.f0
        };
        radiance += share * weighed(light, &lobe_factors(&lobe)).max(Vec3::ZERO);
    }
    radiance
}

fn lobe_factors(lobe: &bsdf::Lobe) -> Coefficients {
    // 90 % of a Gaussian lie within √(2 ln 10) σ.
    const SIGMAS: f32 = 2.145_966;
    let sigma = lobe.width / SIGMAS;
    let mut y = sh::evaluate(lobe.direction);
    for l in 0..=sh::MAX_DEGREE {
        let fade = (-0.5 * (l * (l + 1)) as f32 * sigma * sigma).exp();
        y[l * l..sh::count(l)].iter_mut().for_each(|y| *y *= fade);
    }
    y
}
