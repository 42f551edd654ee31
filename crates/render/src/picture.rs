//! What every integrator renders, and what an eye sees of it without any reflection.

use crate::direct::light_met;
use crate::layers::{PixelSum, RenderSize, Tile, render_blocks};
use crate::sampler::Sampler;
use crate::watch::{Cancelled, Watch};
use glam::{Vec2, Vec3};
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::{Look, TracedScene};

/// A picture to be made: a scene in its light, as a camera sees it.
#[derive(Clone, Copy)]
pub struct Picture<'a> {
    /// What is seen.
    pub scene: &'a TracedScene,
    /// What shines.
    pub lights: &'a LightSet<'a>,
    /// Who looks.
    pub camera: &'a Camera,
    /// Pixels of the image.
    pub size: RenderSize,
    /// Samples per pixel; as many as the integrator takes by itself where `None`.
    pub spp: Option<u32>,
    /// Images with different seeds are independent.
    pub seed: u64,
    /// Whether to make a layer per light.
    pub light_layers: bool,
    /// Is told of the progress, and may stop it.
    pub watch: &'a dyn Watch,
}

/// What an eye ray meets.
pub(crate) struct Seen {
    pub hit: SurfaceHit,
    /// The last, straight part of its way.
    pub ray: Ray,
    /// What solid glass leaves of the light from there, but for panes before the last part's end; linear RGB.
    pub tint: Vec3,
}

impl Seen {
    /// What a look ends at; `None`: nothing.
    pub(crate) fn of(look: &Look) -> Option<Seen> {
        look.hit.map(|hit| Seen {
            hit,
            ray: look.ray,
            tint: look.tint,
        })
    }
}

impl<'a> Picture<'a> {
    /// With as many samples as the integrator takes by itself, seed 0, no light layers, and nobody to watch.
    pub fn new(
        scene: &'a TracedScene,
        lights: &'a LightSet<'a>,
        camera: &'a Camera,
        size: RenderSize,
    ) -> Picture<'a> {
        Picture {
            scene,
            lights,
            camera,
            size,
            spp: None,
            seed: 0,
            light_layers: false,
            watch: &(),
        }
    }

    /// Number of a pixel, row by row.
    pub(crate) fn pixel(&self, (x, y): (usize, usize)) -> u64 {
        (y * self.size.width + x) as u64
    }

    /// The ray through a place of the image, in pixels.
    pub(crate) fn ray_through(&self, place: Vec2) -> Ray {
        let size = Vec2::new(self.size.width as f32, self.size.height as f32);
        Ray::endless(self.camera.position, self.camera.direction(place, size))
    }

    /// The ray through a random point of a pixel (box filter), and the sample's further random numbers.
    pub(crate) fn eye_ray(&self, pixel: (usize, usize), sample: u32) -> (Ray, Sampler) {
        let mut sampler = Sampler::new(self.seed, self.pixel(pixel), sample);
        let place = Vec2::from(sampler.next_2d()) + Vec2::new(pixel.0 as f32, pixel.1 as f32);
        (self.ray_through(place), sampler)
    }

    /// What the eye sees of a ray, through solid glass: emission of lights and surfaces and what surfaces are like. Returns what it meets.
    pub(crate) fn see(&self, ray: &Ray, sums: &mut PixelSum) -> Option<Seen> {
        let look = self.scene.look(ray, |part, end, tint| {
            (self.lights).along(part.origin, part.direction, end, |met| {
                sums.add(Some(met.light), 0, met.radiance * tint);
            });
        });
        self.met(ray, &look, sums);
        Seen::of(&look)
    }

    /// Adds what an eye ray shows at its end without any reflection, as [`Picture::see`] does.
    pub(crate) fn met(&self, eye: &Ray, look: &Look, sums: &mut PixelSum) {
        let Picture { scene, lights, .. } = *self;
        let (ray, hit) = (&look.ray, look.hit.as_ref());
        light_met(
            scene,
            lights,
            ray.origin,
            ray.direction,
            hit,
            None,
            |light, radiance, _| {
                let radiance = radiance * look.tint;
                sums.add(Some(light), 0, radiance);
                if hit.is_none() {
                    sums.add_background(radiance);
                }
            },
        );
        if let Some(hit) = hit {
            let point = scene.shading_point(hit);
            if scene.material(hit.primitive).unlit {
                sums.add(None, 0, point.emission * look.tint);
            }
            let along = look.length();
            let planar = along * eye.direction.dot(self.camera.forward);
            sums.add_surface(scene.albedo(hit), point.shading_normal, [along, planar]);
        }
    }

    /// Renders tile by tile: [`render_blocks`].
    pub(crate) fn by_tiles<S>(
        &self,
        state: impl Fn() -> S + Sync + Send,
        tile: impl Fn(&mut S, &Tile, &mut [PixelSum]) + Sync,
    ) -> Result<Layers, Cancelled> {
        render_blocks(self.size, self.lights, self.light_layers, self.watch, state, tile)
    }

    /// Renders by `sample(state, pixel, number, sums)` for each of `spp` samples of every pixel.
    pub(crate) fn by_samples<S>(
        &self,
        spp: u32,
        state: impl Fn() -> S + Sync + Send,
        sample: impl Fn(&mut S, (usize, usize), u32, &mut PixelSum) + Sync,
    ) -> Result<Layers, Cancelled> {
        self.by_tiles(state, |state, tile, sums| {
            for (pixel, sums) in tile.pixels().zip(sums) {
                sums.samples = spp;
                (0..spp).for_each(|number| sample(state, pixel, number, sums));
            }
        })
    }
}
