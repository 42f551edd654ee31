//! The lights under which a bake judges itself.

use crate::viewpoints::Viewpoints;
use glam::Vec3;
use relight_scene::animated::Animated;
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;

/// The lights at hand: those given, else the scene's own, else a mix of lamps in open space and a sun, each of which gives what it
/// lights some 1 W/m².
pub fn lights(scene: &Scene, given: Option<&Sequence>, viewpoints: &Viewpoints) -> Sequence {
    if let Some(sequence) = given {
        return sequence.clone();
    }
    if !scene.sequence.lights.is_empty() {
        return scene.sequence.clone();
    }
    let sun = LightKind::Directional {
        direction: Animated::Constant(Vec3::new(-0.4, -0.8, -0.45).normalize()),
        irradiance: Animated::Constant(Vec3::ONE),
    };
    let lamps = viewpoints.lamps.iter().map(|&(place, way)| LightKind::Point {
        position: Animated::Constant(place),
        intensity: Animated::Constant(Vec3::splat(way.powi(2).clamp(f32::MIN_POSITIVE, 1e30))),
    });
    let kinds = std::iter::once(sun).chain(lamps);
    let name = |i: usize| if i == 0 { "sun".into() } else { format!("lamp {i}") };
    Sequence {
        lights: (kinds.enumerate())
            .map(|(i, kind)| LightTrack { name: name(i), kind })
            .collect(),
        ..Sequence::default()
    }
}
