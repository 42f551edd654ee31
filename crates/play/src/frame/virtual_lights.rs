//! The asset's points as virtual lights of a frame.

use super::received::{Receiving, Starts};
use super::settings::FrameSettings;
use crate::prepared::PreparedScene;
use crate::transfer::TransferStats;
use crate::virtual_points::PointSets;
use glam::Vec3;
use relight_render::lightcuts::{AT_POINTS, ManyLights, worthwhile};
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
    let sets = (prepared.virtual_points).get(&prepared.scene, transfer, &prepared.points, most as usize);
    let receiving = Receiving { prepared, settings };
    let add = |points: &mut PointLights, direct: &[Vec3], source: usize| {
        let radiosity = transfer.radiosity_from_direct(direct, None, &mut TransferStats::default());
        points.add_standing(&sets.lights, &sets.intensities(&radiosity), source as u32);
    };
    if settings.light_layers {
        for light in (0..lights.len()).filter(|&light| !lights.is_dark(light)) {
            go_on(watch)?;
            add(points, &received_of(receiving, lights, light), light);
        }
    } else {
        add(points, &received(receiving, lights, watch)?, 0);
    }
    Ok(Some(sets))
}

/// Direct irradiance of one light at the finest points.
fn received_of(receiving: Receiving, lights: &LightSet, light: usize) -> Vec<Vec3> {
    let starts = Starts {
        points: Some(&receiving.prepared.places),
        samples: None,
    };
    receiving.of(starts, lights, light).points.unwrap_or_default()
}

/// Direct irradiance of all lights at the finest points.
fn received(receiving: Receiving, lights: &LightSet, watch: &dyn Watch) -> Result<Vec<Vec3>, Cancelled> {
    let Receiving { prepared, settings } = receiving;
    if worthwhile(lights, settings.point_samples, AT_POINTS) {
        let many = ManyLights::new(&prepared.scene, lights, settings.seed);
        return Ok(receiving.by_lightcuts(&many, &prepared.places).0);
    }
    let mut sum = Sum::Nothing(prepared.places.points());
    for light in (0..lights.len()).filter(|&light| !lights.is_dark(light)) {
        go_on(watch)?;
        sum.add(&received_of(receiving, lights, light), Vec3::ONE);
    }
    Ok(sum.rounded())
}
