//! The check at the end of every bake.

use crate::error::ProbeError;
use crate::expected::Expected;
use crate::lights::lights;
use crate::traced::{Effort, Probes, Told};
use crate::viewpoints::{CHECK, Viewpoints};
use relight_bake::{Baked, Request};
use relight_render::watch::Watch;

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

/// Measures what was baked of a request and keeps in its asset what is expected of it; `None` where no camera sees anything, so that
/// nothing can be told.
///
/// # Errors
/// [`ProbeError`].
pub fn check(
    baked: &mut Baked,
    request: &Request,
    watch: &dyn Watch,
    told: Told,
) -> Result<Option<Expected>, ProbeError> {
    let Some(viewpoints) = Viewpoints::new(request, CHECK)? else {
        return Ok(None);
    };
    let sequence = lights(&request.scene, request.lights, &viewpoints);
    let counts = &baked.asset.provenance.counts;
    let rays = (counts.iter().find(|c| c.0 == "rays")).map_or(0, |c| c.1);
    let pixels = viewpoints.windows.len() * viewpoints.pixels();
    let paths = rays / SHARE / RAYS_OF_PATH;
    let effort = Effort {
        noise: CLEAN,
        most: (paths / pixels.max(1) as u64).clamp(FEWEST, MOST) as u32,
    };
    let probes = Probes::trace(viewpoints, &sequence, request.params, effort, watch, told)?;
    let expected = probes.estimate(&baked.asset, watch)?;
    expected.store(&mut baked.asset.estimates);
    Ok(Some(expected))
}
