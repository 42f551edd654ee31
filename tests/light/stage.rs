//! What the tests share: bakes that go through a file, and small images of them.

use glam::{DVec3, Vec3};
use relight_bake::params::BakeParams;
use relight_bake::{Progress, bake};
use relight_data_generate::glb::Glb;
use relight_format::{self as format, Asset};
use relight_play::frame::{LightingSettings, Lit};
use relight_play::load::{Loaded, load};
use relight_play::reflections::FIXED_RAYS;
use relight_play::shot::{Shot, expose};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::light::LightTrack;
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::sequence::{Sequence, read_sequence};
use relight_scene::traced::Shading;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Nobody watches.
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, _: u64) {}
    fn stopped(&self) -> bool {
        false
    }
}

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
    bake(scene, Shading::Lambert, params, None, 0, &Silent)
        .unwrap()
        .asset
}

/// Bakes a scene of the generator.
pub fn bake_glb(glb: &Glb, params: &BakeParams) -> Asset {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.glb");
    std::fs::write(&file, glb.to_bytes()).unwrap();
    bake_file(&file, params)
}

/// Writes an asset and loads it as a player does.
pub fn through_file(asset: &Asset) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.relight");
    format::write_file(&file, asset).unwrap();
    load(&file, true).unwrap()
}

/// What the scene's first camera sees, `size` pixels square.
pub fn shot(loaded: &Loaded, size: usize) -> Shot {
    let camera = loaded.scene.cameras[0].at(0.0);
    let mut shot = expose(&loaded.player.scene, &camera, size, size, 1);
    let player = &loaded.player;
    shot.weigh(player.transfer.as_ref().unwrap(), &player.scene, FIXED_RAYS);
    shot
}

/// Lights a shot with the command line's numbers of samples.
pub fn light(loaded: &Loaded, shot: &Shot, tracks: &[LightTrack], per_light: bool) -> Lit {
    light_sampled(loaded, shot, tracks, per_light, 4)
}

/// As [`light`], with the direct light at each point from `point_samples` rays.
pub fn light_sampled(
    loaded: &Loaded,
    shot: &Shot,
    tracks: &[LightTrack],
    per_light: bool,
    point_samples: u32,
) -> Lit {
    let emitters = SceneEmitters::new(&loaded.player.scene);
    let lights = LightSet::new(&emitters, tracks, 0.0).unwrap();
    let settings = LightingSettings {
        pixel_samples: 8,
        point_samples,
        seed: 0,
        per_light,
        indirect: true,
        bounce_cuts: None,
    };
    loaded.player.light(shot, &lights, None, &settings).0
}

/// Mean over places, RGB.
pub fn mean(values: &[Vec3]) -> DVec3 {
    values.iter().map(|v| v.as_dvec3()).sum::<DVec3>() / values.len() as f64
}
