//! Options of the integrators over lights without extent, and what the JSON says of them.

use crate::failure::Failure;
use crate::play::Integrator;
use crate::session::milliseconds;
use clap::Args;
use relight_render::many_lights::{PointLights, PointSettings};
use relight_render::pixelcuts::{PixelcutsSettings, PixelcutsStats, PixelcutsTimes};
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

/// How pixelcuts go about it.
#[derive(Args, Clone, Debug, Default)]
pub struct PixelcutsArgs {
    /// Clusters of pixels that each light is sent to, before refinement (pixelcuts) [default: 2048].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_048_576))]
    pub clusters: Option<u32>,
    /// Trees of pixels, each for a random part of the lights (pixelcuts) [default: 16].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub trees: Option<u32>,
    /// Highest degree of the spherical harmonics that incident light is kept in (pixelcuts) [default: 3].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=3))]
    pub sh_degree: Option<u32>,
}

impl PixelcutsArgs {
    /// The settings of an image.
    pub fn settings(&self, spp: Option<u32>, seed: u64, light_layers: bool) -> PixelcutsSettings {
        let defaults = PixelcutsSettings::default();
        PixelcutsSettings {
            spp: spp.unwrap_or(defaults.spp),
            clusters: self.clusters.unwrap_or(defaults.clusters),
            trees: self.trees.unwrap_or(defaults.trees),
            degree: self.sh_degree.map_or(defaults.degree, |degree| degree as usize),
            seed,
            light_layers,
            ..defaults
        }
    }

    fn given(&self) -> bool {
        self.clusters.is_some() || self.trees.is_some() || self.sh_degree.is_some()
    }
}

/// Puts what pixelcuts took into the JSON of a frame.
pub fn insert_pixelcuts(times: &mut Map<String, Value>, stats: &PixelcutsStats, pixels: usize) {
    let PixelcutsTimes {
        eye,
        exact,
        estimate,
        trees,
        cuts,
        scatter,
        shade,
        resolve,
    } = stats.times;
    for (name, value) in [
        ("eye", eye),
        ("exact", exact),
        ("estimate", estimate),
        ("trees", trees),
        ("cuts", cuts),
        ("scatter", scatter),
        ("shade", shade),
        ("resolve", resolve),
    ] {
        times.insert(name.into(), value.into());
    }
    let per_pixel = |count: u64| Value::from(count as f64 / pixels as f64);
    times.insert("exact_lights".into(), stats.exact.into());
    times.insert("shadow_rays_per_pixel".into(), per_pixel(stats.shadow_rays));
    times.insert("nodes_per_pixel".into(), per_pixel(stats.clusters));
}

/// Refuses options that the integrator has no use for.
pub fn check(integrator: Integrator, points: &PointArgs, pixelcuts: &PixelcutsArgs) -> Result<(), Failure> {
    if points.given()
        && !matches!(
            integrator,
            Integrator::Brute | Integrator::Lightcuts | Integrator::Pixelcuts
        )
    {
        return Err(Failure::Usage(
            "--area-samples and --vpls belong to --integrator brute, lightcuts and pixelcuts".into(),
        ));
    }
    if pixelcuts.given() && integrator != Integrator::Pixelcuts {
        return Err(Failure::Usage(
            "--clusters, --trees and --sh-degree belong to --integrator pixelcuts".into(),
        ));
    }
    Ok(())
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
