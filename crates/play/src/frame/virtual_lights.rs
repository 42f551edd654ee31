//! The asset's points as virtual lights of a frame.

use super::received::{Receiving, Starts};
use super::settings::FrameSettings;
use crate::prepared::PreparedScene;
use crate::transfer::{Transfer, TransferStats};
use crate::virtual_points::PointSets;
use glam::Vec3;
use relight_render::lightcuts::{AT_POINTS, ManyLights, diagonal, worthwhile};
use relight_render::many_lights::PointLights;
use relight_render::sum::Sum;
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::light_set::LightSet;
use std::sync::Arc;

/// Adds up to `most` virtual lights to the points of a frame's lights, with light layers as many for each light. `None` of an asset without
/// points.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub(super) fn add_standing(
    prepared: &PreparedScene,
    lights: &LightSet<'_>,
    settings: &FrameSettings,
    most: u32,
    points: &mut PointLights,
    watch: &dyn Watch,
) -> Result<Option<Arc<PointSets>>, Cancelled> {
    let Some(transfer) = prepared.transfer.as_ref().filter(|_| most > 0) else {
        return Ok(None);
    };
    let scene = &prepared.scene;
    let sets =
        (prepared.virtual_points).get(scene, transfer, &prepared.points, diagonal(scene), most as usize);
    let add = |points: &mut PointLights, direct: &[Vec3], source: usize| {
        let radiosity = transfer.radiosity_from_direct(direct, &mut TransferStats::default());
        points.add_standing(&sets.lights, &sets.intensities(&radiosity), source as u32);
    };
    if settings.light_layers {
        for light in (0..lights.len()).filter(|&light| !lights.is_dark(light)) {
            go_on(watch)?;
            add(points, &received_of(prepared, settings, lights, light), light);
        }
    } else {
        add(points, &received(prepared, transfer, settings, lights, watch)?, 0);
    }
    Ok(Some(sets))
}

/// Direct irradiance of one light at the finest points.
fn received_of(
    prepared: &PreparedScene,
    settings: &FrameSettings,
    lights: &LightSet<'_>,
    light: usize,
) -> Vec<Vec3> {
    let starts = Starts {
        points: Some(&prepared.places),
        samples: None,
    };
    let received = Receiving { prepared, settings }.of(starts, lights, light);
    received.points.unwrap_or_default()
}

/// Direct irradiance of all lights at the finest points.
fn received(
    prepared: &PreparedScene,
    transfer: &Transfer,
    settings: &FrameSettings,
    lights: &LightSet<'_>,
    watch: &dyn Watch,
) -> Result<Vec<Vec3>, Cancelled> {
    if worthwhile(lights, settings.point_samples, AT_POINTS) {
        let many = ManyLights::new(&prepared.scene, lights, settings.seed);
        let places = &prepared.places;
        let (irradiance, _) = many.irradiance_at(&prepared.scene, &places.hits, prepared.footprint());
        return Ok(places.means(irradiance));
    }
    let mut sum = Sum::Nothing(transfer.finest.len());
    for light in (0..lights.len()).filter(|&light| !lights.is_dark(light)) {
        go_on(watch)?;
        sum.add(received_of(prepared, settings, lights, light));
    }
    Ok(sum.rounded())
}
