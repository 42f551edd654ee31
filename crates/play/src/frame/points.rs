//! What lights let arrive at the asset's finest points, for other tools.

use super::received::{Receiving, Starts};
use super::settings::FrameSettings;
use crate::lights::Lights;
use crate::prepared::PreparedScene;
use glam::Vec3;
use relight_render::watch::{Cancelled, Watch, go_on};

/// Irradiance of one light at the finest points, W/m², linear RGB, on their normals' side.
#[derive(Clone, Debug)]
pub struct LitPoints {
    /// The light.
    pub name: String,
    /// Straight from it.
    pub direct: Vec<Vec3>,
    /// By way of other surfaces. May be below zero by the operator's error.
    pub indirect: Vec<Vec3>,
}

/// Lights the points, light by light, as frames by transfer do. Empty for an asset without points.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub fn lit_points(
    prepared: &PreparedScene,
    lights: &Lights,
    time: f64,
    settings: &FrameSettings,
    watch: &dyn Watch,
) -> Result<Vec<LitPoints>, Cancelled> {
    let Some(transfer) = &prepared.transfer else {
        return Ok(Vec::new());
    };
    let receiving = Receiving { prepared, settings };
    let starts = Starts {
        points: Some(&prepared.places),
        samples: None,
    };
    let set = lights.at(time);
    let mut all = Vec::with_capacity(set.len());
    for light in 0..set.len() {
        go_on(watch)?;
        let received = receiving.with_lobes(starts, &set, light);
        let direct = received.points.unwrap_or_default();
        let (values, _) = transfer.indirect_with_lobes(&direct, received.over_lobes.as_ref());
        let indirect = (values.iter().zip(&transfer.finest.normals))
            .map(|(value, normal)| value.irradiance(*normal))
            .collect();
        all.push(LitPoints {
            name: set.name(light).to_owned(),
            direct,
            indirect,
        });
        watch.advance_to(light + 1, set.len());
    }
    Ok(all)
}
