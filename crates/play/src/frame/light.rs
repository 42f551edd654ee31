//! Light of a shot's fragments, from direct to indirect.

use super::direct::{ByLightcuts, Starts, Sums};
use super::emission::emission_at;
use super::settings::FrameSettings;
use super::stats::{RelitStats, milliseconds};
use super::task::{Received, Task, add};
use crate::choice::{CutKind, CutUse};
use crate::lights::{Distant, Lights};
use crate::prepared::PreparedScene;
use crate::shot::RelitShot;
use glam::Vec3;
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::light_set::{DistantLight, LightSet};
use std::time::Instant;

/// Radiance per fragment of a shot, W/(m² sr).
#[derive(Clone, Debug, Default)]
pub struct Lit {
    /// Light seen directly.
    pub emission: Vec<Vec3>,
    /// One reflection.
    pub direct: Vec<Vec3>,
    /// Two reflections and more; not clamped.
    pub indirect: Vec<Vec3>,
    /// Per light of the sequence its emission + direct + indirect, if asked for.
    pub lights: Vec<(String, Vec<Vec3>)>,
}

/// What visibility cuts are used for in a shot under some lights.
pub fn cut_use(prepared: &PreparedScene, shot: &RelitShot, lights: &Lights) -> CutUse {
    match shot.sites {
        Some(_) => CutKind::of(prepared).used_for(lights),
        None => CutUse::Nothing,
    }
}

/// Lights a shot.
///
/// # Errors
/// [`Cancelled`] if `watch`, which hears of every light, says so.
pub fn light(
    prepared: &PreparedScene,
    shot: &RelitShot,
    lights: &Lights,
    time: f64,
    settings: &FrameSettings,
    watch: &dyn Watch,
) -> Result<(Lit, RelitStats), Cancelled> {
    let by_cuts = cut_use(prepared, shot, lights);
    let task = Task {
        prepared,
        shot,
        views: &shot.seen.views(),
        settings,
    };
    let samples = prepared.cuts.as_ref().and_then(|cuts| cuts.samples());
    let starts = Starts {
        points: (shot.transfers && prepared.transfer.is_some()).then_some(&prepared.places),
        samples: (samples.filter(|_| by_cuts == CutUse::FirstBounce)).map(|samples| &samples.hits[..]),
    };
    let distant = (by_cuts == CutUse::Environments).then(|| lights.distant_at(time));
    let lights = lights.at(time);
    let mut stats = RelitStats::default();
    let mut lit = Lit::default();
    let mut sums = Sums::new(shot.seen.len(), starts);
    let shadowed = distant.as_ref().map_or(&lights, |d| &d.near);
    let all_at_once = if settings.light_layers {
        ByLightcuts::default()
    } else {
        task.add_by_lightcuts(starts, shadowed, &mut sums, &mut stats.times)
    };
    stats.lightcuts = all_at_once.used;
    for light in 0..lights.len() {
        go_on(watch)?;
        if settings.light_layers {
            let distant = distant.as_ref();
            let (direct, received) =
                light_layer(&task, starts, &lights, distant, light, &mut lit, &mut stats);
            sums.direct.add(direct);
            sums.add_received(received);
        } else {
            if !all_at_once.points {
                let start = Instant::now();
                sums.add_received(task.received_of(starts, shadowed, light));
                stats.times.direct_points += milliseconds(start);
            }
            if !all_at_once.pixels {
                let start = Instant::now();
                let reflected = task.reflected_of(shadowed, light, distant.is_some());
                sums.direct.add(reflected);
                stats.times.direct_pixels += milliseconds(start);
            }
        }
        watch.advance_to(light + 1, lights.len() + 1);
    }
    go_on(watch)?;
    if let (Some(distant), false) = (&distant, settings.light_layers) {
        let all: Vec<&DistantLight> = distant.lights.iter().flatten().collect();
        if let Some(even) = task.even_light(&all, &mut stats.times) {
            sums.direct.add(even.radiance);
            sums.add_received(Received {
                points: even.irradiance,
                samples: None,
            });
            stats.cuts = Some(even.stats);
        }
    }
    go_on(watch)?;
    let received;
    (lit.direct, received) = sums.rounded();
    lit.emission = emission_at(&prepared.scene, &shot.seen, &lights, None);
    let indirect = task.indirect(&received, &mut stats.times);
    lit.indirect = indirect.radiance;
    stats.transfer = indirect.transfer;
    stats.cuts = stats.cuts.or(indirect.cuts);
    stats.pixels = shot.seen.width * shot.seen.height;
    Ok((lit, stats))
}

/// Makes the layer of one light, and returns its direct light and what it lets arrive where indirect light starts.
fn light_layer(
    task: &Task,
    starts: Starts,
    lights: &LightSet,
    distant: Option<&Distant>,
    light: usize,
    lit: &mut Lit,
    stats: &mut RelitStats,
) -> (Vec<Vec3>, Received) {
    let times = &mut stats.times;
    let shadowed = distant.map_or(lights, |d| &d.near);
    let start = Instant::now();
    let mut received = task.received_of(starts, shadowed, light);
    times.direct_points += milliseconds(start);
    let start = Instant::now();
    let mut direct = task.reflected_of(shadowed, light, distant.is_some());
    times.direct_pixels += milliseconds(start);
    let own = distant.and_then(|distant| distant.lights[light].as_ref());
    if let Some(own) = own {
        let even = task.even_light(&[own], times);
        if let Some(even) = &even {
            add(&mut direct, &even.radiance);
            if let (Some(points), Some(irradiance)) = (&mut received.points, &even.irradiance) {
                add(points, irradiance);
            }
        }
        stats.cuts = even.map(|even| even.stats);
    }
    let mut layer = emission_at(&task.prepared.scene, &task.shot.seen, lights, Some(light));
    add(&mut layer, &direct);
    add(&mut layer, &task.indirect(&received, times).radiance);
    lit.lights.push((lights.name(light).to_owned(), layer));
    (direct, received)
}
