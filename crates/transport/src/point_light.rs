//! Lights without extent, as which many-light methods see every light.
//!
//! Source: Walter et al. 2005, section 3 (omni, oriented and directional lights; L = Σ M G V I); spot lights are beyond
//! that paper and fall off as the sequence's do.

use glam::Vec3;

/// How a light without extent shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Emission {
    /// Alike in all directions.
    Omni,
    /// With the cosine about the axis: a point of a surface that emits or reflects like Lambert's.
    Oriented,
    /// The same for a patch of surface, which those near by see with its extent.
    Patch(Patch),
    /// Within a cone about the axis.
    Spot {
        /// Factor and summand of the cosine to the axis; their sum, clamped to 0..1 and squared, scales the intensity
        /// (KHR_lights_punctual).
        scale: f32,
        /// See `scale`.
        offset: f32,
    },
    /// As was measured: the intensity is the largest one in any direction, and whoever has the measurement multiplies with its share. Here it is
    /// known that nothing leaves at cosines to the axis below `outer`.
    Measured {
        /// Which measurement.
        profile: u32,
        /// Smallest cosine to the axis with light.
        outer: f32,
    },
    /// From infinitely far, along the axis.
    Directional,
}

/// A rectangle at right angles to a light's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// From the light to the rectangle's middle, metres.
    pub middle: Vec3,
    /// From there to the middles of two sides.
    pub halves: [Vec3; 2],
}

/// A light without extent, or nearly so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// How it shines.
    pub emission: Emission,
    /// World space, metres; of directional lights unused and zero.
    pub position: Vec3,
    /// Unit: the way in which it shines; of omni lights unused and zero.
    pub axis: Vec3,
    /// RGB: W/sr along the axis, or where it is largest; of directional lights W/m² on a surface that faces them. Finite, not negative.
    pub intensity: Vec3,
}

/// What reaches a point from a light if nothing is in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Unit, towards the light.
    pub direction: Vec3,
    /// Metres; infinite from directional lights.
    pub distance: f32,
    /// What the light's intensity is multiplied with to give the irradiance on a surface that faces the light: per m²,
    /// or 1 for directional lights.
    pub factor: f32,
}

/// Squared distance, in areas, up to which a patch is seen with its extent: beyond, one light is off by some hundredths.
const NEAR: f32 = 16.0;

impl Patch {
    /// m².
    pub fn area(&self) -> f32 {
        4.0 * self.halves[0].cross(self.halves[1]).length()
    }

    /// What reaches `x`, as seen from the light, which is at `distance`: Lambert's sum over the edges (Arvo 1994, equation 5: the
    /// irradiance of a polygon); its direction is that of the vector irradiance.
    fn arrival(&self, x: Vec3, distance: f32) -> Option<Arrival> {
        let [u, v] = self.halves;
        let from_x = self.middle - x;
        let corners = [u + v, v - u, -u - v, u - v].map(|corner| (from_x + corner).normalize());
        let mut sum = Vec3::ZERO;
        for (k, &corner) in corners.iter().enumerate() {
            let next = corners[(k + 1) % 4];
            let across = corner.cross(next);
            let sin = across.length();
            // An edge that is seen from its end has no plane and no angle.
            if sin > 0.0 {
                sum += across * (sin.atan2(corner.dot(next)) / sin);
            }
        }
        // Either way around.
        if sum.dot(from_x) < 0.0 {
            sum = -sum;
        }
        let length = sum.length();
        let factor = 0.5 * length / self.area();
        (factor > 0.0 && factor.is_finite()).then(|| Arrival {
            direction: sum / length,
            distance,
            factor,
        })
    }
}

impl PointLight {
    /// What reaches `x`, of measured lights at most; `None` if nothing does, because `x` lies behind the light, outside its cone, or on it.
    pub fn arrival(&self, x: Vec3) -> Option<Arrival> {
        if self.emission == Emission::Directional {
            return Some(Arrival {
                direction: -self.axis,
                distance: f32::INFINITY,
                factor: 1.0,
            });
        }
        let to_light = self.position - x;
        let distance = to_light.length();
        let direction = to_light / distance;
        let emitted = self.emission.towards(-direction.dot(self.axis));
        if emitted > 0.0
            && let Emission::Patch(patch) = self.emission
            && distance * distance < NEAR * patch.area()
        {
            return patch.arrival(-to_light, distance);
        }
        let factor = emitted / (distance * distance);
        (factor > 0.0 && factor.is_finite()).then_some(Arrival {
            direction,
            distance,
            factor,
        })
    }
}

impl Emission {
    /// Share of the intensity along the axis that leaves at the cosine `cos` to it.
    pub fn towards(self, cos: f32) -> f32 {
        match self {
            Emission::Omni | Emission::Directional => 1.0,
            Emission::Oriented | Emission::Patch(_) => cos.max(0.0),
            Emission::Spot { scale, offset } => {
                let share = (cos * scale + offset).clamp(0.0, 1.0);
                share * share
            }
            // The most that it may be.
            Emission::Measured { outer, .. } => f32::from(cos >= outer),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_reaches_what_it_shines_at_with_the_inverse_square() {
        let light = |emission| PointLight {
            emission,
            position: Vec3::new(0.0, 2.0, 0.0),
            axis: Vec3::NEG_Y,
            intensity: Vec3::ONE,
        };
        let below = Vec3::ZERO;
        let arrival = light(Emission::Oriented).arrival(below).unwrap();
        assert_eq!(
            (arrival.direction, arrival.distance, arrival.factor),
            (Vec3::Y, 2.0, 0.25)
        );
        let aslant = Vec3::new(2.0, 0.0, 0.0);
        let cos = 0.5f32.sqrt();
        let arrival = light(Emission::Oriented).arrival(aslant).unwrap();
        assert!((arrival.factor - cos / 8.0).abs() < 1e-7);
        assert!(
            light(Emission::Oriented)
                .arrival(Vec3::new(0.0, 3.0, 0.0))
                .is_none()
        );
        assert_eq!(
            light(Emission::Omni)
                .arrival(Vec3::new(0.0, 3.0, 0.0))
                .unwrap()
                .factor,
            1.0
        );
        assert!(
            light(Emission::Omni)
                .arrival(light(Emission::Omni).position)
                .is_none()
        );
        let sun = light(Emission::Directional).arrival(aslant).unwrap();
        assert_eq!(
            (sun.direction, sun.distance, sun.factor),
            (Vec3::Y, f32::INFINITY, 1.0)
        );
        let spot = Emission::Spot {
            scale: 1.0 / (1.0 - cos),
            offset: -cos / (1.0 - cos),
        };
        assert_eq!(light(spot).arrival(below).unwrap().factor, 0.25);
        assert!(light(spot).arrival(aslant * 1.01).is_none());
    }

    /// Truth: the patch as ten thousand lights without extent. Tolerance: their sum; of the two places beyond [`NEAR`], that one light stands for
    /// the patch, along the surface more than above it.
    #[test]
    fn a_patch_lights_what_is_near_as_its_parts_do() {
        let axis = Vec3::new(0.3, -0.8, 0.2).normalize();
        let (u, v) = axis.any_orthonormal_pair();
        let oriented = PointLight {
            emission: Emission::Oriented,
            position: Vec3::new(1.0, 2.0, 3.0),
            axis,
            intensity: Vec3::ONE,
        };
        let [long, wide, aside] = [0.4f32, 0.2, 0.01];
        let patch = PointLight {
            emission: Emission::Patch(Patch {
                middle: u * aside,
                halves: [0.5 * long * u, 0.5 * wide * v],
            }),
            ..oriented
        };
        for (along, beside, away, tolerance) in [
            (0.0, 0.0, 0.15, 0.01),
            (0.5, -0.2, 0.15, 0.01),
            (0.3, 0.3, 1.2, 0.02),
            (1.5, 0.4, 0.3, 0.05),
        ] {
            let x = patch.position + u * along + v * beside + axis * away;
            let mut vector = Vec3::ZERO;
            for k in 0..10_000 {
                let [a, b] = [k / 100, k % 100].map(|k: u32| (k as f32 + 0.5) / 100.0 - 0.5);
                let part = PointLight {
                    position: patch.position + u * (aside + a * long) + v * (b * wide),
                    ..oriented
                };
                let arrival = part.arrival(x).unwrap();
                vector += arrival.direction * arrival.factor * 1e-4;
            }
            let arrival = patch.arrival(x).unwrap();
            let found = arrival.direction * arrival.factor;
            assert!(
                found.distance(vector) < tolerance * vector.length(),
                "{found} {vector}"
            );
        }
        assert!(patch.arrival(patch.position - axis * 0.1).is_none(), "behind it");
        assert!(patch.arrival(patch.position).is_none(), "on it");
    }
}
