//! Sums of images of the sky's patches against the player's own frames.

use relight_play::daylight::{DaylightError, DaylightLayers, DaylightOrder, MOST_BYTES, most_bytes};
use relight_play::glam::Vec3;
use relight_play::scene::animated::Animated;
use relight_play::scene::image::Layers;
use relight_play::scene::light::{LightKind, LightTrack};
use relight_play::scene::sky_patches::SkyPatches;
use relight_play::{FrameSettings, Player, Shot, ShotSettings};
use relight_transport::random::mix;
use std::sync::Arc;

const SIZE: usize = 24;
const ALL: [&str; 5] = ["beauty", "emission", "direct", "indirect", "background"];

/// A box that is open towards the north, where the camera stands.
fn player() -> Player {
    Player::open("tests/cornell.relight").unwrap()
}

fn shot(player: &Player) -> Shot {
    let settings = ShotSettings {
        width: SIZE,
        height: SIZE,
        samples: Some(2),
        ..ShotSettings::default()
    };
    player
        .shot(&player.scene().cameras[0].at(0.0), &settings)
        .unwrap()
}

/// The patches that face the box and are not high.
fn facing(patches: &SkyPatches) -> Vec<bool> {
    patches.middles().iter().map(|middle| middle.z < -0.7).collect()
}

fn layers(
    player: &Player,
    shot: &Shot,
    patches: &SkyPatches,
    lit: &[bool],
    wanted: &[&str],
) -> DaylightLayers {
    let order = DaylightOrder {
        patches,
        lit,
        wanted,
        frame: FrameSettings::default(),
    };
    DaylightLayers::new(player, shot, &order, &()).unwrap()
}

/// What the player itself makes of one patch.
fn by_itself(player: &Player, shot: &Shot, patches: &SkyPatches, patch: usize) -> Layers {
    let sky = LightTrack {
        name: "patch".into(),
        kind: LightKind::Environment {
            maps: Arc::new(patches.map(patch)).into(),
            file: "patch".into(),
            scale: Animated::Constant(Vec3::ONE),
            rotation_deg: Animated::Constant(0.0),
        },
    };
    let settings = FrameSettings {
        seed: mix(patch as u64),
        surface_layers: true,
        ..FrameSettings::default()
    };
    player
        .frame(shot, &player.lights(&[sky]).unwrap(), 0.0, &settings)
        .unwrap()
        .layers
}

/// Truth: the player's frames of two patches by themselves, added up. Halves have 11 bits, of what is not 2²⁸ below an image's largest.
#[test]
fn a_frame_is_the_sum_of_what_its_patches_make() {
    let player = player();
    let shot = shot(&player);
    let patches = SkyPatches::new(145).unwrap();
    let lit = facing(&patches);
    let found = layers(&player, &shot, &patches, &lit, &ALL);
    let two: Vec<usize> = (0..145).filter(|&patch| lit[patch]).take(2).collect();
    let colors = [Vec3::new(2.0, 3.0, 5.0), Vec3::new(7000.0, 0.0, 0.25)];
    let mut skies = vec![vec![Vec3::ZERO; 145]; 3];
    (skies[0][two[0]], skies[2][two[0]], skies[2][two[1]]) = (colors[0], colors[0], colors[1]);
    let frames = found.frames(&skies);
    let alone = two
        .clone()
        .into_iter()
        .map(|patch| by_itself(&player, &shot, &patches, patch))
        .collect::<Vec<_>>();
    for (frame, shares) in frames.iter().zip([[1.0, 0.0], [0.0, 0.0], [1.0, 1.0f32]]) {
        for name in ALL {
            let [a, b] = [0, 1].map(|i| alone[i].rgb(name).unwrap().pixels);
            let sums = frame.rgb(name).unwrap().pixels;
            let largest = colors[1].max_element() * b.iter().flatten().fold(0.0f32, |m, v| m.max(v.abs()));
            for ((sum, a), b) in sums.iter().zip(a).zip(b) {
                let truth = Vec3::from(a) * colors[0] * shares[0] + Vec3::from(b) * colors[1] * shares[1];
                let size = Vec3::from(a).abs() * colors[0] + Vec3::from(b).abs() * colors[1];
                // A beauty is rounded as three.
                let off = (Vec3::from(*sum) - truth).abs().max_element();
                assert!(
                    off <= size.max_element() / 1024.0 + 1e-6 * largest,
                    "{name}: {sum:?} {truth}"
                );
            }
        }
        let names: Vec<&str> = frame.layers.iter().map(|layer| layer.name.as_str()).collect();
        let own: Vec<&str> = alone[0].layers.iter().map(|layer| layer.name.as_str()).collect();
        assert_eq!(names, own);
        for name in ["albedo", "depth", "A"] {
            assert_eq!(frame.layer(name), alone[0].layer(name), "{name}");
        }
    }
    let light = frames[2].rgb("indirect").unwrap();
    assert!(light.pixels.iter().flatten().any(|value| *value > 0.0));
}

#[test]
fn beauty_alone_is_that_of_all_layers() {
    let player = player();
    let shot = shot(&player);
    let patches = SkyPatches::new(145).unwrap();
    let lit = facing(&patches);
    let [alone, all] = [&["beauty"][..], &ALL].map(|wanted| layers(&player, &shot, &patches, &lit, wanted));
    assert!(alone.bytes() < all.bytes());
    let sky: Vec<Vec3> = lit
        .iter()
        .map(|lit| Vec3::splat(f32::from(u8::from(*lit))))
        .collect();
    let [alone, all] = [alone, all].map(|layers| layers.frames(std::slice::from_ref(&sky)).remove(0));
    assert!(alone.layer("direct").is_none());
    let [a, b] = [&alone, &all].map(|frame| frame.rgb("beauty").unwrap().pixels);
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!((a - b).abs() <= b.abs() / 512.0 + 1e-6, "{a} {b}");
    }
}

#[test]
fn what_lights_nothing_takes_no_memory_and_what_does_no_more_than_was_said() {
    let player = player();
    let shot = shot(&player);
    let patches = SkyPatches::new(145).unwrap();
    // The box stands with its back to the south: what is high there lights what nobody sees.
    let south: Vec<bool> = (patches.middles().iter())
        .map(|middle| middle.z > 0.3 && middle.y > 0.4)
        .collect();
    let behind = layers(&player, &shot, &patches, &south, &["beauty"]);
    let count = south.iter().filter(|lit| **lit).count();
    assert!(count > 10);
    assert_eq!((behind.unseen(), behind.len(), behind.bytes()), (count, 0, 0));
    assert!(behind.is_empty());
    let front = facing(&patches);
    let shining = front.iter().filter(|lit| **lit).count();
    let lights = layers(&player, &shot, &patches, &front, &["direct", "indirect"]);
    // Beside the values there is where they begin.
    let most = most_bytes(shining, &["direct", "indirect"], (SIZE, SIZE)).unwrap();
    assert!(
        lights.bytes() <= most + (shining * 2 * 64) as u64,
        "{} {most}",
        lights.bytes()
    );
    assert!(lights.frames(&[]).is_empty());
}

#[test]
fn images_beyond_the_memory_are_refused_before_they_are_made() {
    let wanted = ["beauty", "direct", "indirect"];
    assert!(most_bytes(145, &wanted, (1920, 1080)).unwrap() < MOST_BYTES);
    let error = most_bytes(2305, &wanted, (1920, 1080)).unwrap_err();
    assert!(matches!(error, DaylightError::Memory { .. }));
    assert_eq!(
        error.to_string(),
        "images of 2305 patches of 1920x1080 pixels take up to 57.4 GB, and may take 4.3 GB; choose fewer patches, a smaller image, or the \
         beauty alone"
    );
}
