//! Light on a small surface at a place in the open, as a lux meter would measure it.
//!
//! What lamps, skies and emissive surfaces send there directly is sampled with shadow rays; what surfaces reflect there comes by rays over
//! the hemisphere, whose ends are lit as the fragments of a frame are.

use super::settings::FrameSettings;
use crate::choice::Integrator;
use crate::lights::Lights;
use crate::player::{FrameError, Player};
use crate::shot::ShotSettings;
use glam::{DVec3, Vec2, Vec3};
use relight_render::expose::expose_around;
use relight_render::watch::{Watch, go_on};
use relight_scene::light_set::LightSet;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::TracedScene;
use relight_transport::sampling::{Frame, cosine_hemisphere, r2};

/// Samples of a light with extent.
const SAMPLES: u32 = 4096;
/// Rays over the hemisphere.
const RAYS: u32 = 4096;
/// Share of the scene's diagonal by which the place is lifted, and by which rays stop short: people name places on tables.
const LIFT: f32 = 1e-5;

/// Irradiance of a surface, RGB, W/m².
#[derive(Clone, Debug, PartialEq)]
pub struct Arriving {
    /// By each light of the sequence, what is in between taken away.
    pub direct: Vec<Vec3>,
    /// By surfaces of the scene that reflect light of all of them; zero without points.
    pub indirect: Vec3,
}

/// Irradiance of a surface at a place in the open with a unit normal, world space; `time` in frames.
///
/// # Errors
/// It was stopped.
pub fn arriving(
    player: &Player,
    lights: &Lights,
    time: f64,
    (place, normal): (Vec3, Vec3),
    settings: &FrameSettings,
    watch: &dyn Watch,
) -> Result<Arriving, FrameError> {
    let scene = &player.prepared.scene;
    let diagonal = scene.bounds().map_or(0.0, |(low, high)| (high - low).length());
    let lift = LIFT * diagonal;
    let place = place + normal * lift;
    let set = lights.at(time);
    go_on(watch)?;
    let direct = (0..set.len())
        .map(|light| direct(scene, &set, light, (place, normal), lift))
        .collect();
    let frame = Frame::around(normal);
    let directions: Vec<Vec3> = (0..RAYS)
        .map(|i| {
            frame
                .world_from_local(cosine_hemisphere(r2(i, Vec2::ZERO)))
                .normalize()
        })
        .collect();
    let shot = player.shot_of(
        expose_around(scene, place, &directions),
        &ShotSettings {
            integrator: Integrator::Transfer,
            moving: true,
            ..ShotSettings::default()
        },
    );
    let (lit, _) = player.light(&shot, lights, time, settings, watch)?;
    let sum: DVec3 = (lit.direct.iter().zip(&lit.indirect))
        .map(|(direct, indirect)| (*direct + *indirect).as_dvec3())
        .sum();
    Ok(Arriving {
        direct,
        indirect: (sum * (std::f64::consts::PI / f64::from(RAYS))).as_vec3(),
    })
}

/// Irradiance by one light.
fn direct(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    light: usize,
    (place, normal): (Vec3, Vec3),
    short: f32,
) -> Vec3 {
    let count = if lights.is_delta(light) { 1 } else { SAMPLES };
    let mut sum = DVec3::ZERO;
    for i in 0..count {
        let [a, b] = r2(i, Vec2::ZERO).to_array();
        let random = [a, b, (i as f32 + 0.5) / count as f32];
        let Some(sample) = lights.sample(light, place, random) else {
            continue;
        };
        let cosine = normal.dot(sample.direction);
        if cosine <= 0.0 {
            continue;
        }
        let mut ray = Ray::endless(place, sample.direction);
        if sample.distance < f32::INFINITY {
            ray.t_max = sample.distance - short.max(LIFT * sample.distance);
        }
        let passed = scene.passed(&ray);
        sum += (sample.radiance_over_pdf * passed).as_dvec3() * f64::from(cosine);
    }
    (sum / f64::from(count)).as_vec3()
}
