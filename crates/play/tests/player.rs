//! What the front door promises beside right light.

use relight_play::frame::stats::FrameStats;
use relight_play::glam::Vec3;
use relight_play::player::{FrameError, ShotError};
use relight_play::render::watch::{Cancelled, Watch};
use relight_play::scene::animated::{Animated, Interpolation};
use relight_play::scene::light::{LightKind, LightTrack};
use relight_play::scene::material_edits::{MaterialEdits, parse_material_edits};
use relight_play::{Frame, FrameSettings, Integrator, Lights, Player, Shot, ShotSettings, Tracer};

fn player() -> Player {
    Player::open("tests/cornell.relight").unwrap()
}

fn lamp(name: &str, position: Vec3) -> LightTrack {
    LightTrack {
        name: name.into(),
        kind: LightKind::Point {
            position: Animated::Constant(position),
            intensity: Animated::Constant(Vec3::ONE),
        },
    }
}

fn lights(player: &Player) -> Lights {
    let left = lamp("left", Vec3::new(0.2, 0.4, 0.1));
    let right = lamp("right", Vec3::new(0.45, 0.4, 0.15));
    player.lights(&[left, right]).unwrap()
}

fn shot_by(player: &Player, integrator: Integrator) -> Shot {
    let camera = player.scene().cameras[0].at(0.0);
    let settings = ShotSettings {
        integrator,
        width: 24,
        height: 24,
        samples: Some(2),
        ..ShotSettings::default()
    };
    player.shot(&camera, &settings).unwrap()
}

fn shot(player: &Player) -> Shot {
    shot_by(player, Integrator::Auto)
}

fn edits(player: &Player, text: &str) -> MaterialEdits {
    let text = format!(r#"{{ "relight_materials": 1, "edits": [{text}] }}"#);
    parse_material_edits(&text, player.scene(), "edits").unwrap()
}

fn mean(frame: &Frame, layer: &str) -> f64 {
    let pixels = frame.layers.rgb(layer).unwrap().pixels;
    pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>() / pixels.len() as f64
}

#[test]
fn all_of_it_may_be_shared_by_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<Player>();
    shared::<Lights>();
    shared::<Shot>();
    shared::<Frame>();
}

/// Truth: light is linear. Tolerance: f32 sums of some hundred terms.
#[test]
fn light_layers_sum_to_the_beauty() {
    let player = player();
    let (lights, shot) = (lights(&player), shot(&player));
    let settings = FrameSettings {
        light_layers: true,
        ..FrameSettings::default()
    };
    let frame = player.frame(&shot, &lights, 0.0, &settings).unwrap();
    let (left, right) = (mean(&frame, "light.left"), mean(&frame, "light.right"));
    let beauty = mean(&frame, "beauty");
    assert!(left > 0.0 && right > 0.0);
    assert!(
        (left + right - beauty).abs() < 1e-3 * beauty,
        "{left} {right} {beauty}"
    );
}

/// Truth: light is in proportion to a lamp's colour, channel by channel. Tolerance: f32 roundings of products and of sums over two lamps.
#[test]
fn a_lamp_that_is_dimmed_or_coloured_is_found_once() {
    let player = player();
    let shot = shot(&player);
    let colors = [
        Vec3::ONE,
        Vec3::splat(0.25),
        Vec3::new(0.5, 2.0, 0.0),
        Vec3::ZERO,
        Vec3::splat(1e-12),
        Vec3::splat(3.0),
    ];
    let mut dimmed = lamp("left", Vec3::new(0.2, 0.4, 0.1));
    *dimmed.kind.color_mut() = Animated::Keys {
        keys: (0..).map(f64::from).zip(colors).collect(),
        interpolation: Interpolation::Step,
    };
    let lights = player.lights(&[dimmed]).unwrap();
    let pixels = |frame: &Frame| frame.layers.rgb("beauty").unwrap().pixels.clone();
    let mut white = Vec::new();
    for (time, color) in colors.into_iter().enumerate() {
        let frame = player
            .frame(&shot, &lights, time as f64, &FrameSettings::default())
            .unwrap();
        let FrameStats::Relit(stats) = &frame.stats else {
            panic!("transfer makes indirect light")
        };
        let kept = usize::from(time > 0 && color != Vec3::ZERO);
        assert_eq!(stats.still_lights, kept, "frame {time}");
        if white.is_empty() {
            white = pixels(&frame);
        }
        for (pixel, white) in pixels(&frame).iter().zip(&white) {
            let (pixel, expected) = (Vec3::from(*pixel), Vec3::from(*white) * color);
            let most = (Vec3::from(*white) * color).max_element();
            assert!(
                (pixel - expected).abs().max_element() <= 1e-5 * most,
                "frame {time}: {pixel}, not {expected}"
            );
        }
    }
}

#[test]
fn a_frame_stops_when_its_watcher_says_so() {
    struct Stopped;
    impl Watch for Stopped {
        fn stopped(&self) -> bool {
            true
        }
    }
    let player = player();
    let lights = lights(&player);
    for integrator in [Integrator::Auto, Tracer::default().into()] {
        let shot = shot_by(&player, integrator);
        let frame = player.frame_watched(&shot, &lights, 0.0, &FrameSettings::default(), &Stopped);
        assert_eq!(frame.err(), Some(FrameError::Cancelled(Cancelled)));
    }
}

#[test]
fn auto_takes_transfer_and_says_so() {
    let player = player();
    let (lights, shot) = (lights(&player), shot(&player));
    let frame = player
        .frame(&shot, &lights, 0.0, &FrameSettings::default())
        .unwrap();
    assert_eq!(frame.choice.integrator, Integrator::Transfer);
    assert!(matches!(frame.stats, FrameStats::Relit(_)));
    assert!(
        frame
            .stats
            .figures()
            .iter()
            .any(|(name, figure)| { *name == "direct_points" && figure.value() > 0.0 })
    );
}

/// Truth: a player that was never edited. Tolerance: the file rounds the points' reflectances to 1/255, which an edit evaluates.
#[test]
fn a_shot_is_refused_once_materials_have_changed_and_edits_can_be_taken_back() {
    let mut player = player();
    let (lights, settings) = (lights(&player), FrameSettings::default());
    let old = shot(&player);
    let before = player.frame(&old, &lights, 0.0, &settings).unwrap();
    let all = |player: &Player, what: &str| {
        let one = |i: usize| format!(r#"{{ "material": {i}, {what} }}"#);
        let all: Vec<String> = (0..player.scene().materials.len()).map(one).collect();
        edits(player, &all.join(","))
    };
    let dark = all(&player, r#""base_color": [0.01, 0.01, 0.01]"#);
    player.edit_materials(dark, 0.0).unwrap();
    assert_eq!(
        player.frame(&old, &lights, 0.0, &settings).err(),
        Some(FrameError::Stale)
    );
    let darkened = player.frame(&shot(&player), &lights, 0.0, &settings).unwrap();
    assert!(mean(&darkened, "direct") < 0.1 * mean(&before, "direct"));
    assert!(mean(&darkened, "indirect") < 0.01 * mean(&before, "indirect"));
    let none = edits(&player, "");
    player.edit_materials(none, 0.0).unwrap();
    let after = player.frame(&shot(&player), &lights, 0.0, &settings).unwrap();
    assert_eq!(mean(&after, "direct"), mean(&before, "direct"));
    let (found, truth) = (mean(&after, "indirect"), mean(&before, "indirect"));
    assert!((found / truth - 1.0).abs() < 0.02, "{found} {truth}");
}

/// Truth: another shot, made with the materials of that time.
#[test]
fn a_refreshed_shot_shows_materials_as_they_move() {
    let mut player = player();
    let (lights, settings) = (lights(&player), FrameSettings::default());
    let moving = edits(
        &player,
        r#"{ "material": 0, "base_color": {"keys": [[0, [0.1, 0.1, 0.1]], [10, [0.9, 0.9, 0.9]]], "interpolation": "linear"} }"#,
    );
    player.edit_materials(moving, 0.0).unwrap();
    let mut kept = shot(&player);
    player.set_time(10.0).unwrap();
    assert_eq!(
        player.frame(&kept, &lights, 10.0, &settings).err(),
        Some(FrameError::Stale)
    );
    player.refresh(&mut kept).unwrap();
    let kept = player.frame(&kept, &lights, 10.0, &settings).unwrap();
    let fresh = player.frame(&shot(&player), &lights, 10.0, &settings).unwrap();
    assert_eq!(kept.layers.rgb("beauty"), fresh.layers.rgb("beauty"));
}

#[test]
fn a_shot_can_be_stopped() {
    struct Impatient;
    impl Watch for Impatient {
        fn stopped(&self) -> bool {
            true
        }
    }
    let player = player();
    let camera = player.scene().cameras[0].at(0.0);
    let size = ShotSettings {
        width: 32,
        height: 18,
        ..ShotSettings::default()
    };
    let stopped = player.shot_watched(&camera, &size, &Impatient);
    assert!(matches!(stopped, Err(ShotError::Cancelled(Cancelled))));
}
