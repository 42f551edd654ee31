//! `relight bake --target-error E`: chooses the knobs of a bake by what they do to images.
//!
//! E is the root of relMSE of the indirect layer, less its reference's own noise: what `report` lists as the error of indirect
//! light. It is estimated in small windows of images that the cameras would make from other places nearby, so that
//! no pixel that anyone plays decides. The settings of [`LADDER`] are baked from the coarsest on until one will do;
//! that bake is the asset.

use crate::bake::job::{Job, bake_job, unjudged};
use crate::console::Console;
use crate::failure::Failure;
use crate::signals::{self, Signals};
use crate::words;
use relight_bake::Baked;
use relight_bake::params::{BakeParams, Preset};
use relight_probes::expected::{CLOSE_ENOUGH, DOUBT, percent};
use relight_probes::lights::lights;
use relight_probes::traced::{Effort, Probes};
use relight_probes::viewpoints::{SEARCH, Viewpoints};
use relight_probes::{Expected, Verdict};
use relight_scene::scene::Scene;
use std::path::Path;
use std::sync::Arc;

/// A setting to try.
#[derive(Clone, Copy)]
struct Step {
    /// Whose rays it takes, and its name on the command line.
    preset: (Preset, &'static str),
    levels: usize,
    sender_levels: usize,
    epsilon: f32,
    /// The coarse radius; `None`: what was given, or that of the scene.
    coarse_radius: Option<f32>,
}

const fn step(preset: (Preset, &'static str), levels: usize, sender_levels: usize, epsilon: f32) -> Step {
    Step {
        preset,
        levels,
        sender_levels,
        epsilon,
        coarse_radius: None,
    }
}

const DRAFT: (Preset, &str) = (Preset::Draft, "draft");

/// Each costs two to three times the one before and errs by a third less, as long as points and links are what errs
/// (docs/notebook/report.md).
const LADDER: [Step; 7] = [
    step(DRAFT, 2, 1, 0.15),
    step(DRAFT, 3, 2, 0.075),
    step(DRAFT, 4, 2, 0.075),
    step(DRAFT, 4, 3, 0.04),
    step(DRAFT, 5, 3, 0.04),
    step((Preset::Standard, "standard"), 6, 4, 0.018),
    step((Preset::Fine, "fine"), 6, 5, 0.0075),
];

/// Most samples of a probe's pixel where all windows see something.
const MOST: f32 = 512.0;
/// What errs by less than this share of what was asked for, after a step that erred by too much, has a step tried between
/// the two.
const TOO_FINE: f64 = 0.75;
/// Between two steps is the coarser one with points so much nearer to each other, twice as many.
const BETWEEN: f32 = std::f32::consts::SQRT_2;
/// A step that takes less off the error than this says that finer ones won't help.
const WORTH: f64 = 0.95;

/// What is baked, and for what.
pub struct Order<'a> {
    /// The bake; its parameters hold for what the steps do not choose.
    pub job: &'a Job<'a>,
    /// E.
    pub target: f64,
    /// Where the asset will be.
    pub output: &'a Path,
}

/// Bakes step after step until one will do.
///
/// # Errors
/// A bake fails, a signal asks to stop, or nothing can be seen.
pub fn search(order: &Order, scene: &Arc<Scene>, console: &Console) -> Result<Baked, Failure> {
    let given = order.job.params;
    let request = order.job.request(given, scene.clone());
    let Some(viewpoints) = Viewpoints::new(&request, SEARCH).map_err(unjudged)? else {
        return Err(anyhow::anyhow!("no camera sees anything by which --target-error could judge").into());
    };
    let sequence = lights(scene, request.lights, &viewpoints);
    console.begin("Path tracing probes", None);
    let effort = Effort {
        noise: order.target,
        // Pixels that see nothing add no noise but count in the mean: the more there are, the noisier the others may be, and
        // the more they are of what is sought.
        most: (MOST * viewpoints.seen.recip().sqrt()) as u32,
    };
    let told = |words| console.detail(words);
    let traced = Probes::trace(viewpoints, &sequence, given, effort, &Signals, &told);
    let probes = traced.map_err(unjudged)?;
    let mut best: Option<(Baked, Expected)> = None;
    let mut idle = 0;
    let mut last = LADDER[0];
    for step in LADDER {
        if relight_bake::settings::validate(&with_step(given, step)).is_err() {
            continue;
        }
        let (baked, estimate) = tried(order, scene, &probes, step, console)?;
        let before = best.as_ref().map(|b| b.1.error);
        let better = before.is_none_or(|b| estimate.error < b * WORTH);
        idle = if better { 0 } else { idle + 1 };
        let done = estimate.error <= CLOSE_ENOUGH * order.target && estimate.verdict() != Verdict::Wrong;
        if done && before.is_some() && estimate.error < TOO_FINE * order.target {
            let radius = baked.asset.points.first().map(|level| level.disk_radius);
            let between = Step {
                coarse_radius: radius.map(|radius| radius / BETWEEN),
                ..last
            };
            let coarser = tried(order, scene, &probes, between, console)?;
            // It must not err more than asked for, nor less than the finer one.
            let fits = (estimate.error..=CLOSE_ENOUGH * order.target).contains(&coarser.1.error)
                && coarser.1.verdict() != Verdict::Wrong;
            best = Some(if fits { coarser } else { (baked, estimate) });
            break;
        }
        if better || done {
            best = Some((baked, estimate));
        }
        last = step;
        // Two steps in vain: what errs is none of the knobs'.
        if done || idle == 2 {
            break;
        }
    }
    console.close();
    let Some((mut baked, estimate)) = best else {
        return Err(anyhow::anyhow!("no setting could be baked for --target-error").into());
    };
    said(order.target, estimate, &probes, console);
    let expected = Expected {
        target: Some(order.target),
        ..estimate
    };
    expected.store(&mut baked.asset.estimates);
    Ok(baked)
}

/// Bakes a step and judges it.
fn tried(
    order: &Order,
    scene: &Arc<Scene>,
    probes: &Probes,
    step: Step,
    console: &Console,
) -> Result<(Baked, Expected), Failure> {
    let params = with_step(order.job.params, step);
    // What is coarsest is smallest: where that has no room, none will.
    let target = (step.levels == LADDER[0].levels).then_some(order.output);
    let baked = bake_job(order.job, &params, scene.clone(), None, target, console)?;
    signals::go_on()?;
    console.begin("Comparing with the probes", None);
    let estimate = probes.estimate(&baked.asset, &Signals).map_err(unjudged)?;
    console.note(format!(
        "{}: indirect light is expected to err by {} (asked for: {}).",
        words_of(step),
        percent(estimate.error),
        percent(order.target)
    ));
    Ok((baked, estimate))
}

fn with_step(given: &BakeParams, step: Step) -> BakeParams {
    BakeParams {
        levels: step.levels,
        sender_levels: step.sender_levels,
        epsilon: step.epsilon,
        rays: BakeParams::preset(step.preset.0).rays,
        coarse_radius: step.coarse_radius.or(given.coarse_radius),
        ..given.clone()
    }
}

fn words_of(step: Step) -> String {
    let radius = (step.coarse_radius).map_or_else(String::new, |r| format!(" --coarse-radius {r}"));
    format!(
        "--preset {} --levels {} --sender-levels {} --epsilon {}{radius}",
        step.preset.1, step.levels, step.sender_levels, step.epsilon
    )
}

fn said(target: f64, estimate: Expected, probes: &Probes, console: &Console) {
    let Expected {
        error, error_noise, ..
    } = estimate;
    if error > CLOSE_ENOUGH * target {
        console.note(format!(
            "warning: an error of {} is out of reach: the setting that was taken is expected to err by {}, and finer ones \
             by hardly less. The rest is none of these knobs': points' distance at contacts, or surfaces that are not matt.",
            percent(target),
            percent(error)
        ));
    } else if error < target / 1.5 {
        console.note(format!(
            "The coarsest setting is expected to err by {} already, less than asked for.",
            percent(error)
        ));
    }
    console.note(format!(
        "Estimated in {} of other viewpoints, whose reference's own noise is {}: give or take {}.",
        words::plural(probes.pixels(), "pixel"),
        percent(probes.noise()),
        percent(DOUBT * error_noise)
    ));
}
