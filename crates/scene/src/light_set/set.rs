//! The lights of one frame: what all kinds have in common.

use super::distant::{DistantLight, Split};
use super::emitters::Emitters;
use super::form::LightForm;
use super::shape::{Extent, LightSample, LongRay, MetEmitter, ReferencePoint, Shape};
use glam::Vec3;
use std::f64::consts::PI;
use std::sync::Arc;

/// Light that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit {
    /// Which light.
    pub light: usize,
    /// Its radiance towards the ray's origin, RGB.
    pub radiance: Vec3,
    /// Density per steradian with which [`LightSet::sample`] draws the ray's direction from its origin.
    pub pdf: f32,
}

/// A light that lies in a surface is in front of it: this much of the ray's length counts as lying in it, as
/// much as [`crate::rays::shadow_ray_to_point`] stops short of a light.
const TOUCHING: f64 = 1.0 / (1u32 << 17) as f64;

/// The lights of one frame. A light's index is its place in the sequence.
pub struct LightSet<'a> {
    lights: Vec<Light>,
    emitters: &'a dyn Emitters,
}

struct Light {
    name: String,
    shape: Box<dyn Shape>,
}

impl<'a> LightSet<'a> {
    pub(super) fn of_shapes(
        shapes: impl Iterator<Item = (String, Box<dyn Shape>)>,
        emitters: &'a dyn Emitters,
    ) -> LightSet<'a> {
        let lights = shapes.map(|(name, shape)| Light { name, shape }).collect();
        LightSet { lights, emitters }
    }

    /// Number of lights, dark ones included.
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether there are no lights at all.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// The name of a light.
    ///
    /// # Panics
    /// `light` is not below [`LightSet::len`]; so for every method that takes a light's index.
    pub fn name(&self, light: usize) -> &str {
        &self.lights[light].name
    }

    /// Whether a light has no extent: one sample says all about it.
    pub fn is_delta(&self, light: usize) -> bool {
        self.lights[light].shape.extent() == Extent::Delta
    }

    /// Whether a light comes from all around, as [`crate::light::LightTrack::is_distant`] has it: its samples do not
    /// depend on the place.
    pub fn is_distant(&self, light: usize) -> bool {
        self.lights[light].shape.extent() == Extent::Distant
    }

    /// Whether a light is the scene's own emissive surfaces, which rays meet.
    pub fn is_emissive(&self, light: usize) -> bool {
        self.lights[light].shape.extent() == Extent::Emissive
    }

    /// Whether a light is a lamp: without extent, or a shape of its own. Neither the scene's surfaces nor what comes from all around.
    pub fn is_lamp(&self, light: usize) -> bool {
        matches!(self.lights[light].shape.extent(), Extent::Delta | Extent::Near)
    }

    /// Whether rays can meet any light ([`LightSet::along`]).
    pub fn any_along(&self) -> bool {
        (self.lights.iter()).any(|light| matches!(light.shape.extent(), Extent::Near | Extent::Distant))
    }

    /// Whether any light makes surfaces shine.
    pub fn has_emissive(&self) -> bool {
        (self.lights.iter()).any(|light| light.shape.extent() == Extent::Emissive)
    }

    /// Draws a direction from a place (a hit, or a point of free space) towards a light, from three random numbers in
    /// [0, 1). `None` where that light sends nothing there (or what was drawn turns its back: an estimate of zero).
    pub fn sample(
        &self,
        light: usize,
        at: impl Into<ReferencePoint>,
        random: [f32; 3],
    ) -> Option<LightSample> {
        let sample = self.lights[light]
            .shape
            .sample(self.emitters, &at.into(), random)?;
        let lit = sample.radiance_over_pdf.max_element() > 0.0 && sample.radiance_over_pdf.is_finite();
        lit.then_some(sample)
    }

    /// Calls `visit` for every rectangle and sphere that a ray (unit `direction`, world space) meets before
    /// `t_max` or within rounding of it, and, where `t_max` is infinite, for every environment.
    pub fn along(&self, origin: Vec3, direction: Vec3, t_max: f32, mut visit: impl FnMut(LightHit)) {
        let ray = LongRay {
            from: origin.as_dvec3(),
            direction: direction.as_dvec3(),
            direction_f32: direction,
            reach: f64::from(t_max) * (1.0 + TOUCHING),
        };
        for (light, Light { shape, .. }) in self.lights.iter().enumerate() {
            if let Some(seen) = shape.met_by(&ray) {
                visit(LightHit {
                    light,
                    radiance: seen.radiance,
                    pdf: seen.pdf,
                });
            }
        }
    }

    /// Calls `visit` for every light that makes a surface shine which a ray met. `from`: where the ray's light is to arrive, if
    /// densities are wanted; they are 0 without. The caller makes sure that the side that was met emits.
    pub fn emitted(&self, met: &MetEmitter, from: Option<&ReferencePoint>, mut visit: impl FnMut(LightHit)) {
        let mut emission = None;
        for (light, Light { shape, .. }) in self.lights.iter().enumerate() {
            if let Some(scale) = shape.lights_up(met.primitive) {
                let emission =
                    *emission.get_or_insert_with(|| self.emitters.emitted(met.primitive, met.barycentric));
                visit(LightHit {
                    light,
                    radiance: emission * scale,
                    pdf: from.map_or(0.0, |from| shape.density_of(self.emitters, met, from)),
                });
            }
        }
    }

    /// About how much irradiance a light can give at `x`, occlusion and the receiver's cosine aside: for
    /// choosing among lights. Zero only where there is no light at all.
    pub fn importance(&self, light: usize, x: Vec3) -> f64 {
        self.lights[light].shape.importance(x.as_dvec3())
    }

    /// Power that a light sends into a scene inside a ball of `radius` metres, RGB, W: all that near lights
    /// emit, and what of distant lights falls on the ball's disc.
    pub fn power(&self, light: usize, radius: f32) -> Vec3 {
        let disc = PI * f64::from(radius) * f64::from(radius);
        self.lights[light].shape.power(disc)
    }

    /// Whether a light sends nothing anywhere.
    pub fn is_dark(&self, light: usize) -> bool {
        self.power(light, 1.0) == Vec3::ZERO
    }

    /// What light `light` is.
    pub fn form(&self, light: usize) -> LightForm<'_> {
        self.lights[light].shape.form(self.emitters)
    }

    /// The surfaces of the scene that can emit.
    pub fn emitters(&self) -> &dyn Emitters {
        self.emitters
    }

    /// Takes the smooth part of every environment out of the lights: per light that part, where it has one that shines. `split`
    /// gives the parts of a light's map. Of a sun with sky, the sky is taken and the sun stays.
    pub fn take_distant(&mut self, split: impl Fn(usize) -> Option<Arc<Split>>) -> Vec<Option<DistantLight>> {
        let take = |(i, light): (usize, &mut Light)| {
            if light.shape.extent() != Extent::Distant {
                return None;
            }
            let (left, environment) = light.shape.split(split(i).as_deref())?;
            light.shape = left;
            (environment.scale != Vec3::ZERO).then_some(DistantLight { environment })
        };
        self.lights.iter_mut().enumerate().map(take).collect()
    }
}
