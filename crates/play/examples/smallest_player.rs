//! The smallest player: loads an asset and lights what its first camera sees with the scene's own lights.
//!
//! `cargo run --release -p relight-play --example smallest_player -- ASSET.relight`

use glam::Vec3;
use relight_play::frame::LightingSettings;
use relight_play::load::load;
use relight_play::reflections::FIXED_RAYS;
use relight_play::shot::expose;
use relight_scene::light_set::{LightRig, SceneEmitters};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: smallest_player ASSET.relight")?;
    let loaded = load(path.as_ref(), true)?;
    let player = &loaded.player;
    let camera = loaded.scene.cameras.first().ok_or("the scene has no camera")?;
    let emitters = SceneEmitters::new(&player.scene);
    let rig = LightRig::new(&emitters, &loaded.scene.sequence.lights)?;
    let mut shot = expose(&player.scene, &camera.at(0.0), 160, 90, 4);
    if let Some(transfer) = &player.transfer {
        shot.weigh(transfer, &player.scene, FIXED_RAYS);
    }
    let settings = LightingSettings {
        pixel_samples: 4,
        point_samples: 4,
        seed: 0,
        per_light: false,
        indirect: true,
        bounce_cuts: None,
    };
    let (lit, _) = player.light(&shot, &rig.at(0.0), None, &settings);
    let mean = |fragments: &[Vec3]| {
        let pixels = shot.resolve(fragments);
        pixels.iter().sum::<Vec3>() / pixels.len() as f32
    };
    println!("direct {}, indirect {}", mean(&lit.direct), mean(&lit.indirect));
    Ok(())
}
