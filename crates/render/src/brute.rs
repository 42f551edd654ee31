//! Direct light alone, light by light: every light gets a shadow ray of its own at every sample, lights with
//! extent several. No choice among lights and no recursion, so it shares little with what it is compared to.
//!
//! Or over lights without extent that stand for them ([`render_points`]), virtual lights included: the reference of
//! lightcuts and pixelcuts.

use crate::direct::direct_sample;
use crate::many_lights::{PointLights, clamp_limit, clamped};
use crate::picture::{Picture, Seen};
use crate::sampler::Sampler;
use crate::watch::Cancelled;
use glam::{DVec3, Vec3};
use relight_scene::bsdf::Viewed;
use relight_scene::image::Layers;
use relight_scene::surface::{Surfaces, ray_end};
use relight_transport::random::mix;
use std::sync::atomic::{AtomicU64, Ordering};

/// Samples per pixel where none are asked for.
pub const SPP: u32 = 16;
/// Shadow rays per sample and light with extent; lights without extent get one.
const LIGHT_SAMPLES: u32 = 4;

/// Renders an image. Layers: see [`crate::layers`]; `indirect` is black.
///
/// # Errors
/// [`Cancelled`] if the picture's watch says so.
pub fn render(picture: &Picture<'_>) -> Result<Layers, Cancelled> {
    let Picture { scene, lights, .. } = *picture;
    let spp = picture.spp.unwrap_or(SPP);
    picture.by_samples(
        spp,
        || (),
        |(), pixel, sample, sums| {
            let (eye, _) = picture.eye_ray(pixel, sample);
            let Some(Seen { hit, ray, tint }) = picture.see(&eye, sums) else {
                return;
            };
            let wo = -ray.direction;
            let tint = tint * scene.tint(&ray, hit.t);
            let point = scene.shading_point(&hit).facing(wo);
            for light in 0..lights.len() {
                let count = if lights.is_delta(light) { 1 } else { LIGHT_SAMPLES };
                for k in 0..count {
                    // The samples of one light continue one well-stratified sequence from sample to sample.
                    let seed = picture.seed ^ mix(1 + light as u64);
                    let number = sample.wrapping_mul(count).wrapping_add(k);
                    let random = Sampler::new(seed, picture.pixel(pixel), number).next_3d();
                    if let Some((radiance, _)) = direct_sample(scene, lights, light, &hit, &point, wo, random)
                    {
                        sums.add(Some(light), 1, radiance * tint / count as f32);
                    }
                }
            }
        },
    )
}

/// Points whose shadow rays are cast together: so many rays fit into a first-level cache.
const TOGETHER: usize = 512;

/// Renders an image by a shadow ray to each of `points` from each sample: what shines directly is the `direct` layer,
/// virtual lights, clamped, the `indirect` one. Returns the layers and the number of shadow rays.
///
/// # Errors
/// [`Cancelled`] if the picture's watch says so.
pub fn render_points(picture: &Picture<'_>, points: &PointLights) -> Result<(Layers, u64), Cancelled> {
    let scene = picture.scene;
    let shadow_rays = AtomicU64::new(0);
    let spp = picture.spp.unwrap_or(SPP);
    let buffers = || (Vec::new(), Vec::new(), Vec::<(usize, Vec3)>::new(), Vec::new());
    let layers = picture.by_samples(spp, buffers, |buffers, pixel, sample, sums| {
        let (rays, reached, passed_on, occluded) = buffers;
        let (eye, _) = picture.eye_ray(pixel, sample);
        let Some(Seen { hit, ray, tint }) = picture.see(&eye, sums) else {
            return;
        };
        let wo = -ray.direction;
        let tint = tint * scene.tint(&ray, hit.t);
        let point = scene.shading_point(&hit).facing(wo);
        let viewed = Viewed::new(&point, wo);
        let mut total = DVec3::ZERO;
        let mut passed = [Vec3::ZERO; TOGETHER];
        passed_on.clear();
        for first in (0..points.len()).step_by(TOGETHER) {
            rays.clear();
            reached.clear();
            for i in first..(first + TOGETHER).min(points.len()) {
                if let Some(radiance) = points.unoccluded(i, &hit, &viewed)
                    && let Some(ray) = points.shadow_ray(i, &ray_end(&hit))
                {
                    rays.push(ray);
                    reached.push((i, radiance));
                }
            }
            scene.passed_packet(rays, &mut passed[..rays.len()], occluded);
            shadow_rays.fetch_add(rays.len() as u64, Ordering::Relaxed);
            for (&(i, radiance), &passed) in reached.iter().zip(&passed) {
                if passed == Vec3::ZERO {
                    continue;
                }
                let radiance = radiance * passed * tint;
                total += radiance.as_dvec3();
                if points.is_clamped(i) {
                    passed_on.push((i, radiance));
                } else {
                    let layer = 1 + u32::from(points.is_virtual(i));
                    sums.add(Some(points.source[i] as usize), layer, radiance);
                }
            }
        }
        let limit = clamp_limit(total.as_vec3(), points.clamp);
        for &(i, radiance) in passed_on.iter() {
            sums.add(Some(points.source[i] as usize), 2, clamped(radiance, limit));
        }
    })?;
    Ok((layers, shadow_rays.into_inner()))
}
