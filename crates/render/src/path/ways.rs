//! Which way a path takes through solid glass.
//!
//! Let f be a surface's BRDF, the sum of a sharp lobe and the rest. What lies behind solid glass is shown by the lobe over rays that bend, and lights
//! the rest over rays that go straight on. Where a ray's direction wi has been drawn and glass is the first that it meets, it bends with
//! probability s = lobe(wi)/f(wi) and carries the lobe's part over s, or goes straight on and carries the rest over 1 − s. Light samples through glass
//! light the rest alone ([`crate::direct`]). So each way of the light from lamp to eye counts once: bent ones have no light samples, and
//! multiple importance sampling weighs straight ones as elsewhere.

use super::Tracer;
use crate::sampler::Sampler;
use glam::Vec3;
use relight_scene::bsdf;
use relight_scene::rays::Ray;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::Look;

/// How a ray takes solid glass.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Way {
    Straight,
    Bent,
}

impl Tracer<'_> {
    /// The way of a ray whose unit direction was drawn at a point seen from `wo`, and the factor of what it carries.
    pub(super) fn way(
        &self,
        ray: &Ray,
        (hit, point): (&SurfaceHit, &ShadingPoint),
        wo: Vec3,
        sampler: &mut Sampler,
    ) -> (Way, Vec3) {
        if !self.scene.bends_from(hit, point) || !self.scene.meets_solid(ray) {
            return (Way::Straight, Vec3::ONE);
        }
        let whole = bsdf::eval(point, wo, ray.direction);
        let rest = bsdf::eval_diffuse(point, wo, ray.direction).min(whole);
        let share = (whole - rest).element_sum() / whole.element_sum();
        if !(whole.is_finite() && share.is_finite()) {
            return (Way::Straight, Vec3::ONE);
        }
        let (way, part, chance) = if sampler.next_1d() < share {
            (Way::Bent, whole - rest, share)
        } else {
            (Way::Straight, rest, 1.0 - share)
        };
        // A channel in which nothing is reflected carries nothing.
        let factor = Vec3::select(whole.cmpgt(Vec3::ZERO), part / whole, Vec3::ZERO) / chance;
        (way, factor)
    }

    /// Follows a ray on its way. `met(light, radiance, density)` of lights without surfaces on parts before the last, the density of drawing their direction
    /// as a light sample; `None` where no light sample goes.
    pub(super) fn go(&self, way: Way, ray: &Ray, mut met: impl FnMut(usize, Vec3, Option<f32>)) -> Look {
        if way == Way::Straight {
            return Look::straight(ray, self.scene.closest_hit(ray));
        }
        let mut first = true;
        self.scene.look(ray, |part, end, tint| {
            (self.lights).along(part.origin, part.direction, end, |at| {
                met(at.light, at.radiance * tint, first.then_some(at.pdf));
            });
            first = false;
        })
    }
}
