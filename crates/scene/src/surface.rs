//! Surfaces as algorithms see them: something rays hit, which reflects light (design section 6, meshless
//! paper section 5.1). Triangle scenes, implicit surfaces and isosurfaces all stand behind [`Surfaces`].

use crate::rays::{self, Ray, SurfacePoint};
use glam::Vec3;

/// Where a ray met a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Distance along the ray in units of the direction's length.
    pub t: f32,
    /// World space, on the surface to within `position_error`.
    pub position: Vec3,
    /// Bound of the absolute error of each coordinate of `position`, and of how near to it a ray may start
    /// without meeting the same surface again.
    pub position_error: Vec3,
    /// Unit normal of the true surface, on the side the ray came from.
    pub geometric_normal: Vec3,
    /// Unit smooth (interpolated) normal without normal maps, on the same side as `geometric_normal`.
    pub normal: Vec3,
    /// Whether the ray met the front.
    pub front: bool,
    /// Which primitive was hit (triangle index of a triangle scene); opaque to algorithms.
    pub primitive: u32,
    /// Barycentric weights of vertices 1 and 2 of the primitive, where it has any.
    pub barycentric: [f32; 2],
}

/// Something that rays hit and that reflects light.
pub trait Surfaces: Sync {
    /// Axis-aligned bounds of all surfaces, world space; `None` where there are none.
    fn bounds(&self) -> Option<(Vec3, Vec3)>;
    /// The nearest surface along the ray. Masked-out parts are passed; a blended surface is hit with
    /// probability α, decided by a hash of ray and primitive, so that equal rays meet equal surfaces.
    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit>;
    /// Whether any surface lies on the ray; alpha as for [`Surfaces::closest_hit`].
    fn occluded(&self, ray: &Ray) -> bool;
    /// [`Surfaces::occluded`] for rays that share their origin or their target.
    fn occluded_packet(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, out) in rays.iter().zip(occluded) {
            *out = self.occluded(ray);
        }
    }
    /// Total hemispherical reflectance (diffuse and specular, averaged over all directions) where a ray hit,
    /// linear RGB in 0..=1.
    fn albedo(&self, hit: &SurfaceHit) -> Vec3;
}

/// A ray from a hit into `direction`, without end, that does not meet the surface it starts on. It starts on the
/// side of the surface that `direction` points to; t counts in units of the direction's length.
pub fn ray_from(hit: &SurfaceHit, direction: Vec3) -> Ray {
    let error = hit.position_error.max_element();
    Ray {
        origin: rays::offset_origin(hit.position, hit.geometric_normal, direction, error),
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

/// A ray from a hit to a point in space, such as a point light, that meets neither the surface it starts on nor
/// one that the point lies on. Its direction is the difference of its ends.
pub fn ray_between(hit: &SurfaceHit, target: Vec3) -> Ray {
    rays::shadow_ray_to_point(&ray_end(hit), target)
}

/// A ray from one hit to another that meets neither surface. Its direction is the difference of its ends.
pub fn ray_between_hits(from: &SurfaceHit, to: &SurfaceHit) -> Ray {
    rays::shadow_ray(&ray_end(from), &ray_end(to))
}

fn ray_end(hit: &SurfaceHit) -> SurfacePoint {
    SurfacePoint {
        position: hit.position,
        normal: hit.geometric_normal,
        clearance: hit.position_error.max_element(),
    }
}
