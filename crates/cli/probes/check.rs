//! The check at the end of every bake.

use super::lit::lit;
use super::traced::{Effort, Probes};
use super::viewpoints::{CHECK, Viewpoints};
use crate::console::Console;
use crate::estimates::Expected;
use crate::failure::Failure;
use relight_bake::Baked;
use relight_bake::params::BakeParams;
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;
use relight_scene::traced::Shading;
use std::sync::Arc;

/// Share of the bake's rays that the check may cast.
const SHARE: u64 = 10;
/// Rays of a path, with those to lights: in rooms of middling albedo.
const RAYS_OF_PATH: u64 = 10;
/// Fewest and most samples of a pixel: some tenths of a second, and seconds. Rays are counted and not time, so that the same bake has the
/// same bytes on any machine.
const FEWEST: u64 = 64;
const MOST: u64 = 256;
/// Noise of the reference that needs no more samples.
const CLEAN: f64 = 0.02;

/// Measures a bake and keeps in its asset what is expected of it; says so where nothing can be told.
///
/// # Errors
/// The scene cannot be traced, or a signal asks to stop.
pub fn check(
    baked: &mut Baked,
    scene: &Arc<Scene>,
    shading: Shading,
    lights: Option<&Sequence>,
    params: &BakeParams,
    console: &Console,
) -> Result<(), Failure> {
    console.begin("Checking with probes", None);
    let Some(viewpoints) = Viewpoints::new(scene, shading, lights, params, CHECK)? else {
        console.note("note: no camera sees anything, so that this bake cannot measure itself.");
        return Ok(());
    };
    let sequence = lit(scene, lights, &viewpoints)?;
    let counts = &baked.asset.provenance.counts;
    let rays = (counts.iter().find(|c| c.0 == "rays")).map_or(0, |c| c.1);
    let pixels = viewpoints.windows.len() * viewpoints.pixels();
    let paths = rays / SHARE / RAYS_OF_PATH;
    let effort = Effort {
        noise: CLEAN,
        most: (paths / pixels.max(1) as u64).clamp(FEWEST, MOST) as u32,
    };
    let probes = Probes::trace(viewpoints, &sequence, params, effort, console)?;
    let expected: Expected = probes.estimate(&baked.asset)?;
    expected.store(&mut baked.asset.estimates);
    console.close();
    Ok(())
}
