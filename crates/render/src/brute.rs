//! Direct light alone, light by light: every light gets a shadow ray of its own at every sample, lights with
//! extent several. No choice among lights and no recursion, so it shares little with what it is compared to.
//!
//! Or over lights without extent that stand for them ([`render_points`]), virtual lights included: the reference of
//! lightcuts and pixelcuts.

use crate::direct::direct_sample;
use crate::layers::{RenderSize, render_tiles};
use crate::many_lights::{PointLights, clamp_limit, clamped};
use crate::path::{eye_ray, see};
use crate::sampler::Sampler;
use crate::watch::{Cancelled, Watch};
use glam::{DVec3, Vec3};
use relight_scene::bsdf::Viewed;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use relight_scene::rays::Ray;
use relight_scene::surface::{Surfaces, ray_end};
use relight_scene::traced::TracedScene;
use std::sync::atomic::{AtomicU64, Ordering};

/// How to evaluate all lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BruteSettings {
    /// Samples per pixel.
    pub spp: u32,
    /// Shadow rays per sample and light with extent; lights without extent get one.
    pub light_samples: u32,
    /// Images with different seeds are independent.
    pub seed: u64,
    /// Whether to make a layer per light.
    pub light_layers: bool,
}

impl Default for BruteSettings {
    fn default() -> Self {
        BruteSettings {
            spp: 16,
            light_samples: 4,
            seed: 0,
            light_layers: false,
        }
    }
}

/// Renders an image. Layers: see [`crate::layers`]; `indirect` is black.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub fn render(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    camera: &Camera,
    size: RenderSize,
    settings: &BruteSettings,
    watch: &dyn Watch,
) -> Result<Layers, Cancelled> {
    render_tiles(
        size,
        lights,
        settings.light_layers,
        settings.spp,
        watch,
        |x, y, sums| {
            let pixel = (y * size.width + x) as u64;
            for sample in 0..settings.spp {
                let mut sampler = Sampler::new(settings.seed, pixel, sample);
                let eye = eye_ray(camera, size, x, y, &mut sampler);
                let Some(hit) = see(scene, lights, &eye, sums) else {
                    continue;
                };
                let wo = -eye.direction;
                let point = scene.shading_point(&hit).facing(wo);
                for light in 0..lights.len() {
                    let count = if lights.is_delta(light) {
                        1
                    } else {
                        settings.light_samples.max(1)
                    };
                    for k in 0..count {
                        // The samples of one light continue one well-stratified sequence from sample to sample.
                        let mut stream = Sampler::new(
                            settings.seed ^ relight_transport::random::mix(1 + light as u64),
                            pixel,
                            sample.wrapping_mul(count).wrapping_add(k),
                        );
                        let random = stream.next_3d();
                        if let Some((radiance, _)) =
                            direct_sample(scene, lights, light, &hit, &point, wo, random)
                        {
                            sums.add(Some(light), 1, radiance / count as f32);
                        }
                    }
                }
            }
        },
    )
}

/// How to evaluate all points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointsSettings {
    /// Samples per pixel.
    pub spp: u32,
    /// Images with different seeds are independent.
    pub seed: u64,
    /// Whether to make a layer per light.
    pub light_layers: bool,
    /// Whether shadow rays go in packets from each sample, or one by one.
    pub packets: bool,
}

/// Points whose shadow rays are cast together: so many rays fit into a first-level cache.
const TOGETHER: usize = 512;

/// Renders an image by a shadow ray to each of `points` from each sample: what shines directly is the `direct` layer,
/// virtual lights, clamped, the `indirect` one. Returns the layers and the number of shadow rays.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub fn render_points(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    points: &PointLights,
    camera: &Camera,
    size: RenderSize,
    settings: &PointsSettings,
    watch: &dyn Watch,
) -> Result<(Layers, u64), Cancelled> {
    let shadow_rays = AtomicU64::new(0);
    let layers = render_tiles(
        size,
        lights,
        settings.light_layers,
        settings.spp,
        watch,
        |x, y, sums| {
            let pixel = (y * size.width + x) as u64;
            let mut rays = Vec::with_capacity(TOGETHER);
            let mut reached: Vec<(usize, Vec3)> = Vec::with_capacity(TOGETHER);
            let mut occluded = [false; TOGETHER];
            let mut passed_on: Vec<(usize, Vec3)> = Vec::new();
            for sample in 0..settings.spp {
                let mut sampler = Sampler::new(settings.seed, pixel, sample);
                let eye = eye_ray(camera, size, x, y, &mut sampler);
                let Some(hit) = see(scene, lights, &eye, sums) else {
                    continue;
                };
                let wo = -eye.direction;
                let point = scene.shading_point(&hit).facing(wo);
                let viewed = Viewed::new(&point, wo);
                let mut total = DVec3::ZERO;
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
                    cast(scene, &rays, &mut occluded[..rays.len()], settings.packets);
                    shadow_rays.fetch_add(rays.len() as u64, Ordering::Relaxed);
                    for (&(i, radiance), &occluded) in reached.iter().zip(&occluded) {
                        if occluded {
                            continue;
                        }
                        total += radiance.as_dvec3();
                        if points.is_virtual(i) {
                            passed_on.push((i, radiance));
                        } else {
                            sums.add(Some(points.source[i] as usize), 1, radiance);
                        }
                    }
                }
                let limit = clamp_limit(total.as_vec3(), points.clamp);
                for &(i, radiance) in &passed_on {
                    sums.add(Some(points.source[i] as usize), 2, clamped(radiance, limit));
                }
            }
        },
    )?;
    Ok((layers, shadow_rays.into_inner()))
}

fn cast(scene: &TracedScene, rays: &[Ray], occluded: &mut [bool], packets: bool) {
    if packets {
        scene.occluded_packet(rays, occluded);
    } else {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = scene.occluded(ray);
        }
    }
}
