//! Sampling a triangle by the solid angle that it fills, seen from a point.
//!
//! Source: Arvo, *Stratified Sampling of Spherical Triangles*, SIGGRAPH 1995; the solid angle after Van Oosterom and
//! Strackee, *The Solid Angle of a Plane Triangle*, 1983, which small triangles lose no digits by.

use glam::DVec3;

/// A triangle on the unit sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct SphericalTriangle {
    /// Unit directions to the corners A, B and C.
    corners: [DVec3; 3],
    /// Steradians, above 0.
    pub solid_angle: f64,
}

impl SphericalTriangle {
    /// The triangle of `vertices` as seen from `from`; `None` where it fills no solid angle.
    pub fn new(from: DVec3, vertices: [DVec3; 3]) -> Option<SphericalTriangle> {
        let unit = |vertex: DVec3| (vertex - from).try_normalize();
        let [a, b, c] = [unit(vertices[0])?, unit(vertices[1])?, unit(vertices[2])?];
        let volume = a.dot(b.cross(c)).abs();
        let solid_angle = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        (solid_angle > 0.0).then_some(SphericalTriangle {
            corners: [a, b, c],
            solid_angle,
        })
    }

    /// The direction at a place of the unit square, evenly over the solid angle.
    pub fn direction(&self, [u, v]: [f64; 2]) -> DVec3 {
        let [a, b, c] = self.corners;
        let (across_b, across_c) = (a.cross(b), a.cross(c));
        // The angle at A.
        let alpha = across_b.cross(across_c).length().atan2(across_b.dot(across_c));
        let (sin_alpha, cos_alpha) = alpha.sin_cos();
        // Arvo's figure 2: the part of the triangle that holds u of its area.
        let (s, t) = (u * self.solid_angle - alpha).sin_cos();
        let (p, q) = (t - cos_alpha, s + sin_alpha * a.dot(b));
        let cos_side = ((q * t - p * s) * cos_alpha - q) / ((q * s + p * t) * sin_alpha);
        let cos_side = if cos_side.is_nan() {
            1.0
        } else {
            cos_side.clamp(-1.0, 1.0)
        };
        let towards = |from: DVec3, to: DVec3, cos: f64| {
            let across = (to - from * from.dot(to)).normalize_or_zero();
            from * cos + across * (1.0 - cos * cos).max(0.0).sqrt()
        };
        let edge = towards(a, c, cos_side);
        let cos = 1.0 - v * (1.0 - edge.dot(b));
        towards(b, edge, cos)
    }
}
