//! Unit vectors as two integers: the sphere folded onto an octahedron, unfolded onto a square (Meyer et al.,
//! "On floating-point normal vectors", EGSR 2010; Cigolle et al., "A survey of efficient representations for
//! independent unit vectors", JCGT 2014). SPEC 7.5.
//!
//! The grid is symmetric, −M … M with M = 2ᵇ⁻¹ − 1, so the six axis directions are exact: walls stay walls.
//! Error: a step h = 1/M of the square moves the unfolded point by at most h/2 on each axis; the octahedron's
//! third coordinate follows with at most h; the distance √(1/4 + 1/4 + 1)·h = 1.23 h is stretched by at most √3
//! on the way to the sphere (centre of a face): angle ≤ 2.13/M, that is 1.1e-3 rad for 12 bits and 6.6e-5 rad for
//! 16 bits (f32 rounding of the result included).

/// Largest absolute code of `bits` bits: 2ᵇ⁻¹ − 1.
pub const fn max_code(bits: u32) -> i32 {
    (1 << (bits - 1)) - 1
}

/// The code of a direction, each component −M … M. The vector need not be normalised; a zero or non-finite one
/// becomes +Z. Directions that the square holds twice (its border) get the non-negative of the two codes.
pub fn encode(direction: [f32; 3], bits: u32) -> [i32; 2] {
    let [x, y, z] = direction.map(f64::from);
    let norm = x.abs() + y.abs() + z.abs();
    if !(norm > 0.0 && norm.is_finite()) {
        return [0, 0];
    }
    let [x, y, z] = [x / norm, y / norm, z / norm];
    let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
    let [u, v] = if z < 0.0 {
        [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)]
    } else {
        [x, y]
    };
    let max = max_code(bits);
    let quantise = |t: f64| ((t * f64::from(max)).round() as i32).clamp(-max, max);
    let [mut u, mut v] = [quantise(u), quantise(v)];
    // On the border (u, ±M) and (−u, ±M) are one direction, and so for v.
    if v.abs() == max {
        u = u.abs();
    }
    if u.abs() == max {
        v = v.abs();
    }
    [u, v]
}

/// The unit vector of a code.
pub fn decode(code: [i32; 2], bits: u32) -> [f32; 3] {
    let max = f64::from(max_code(bits));
    let [u, v] = code.map(|c| (f64::from(c) / max).clamp(-1.0, 1.0));
    let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
    let z = 1.0 - u.abs() - v.abs();
    let [x, y] = if z < 0.0 {
        [(1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v)]
    } else {
        [u, v]
    };
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length].map(|c| c as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn angle(a: [f32; 3], b: [f32; 3]) -> f64 {
        let [a, b] = [a.map(f64::from), b.map(f64::from)];
        let cross = [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ];
        let norm = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        norm(cross).atan2(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
    }

    #[test]
    fn axis_directions_are_exact() {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut n = [0.0; 3];
                n[axis] = sign;
                for bits in [12, 16] {
                    assert_eq!(decode(encode(n, bits), bits), n);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn the_angle_stays_within_the_bound(z in -1.0f64..=1.0, phi in 0.0f64..6.3) {
            let s = (1.0 - z * z).sqrt();
            let n = [s * phi.cos(), s * phi.sin(), z].map(|c| c as f32);
            for (bits, bound) in [(12, 1.1e-3), (16, 6.6e-5)] {
                let code = encode(n, bits);
                let decoded = decode(code, bits);
                prop_assert!(angle(n, decoded) <= bound, "{}", angle(n, decoded));
                prop_assert_eq!(encode(decoded, bits), code, "encoding what was decoded changes nothing");
            }
        }

        #[test]
        fn every_canonical_code_survives(u in -2047i32..=2047, v in -2047i32..=2047) {
            let canonical = encode(decode([u, v], 12), 12);
            prop_assert_eq!(encode(decode(canonical, 12), 12), canonical);
            prop_assert_eq!(decode(canonical, 12), decode([u, v], 12));
            let border = u.abs() == 2047 || v.abs() == 2047;
            prop_assert!(border || canonical == [u, v]);
        }
    }
}
