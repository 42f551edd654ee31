//! The lightcut of one place: which clusters of lights and of the asset's points light it.

use super::settings::FrameSettings;
use super::virtual_lights::add_standing;
use crate::prepared::PreparedScene;
use glam::Vec3;
use relight_render::lightcuts::{CutCluster, LightcutSettings, cut_at, trees};
use relight_render::many_lights::{PointLights, PointSettings};
use relight_render::watch::{Cancelled, Watch};
use relight_scene::light_set::LightSet;
use relight_scene::surface::SurfaceHit;

/// The cut of a place by the defaults of the integrator `lightcuts`, with the asset's points as virtual lights.
#[derive(Clone, Debug, Default)]
pub struct LightCut {
    /// Its clusters, brightest first.
    pub clusters: Vec<CutCluster>,
    /// Lights of all trees.
    pub lights: usize,
}

/// The cut of a place that is looked at from `towards`, a unit vector.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub(crate) fn light_cut(
    prepared: &PreparedScene,
    lights: &LightSet<'_>,
    hit: &SurfaceHit,
    towards: Vec3,
    watch: &dyn Watch,
) -> Result<LightCut, Cancelled> {
    let scene = &prepared.scene;
    let settings = FrameSettings::default();
    let mut points = PointLights::that_shine(scene, lights, &PointSettings::default());
    let standing = add_standing(prepared, lights, &settings, u32::MAX, &mut points, watch)?;
    let standing = standing.as_ref().map(|sets| &sets.lights);
    let clusters = trees(scene, &points, standing, false, settings.seed);
    Ok(LightCut {
        clusters: cut_at(
            scene,
            &points,
            &clusters,
            &LightcutSettings::default(),
            hit,
            towards,
        ),
        lights: points.len(),
    })
}
