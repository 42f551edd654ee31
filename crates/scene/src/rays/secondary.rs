//! Rays that start or end on a surface, and must not hit it.
//!
//! In the manner of Pharr, Jakob and Humphreys, *Physically Based Rendering*, section "Managing Rounding Error": the
//! point is interpolated from the triangle's vertices, not found along the ray; the start of the next ray is moved along the
//! geometric normal beyond the error bound, and rounded away from the surface. Two deviations:
//!
//! * Interpolation is done in double precision and rounded once, so the bound is one rounding instead of seven.
//! * The book rejects hits whose t is below its own error bound. That opens leaks, because the bound is large for
//!   triangles seen edge-on. Here the ray starts farther than the triangle test can err: a reported hit is within 17uM of
//!   the ray in each component (`ray_setup`), less than 30uM in length, where M, for the triangle that the ray starts on, is
//!   its size. A start 64uM above the triangle cannot be reported to hit it. Neighbours in the same plane that are larger
//!   are settled by the double-precision test of `RaySetup::plane_is_ahead`.

use glam::{DVec3, Vec3};

use super::bvh::TriangleBvh;
use super::layout::{HIT_ERROR, UNIT_ROUNDOFF};
use super::ray::{Hit, Ray, SurfacePoint};

/// Height above a surface, relative to the distances that the triangle test rounds, at which it is never hit: twice the
/// margin of the boxes.
const CLEARANCE: f32 = 2.0 * HIT_ERROR;

/// The point of a hit (world space) and a bound of its rounding error along each axis (metres).
///
/// Both are NaN if `hit` is not of this `bvh`; a ray from there hits nothing.
pub fn hit_position(bvh: &TriangleBvh, hit: &Hit) -> (Vec3, Vec3) {
    position_on(bvh.triangle(hit.triangle).unwrap_or([Vec3::NAN; 3]), hit)
}

fn position_on([a, b, c]: [Vec3; 3], hit: &Hit) -> (Vec3, Vec3) {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    let position = (a + (b - a) * f64::from(hit.u) + (c - a) * f64::from(hit.v)).as_vec3();
    // The double-precision part is 2⁻²⁹ of this; the smallest normal number covers rounding of denormals.
    let error = position.abs() * (UNIT_ROUNDOFF * (1.0 + f32::EPSILON)) + f32::MIN_POSITIVE;
    (position, error)
}

/// The surface at a hit, with the clearance that its triangle needs.
pub fn surface_point(bvh: &TriangleBvh, hit: &Hit) -> SurfacePoint {
    TriangleSurface::new(bvh, hit.triangle).at(hit)
}

/// A triangle, for any number of hits on it.
pub struct TriangleSurface {
    /// World space; NaN if there is no such triangle.
    vertices: [Vec3; 3],
    normal: Vec3,
    /// Its largest extent along an axis, m.
    size: f32,
}

impl TriangleSurface {
    /// Of a triangle of this `bvh`.
    pub fn new(bvh: &TriangleBvh, triangle: u32) -> TriangleSurface {
        let [a, b, c] = bvh.triangle(triangle).unwrap_or([Vec3::NAN; 3]);
        TriangleSurface {
            vertices: [a, b, c],
            normal: geometric_normal(a, b, c),
            size: (a.max(b).max(c) - a.min(b).min(c)).max_element(),
        }
    }

    /// [`surface_point`] of a hit on it.
    pub fn at(&self, hit: &Hit) -> SurfacePoint {
        let (position, error) = position_on(self.vertices, hit);
        SurfacePoint {
            position,
            normal: self.normal,
            // Beyond a sheet as far again as it lies before this one: in front of it, too, nothing is met that is nearer.
            clearance: error.max_element() + CLEARANCE * self.size + 2.0 * hit.sheet,
        }
    }
}

/// Unit normal of the plane through three points, or zero. In double precision, scaled so that tiny triangles have one.
fn geometric_normal(a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    let (e1, e2) = (b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3());
    let normal = e1.cross(e2);
    let length = normal.length();
    if length > 0.0 {
        (normal / length).as_vec3()
    } else {
        DVec3::ZERO.as_vec3()
    }
}

/// A start for a ray in `direction` from a surface point that is known up to `position_error` along each axis: moved
/// along the normal, to the side that `direction` points to, by at least that error, and rounded away from the surface.
#[inline]
pub fn offset_origin(position: Vec3, geometric_normal: Vec3, direction: Vec3, position_error: f32) -> Vec3 {
    let n = geometric_normal;
    let height = position_error * (n.x.abs() + n.y.abs() + n.z.abs());
    let offset = n * if direction.dot(n) < 0.0 { -height } else { height };
    let away = |p: f32, o: f32| {
        let moved = p + o;
        let next = if o > 0.0 {
            moved.next_up()
        } else {
            moved.next_down()
        };
        if o == 0.0 { moved } else { next }
    };
    Vec3::new(
        away(position.x, offset.x),
        away(position.y, offset.y),
        away(position.z, offset.z),
    )
}

/// The parameter that leads `distance` along each axis at most, in units of `direction`.
#[inline]
fn parameter_of(distance: f32, direction: Vec3) -> f32 {
    distance / direction.abs().max_element()
}

/// A ray from a surface point into `direction`, without end. It starts one clearance above the surface and one along
/// the ray, so that at an edge it does not hit the other face that it starts on, either.
#[inline]
pub fn ray_from_surface(from: &SurfacePoint, direction: Vec3) -> Ray {
    let origin = offset_origin(from.position, from.normal, direction, from.clearance);
    Ray {
        origin,
        direction,
        t_min: parameter_of(from.clearance, direction),
        t_max: f32::INFINITY,
    }
}

/// A ray between two surface points that hits neither's surface. Its direction is the difference of its ends.
#[inline]
pub fn shadow_ray(from: &SurfacePoint, to: &SurfacePoint) -> Ray {
    let between = to.position - from.position;
    // Seen from the start, the target's triangle lies as far away as the ray is long.
    let clearance = to.clearance + CLEARANCE * between.abs().max_element();
    let target = offset_origin(to.position, to.normal, -between, clearance);
    let mut ray = ray_from_surface(from, between);
    ray.direction = target - ray.origin;
    ray.t_min = parameter_of(from.clearance, ray.direction);
    ray.t_max = 1.0 - parameter_of(clearance, ray.direction);
    ray
}

/// A ray from a surface point to a point in space, such as a point light. It ends short of the point by 2⁻¹⁷ of its
/// length, so that a light on a surface is not hidden by it, except at grazing angles.
#[inline]
pub fn shadow_ray_to_point(from: &SurfacePoint, point: Vec3) -> Ray {
    let mut ray = ray_from_surface(from, point - from.position);
    ray.direction = point - ray.origin;
    ray.t_min = parameter_of(from.clearance, ray.direction);
    ray.t_max = 1.0 - 2.0 * CLEARANCE;
    ray
}
