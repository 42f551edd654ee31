//! Light of a shot's fragments, from direct to indirect.

use super::direct::Sums;
use super::emission::emission_at;
use super::parts::Received;
use super::received::Starts;
use super::settings::FrameSettings;
use super::stats::{FrameTimes, RelitStats, milliseconds};
use super::task::{NodeCounts, Task, add};
use crate::choice::{CutKind, CutUse};
use crate::lights::{FrameLights, Lights};
use crate::prepared::PreparedScene;
use crate::shot::RelitShot;
use crate::still::Cause;
use glam::Vec3;
use relight_render::sum::Sum;
use relight_render::watch::{Cancelled, Watch, go_on};
use std::sync::Arc;
use std::time::Instant;

/// Radiance per fragment of a shot, W/(m² sr).
#[derive(Clone, Debug, Default)]
pub struct Lit {
    /// Light seen directly.
    pub emission: Vec<Vec3>,
    /// One reflection.
    pub direct: Vec<Vec3>,
    /// Two reflections and more; may be below zero by the operator's error.
    pub indirect: Vec<Vec3>,
    /// Per light of the sequence its emission + direct + indirect, if asked for.
    pub lights: Vec<(String, Vec<Vec3>)>,
    /// Numbers of nodes, if asked for.
    pub cuts: Option<CutCounts>,
}

/// Nodes of visibility cuts at the fragments of a shot.
#[derive(Clone, Debug, Default)]
pub struct CutCounts {
    /// Of the merged cut of each fragment's sites.
    pub cut_size: Vec<u32>,
    /// Of all that it was shaded with, the illumination cut merged in, over all lights.
    pub nodes: Vec<u32>,
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
    let nodes = match settings.cut_layers {
        true => NodeCounts::of(shot.seen.len()),
        false => NodeCounts::default(),
    };
    let task = Task {
        prepared,
        shot,
        views: &shot.seen.views(),
        settings,
        nodes: &nodes,
    };
    let samples = prepared.cuts.as_ref().and_then(|cuts| cuts.samples());
    let starts = Starts {
        points: (shot.transfers && prepared.transfer.is_some()).then_some(&prepared.places),
        samples: (samples.filter(|_| by_cuts == CutUse::FirstBounce)).map(|samples| &samples.hits[..]),
    };
    let by_directions = by_cuts == CutUse::Environments;
    let causes: Vec<Cause> = (lights.tracks().iter())
        .map(|track| Cause {
            light: Arc::new(track.state_at(time).white()),
            settings: *settings,
            by_directions,
            starts: [starts.points.is_some(), starts.samples.is_some()],
            edition: shot.edition,
        })
        .collect();
    let shining = Shining {
        causes: &causes,
        of: &lights.of_frame(time, by_directions),
        by_directions,
    };
    let mut stats = RelitStats {
        pixels: shot.seen.width * shot.seen.height,
        ..RelitStats::default()
    };
    let mut lit = match settings.light_layers {
        true => light_by_light(&task, starts, &shining, &mut stats, watch)?,
        false => all_together(&task, starts, &shining, &mut stats, watch)?,
    };
    lit.cuts = nodes.into_sums().map(|nodes| CutCounts {
        cut_size: match (&prepared.cuts, &shot.sites) {
            (Some(cuts), Some(sites)) => sites.cut_sizes(cuts, nodes.len()),
            _ => vec![0; nodes.len()],
        },
        nodes,
    });
    Ok((lit, stats))
}

/// The lights of a frame.
struct Shining<'a> {
    /// What each at a colour of 1 follows from.
    causes: &'a [Cause],
    of: &'a FrameLights<'a>,
    /// Whether visibility cuts take what comes from even directions.
    by_directions: bool,
}

impl Shining<'_> {
    /// Adds what a light lets arrive where indirect light starts, by shadow rays.
    fn add_received(
        &self,
        light: usize,
        task: &Task,
        starts: Starts,
        sums: &mut Sums,
        times: &mut FrameTimes,
    ) {
        if self.of.lights.is_dark(light) {
            return;
        }
        let start = Instant::now();
        let make = || task.receiving().with_lobes(starts, &self.of.white, light);
        let cause = self.causes[light].at_points();
        let (received, _) = task.prepared.received.light_of(light, &cause, make);
        sums.add_received(&received, self.of.colors[light]);
        let make = || {
            let direct = received.points.as_deref()?;
            task.receiving().at_ends(task.shot, &self.of.white, light, direct)
        };
        let (at_ends, _) = task.shot.at_ends.light_of(light, &cause, make);
        if let Some(at_ends) = &*at_ends {
            let nothing = || Sum::Nothing(at_ends.len());
            (sums.at_ends.get_or_insert_with(nothing)).add(at_ends, self.of.colors[light]);
        }
        times.direct_points += milliseconds(start);
    }

    /// Adds what fragments reflect of a light, by shadow rays.
    fn add_reflected(&self, light: usize, task: &Task, sums: &mut Sums, stats: &mut RelitStats) {
        if self.of.lights.is_dark(light) {
            return;
        }
        let start = Instant::now();
        let make = || task.reflected_of(&self.of.white, light, self.by_directions);
        let cause = self.causes[light].at_pixels();
        let (reflected, kept) = task.shot.reflected.light_of(light, &cause, make);
        sums.direct.add(&reflected, self.of.colors[light]);
        stats.still_lights += usize::from(kept);
        stats.times.direct_pixels += milliseconds(start);
    }

    /// Adds its light of even directions, where visibility cuts take it.
    fn add_even(&self, light: usize, task: &Task, sums: &mut Sums, stats: &mut RelitStats) {
        let Some(distant) = &self.of.even[light] else {
            return;
        };
        if self.of.lights.is_dark(light) {
            return;
        }
        let make = || task.even_light(distant, &mut stats.times);
        let (even, _) = task.shot.even.light_of(light, &self.causes[light], make);
        if let Some(even) = &*even {
            task.nodes.add(&even.nodes);
            sums.add_even(even, self.of.colors[light]);
            stats.cuts = Some(even.stats);
        }
    }
}

/// All lights in one pass of indirect light.
fn all_together(
    task: &Task,
    starts: Starts,
    shining: &Shining,
    stats: &mut RelitStats,
    watch: &dyn Watch,
) -> Result<Lit, Cancelled> {
    let lights = &shining.of.lights;
    let mut sums = Sums::new(task.shot.seen.len(), starts);
    let at_once = task.add_by_lightcuts(starts, shining.of.shadowed(), &mut sums, &mut stats.times);
    stats.lightcuts = at_once.used;
    for light in 0..lights.len() {
        go_on(watch)?;
        if !at_once.points {
            shining.add_received(light, task, starts, &mut sums, &mut stats.times);
        }
        if !at_once.pixels {
            shining.add_reflected(light, task, &mut sums, stats);
        }
        watch.advance_to(light + 1, lights.len() + 1);
    }
    for light in 0..lights.len() {
        go_on(watch)?;
        shining.add_even(light, task, &mut sums, stats);
    }
    go_on(watch)?;
    let (direct, received) = sums.rounded();
    Ok(Lit {
        emission: emission_at(&task.prepared.scene, &task.shot.seen, lights, None),
        direct,
        indirect: indirect(task, &received, stats),
        lights: Vec::new(),
        cuts: None,
    })
}

/// Every light by itself, and their sums.
fn light_by_light(
    task: &Task,
    starts: Starts,
    shining: &Shining,
    stats: &mut RelitStats,
    watch: &dyn Watch,
) -> Result<Lit, Cancelled> {
    let (lights, seen) = (&shining.of.lights, &task.shot.seen);
    let mut layers = Vec::new();
    let nothing = || Sum::Nothing(seen.len());
    let (mut all_direct, mut all_indirect) = (nothing(), nothing());
    for light in 0..lights.len() {
        go_on(watch)?;
        let mut layer = emission_at(&task.prepared.scene, seen, lights, Some(light));
        if !lights.is_dark(light) {
            let (direct, received) = direct_of(task, starts, shining, light, stats);
            let indirect = indirect(task, &received, stats);
            add(&mut layer, &direct);
            add(&mut layer, &indirect);
            all_direct.add(&direct, Vec3::ONE);
            all_indirect.add(&indirect, Vec3::ONE);
        }
        layers.push((lights.name(light).to_owned(), layer));
        watch.advance_to(light + 1, lights.len() + 1);
    }
    Ok(Lit {
        emission: emission_at(&task.prepared.scene, seen, lights, None),
        direct: all_direct.rounded(),
        indirect: all_indirect.rounded(),
        lights: layers,
        cuts: None,
    })
}

/// Direct light of one light at the fragments, and what it lets arrive where indirect light starts.
fn direct_of(
    task: &Task,
    starts: Starts,
    shining: &Shining,
    light: usize,
    stats: &mut RelitStats,
) -> (Vec<Vec3>, Received) {
    let mut sums = Sums::new(task.shot.seen.len(), starts);
    shining.add_received(light, task, starts, &mut sums, &mut stats.times);
    shining.add_reflected(light, task, &mut sums, stats);
    shining.add_even(light, task, &mut sums, stats);
    sums.rounded()
}

/// Indirect light at the fragments of what points and samples have received.
fn indirect(task: &Task, received: &Received, stats: &mut RelitStats) -> Vec<Vec3> {
    let indirect = task.indirect(received, &mut stats.times);
    stats.transfer = indirect.transfer;
    stats.cuts = stats.cuts.or(indirect.cuts);
    indirect.radiance
}
