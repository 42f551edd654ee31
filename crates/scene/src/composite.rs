//! Several surfaces as one: what makes scenes of meshes, implicit surfaces and isosurfaces.

use crate::rays::Ray;
use crate::surface::{SurfaceHit, Surfaces};
use glam::Vec3;

/// One of the surfaces of a [`Composite`].
pub struct CompositeSurface {
    /// Its name, for messages.
    pub name: String,
    /// The surface.
    pub surfaces: Box<dyn Surfaces + Send>,
    /// One more than the largest `primitive` of its hits.
    pub primitives: u32,
}

/// Surfaces side by side. Primitives are numbered surface by surface. A ray asks every surface whose bounds it does not
/// need to rule out first: meant for dozens of parts, not for thousands.
#[derive(Default)]
pub struct Composite {
    surfaces: Vec<CompositeSurface>,
    /// Per surface the number of its first primitive.
    first_primitive: Vec<u32>,
}

impl Composite {
    /// Puts surfaces side by side, or returns `None` if they have more than 2³² primitives.
    pub fn new(surfaces: Vec<CompositeSurface>) -> Option<Composite> {
        let mut next = 0u32;
        let mut first_primitive = Vec::with_capacity(surfaces.len());
        for surface in &surfaces {
            first_primitive.push(next);
            next = next.checked_add(surface.primitives)?;
        }
        Some(Composite {
            surfaces,
            first_primitive,
        })
    }

    /// The surfaces, in order.
    pub fn surfaces(&self) -> &[CompositeSurface] {
        &self.surfaces
    }

    /// Which surface a hit is on: index into [`Composite::surfaces`]; `None` for hits of other surfaces.
    pub fn surface_of(&self, hit: &SurfaceHit) -> Option<usize> {
        let after = self
            .first_primitive
            .partition_point(|&first| first <= hit.primitive);
        after.checked_sub(1)
    }
}

impl Surfaces for Composite {
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.surfaces
            .iter()
            .filter_map(|surface| surface.surfaces.bounds())
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        let mut ray = *ray;
        let mut closest = None;
        for (surface, first) in self.surfaces.iter().zip(&self.first_primitive) {
            if let Some(mut hit) = surface.surfaces.closest_hit(&ray) {
                // A surface may round t up past the limit; the nearer hit stays.
                if hit.t <= ray.t_max {
                    hit.primitive += first;
                    ray.t_max = hit.t;
                    closest = Some(hit);
                }
            }
        }
        closest
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.surfaces.iter().any(|surface| surface.surfaces.occluded(ray))
    }

    fn tint(&self, ray: &Ray, t: f32) -> Vec3 {
        let tints = self.surfaces.iter().map(|surface| surface.surfaces.tint(ray, t));
        tints.fold(Vec3::ONE, |product, tint| product * tint)
    }

    fn albedo(&self, hit: &SurfaceHit) -> Vec3 {
        let Some(at) = self.surface_of(hit) else {
            return Vec3::ZERO;
        };
        let hit = SurfaceHit {
            primitive: hit.primitive - self.first_primitive[at],
            ..*hit
        };
        self.surfaces[at].surfaces.albedo(&hit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::implicit::{ImplicitSurface, Sdf};
    use glam::DVec3;

    fn ball(x: f32, albedo: f32) -> CompositeSurface {
        let sdf = Sdf::Sphere {
            center: DVec3::X * f64::from(x),
            radius: 1.0,
        };
        let (low, high) = (Vec3::new(x - 1.0, -1.0, -1.0), Vec3::new(x + 1.0, 1.0, 1.0));
        let surfaces = Box::new(ImplicitSurface::new(sdf, (low, high), Vec3::splat(albedo)));
        CompositeSurface {
            name: String::new(),
            surfaces,
            primitives: 1,
        }
    }

    /// Truth by hand: two balls of radius 1 at x = 0 and x = 3, in either order.
    #[test]
    fn the_nearest_surface_is_hit_and_keeps_its_albedo() {
        for surfaces in [
            vec![ball(0.0, 0.2), ball(3.0, 0.6)],
            vec![ball(3.0, 0.6), ball(0.0, 0.2)],
        ] {
            let both = Composite::new(surfaces).unwrap();
            assert_eq!(both.bounds().unwrap().0.x.round(), -1.0);
            assert_eq!(both.bounds().unwrap().1.x.round(), 4.0);
            for (from, toward, t, albedo) in [(-5.0, Vec3::X, 4.0, 0.2), (8.0, Vec3::NEG_X, 4.0, 0.6)] {
                let ray = Ray {
                    origin: Vec3::X * from,
                    direction: toward,
                    t_min: 0.0,
                    t_max: 100.0,
                };
                let hit = both.closest_hit(&ray).unwrap();
                assert!((hit.t - t).abs() < 1e-5);
                assert_eq!(both.albedo(&hit), Vec3::splat(albedo));
                assert!(both.occluded(&ray) && !both.occluded(&Ray { t_max: 3.9, ..ray }));
            }
        }
    }
}
