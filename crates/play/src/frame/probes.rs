//! Light that arrives at places in the open, as spherical harmonics: what irradiance volumes hold.
//!
//! Source: Ramamoorthi and Hanrahan 2001: irradiance needs nine coefficients of incident radiance.

use super::emission::emission_at;
use super::settings::FrameSettings;
use crate::choice::Integrator;
use crate::lights::Lights;
use crate::player::{FrameError, Player};
use crate::shot::ShotSettings;
use glam::Vec3;
use relight_render::expose::expose_around;
use relight_render::exposure::Exposure;
use relight_render::watch::{Watch, go_on};
use relight_transport::light_tree::sphere_direction;
use relight_transport::sh;
use std::f32::consts::PI;

/// Spherical harmonics of degrees 0 to 2.
pub const COEFFICIENTS: usize = sh::count(2);

/// Rays from each place, evenly spread. Where light comes from a tenth of the sphere, its sum errs by some percent.
const RAYS: u32 = 512;

/// Rays that are lit together: some hundred bytes each.
const AT_ONCE: usize = 1 << 18;

/// Light that arrives at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Coefficients of radiance, W/(m² sr), linear RGB; basis and order of [`sh`].
    pub radiance: [Vec3; COEFFICIENTS],
    /// Share of the directions in which there is the front of a surface, or nothing: near 0 inside of things.
    pub open: f32,
}

impl Incident {
    /// Irradiance of a surface with this unit normal, W/m².
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        let factors = sh::irradiance_factors(normal);
        (self.radiance.iter().zip(factors)).map(|(c, f)| *c * f).sum()
    }
}

/// Light of surfaces, skies and lamps with extent at some places. Lamps without extent meet no ray, so that only what they light is there.
///
/// # Errors
/// It was stopped.
pub fn incident(
    player: &Player,
    lights: &Lights,
    time: f64,
    places: &[Vec3],
    settings: &FrameSettings,
    watch: &dyn Watch,
) -> Result<Vec<Incident>, FrameError> {
    let scene = &player.prepared.scene;
    let directions: Vec<Vec3> = (0..RAYS).map(|i| sphere_direction(i, RAYS)).collect();
    let set = lights.at(time);
    let shot_settings = ShotSettings {
        integrator: Integrator::Transfer,
        // Lobes by few rays: a place takes the mean of hundreds.
        moving: true,
        ..ShotSettings::default()
    };
    let mut all = Vec::with_capacity(places.len());
    for some in places.chunks(AT_ONCE / RAYS as usize) {
        go_on(watch)?;
        let (mut seen, mut emission, mut open) = (Exposure::default(), Vec::new(), Vec::new());
        for &place in some {
            let around = expose_around(scene, place, &directions);
            // By itself, since lamps without matter are seen from somewhere.
            emission.extend(emission_at(scene, &around, &set, None));
            let fronts = (around.hits.iter()).filter(|hit| hit.as_ref().is_none_or(|hit| hit.front));
            open.push(fronts.count() as f32 / RAYS as f32);
            seen.append(around);
        }
        let shot = player.shot_of(seen, &shot_settings);
        let (lit, _) = player.light(&shot, lights, time, settings, watch)?;
        for (i, open) in open.into_iter().enumerate() {
            let mut radiance = [Vec3::ZERO; COEFFICIENTS];
            for (ray, &direction) in directions.iter().enumerate() {
                let f = i * directions.len() + ray;
                let arrives = emission[f] + lit.direct[f] + lit.indirect[f];
                let weighted = arrives * (4.0 * PI / RAYS as f32);
                (radiance.iter_mut().zip(sh::evaluate(direction))).for_each(|(c, y)| *c += weighted * y);
            }
            all.push(Incident { radiance, open });
        }
        watch.advance_to(all.len(), places.len());
    }
    Ok(all)
}
