//! What a ray needs once before it meets boxes and triangles, and why no box test can lose a hit.
//!
//! # Triangle test
//!
//! Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013): a shear along the dominant axis
//! k_z of the direction maps the ray to the z axis; the signs of three 2D edge functions decide. Deviation: the
//! paper falls back to double precision where an edge function vanishes. Here every edge function is
//! Kahan's difference of products with fused multiply-adds, whose relative error is at most 2u (u = 2⁻²⁴, Jeannerod,
//! Louvet and Muller 2013): sign and zero are exact for the sheared vertices as rounded. Triangles that share a
//! vertex round it alike, so the projected mesh has neither gaps nor overlaps, whatever the scale.
//!
//! Error of a reported hit, with M the largest |vertex − origin| in any component: a sheared coordinate
//! A_x − S_x A_z carries the roundings of A_x, A_z, S_x, S_x A_z and the sum, at most 5uM since |S_x| ≤ 1. So the
//! point of the triangle with the computed barycentric weights lies within 5uM of the ray in x and y. Its
//! z, hence t, carries at most 12uM: together 17uM.
//!
//! # Box test
//!
//! Slabs as t = plane · (1/d) − o · (1/d) with one fused multiply-add each. Ize, "Robust BVH Ray Traversal" (JCGT 2013)
//! widens the far distance by 3 roundings, which covers the slab test's own rounding but not the triangle
//! test's. Here the ray is a thin cone instead: the position allowed to a hit at distance s is off by 32us, plus
//! terms that do not grow with s. For an axis with |d| well above the cone's slope this turns 1/d into
//! 1/(|d| ± slope); for an axis (nearly) perpendicular to the ray the cone's width at the end of the ray, or where it
//! leaves the scene, is added to the planes. Leaf boxes were widened by 32u times their size, since a vertex is
//! farther than the hit by at most that size.

use super::layout::{HIT_ERROR, Tree, UNIT_ROUNDOFF};
use super::ray::Ray;

/// Slope of the cone around the ray: directions are scaled to a largest component below 2, so a hit at parameter t
/// is at most 2t from the origin along each axis.
const CONE_SLOPE: f32 = 2.0 * HIT_ERROR;

/// Direction components below this count as perpendicular: 2⁸ times the cone's slope, so that the slope
/// changes 1/d by less than half a percent.
const PERPENDICULAR: f32 = 256.0 * CONE_SLOPE;

/// Components are clamped to this before division. A box then meets a ray that is off by 2⁻⁴⁰ of the distance, far
/// within the cone, and 1/d stays finite for zeros and denormals of either sign.
const SMALLEST_COMPONENT: f32 = 1.0 / (1u64 << 40) as f32;

/// Box coordinates and origin are each rounded once on the way into a slab, and once again in the sum.
const PLANE_ERROR: f32 = 4.0 * UNIT_ROUNDOFF;

/// A ray in the tree's internal space, with all per-ray constants.
#[derive(Clone, Copy)]
pub(super) struct RaySetup {
    /// Origin for the triangle test: internal space, not relative to the anchor.
    pub origin: [f32; 3],
    /// Direction, scaled to a largest component in [1, 2).
    pub direction: [f32; 3],
    /// Axes of the shear: the dominant one last.
    pub axes: [usize; 3],
    /// S_x, S_y, S_z of Woop et al.
    pub shear: [f32; 3],
    /// Per axis: t = plane * inverse − offset, for the near and the far plane.
    pub near_inverse: [f32; 3],
    pub near_offset: [f32; 3],
    pub far_inverse: [f32; 3],
    pub far_offset: [f32; 3],
    /// 1 where the direction is negative: the near plane is then the upper one.
    pub negative: [usize; 3],
    pub t_min: f32,
    pub t_max: f32,
    /// The ray's own t per internal t: a power of two.
    pub world_t_from_internal: f64,
    /// Metres per internal length.
    pub world_from_internal: f32,
}

impl RaySetup {
    /// Prepares `ray`, or returns `None` where nothing can be hit: an empty tree, a non-finite origin or direction,
    /// no direction, or an empty interval (NaN bounds included).
    #[inline(always)]
    pub(super) fn new(tree: &Tree, ray: &Ray) -> Option<RaySetup> {
        let direction = ray.direction.to_array();
        let largest = direction[0].abs().max(direction[1].abs()).max(direction[2].abs());
        // f32::max ignores NaN, so the finite test needs every component.
        if !ray.direction.is_finite() || !ray.origin.is_finite() || largest == 0.0 || tree.nodes.is_empty() {
            return None;
        }
        // A power of two brings the largest component into [1, 2). As f64 even denormals have a plain exponent.
        let exponent = (f64::from(largest).to_bits() >> 52) & 0x7ff;
        let inverse_power = f64::from_bits((2046 - exponent) << 52);
        let internal_t_from_world = tree.internal_from_world / inverse_power;
        let d = direction.map(|c| (f64::from(c) * inverse_power) as f32);
        let o = ray
            .origin
            .to_array()
            .map(|c| (f64::from(c) * tree.internal_from_world) as f32);
        let t_min = (f64::from(ray.t_min.max(0.0)) * internal_t_from_world) as f32;
        let t_max = (f64::from(ray.t_max) * internal_t_from_world) as f32;
        // An origin that overflows lies 2¹²⁸ scene sizes away.
        let overflow = o.iter().any(|c| c.is_infinite());
        if ray.t_min.is_nan() || t_max.is_nan() || t_min > t_max || overflow {
            return None;
        }

        let size = d.map(f32::abs);
        let z = if size[2] >= size[0] && size[2] >= size[1] {
            2
        } else if size[1] >= size[0] {
            1
        } else {
            0
        };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][z];
        let inverse_z = 1.0 / d[z];
        let shear = [d[axes[0]] / d[z], d[axes[1]] / d[z], inverse_z];

        let from_anchor = [
            o[0] - tree.anchor[0],
            o[1] - tree.anchor[1],
            o[2] - tree.anchor[2],
        ];
        let farthest = from_anchor[0]
            .abs()
            .max(from_anchor[1].abs())
            .max(from_anchor[2].abs());
        // The largest component is at least 1, so no point of the scene has a larger parameter.
        let reach = t_max.min(farthest + tree.extent);

        let mut setup = RaySetup {
            origin: o,
            direction: d,
            axes,
            shear,
            near_inverse: [0.0; 3],
            near_offset: [0.0; 3],
            far_inverse: [0.0; 3],
            far_offset: [0.0; 3],
            negative: d.map(|c| usize::from(c.is_sign_negative())),
            t_min,
            t_max,
            world_t_from_internal: 1.0 / internal_t_from_world,
            world_from_internal: (1.0 / tree.internal_from_world) as f32,
        };
        for axis in 0..3 {
            let sign = 1f32.copysign(d[axis]);
            let perpendicular = size[axis] < PERPENDICULAR;
            let slope = if perpendicular { 0.0 } else { CONE_SLOPE };
            let padding = if perpendicular { CONE_SLOPE * reach } else { 0.0 };
            let padding = sign * (padding + PLANE_ERROR * from_anchor[axis].abs());
            let component = size[axis].max(SMALLEST_COMPONENT);
            setup.near_inverse[axis] = sign / (component + slope);
            setup.far_inverse[axis] = sign / (component - slope);
            setup.near_offset[axis] = (from_anchor[axis] + padding) * setup.near_inverse[axis];
            setup.far_offset[axis] = (from_anchor[axis] - padding) * setup.far_inverse[axis];
        }
        Some(setup)
    }

    /// The ray's own parameter for an internal one.
    #[inline(always)]
    pub(super) fn world_t(&self, t: f32) -> f32 {
        (f64::from(t) * self.world_t_from_internal) as f32
    }

    /// Whether the ray meets the triangle's plane at or after its start, in double precision.
    ///
    /// Asked for triangles with vertices on both sides of the origin along k_z: there 12uM of error in t may turn
    /// a surface that the ray leaves into one that it meets.
    #[inline(never)]
    pub(super) fn plane_is_ahead(&self, triangle: &[[f32; 3]; 3]) -> bool {
        let sub = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|i| f64::from(a[i]) - f64::from(b[i]));
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a, b) = (sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0]));
        let normal = [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ];
        let t = dot(normal, sub(triangle[0], self.origin)) / dot(normal, self.direction.map(f64::from));
        t >= f64::from(self.t_min)
    }
}
