//! Flicker of indirect light as a lamp glides, and of light of visibility cuts as a map turns.

use crate::numbers::percentiles;
use crate::page::{Page, Table};
use crate::program::{Baked, FOLDER, Result, SHARED, absent};
use glam::Vec3;
use relight_data_generate::random;
use relight_play::{FrameSettings, Integrator, Player, ShotSettings, Tracer};
use relight_render::lightcuts::LightcutSettings;
use relight_render::many_lights::PointSettings;
use relight_render::pixelcuts::PixelcutsSettings;
use relight_scene::animated::Animated;
use relight_scene::camera::Camera;
use relight_scene::environment::read_environment;
use relight_scene::image::flicker::{Flicker, greys};
use relight_scene::light::{LightKind, LightTrack};
use std::path::Path;
use std::sync::Arc;

/// Frames of each sequence.
const FRAMES: usize = 16;
/// How far the lamp goes, metres, and the map, degrees.
const WAY: f32 = 0.3;
const TURN: f32 = 15.0;
/// Watts per steradian of the lamp in scenes without one of their own place for it.
const INTENSITY: f32 = 150.0;
/// Metres from the camera to that lamp, and the radius of the sphere lamp.
const AHEAD: f32 = 1.0;
const RADIUS: f32 = 0.2;
const VIRTUAL_LIGHTS: u32 = 20_000;
/// Samples a pixel of path tracing, which tells where the lamp's light is smooth.
const TRUTH_SPP: u32 = 1024;
const MAP: &str = "data/sky.hdr";
/// Who makes the light.
const BY: [&str; 5] = [
    "transfer, point lamp",
    "transfer, sphere lamp",
    "lightcuts, point lamp",
    "pixelcuts, point lamp",
    "visibility cuts, map that turns",
];

/// A scene, and what it had before virtual lights and shadows' edges stood still: commit edd9447, seen by hand and not measured by
/// this program; empty where nobody looked.
pub struct Scene {
    /// As the table has it.
    pub name: &'static str,
    file: Source,
    preset: &'static str,
    size: [usize; 2],
    lamp: Option<[f32; 3]>,
    before: [&'static str; BY.len()],
}

enum Source {
    Own(&'static str),
    Other(&'static str),
    Seed(u64),
}

/// The scenes, the slowest last; `--fast` takes the first.
pub const SCENES: [Scene; 5] = [
    Scene {
        name: "modern_hall",
        file: Source::Other("modern_hall.glb"),
        before: ["0.002, 0.05, 0.23", "", "2.0, 12.6, 19.2", "1.6, 12.1, 23.5", ""],
        ..Scene::of_seed("", 0, [""; BY.len()])
    },
    Scene::of_seed(
        "random 8",
        8,
        ["0.008, 1.9, 7.6", "", "2.8, 21.0, 41.6", "1.1, 13.6, 32.5", ""],
    ),
    Scene::of_seed(
        "random 15",
        15,
        ["0.1, 1.6, 2.3", "", "2.1, 14.3, 24.3", "1.2, 12.7, 23.8", ""],
    ),
    Scene::of_seed(
        "random 34",
        34,
        ["0.052, 1.2, 5.4", "", "3.0, 15.4, 23.7", "1.2, 9.1, 16.4", ""],
    ),
    Scene {
        name: "atrium",
        file: Source::Own("data/atrium.glb"),
        preset: "standard",
        size: [80, 45],
        lamp: Some([-2.0, 2.5, 0.3]),
        before: [
            "0.1, 4.0, 16.9",
            "0.057, 2.2, 8.0",
            "6.0, 31.7, 54.3",
            "3.4, 28.1, 69.1",
            "0.01, 0.2, 0.4",
        ],
    },
];

impl Scene {
    /// As `--only` takes it.
    pub fn case(&self) -> String {
        format!("flicker/{}", self.name)
    }

    const fn of_seed(name: &'static str, seed: u64, before: [&'static str; BY.len()]) -> Scene {
        Scene {
            name,
            file: Source::Seed(seed),
            preset: "draft",
            size: [64, 36],
            lamp: None,
            before,
        }
    }
}

/// A light on its way from 0 to 1.
type Light<'a> = &'a dyn Fn(f32) -> LightTrack;

/// Five rows of a scene.
pub fn flicker(page: &mut Page, scene: &Scene) -> Result<()> {
    let file = match scene.file {
        Source::Own(file) => file.to_owned(),
        Source::Other(file) => format!("{SHARED}/scenes/{file}"),
        Source::Seed(seed) => {
            let file = format!("{FOLDER}/random_{seed}.glb");
            std::fs::write(&file, random(seed).glb.to_bytes()).map_err(|error| format!("{file}: {error}"))?;
            file
        }
    };
    if let Some(why) = absent([&*file]) {
        return page.without(&[Table::Flicker], scene.name, &why);
    }
    let options = format!("--preset {} --cuts environment", scene.preset);
    let asset = format!("{FOLDER}/flicker_{}.relight", scene.name.replace(' ', "_"));
    let baked = Baked::new(&file, asset, &options)?;
    let player = Player::open(&baked.asset)?;
    let camera = player.camera(&player.scene().sequence, None)?.at(0.0);
    let start = (scene.lamp).map_or(camera.position + AHEAD * camera.forward, Vec3::from);
    let map = Arc::new(read_environment(Path::new(MAP))?);
    let points = PointSettings {
        vpls: VIRTUAL_LIGHTS,
        ..PointSettings::default()
    };
    let lamp = |at: f32| LightTrack {
        name: "lamp".into(),
        kind: LightKind::Point {
            position: Animated::Constant(start + Vec3::X * (WAY * at)),
            intensity: Animated::Constant(INTENSITY * Vec3::new(1.0, 14.0 / 15.0, 0.8)),
        },
    };
    let globe = |at: f32| LightTrack {
        name: "globe".into(),
        kind: LightKind::Sphere {
            center: Animated::Constant(start + Vec3::X * (WAY * at)),
            radius: Animated::Constant(RADIUS),
            radiance: Animated::Constant(Vec3::splat(1000.0)),
        },
    };
    let sky = |at: f32| LightTrack {
        name: "sky".into(),
        kind: LightKind::Environment {
            maps: map.clone().into(),
            file: MAP.into(),
            scale: Animated::Constant(Vec3::ONE),
            rotation_deg: Animated::Constant(TURN * at),
        },
    };
    let lightcuts = Tracer::Lightcuts {
        points,
        cuts: LightcutSettings::default(),
        reconstruction: false,
    };
    let pixelcuts = Tracer::Pixelcuts {
        points,
        cuts: PixelcutsSettings::default(),
    };
    let film = |integrator, layer, spp| Film {
        player: &player,
        camera,
        size: scene.size,
        integrator,
        layer,
        spp,
    };
    let mut truths = Vec::new();
    let lights: [(&str, Light); 2] = [("point lamp", &lamp), ("sphere lamp", &globe)];
    for (name, light) in lights {
        eprintln!("flicker: {}: truth, {name}", scene.name);
        let path = Tracer::Path { max_bounces: None };
        let truth = film(path.into(), "indirect", Some(TRUTH_SPP)).frames(light)?;
        page.row(
            Table::Flicker,
            &[
                scene.name.into(),
                format!("path tracing, {name}"),
                "–".into(),
                percentiles(Flicker::of(truth.clone())),
                "–".into(),
            ],
        )?;
        truths.push((name, truth));
    }
    let ways: [(Integrator, &str, Light); BY.len()] = [
        (Integrator::Transfer, "indirect", &lamp),
        (Integrator::Transfer, "indirect", &globe),
        (lightcuts.into(), "indirect", &lamp),
        (pixelcuts.into(), "indirect", &lamp),
        (Integrator::Cuts, "direct", &sky),
    ];
    for (((integrator, layer, light), by), before) in ways.into_iter().zip(BY).zip(scene.before) {
        eprintln!("flicker: {}: {by}", scene.name);
        let frames = film(integrator, layer, None).frames(light)?;
        let before = if before.is_empty() { "–" } else { before };
        let cells = [
            scene.name.into(),
            by.into(),
            before.into(),
            percentiles(Flicker::of(frames.clone())),
            match truths.iter().find(|(light, _)| by.ends_with(light)) {
                Some((_, truth)) => where_smooth(frames, truth),
                None => "–".into(),
            },
        ];
        page.row(Table::Flicker, &cells)?;
    }
    Ok(())
}

/// Percentiles where truth is smooth, and of how many pixels.
fn where_smooth(frames: Vec<Vec<f32>>, truth: &[Vec<f32>]) -> String {
    let (found, share) = Flicker::where_smooth(frames, truth);
    format!("{} ({:.0} %)", percentiles(found), 100.0 * share)
}

/// A sequence of one light.
struct Film<'a> {
    player: &'a Player,
    camera: Camera,
    size: [usize; 2],
    integrator: Integrator,
    layer: &'static str,
    spp: Option<u32>,
}

impl Film<'_> {
    /// Its layer's grey values as `light` goes from 0 to 1.
    fn frames(&self, light: Light) -> Result<Vec<Vec<f32>>> {
        let settings = ShotSettings {
            integrator: self.integrator.clone(),
            width: self.size[0],
            height: self.size[1],
            samples: self.spp,
            ..ShotSettings::default()
        };
        let shot = self.player.shot(&self.camera, &settings)?;
        let mut frames = Vec::with_capacity(FRAMES);
        for frame in 0..FRAMES {
            let lights = self.player.lights(&[light(frame as f32 / (FRAMES - 1) as f32)])?;
            let frame = (self.player).frame(&shot, &lights, 0.0, &FrameSettings::default())?;
            let layer = frame.layers.rgb(self.layer);
            frames.push(greys(
                &layer.ok_or_else(|| format!("a frame has no layer {}", self.layer))?,
            ));
        }
        Ok(frames)
    }
}
