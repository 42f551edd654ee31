//! Light that arrives at the texels of a map of the whole scene.
//!
//! Texels are lit as pixels of frames by transfer are, a band of rows at a time: direct light by shadow rays at their places, more of
//! them where texels side by side disagree, indirect light by the points' functions.

use super::settings::FrameSettings;
use crate::choice::Integrator;
use crate::lights::Lights;
use crate::player::{FrameError, Player};
use crate::shot::ShotSettings;
use crate::texels::Texels;
use glam::{Vec2, Vec3};
use relight_render::texels::{OnTriangle, expose_texels};
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::surface::{Surfaces, ray_from};
use relight_scene::traced::TracedScene;
use relight_transport::sampling::{Frame, cosine_hemisphere, r2};
use std::f32::consts::PI;

/// Texels that are lit together: what they take is some kilobyte each.
const AT_ONCE: usize = 1 << 18;

/// Rays by which a place is found to be covered.
const RAYS: u32 = 16;

/// Share of the rays that meet backs of closed things from which on a place is covered by them.
const COVERED: f32 = 0.5;

/// Which light a map has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Direct and indirect.
    All,
    /// Straight from the lights.
    Direct,
    /// By way of other surfaces.
    Indirect,
}

/// Takes away places that nobody can see: under a box on the floor, or within a wall, where things of which only fronts are seen show
/// their backs. Lookups beside would mix in their darkness.
///
/// # Errors
/// It was stopped.
pub fn uncover(scene: &TracedScene, texels: &mut Texels, watch: &dyn Watch) -> Result<(), Cancelled> {
    let directions: Vec<Vec3> = (0..RAYS).map(|i| cosine_hemisphere(r2(i, Vec2::ZERO))).collect();
    let backs = |place: &OnTriangle| {
        let hit = scene.surface_at(place.triangle, place.barycentric, true);
        let frame = Frame::around(hit.geometric_normal);
        let meets_back = |direction: &&Vec3| {
            let ray = ray_from(&hit, frame.world_from_local(**direction));
            let met = scene.closest_hit(&ray);
            met.is_some_and(|met| !met.front && !scene.material(met.primitive).double_sided)
        };
        directions.iter().filter(meets_back).count() as f32 / RAYS as f32
    };
    texels.keep(|_, places| {
        if watch.stopped() || backs(&places[0]) == 0.0 {
            return places.to_vec();
        }
        let seen = places.iter().filter(|place| backs(place) < COVERED);
        seen.copied().collect()
    });
    go_on(watch)
}

/// Irradiance of each texel's front, W/m², linear RGB, by all of `lights` together; zero where a texel has no place. Indirect light may be
/// below zero by the operator's error.
///
/// # Errors
/// It was stopped.
pub fn irradiance(
    player: &Player,
    lights: &Lights,
    time: f64,
    (texels, part): (&Texels, Part),
    settings: &FrameSettings,
    watch: &dyn Watch,
) -> Result<Vec<Vec3>, FrameError> {
    let shot_settings = ShotSettings {
        integrator: Integrator::Transfer,
        moving: true,
        ..ShotSettings::default()
    };
    let width = texels.size as usize;
    let band = (AT_ONCE / width.max(1)).max(1) * width;
    let mut all = Vec::with_capacity(texels.len());
    for first in (0..texels.len()).step_by(band.max(1)) {
        go_on(watch)?;
        let last = (first + band).min(texels.len());
        let start = texels.offsets[first];
        let places = &texels.places[start as usize..texels.offsets[last] as usize];
        if places.is_empty() {
            all.resize(last, Vec3::ZERO);
            continue;
        }
        let offsets: Vec<u32> = (texels.offsets[first..=last].iter())
            .map(|at| at - start)
            .collect();
        let seen = expose_texels(&player.prepared.scene, width, &offsets, places);
        let shot = player.shot_of(seen, &shot_settings);
        let (lit, _) = player.light(&shot, lights, time, settings, watch)?;
        all.extend(lit.direct.iter().zip(&lit.indirect).map(|(direct, indirect)| {
            let radiance = match part {
                Part::All => *direct + *indirect,
                Part::Direct => *direct,
                Part::Indirect => *indirect,
            };
            radiance * PI
        }));
        watch.advance_to(all.len(), texels.len());
    }
    Ok(all)
}
