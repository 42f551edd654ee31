//! Bakes of any fineness: however coarse the basis is, hardly any light may be lost or made.

use super::case::{Case, Measure, Measured};
use super::shapes::{LAMP, point, room};
use super::stage::{SIZE, Stage, mean, quick};
use relight_bake::params::BakeParams;
use relight_bake::{Request, coarse_radius};
use relight_scene::traced::{Shading, TracedScene};
use std::sync::Arc;

/// Levels of the bakes.
const LEVELS: [usize; 4] = [1, 2, 3, 4];
/// Paths per pixel of the truth, whose mean has a standard error of 0.3 % then.
const SPP: u32 = 512;
/// What the mean may be off by, whatever the points: three times that.
const PATHS: f64 = 0.01;
/// What it may be off by beyond that, over the root of the number of points.
const PER_ROOT_POINT: f64 = 2.0;

/// The room baked with `factor` times its own coarse radius and each number of levels, against the path tracer.
fn light_is_kept(stage: &Stage, factor: f32) -> Measured {
    let lamp = [point(LAMP, 1.0)];
    let traced = TracedScene::new(Arc::new(room()), Shading::Lambert).map_err(|e| e.to_string())?;
    let truth = mean(&stage.traced_indirect(&traced, &lamp, SPP)?).element_sum();
    let plain = quick();
    let request = Request {
        shading: Shading::Lambert,
        ..Request::new(Arc::new(room()), &plain)
    };
    let (_, own) = coarse_radius(&request, stage).map_err(|e| e.to_string())?;
    let mut measures = Vec::new();
    for levels in LEVELS {
        let params = BakeParams {
            coarse_radius: Some(own * factor),
            levels,
            sender_levels: plain.sender_levels.min(levels),
            ..plain.clone()
        };
        let player = stage.player(room(), &params)?;
        let shot = stage.shot(&player, SIZE)?;
        let lit = stage.lit(&player, &shot, &lamp)?;
        measures.push(Measure::new(
            format!("{levels} levels: mean indirect light over the path tracer's, less 1"),
            (mean(&lit.indirect).element_sum() / truth - 1.0).abs(),
            PATHS + PER_ROOT_POINT / (player.prepared.points.len() as f64).sqrt(),
            "1 % and 2/√n: what n points miss of a lamp's light; 1.7 at most over four seeds",
        ));
    }
    Ok(measures)
}

/// All of them.
pub fn cases() -> Vec<Case> {
    [("half", 0.5, true), ("own", 1.0, false), ("double", 2.0, false)]
        .into_iter()
        .map(|(name, factor, fast)| {
            Case::new(
                format!("fineness/{name}"),
                fast,
                "a coarse basis blurs light but neither loses nor makes it",
                move |stage| light_is_kept(stage, factor),
            )
        })
        .collect()
}
