//! Lights as they are at one frame (design sections 2 and 4 for units).

use crate::animated::Animated;
use glam::Vec3;
use std::sync::Arc;

/// A light over time, as a sequence or a scene describes it. Units: design section 2.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTrack {
    /// Its name: layers are called `light.<name>`. Unique within a sequence.
    pub name: String,
    /// What it is.
    pub kind: LightKind,
}

impl LightTrack {
    /// Whether its light comes from all around, from beyond the scene: an environment, or sun and sky.
    pub fn is_distant(&self) -> bool {
        matches!(
            self.kind,
            LightKind::Environment { .. } | LightKind::SunSky { .. }
        )
    }
}

/// The kinds of lights of a sequence, with values over time.
#[derive(Clone, Debug, PartialEq)]
pub enum LightKind {
    /// Radiant intensity in W/sr, the same in all directions.
    Point {
        /// World space, metres.
        position: Animated<Vec3>,
        /// RGB, W/sr.
        intensity: Animated<Vec3>,
    },
    /// As a point light, with the angular fall-off of KHR_lights_punctual.
    Spot {
        /// World space, metres.
        position: Animated<Vec3>,
        /// The way the light points; need not be of unit length.
        direction: Animated<Vec3>,
        /// Half angle of the full-intensity cone, degrees.
        inner_angle_deg: Animated<f32>,
        /// Half angle beyond which there is no light, degrees, at most 90.
        outer_angle_deg: Animated<f32>,
        /// RGB on the axis, W/sr.
        intensity: Animated<Vec3>,
    },
    /// Parallel light from infinitely far away.
    Directional {
        /// The way the light travels.
        direction: Animated<Vec3>,
        /// RGB on a perpendicular surface, W/m².
        irradiance: Animated<Vec3>,
    },
    /// A rectangle that emits towards `edge_u × edge_v`.
    Rect {
        /// Its middle.
        center: Animated<Vec3>,
        /// One full side.
        edge_u: Animated<Vec3>,
        /// The other full side.
        edge_v: Animated<Vec3>,
        /// RGB, W/(m² sr).
        radiance: Animated<Vec3>,
    },
    /// A sphere that emits outwards.
    Sphere {
        /// Its middle.
        center: Animated<Vec3>,
        /// Metres.
        radius: Animated<f32>,
        /// RGB, W/(m² sr).
        radiance: Animated<Vec3>,
    },
    /// Light from all around, infinitely far away.
    Environment {
        /// The map, shared by all frames.
        map: Arc<EnvironmentMap>,
        /// The file as the sequence names it (kept for error messages and logs).
        file: String,
        /// RGB factor.
        scale: Animated<Vec3>,
        /// Turns the map counter-clockwise about +Y seen from above.
        rotation_deg: Animated<f32>,
    },
    /// Sun and clear sky.
    SunSky {
        /// 2 (very clear) to 10 (hazy).
        turbidity: Animated<f32>,
        /// Towards the sun; need not be of unit length.
        sun_direction: Animated<Vec3>,
        /// RGB factor.
        scale: Animated<Vec3>,
    },
    /// Lets emissive materials of the scene shine.
    Emissive {
        /// Materials of this name; all emissive ones where `None`.
        material: Option<String>,
        /// RGB factor on the material's emission.
        scale: Animated<Vec3>,
    },
}

/// An equirectangular image of radiance from all directions, oriented as design section 2 says.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// Pixels across.
    pub width: usize,
    /// Pixels down; row 0 looks up (+Y).
    pub height: usize,
    /// Linear RGB radiance, row by row. Finite and non-negative.
    pub pixels: Vec<Vec3>,
}
