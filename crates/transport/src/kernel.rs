//! Weight function and distances of the meshless basis.
//!
//! Source: Lehtinen et al. 2008, section 2.2 and 2.3, equations 8 to 11.

use glam::Vec3;

/// F of equation 10: how much faster the distance grows along the normal than in the tangent plane.
pub const SQUASH: f32 = 2.0;

/// Equation 9: falls from 1 at `r` = 0 to 0 at `r` = 1 with zero slope at both ends; 0 beyond.
#[inline]
pub fn falloff(r: f32) -> f32 {
    let inside = 1.0 + r * r * (2.0 * r - 3.0);
    if r >= 1.0 { 0.0 } else { inside }
}

/// Square of the distance of equation 10 from a point with unit normal `normal` at offset `offset` = x − x_j.
///
/// ‖d + F⟨d, n⟩n‖² = ‖d‖² + (2F + F²)⟨d, n⟩², which saves the vector.
#[inline]
pub fn distance_squared(offset: Vec3, normal: Vec3) -> f32 {
    let height = offset.dot(normal);
    offset.length_squared() + (2.0 * SQUASH + SQUASH * SQUASH) * height * height
}

/// Equation 8: weight at offset `offset` from a point of support radius 1/`inverse_radius`, with the
/// cosine `cosine` between the two normals.
#[inline]
pub fn weight(offset: Vec3, normal: Vec3, inverse_radius: f32, cosine: f32) -> f32 {
    let r = distance_squared(offset, normal).sqrt() * inverse_radius;
    // Without a branch: loops over many points are worked off several at a time.
    let facing = falloff(r) * cosine * cosine;
    if cosine <= 0.0 { 0.0 } else { facing }
}

/// What radii are multiplied by for a widening: a power of two.
#[inline]
pub fn width(widening: u8) -> f32 {
    f32::powi(2.0, i32::from(widening))
}

/// Square of the symmetric distance of equation 11 between two oriented points; infinite where their
/// normals are 90° or more apart.
#[inline]
pub fn disk_distance_squared(p: (Vec3, Vec3), q: (Vec3, Vec3)) -> f32 {
    let cosine = p.1.dot(q.1);
    if cosine <= 0.0 {
        return f32::INFINITY;
    }
    let offset = q.0 - p.0;
    let nearest = distance_squared(offset, p.1).min(distance_squared(offset, q.1));
    let squared_cosine = cosine * cosine;
    nearest / (squared_cosine * squared_cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fall_off_starts_at_one_ends_at_zero_and_is_flat_at_both_ends() {
        assert_eq!(falloff(0.0), 1.0);
        assert_eq!(falloff(1.0), 0.0);
        assert_eq!(falloff(7.0), 0.0);
        assert!((falloff(0.5) - 0.5).abs() < 1e-7);
        // Slope 6r² − 6r: a step of 1e-3 off either end moves the value by 3e-6.
        assert!((1.0 - falloff(1e-3)) < 4e-6 && falloff(1.0 - 1e-3) < 4e-6);
    }

    #[test]
    fn iso_surfaces_are_ellipsoids_flattened_by_one_plus_squash() {
        let normal = Vec3::new(0.36, 0.48, 0.8);
        let tangent = normal.any_orthonormal_vector();
        assert!((distance_squared(tangent * 0.3, normal).sqrt() - 0.3).abs() < 1e-6);
        assert!((distance_squared(normal * 0.3, normal).sqrt() - 0.9).abs() < 1e-6);
        // Equation 10 as printed, with the vector written out.
        let d = Vec3::new(0.3, -0.7, 0.2);
        let printed = (d + SQUASH * d.dot(normal) * normal).length();
        assert!((distance_squared(d, normal).sqrt() - printed).abs() < 1e-6);
    }

    #[test]
    fn points_may_coincide_when_their_normals_are_ninety_degrees_apart() {
        let x = Vec3::splat(0.5);
        assert_eq!(disk_distance_squared((x, Vec3::X), (x, Vec3::Y)), f32::INFINITY);
        assert_eq!(
            disk_distance_squared((x, Vec3::X), (x, Vec3::NEG_X)),
            f32::INFINITY
        );
        assert_eq!(disk_distance_squared((x, Vec3::X), (x, Vec3::X)), 0.0);
    }
}
