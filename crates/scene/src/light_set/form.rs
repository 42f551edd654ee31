//! What the lights of a frame are, for algorithms that take them apart, such as lights to points.

use super::emitters::EmissiveTriangle;
use super::map::TurnedMap;
use crate::environment_strata::{Stratum, strata};
use crate::photometry::{LampAxes, Photometry};
use glam::Vec3;
use std::sync::Arc;

/// What a light is at one frame. World space, metres and radiometric units; every vector finite.
pub enum LightForm<'a> {
    /// Nothing shines.
    Dark,
    /// W/sr, the same in all directions.
    Point {
        /// Where it is.
        position: Vec3,
        /// RGB, W/sr.
        intensity: Vec3,
    },
    /// As a point light, times (cos · `scale` + `offset`) clamped to 0..1 and squared (KHR_lights_punctual).
    Spot {
        /// Where it is.
        position: Vec3,
        /// Unit, the way it shines.
        axis: Vec3,
        /// Of the cosine to the axis.
        scale: f32,
        /// See `scale`.
        offset: f32,
        /// RGB on the axis, W/sr.
        intensity: Vec3,
    },
    /// A lamp without extent that shines as a photometric file says.
    Profile {
        /// Where it is.
        position: Vec3,
        /// How the file's angles lie.
        axes: LampAxes,
        /// The file.
        profile: &'a Arc<Photometry>,
        /// RGB, W/sr per candela.
        scale: Vec3,
    },
    /// Parallel light.
    Directional {
        /// Unit, the way it shines.
        axis: Vec3,
        /// RGB, W/m² on a surface that faces it.
        irradiance: Vec3,
    },
    /// A parallelogram that emits towards `edge_u × edge_v`.
    Rect {
        /// One corner; the others are at + `edge_u`, + `edge_v` and + both.
        corner: Vec3,
        /// One full side.
        edge_u: Vec3,
        /// The other full side.
        edge_v: Vec3,
        /// RGB, W/(m² sr).
        radiance: Vec3,
    },
    /// A sphere that emits outwards.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// Metres.
        radius: f32,
        /// RGB, W/(m² sr).
        radiance: Vec3,
    },
    /// Light from all around.
    Environment(DistantMap<'a>),
    /// Sun and sky.
    SunSky {
        /// The sky.
        sky: DistantMap<'a>,
        /// Unit, towards the middle of the sun's disc.
        sun: Vec3,
        /// Radius of the disc seen from the scene: 1 − cos of its half angle.
        one_minus_cos: f64,
        /// RGB, W/(m² sr).
        sun_radiance: Vec3,
    },
    /// Surfaces of the scene. Their emission is [`super::emitters::Emitters::emitted`] × [`super::emitters::Emitters::coverage`] × `scale`.
    Emissive {
        /// Which of them.
        triangles: Vec<&'a EmissiveTriangle>,
        /// RGB factor.
        scale: Vec3,
    },
}

/// An environment at one frame.
pub struct DistantMap<'a> {
    environment: &'a TurnedMap,
}

impl<'a> DistantMap<'a> {
    pub(super) fn new(environment: &'a TurnedMap) -> Self {
        DistantMap { environment }
    }

    /// At most `count` directions that stand for all of it, each for one of as many disjoint parts
    /// ([`mod@crate::environment_strata`]). `random(i)` are three uniform numbers in [0, 1) for part i.
    pub fn strata(&self, count: usize, random: impl FnMut(usize) -> [f32; 3]) -> Vec<Stratum> {
        let TurnedMap { map, scale, turn, .. } = self.environment;
        let mut strata = strata(map, *turn, count, random);
        for stratum in &mut strata {
            stratum.flux *= scale.as_dvec3();
        }
        strata
    }
}
