//! Options of `--integrator lightcuts`, and a frame by it.

use crate::many_lights::PointArgs;
use crate::session::milliseconds;
use clap::{Args, ValueEnum};
use relight_render::layers::{Cancelled, RenderSize, Watch};
use relight_render::lightcuts::{self, EyeRays, LightcutSettings};
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use relight_scene::traced::TracedScene;
use serde_json::{Map, Value};
use std::time::Instant;

/// How to choose lightcuts.
#[derive(Args, Clone, Debug)]
pub struct LightcutArgs {
    /// Most error of a cluster of lights, as a share of a pixel's light (lightcuts only); 0 evaluates every light.
    #[arg(long, value_name = "SHARE", default_value_t = LightcutSettings::default().error_ratio, value_parser = share)]
    pub error_ratio: f32,
    /// Most nodes of a lightcut (lightcuts only); 0 for no limit.
    #[arg(long, value_name = "N", default_value_t = LightcutSettings::default().max_nodes)]
    pub max_nodes: usize,
    /// How visible a cluster of lights is (lightcuts only): as its parts are, or as its representative light is, as in the paper:
    /// three times as fast, but for shadows' edges, where pixels err by several percent.
    #[arg(long, value_enum, default_value_t = ClusterVisibility::Parts)]
    pub cluster_visibility: ClusterVisibility,
    /// Lightcuts at some places only, and reconstruction cuts between them (lightcuts only): several times as fast, and
    /// adaptively antialiased, but without the bounded error.
    #[arg(long, value_enum, default_value_t = Switch::Off)]
    pub reconstruction: Switch,
}

impl Default for LightcutArgs {
    fn default() -> Self {
        let settings = LightcutSettings::default();
        LightcutArgs {
            error_ratio: settings.error_ratio,
            max_nodes: settings.max_nodes,
            cluster_visibility: ClusterVisibility::Parts,
            reconstruction: Switch::Off,
        }
    }
}

/// What says how much of a cluster is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClusterVisibility {
    /// Its parts.
    Parts,
    /// Its representative light.
    Representative,
}

/// On or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Do.
    On,
    /// Don't.
    Off,
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("must be a number from 0 to 1".into()),
    }
}

/// Renders a frame; `times` gets what it took.
pub fn render(
    scene: &TracedScene,
    lights: &LightSet,
    camera: &Camera,
    size: RenderSize,
    (args, points): (&LightcutArgs, &PointArgs),
    (spp, seed, light_layers): (Option<u32>, u64, bool),
    watch: &Watch<'_>,
    times: &mut Map<String, Value>,
) -> Result<Layers, Cancelled> {
    let points = points.points(scene, lights, seed, times);
    let start = Instant::now();
    let clusters = lightcuts::trees(scene, &points, light_layers, seed);
    times.insert("tree".into(), milliseconds(start).into());
    times.insert("tree_bytes".into(), clusters.bytes().into());
    let settings = LightcutSettings {
        spp: spp.unwrap_or(LightcutSettings::default().spp),
        error_ratio: args.error_ratio,
        max_nodes: if args.max_nodes == 0 {
            usize::MAX
        } else {
            args.max_nodes
        },
        doubt: match args.cluster_visibility {
            ClusterVisibility::Parts => LightcutSettings::default().doubt,
            ClusterVisibility::Representative => f32::INFINITY,
        },
        seed,
        light_layers,
    };
    let pixels = (size.width * size.height) as f64;
    let mut per_pixel = |name: &str, count: u64| {
        times.insert(name.into(), (count as f64 / pixels).into());
    };
    let start = Instant::now();
    let layers = if args.reconstruction == Switch::On {
        let eye_rays = spp.map_or(EyeRays::default(), |spp| EyeRays {
            least: spp,
            most: spp,
        });
        let (layers, stats) = lightcuts::render_reconstructed(
            scene, lights, &points, &clusters, camera, size, &settings, eye_rays, watch,
        )?;
        per_pixel("eye_rays_per_pixel", stats.eye_rays);
        per_pixel("shadow_rays_per_pixel", stats.shadow_rays + stats.sample_rays);
        per_pixel("nodes_per_pixel", stats.sample_nodes);
        per_pixel("samples_per_pixel", stats.samples);
        let cuts = stats.cuts.max(1) as f64;
        times.insert(
            "shadow_rays_per_reconstruction_cut".into(),
            (stats.shadow_rays as f64 / cuts).into(),
        );
        layers
    } else {
        let (layers, stats) =
            lightcuts::render(scene, lights, &points, &clusters, camera, size, &settings, watch)?;
        per_pixel("shadow_rays_per_pixel", stats.shadow_rays);
        per_pixel("nodes_per_pixel", stats.nodes);
        per_pixel("limited_cuts_per_pixel", stats.limited);
        layers
    };
    times.insert("light".into(), milliseconds(start).into());
    Ok(layers)
}
