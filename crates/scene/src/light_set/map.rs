//! Environment maps as they are turned and scaled at a frame.

use crate::environment::{EnvironmentSampler, direction_from_uv, uv_from_direction};
use crate::light::EnvironmentMap;
use glam::Vec3;
use std::sync::Arc;

/// An environment map at one frame.
#[derive(Clone)]
pub(super) struct TurnedMap {
    pub map: Arc<EnvironmentMap>,
    pub sampler: Arc<EnvironmentSampler>,
    pub scale: Vec3,
    /// Turns of the map about +Y.
    pub turn: f32,
}

impl TurnedMap {
    pub(super) fn map_uv(&self, direction: Vec3) -> [f32; 2] {
        let [u, v] = uv_from_direction(direction);
        let u = u + self.turn;
        [u - u.floor(), v]
    }

    pub(super) fn radiance(&self, map_uv: [f32; 2]) -> Vec3 {
        self.map.at(map_uv) * self.scale
    }

    pub(super) fn sample(&self, random: [f32; 2]) -> (Vec3, Vec3, f32) {
        let ([u, v], pdf) = self.sampler.sample(random);
        (direction_from_uv([u - self.turn, v]), self.radiance([u, v]), pdf)
    }
}
