//! What the tests share: bakes that go through a file, and small images of them.

use glam::{DVec3, Vec3};
use relight_bake::params::BakeParams;
use relight_bake::{Request, Unwatched, bake};
use relight_data_generate::glb::Glb;
use relight_format::{self as format, Asset};
use relight_play::frame::light::Lit;
use relight_play::shot::RelitShot;
use relight_play::{FrameSettings, Integrator, Player, ShotSettings};
use relight_render::expose::expose;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::light::LightTrack;
use relight_scene::sequence::{Sequence, read_sequence};
use relight_scene::traced::Shading;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file of `data/`.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

/// A sequence of `data/`.
pub fn lights(name: &str) -> Sequence {
    read_sequence(&data(name)).unwrap()
}

/// Bakes a glTF file, every material as Lambert.
pub fn bake_file(scene: &Path, params: &BakeParams) -> Asset {
    let scene = Arc::new(import(scene, &ImportOptions::default()).unwrap());
    let request = Request {
        shading: Shading::Lambert,
        ..Request::new(scene, params)
    };
    bake(&request, None, &Unwatched).unwrap().asset
}

/// Bakes a scene of the generator.
pub fn bake_glb(glb: &Glb, params: &BakeParams) -> Asset {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.glb");
    std::fs::write(&file, glb.to_bytes()).unwrap();
    bake_file(&file, params)
}

/// Writes an asset and loads it as a player does.
pub fn through_file(asset: &Asset) -> Player {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.relight");
    format::write_file(&file, asset).unwrap();
    Player::open(&file).unwrap()
}

/// What the scene's first camera sees, `size` pixels square.
pub fn shot(player: &Player, size: usize) -> RelitShot {
    let camera = player.scene().cameras[0].at(0.0);
    let seen = expose(&player.prepared.scene, &camera, size, size, 1);
    let settings = ShotSettings {
        sites: None,
        ..ShotSettings::default()
    };
    player.shot_of(seen, &settings)
}

/// Lights a shot with the command line's numbers of samples.
pub fn light(player: &Player, shot: &RelitShot, tracks: &[LightTrack], light_layers: bool) -> Lit {
    light_sampled(player, shot, tracks, light_layers, 4)
}

/// As [`light`], with the direct light at each point from `point_samples` rays.
pub fn light_sampled(
    player: &Player,
    shot: &RelitShot,
    tracks: &[LightTrack],
    light_layers: bool,
    point_samples: u32,
) -> Lit {
    let lights = player.lights(tracks).unwrap();
    let settings = FrameSettings {
        point_samples,
        light_layers,
        ..FrameSettings::default()
    };
    player.light(shot, &lights, 0.0, &settings, &()).unwrap().0
}

/// Mean over places, RGB.
pub fn mean(values: &[Vec3]) -> DVec3 {
    values.iter().map(|v| v.as_dvec3()).sum::<DVec3>() / values.len() as f64
}

/// Indirect light of one light in what the scene's first camera sees, `side` pixels square, row by row: green.
pub fn indirect(
    player: &Player,
    track: &LightTrack,
    integrator: Integrator,
    side: usize,
    samples: u32,
) -> Vec<f32> {
    let lights = player.lights(std::slice::from_ref(track)).unwrap();
    let settings = ShotSettings {
        integrator,
        width: side,
        height: side,
        samples: Some(samples),
        ..ShotSettings::default()
    };
    let camera = player.scene().cameras[0].at(0.0);
    let shot = player.shot(&camera, &settings).unwrap();
    let frame = (player.frame(&shot, &lights, 0.0, &FrameSettings::default())).unwrap();
    let pixels = frame.layers.rgb("indirect").unwrap().pixels;
    pixels.iter().map(|pixel| pixel[1]).collect()
}
