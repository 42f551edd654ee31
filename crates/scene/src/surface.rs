//! Surfaces as algorithms see them: something rays hit, which reflects light (the meshless
//! paper, section 5.1). Triangle scenes, implicit surfaces and isosurfaces all stand behind [`Surfaces`].

use crate::rays::{self, Ray, SurfacePoint};
use glam::{DVec3, Vec3};

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

/// Ways that surfaces face: along each axis, or against it.
pub const WAYS: usize = 6;

impl SurfaceHit {
    /// Which way the smooth normal faces mostly, below [`WAYS`]: twice the axis, and one more against it.
    pub fn way(&self) -> usize {
        let axis = self.normal.abs().max_position();
        2 * axis + usize::from(self.normal[axis] < 0.0)
    }
}

/// Something that rays hit and that reflects light.
pub trait Surfaces: Sync {
    /// Axis-aligned bounds of all surfaces, world space; `None` where there are none.
    fn bounds(&self) -> Option<(Vec3, Vec3)>;
    /// The nearest surface along the ray. Masked-out parts are passed; a blended surface is hit with
    /// probability α, decided by a hash of ray and primitive, so that equal rays meet equal surfaces.
    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit>;
    /// [`Surfaces::closest_hit`] of many rays: `visit(i, hit)` for each that meets something, in order. What a hit needs lies
    /// in many places in memory, so that looking up the hits of many rays together is faster than one by one.
    fn closest_hits(&self, rays: &[Ray], visit: &mut dyn FnMut(usize, SurfaceHit)) {
        for (i, ray) in rays.iter().enumerate() {
            if let Some(hit) = self.closest_hit(ray) {
                visit(i, hit);
            }
        }
    }
    /// Whether any surface lies on the ray; alpha as for [`Surfaces::closest_hit`].
    fn occluded(&self, ray: &Ray) -> bool;
    /// [`Surfaces::occluded`] for rays that share their origin or their target.
    fn occluded_packet(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, out) in rays.iter().zip(occluded) {
            *out = self.occluded(ray);
        }
    }
    /// How much of the light along a ray gets through: 0 where something stops it, 1 where nothing is on the ray, between them
    /// through panes; linear RGB.
    fn passed(&self, ray: &Ray) -> Vec3 {
        if self.occluded(ray) { Vec3::ZERO } else { Vec3::ONE }
    }
    /// [`Surfaces::passed`] of several rays; `occluded` is a buffer.
    fn passed_packet(&self, rays: &[Ray], passed: &mut [Vec3], occluded: &mut Vec<bool>) {
        unshaded(self, rays, passed, occluded);
    }
    /// Colour of the panes that [`Surfaces::closest_hit`] has passed before `t`, linear RGB: what arrives from there is to be
    /// multiplied by it.
    fn tint(&self, _ray: &Ray, _t: f32) -> Vec3 {
        Vec3::ONE
    }
    /// Total hemispherical reflectance (diffuse and specular, averaged over all directions) where a ray hit,
    /// linear RGB in 0..=1.
    fn albedo(&self, hit: &SurfaceHit) -> Vec3;
}

/// [`Surfaces::passed_packet`] where light is stopped or is not.
pub(crate) fn unshaded<S: Surfaces + ?Sized>(
    surfaces: &S,
    rays: &[Ray],
    passed: &mut [Vec3],
    occluded: &mut Vec<bool>,
) {
    occluded.clear();
    occluded.resize(rays.len(), false);
    surfaces.occluded_packet(rays, occluded);
    for (passed, &dark) in passed.iter_mut().zip(occluded.iter()) {
        *passed = if dark { Vec3::ZERO } else { Vec3::ONE };
    }
}

/// A ray from a hit into `direction`, without end, that does not meet the surface it starts on. It starts on the
/// side of the surface that `direction` points to; t counts in units of the direction's length.
#[inline]
pub fn ray_from(hit: &SurfaceHit, direction: Vec3) -> Ray {
    ray_from_end(&ray_end(hit), direction)
}

/// As [`ray_from`] from where rays start at the hit.
#[inline]
pub fn ray_from_end(end: &SurfacePoint, direction: Vec3) -> Ray {
    Ray {
        origin: rays::offset_origin(end.position, end.normal, direction, end.clearance),
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

/// A ray from a hit to a point in space, such as a point light, that meets neither the surface it starts on nor
/// one that the point lies on. Its direction is the difference of its ends.
#[inline]
pub fn ray_between(hit: &SurfaceHit, target: Vec3) -> Ray {
    rays::shadow_ray_to_point(&ray_end(hit), target)
}

/// A ray from one hit to another that meets neither surface. Its direction is the difference of its ends.
pub fn ray_between_hits(from: &SurfaceHit, to: &SurfaceHit) -> Ray {
    rays::shadow_ray(&ray_end(from), &ray_end(to))
}

/// Where rays that start or end at a hit do so.
#[inline]
pub fn ray_end(hit: &SurfaceHit) -> SurfacePoint {
    SurfacePoint {
        position: hit.position,
        normal: hit.geometric_normal,
        clearance: hit.position_error.max_element(),
    }
}

/// How near to a curved surface a ray may start, relative to the diagonal of the surface's bounds: some 2⁶ f32
/// roundings, so that the start is on its side of the surface whatever the surface's slope.
const CURVED_CLEARANCE: f64 = 1.0 / (1 << 18) as f64;

/// A ray in f64 with a unit direction, clipped to a box: what surfaces that are no triangles march along.
pub(crate) struct ClippedRay {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// Distances in metres.
    pub(crate) near: f64,
    pub(crate) far: f64,
    /// Whether the ray starts outside the box.
    pub(crate) starts_outside: bool,
    /// Metres per unit of the ray's own t.
    length: f64,
}

impl ClippedRay {
    /// `None` where the ray misses the box or is not finite.
    pub(crate) fn new(ray: &Ray, low: DVec3, high: DVec3) -> Option<ClippedRay> {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let length = direction.length();
        if !(origin.is_finite() && length.is_finite() && length > 0.0) {
            return None;
        }
        let direction = direction / length;
        let start = f64::from(ray.t_min.max(0.0)) * length;
        let (mut near, mut far) = (start, f64::from(ray.t_max) * length);
        for axis in 0..3 {
            let a = (low[axis] - origin[axis]) / direction[axis];
            let b = (high[axis] - origin[axis]) / direction[axis];
            if a.is_nan() || b.is_nan() {
                continue; // within a face and along it
            }
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some(ClippedRay {
            origin,
            direction,
            near,
            far,
            starts_outside: near > start,
            length,
        })
    }

    pub(crate) fn at(&self, distance: f64) -> DVec3 {
        self.origin + self.direction * distance
    }

    /// The hit at a distance on a surface whose outward `gradient` (and smooth gradient) may have any length.
    pub(crate) fn hit(&self, distance: f64, gradient: DVec3, smooth: DVec3, diagonal: f64) -> SurfaceHit {
        let position = self.at(distance).as_vec3();
        // Where the gradient vanishes the surface faces the ray.
        let outward = gradient.try_normalize().unwrap_or(-self.direction);
        let front = outward.dot(self.direction) <= 0.0;
        let geometric = if front { outward } else { -outward };
        let smooth = smooth.try_normalize().unwrap_or(geometric);
        let smooth = if smooth.dot(geometric) < 0.0 {
            -smooth
        } else {
            smooth
        };
        let rounding = position.abs().max_element() * f32::EPSILON + f32::MIN_POSITIVE;
        SurfaceHit {
            t: (distance / self.length) as f32,
            position,
            position_error: Vec3::splat(rounding + (diagonal * CURVED_CLEARANCE) as f32),
            geometric_normal: geometric.as_vec3(),
            normal: smooth.as_vec3(),
            front,
            primitive: 0,
            barycentric: [0.0; 2],
        }
    }
}
