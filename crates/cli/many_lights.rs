//! Options of the integrators over lights without extent, and what the JSON says of them.

use crate::session::milliseconds;
use clap::Args;
use relight_play::many_lights::{PointLights, PointSettings};
use relight_scene::light_set::LightSet;
use relight_scene::traced::TracedScene;
use serde_json::{Map, Value};
use std::time::Instant;

/// How many lights without extent stand for all lights.
#[derive(Args, Clone, Debug)]
pub struct PointArgs {
    /// Points over all area lights together, each light gets one at least; brute takes the same points [default: 64 per
    /// light, for emissive surfaces of more triangles one each, up to 4096].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16_777_216))]
    pub area_samples: Option<u32>,
    /// Virtual lights, which make indirect light.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=16_777_216))]
    pub vpls: Option<u32>,
    /// Largest share of the light at a pixel that a single virtual light may have; inf for no limit.
    #[arg(long, value_name = "SHARE", default_value_t = PointSettings::default().clamp, value_parser = share)]
    pub clamp: f32,
}

impl Default for PointArgs {
    fn default() -> Self {
        PointArgs {
            area_samples: None,
            vpls: None,
            clamp: PointSettings::default().clamp,
        }
    }
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 => Ok(value),
        _ => Err("must be a number above 0".into()),
    }
}

impl PointArgs {
    /// Whether points were asked for.
    pub fn given(&self) -> bool {
        self.area_samples.is_some() || self.vpls.is_some()
    }

    /// The points of a frame; `times` gets how long it took and how many there are.
    pub fn points(
        &self,
        scene: &TracedScene,
        lights: &LightSet,
        seed: u64,
        times: &mut Map<String, Value>,
    ) -> PointLights {
        let start = Instant::now();
        let settings = PointSettings {
            area_samples: self.area_samples,
            vpls: self.vpls.unwrap_or(0),
            clamp: self.clamp,
            seed,
            ..PointSettings::default()
        };
        let points = PointLights::new(scene, lights, &settings);
        times.insert("points".into(), milliseconds(start).into());
        times.insert("lights".into(), points.len().into());
        times.insert("virtual_lights".into(), (points.len() - points.direct).into());
        points
    }
}
