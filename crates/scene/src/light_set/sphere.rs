//! Spherical lights, and the sun's disc: uniform sampling of a cone of directions.

use super::emitters::Emitters;
use super::form::LightForm;
use super::shape::{
    Extent, LightSample, LongRay, ReferencePoint, Seen, Shape, attenuate, extended, luminance64, times,
};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// A sphere that shines.
pub(super) struct SphereLight {
    pub sphere: Sphere,
    /// RGB, W/(m² sr).
    pub radiance: Vec3,
}

impl Shape for SphereLight {
    fn extent(&self) -> Extent {
        Extent::Near
    }

    fn sample(&self, _: &dyn Emitters, at: &ReferencePoint, [r0, r1, _]: [f32; 3]) -> Option<LightSample> {
        let (direction, distance, pdf) = self.sphere.sample(at.position.as_dvec3(), [r0, r1])?;
        Some(extended(direction.as_vec3(), distance, self.radiance, pdf))
    }

    fn met_by(&self, ray: &LongRay) -> Option<Seen> {
        self.sphere
            .hit(ray.from, ray.direction)
            .filter(|&t| t < ray.reach)?;
        Some(Seen {
            radiance: self.radiance,
            pdf: self.sphere.pdf(ray.from) as f32,
        })
    }

    fn importance(&self, from: DVec3) -> f64 {
        let Sphere { center, radius } = self.sphere;
        let disc = PI * radius * radius;
        attenuate(luminance64(self.radiance) * disc, from, center, radius)
    }

    fn power(&self, _: f64) -> Vec3 {
        times(self.radiance, 4.0 * (PI * self.sphere.radius).powi(2))
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        LightForm::Sphere {
            center: self.sphere.center.as_vec3(),
            radius: self.sphere.radius as f32,
            radiance: self.radiance,
        }
    }
}

/// A sphere that emits outwards.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    pub center: DVec3,
    /// m.
    pub radius: f64,
}

impl Sphere {
    /// 1 − cos of the half angle under which `x` sees it; `None` from inside, where it emits nothing.
    fn one_minus_cos(&self, x: DVec3) -> Option<f64> {
        let sin_squared = self.radius * self.radius / (self.center - x).length_squared();
        // 1 − √(1 − s) without cancellation for small s.
        (sin_squared < 1.0).then(|| sin_squared / (1.0 + (1.0 - sin_squared).sqrt()))
    }

    /// Unit direction from `x`, the distance at which it meets the sphere, and the density per steradian.
    pub fn sample(&self, x: DVec3, random: [f32; 2]) -> Option<(DVec3, f64, f64)> {
        let one_minus_cos = self.one_minus_cos(x)?;
        let axis = (self.center - x).normalize();
        let direction = sample_cone(axis, one_minus_cos, random);
        // A direction that rounding put on the rim may miss by a hair: then the tangent point is meant.
        let distance = self.hit(x, direction).unwrap_or_else(|| {
            ((self.center - x).length_squared() - self.radius * self.radius)
                .max(0.0)
                .sqrt()
        });
        let pdf = 1.0 / (2.0 * PI * one_minus_cos);
        (pdf.is_finite() && distance > 0.0).then_some((direction, distance, pdf))
    }

    /// Density with which [`Sphere::sample`] draws a direction that hits it from `x`; 0 from inside.
    pub fn pdf(&self, x: DVec3) -> f64 {
        self.one_minus_cos(x).map_or(0.0, |m| 1.0 / (2.0 * PI * m))
    }

    /// Where a ray (unit direction) meets the outside of the sphere.
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let to_center = self.center - origin;
        let along = to_center.dot(direction);
        let beside = (to_center - along * direction).length_squared();
        let half = self.radius * self.radius - beside;
        if half < 0.0 || to_center.length_squared() <= self.radius * self.radius {
            return None;
        }
        let t = along - half.sqrt();
        (t > 0.0).then_some(t)
    }
}

/// A unit direction, uniform in the cone around `axis` (unit) whose half angle has the given 1 − cos.
pub(super) fn sample_cone(axis: DVec3, one_minus_cos: f64, random: [f32; 2]) -> DVec3 {
    let lost = f64::from(random[0]) * one_minus_cos;
    // sin² = 1 − (1 − m)² = m (2 − m).
    let sin = (lost * (2.0 - lost)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = (f64::from(random[1]) * 2.0 * PI).sin_cos();
    let (u, v) = axis.any_orthonormal_pair();
    (axis * (1.0 - lost) + (u * cos_phi + v * sin_phi) * sin).normalize()
}
