//! Direct light alone, light by light: every light gets a shadow ray of its own at every sample, lights with
//! extent several. No choice among lights and no recursion, so it shares little with what it is compared to.

use crate::direct::direct_sample;
use crate::layers::{Cancelled, RenderSize, Watch, render_tiles};
use crate::path::{eye_ray, see};
use crate::sampler::Sampler;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use relight_scene::traced::TracedScene;

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
    watch: &Watch<'_>,
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
