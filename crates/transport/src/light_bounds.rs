//! Upper bounds of what a cluster of lights without extent can send to a point.
//!
//! Source: Walter et al. 2005 (lightcuts), section 4.1: equation 4 (largest cosine of the angle between an axis and a
//! box) and figure 5 (oriented lights). Beyond the paper: spot lights by their envelope; and since directional lights
//! lie on the unit sphere, their cosine with an axis is also at most their largest coordinate along it.
//!
//! All bounds hold for what f32 computes light by light: they are loosened by more than its rounding, which for narrow
//! lobes means sines, not cosines (see [`Angle`]).

use crate::light_clusters::{ClusterEmission, ClusterNode};
use crate::sampling::Frame;
use glam::{Mat3A, Vec3, Vec3A};

/// What a bound is loosened by, relatively: sums of a dozen f32 roundings.
const LOOSE: f32 = 1.0 + 4e-6;
/// Rounding of the sine of an angle between two unit vectors in f32: of a frame, a box in it, and of whoever compares.
const SINE_ROUNDING: f32 = 1.5e-6;

/// The vectors from a point to all lights of a cluster lie in this box; of directional lights the unit vectors.
#[derive(Clone, Copy, Debug)]
pub struct LightBox {
    /// Middle.
    pub centre: Vec3A,
    /// Half extents, not negative.
    pub half: Vec3A,
    /// All vectors in it are unit vectors.
    pub unit: bool,
}

/// A unit axis and all that equation 4 needs of it, to be used with many boxes.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// To a frame whose third axis it is.
    local_from_world: Mat3A,
    /// The same with all elements' sizes.
    sizes: Mat3A,
}

impl Axis {
    /// Of a unit vector.
    #[inline]
    pub fn new(direction: Vec3) -> Axis {
        let Frame {
            tangent: t,
            bitangent: b,
            normal: n,
        } = Frame::around(direction);
        let local_from_world = Mat3A::from_cols(
            Vec3A::new(t.x, b.x, n.x),
            Vec3A::new(t.y, b.y, n.y),
            Vec3A::new(t.z, b.z, n.z),
        );
        Axis {
            local_from_world,
            sizes: local_from_world.abs(),
        }
    }

    /// The unit vector itself.
    pub fn direction(&self) -> Vec3 {
        let m = &self.local_from_world;
        Vec3::new(m.x_axis.z, m.y_axis.z, m.z_axis.z)
    }
}

/// The smallest angle with an axis that anything in a box may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angle {
    /// Largest cosine, −1..=1.
    pub cos: f32,
    /// The sine of that angle, not above the true one: for small angles the cosine has lost its digits. 0..=1.
    pub sin: f32,
}

impl LightBox {
    /// As seen from `x`.
    #[inline]
    pub fn new(node: &ClusterNode, emission: ClusterEmission, x: Vec3) -> LightBox {
        let unit = emission == ClusterEmission::Directional;
        let origin = if unit { Vec3A::ZERO } else { x.into() };
        // Differences first: near a light far from the origin the digits are in them.
        let (low, high) = (Vec3A::from(node.low) - origin, Vec3A::from(node.high) - origin);
        LightBox {
            centre: (low + high) * 0.5,
            half: (high - low) * 0.5,
            unit,
        }
    }

    /// Smallest squared length of a vector in it.
    #[inline]
    pub fn nearest_squared(&self) -> f32 {
        (self.centre.abs() - self.half).max(Vec3A::ZERO).length_squared()
    }

    /// Smallest angle with the axis, equation 4.
    #[inline]
    pub fn angle(&self, axis: &Axis) -> Angle {
        let centre = axis.local_from_world * self.centre;
        let half = axis.sizes * self.half;
        let height = centre.z + half.z;
        let across = if height >= 0.0 {
            (centre.abs() - half).max(Vec3A::ZERO)
        } else {
            centre.abs() + half
        };
        let across2 = across.x * across.x + across.y * across.y;
        let length = (across2 + height * height).sqrt();
        let (mut cos, mut sin) = (height / length, across2.sqrt() / length);
        if length.is_nan() || length <= 0.0 || length == f32::INFINITY {
            (cos, sin) = (1.0, 0.0);
        }
        if self.unit && height < cos {
            // The square magnifies the height's rounding near the axis.
            let by_height = (1.0 - height * height - 6e-7).max(0.0).sqrt();
            (cos, sin) = (height, sin.max(by_height));
        }
        // A box narrower than its own rounding: up to here the sine may be too large, and the cosine too small.
        let sin = (sin - SINE_ROUNDING).max(0.0);
        Angle {
            cos: if cos > 0.0 {
                (cos * LOOSE).min(1.0)
            } else {
                (cos + SINE_ROUNDING).min(1.0)
            },
            sin,
        }
    }
}

/// Most that any light of the node sends to a point, as a factor of its intensity ([`crate::point_light::Arrival`]'s
/// factor): infinite for a point within the box.
#[inline]
pub fn geometric_bound(node: &ClusterNode, emission: ClusterEmission, seen: &LightBox) -> f32 {
    let leaving = match emission {
        ClusterEmission::Directional => return 1.0,
        ClusterEmission::Omni => 1.0,
        ClusterEmission::Oriented => emission_cosine(node, seen).max(0.0),
        // The rim magnifies the cosine's rounding by its steepness; a beam's edge this near is not worth more digits.
        ClusterEmission::Spot(envelope) => envelope.towards(emission_cosine(node, seen) + 2e-6),
    };
    if leaving <= 0.0 {
        return 0.0;
    }
    leaving / seen.nearest_squared() * LOOSE
}

/// Largest cosine between a light's axis and the way from it to the point (figure 5): all lights are moved to the
/// origin, and the point becomes the box turned over.
#[inline]
fn emission_cosine(node: &ClusterNode, seen: &LightBox) -> f32 {
    let turned = LightBox {
        centre: -seen.centre,
        ..*seen
    };
    let angle = turned.angle(&Axis::new(node.axis));
    // cos(θ − half), with θ beyond half.
    let (sin_half, cos_half) = node.half_angle();
    if angle.cos >= cos_half {
        return 1.0;
    }
    // The angle's sine is a lower bound, here the upper one is wanted: from the cosine, rounded up.
    let sin = (1.0 - angle.cos * angle.cos).max(0.0).sqrt();
    (angle.cos * cos_half + sin * sin_half + 1e-6).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light_clusters::{BuildSettings, build};
    use crate::point_light::{Emission, PointLight};
    use crate::random::Stream;
    use crate::test_random::direction;

    /// A cluster of up to 8 lights of one type around a place, of any width.
    fn random_cluster(s: &mut Stream) -> Vec<PointLight> {
        let middle = direction(s) * 10f32.powf(4.0 * s.uniform() - 2.0);
        let width = 10f32.powf(5.0 * s.uniform() - 4.0);
        let (axis, spread) = (direction(s), 2.0 * s.uniform() * s.uniform());
        let kind = (s.uniform() * 5.0) as u32;
        let flat = if s.uniform() < 0.5 { 0.0 } else { 1.0 };
        (0..1 + (s.uniform() * 8.0) as u32)
            .map(|_| {
                let outer = s.uniform();
                let inner = outer + (1.0 - outer) * s.uniform().max(0.01);
                let position = middle + direction(s) * Vec3::new(1.0, 1.0, flat) * width;
                PointLight {
                    emission: match kind {
                        0 => Emission::Omni,
                        1 => Emission::Oriented,
                        2 => Emission::Spot {
                            scale: 1.0 / (inner - outer),
                            offset: -outer / (inner - outer),
                        },
                        3 => Emission::Measured { profile: 0, outer },
                        _ => Emission::Directional,
                    },
                    position: if kind == 4 { Vec3::ZERO } else { position },
                    axis: (axis + direction(s) * spread).try_normalize().unwrap_or(axis),
                    intensity: Vec3::splat(s.uniform() + 0.1),
                }
            })
            .collect()
    }

    /// Truth: every light of the cluster one by one.
    #[test]
    fn no_light_of_a_cluster_sends_more_than_the_bound() {
        let (mut tight, mut counted) = (0.0f64, 0u32);
        for case in 0..200_000 {
            let mut s = Stream::new(5, 0, case);
            let lights = random_cluster(&mut s);
            let trees = build(&lights, &[], 1.0, &BuildSettings::default());
            let root = trees.roots[0].node;
            let (node, emission) = (&trees.nodes[root as usize], trees.emission(root));
            let x = direction(&mut s) * 10f32.powf(4.0 * s.uniform() - 2.0);
            let seen = LightBox::new(node, emission, x);
            let bound = geometric_bound(node, emission, &seen);
            let axis = Axis::new(direction(&mut s));
            let angle = seen.angle(&axis);
            let mut most = 0.0f32;
            for light in &lights {
                let Some(arrival) = light.arrival(x) else { continue };
                most = most.max(arrival.factor);
                assert!(
                    arrival.factor <= bound,
                    "{case}: {light:?} {bound} {node:?} {x} {}",
                    arrival.factor / bound - 1.0
                );
                let cos = arrival.direction.dot(axis.direction());
                assert!(cos <= angle.cos + 1e-6, "{case}: cosine {cos} {angle:?}");
                let sin = arrival.direction.cross(axis.direction()).length();
                assert!(cos <= 0.0 || sin >= angle.sin, "{case}: sine {sin} {angle:?}");
            }
            if most > 0.0 && bound.is_finite() {
                tight += f64::from(most / bound);
                counted += 1;
            }
        }
        // A bound that is far off would be of no use.
        assert!(tight / f64::from(counted) > 0.5, "{}", tight / f64::from(counted));
    }

    #[test]
    fn a_single_light_is_bounded_by_what_it_sends() {
        for case in 0..1000 {
            let mut s = Stream::new(6, 0, case);
            let mut lights = random_cluster(&mut s);
            lights.truncate(1);
            let trees = build(&lights, &[], 1.0, &BuildSettings::default());
            let x = direction(&mut s);
            let (node, emission) = (&trees.nodes[0], trees.emission(0));
            let bound = geometric_bound(node, emission, &LightBox::new(node, emission, x));
            let sent = lights[0].arrival(x).map_or(0.0, |a| a.factor);
            // A spot's rim magnifies the cosine's rounding at most a hundredfold here.
            let (square, rim) = (lights[0].position.distance_squared(x), 2e-3);
            assert!(
                bound - sent <= rim * (bound + 1.0 / square),
                "{case}: {bound} {sent}"
            );
        }
    }
}
