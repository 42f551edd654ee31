//! Rays, what they meet, and where they start.

use glam::Vec3;

/// A part of a straight line: `origin + t * direction` for `t_min <= t <= t_max`, in world space.
///
/// `direction` need not be of unit length; t counts in units of its length. A negative `t_min` counts as 0. A ray with
/// a NaN, an infinite origin or direction, or no direction, hits nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start of the ray (metres).
    pub origin: Vec3,
    /// Direction, of any length.
    pub direction: Vec3,
    /// Smallest parameter of a hit, inclusive.
    pub t_min: f32,
    /// Largest parameter of a hit, inclusive; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray from its origin on, without end.
    #[inline]
    pub fn endless(origin: Vec3, direction: Vec3) -> Ray {
        Ray {
            origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Parameter along the ray, in units of its direction's length.
    pub t: f32,
    /// Index of the triangle in the input of [`super::TriangleBvh::build`].
    pub triangle: u32,
    /// Barycentric weight of the triangle's vertex 1, in [0, 1].
    pub u: f32,
    /// Barycentric weight of the triangle's vertex 2, in [0, 1]; vertex 0 has 1 − u − v.
    pub v: f32,
    /// How far before the triangle, across it, the back of a sheet lies that this hit was preferred to (metres); 0 where
    /// there is none. Rays from here start beyond it.
    pub sheet: f32,
}

/// A point on a surface that rays can start from or end at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point (world space, metres).
    pub position: Vec3,
    /// Unit geometric normal of the triangle, counter-clockwise side; zero for a triangle without area.
    pub normal: Vec3,
    /// How far from the surface, along each axis, a ray must start (metres).
    pub clearance: f32,
}
