//! Any number of lights with a bounded error: lightcuts.
//!
//! Source: Walter et al. 2005. All lights become lights without extent ([`crate::many_lights`]); trees over them hold
//! clusters ([`relight_transport::light_clusters`]), and every eye ray's point gets the coarsest cut through them whose
//! nodes' error bounds ([`relight_transport::light_bounds`], [`relight_scene::bsdf::bounds`]) are each at most a share
//! of the light there. Clusters that are hidden for sure (`hidden`) have no error; those that little lies in front of
//! are as visible as their parts are (`sights`).
//!
//! Lights that shine directly and virtual lights are trees apart, so that layers add up, and with light layers every
//! source has its own; the error is relative to all light together.
//!
//! Mirrors (metals of roughness up to 0.01) are followed by a ray of their own, as the paper does with delta BRDFs. The
//! scene model has no glass. Deviation: errors and totals are compared in the largest channel.

mod blocks;
pub(crate) mod cut;
mod gather;
mod hidden;
mod lit;
mod sample;
mod sights;
mod told;

use crate::direct::light_met;
use crate::layers::PixelSum;
use crate::many_lights::{PointLights, StandingLights};
use crate::picture::{Picture, Seen};
use crate::sum::Total;
use crate::watch::Cancelled;
pub use blocks::{EyeRays, render as render_reconstructed};
use cut::Cut;
use glam::Vec3;
use lit::{Lit, Receiver};
use relight_scene::bsdf;
use relight_scene::image::Layers;
use relight_scene::rays::Ray;
use relight_scene::shading::{Gloss, MIN_ALPHA, ShadingPoint};
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::TracedScene;
use relight_transport::light_clusters::{BuildSettings, LightClusters, build};
use sights::Sights;
use std::ops::AddAssign;

pub use gather::{AT_PIXELS, AT_POINTS, Crossover, ManyLights, worthwhile};
pub use lit::LightcutSettings;
pub use sample::ReconstructionStats;
pub use told::{CutCluster, cut_at};

/// What an image took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightcutStats {
    /// Shadow rays of all pixels.
    pub shadow_rays: u64,
    /// Nodes of all cuts.
    pub nodes: u64,
    /// Cuts: points that were lit.
    pub cuts: u64,
    /// Cuts that the limit on nodes ended.
    pub limited: u64,
}

/// Trees over points, groups by layer and, with `light_layers`, by source. `standing`: where virtual lights stand still, if they do.
pub fn trees(
    scene: &TracedScene,
    points: &PointLights,
    standing: Option<&StandingLights>,
    light_layers: bool,
    seed: u64,
) -> LightClusters {
    let group = |i: usize| {
        let source = if light_layers { points.source[i] } else { 0 };
        2 * source + u32::from(points.is_virtual(i))
    };
    let moving = points.standing.first().map_or(points.len(), |set| set.start);
    let groups: Vec<u32> = (0..moving).map(group).collect();
    let settings = BuildSettings {
        seed,
        ..BuildSettings::default()
    };
    let mut trees = build(&points.lights[..moving], &groups, diagonal(scene), &settings);
    for set in &points.standing {
        let intensities: Vec<Vec3> = points.lights[set.clone()]
            .iter()
            .map(|light| light.intensity)
            .collect();
        if let Some(standing) = standing.filter(|_| intensities.iter().any(|&i| i != Vec3::ZERO)) {
            trees.append(
                &standing.tree.lit_by(&intensities, seed),
                set.start as u32,
                group(set.start),
            );
        }
    }
    trees
}

/// Diagonal of the scene's bounds, m.
pub fn diagonal(scene: &TracedScene) -> f32 {
    scene.bounds().map_or(0.0, |(low, high)| (high - low).length())
}

/// Samples per pixel where none are asked for; a cut for each.
pub const SPP: u32 = 4;

/// Renders an image. `clusters` are the [`trees`] over `points` with the picture's light layers. Layers: see
/// [`crate::layers`]; light by virtual lights is `indirect`, and so is what mirrors show, but for lights.
///
/// # Errors
/// [`Cancelled`] if the picture's watch says so.
pub fn render(
    picture: &Picture<'_>,
    points: &PointLights,
    clusters: &LightClusters,
    settings: &LightcutSettings,
) -> Result<(Layers, LightcutStats), Cancelled> {
    let lit = Lit {
        scene: picture.scene,
        points,
        clusters,
        settings: *settings,
    };
    let total = Total::<LightcutStats>::default();
    let layers = picture.by_tiles(State::default, |state, tile, sums| {
        let mut stats = LightcutStats::default();
        for (pixel, sums) in tile.pixels().zip(sums) {
            sums.samples = picture.spp.unwrap_or(SPP);
            state.views.clear();
            for sample in 0..sums.samples {
                let (eye, _) = picture.eye_ray(pixel, sample);
                let view = (picture.see(&eye, sums)).and_then(|seen| follow_mirrors(picture, seen, sums));
                state.views.extend(view);
            }
            // Stable, so that what is on one triangle keeps its order.
            state.views.sort_by_key(|view| view.hit.primitive);
            for views in state.views.chunk_by(|a, b| a.hit.primitive == b.hit.primitive) {
                state.sights.begin(&lit, views.iter().map(|view| &view.hit));
                for view in views {
                    let receiver = Receiver::new(&view.hit, &view.point, view.wo);
                    (state.cut).choose(&lit, &receiver, &mut state.sights, &mut stats.shadow_rays);
                    stats.count(&state.cut, &lit);
                    state.cut.light(&lit, |root, radiance| {
                        add(&lit, picture.light_layers, view, root, radiance, sums);
                    });
                }
            }
        }
        total.add(stats);
    })?;
    Ok((layers, total.sum()))
}

/// What a worker keeps from pixel to pixel.
#[derive(Default)]
struct State {
    cut: Cut,
    sights: Sights,
    /// What the pixel's eye rays see.
    views: Vec<View>,
}

impl AddAssign for LightcutStats {
    fn add_assign(&mut self, other: LightcutStats) {
        self.shadow_rays += other.shadow_rays;
        self.nodes += other.nodes;
        self.cuts += other.cuts;
        self.limited += other.limited;
    }
}

impl LightcutStats {
    fn count(&mut self, cut: &Cut, lit: &Lit<'_>) {
        self.nodes += cut.len() as u64;
        self.cuts += 1;
        self.limited += u64::from(cut.len() >= lit.settings.max_nodes);
    }
}

/// Adds a root's light to the layers.
fn add(lit: &Lit<'_>, light_layers: bool, view: &View, root: u32, radiance: Vec3, sums: &mut PixelSum) {
    let group = lit.clusters.roots[root as usize].group;
    let source = light_layers.then_some((group / 2) as usize);
    sums.add(source, 1 + group % 2 + view.mirrors, view.throughput * radiance);
}

/// What is seen, perhaps over mirrors.
#[derive(Clone, Copy)]
pub(crate) struct View {
    pub hit: SurfaceHit,
    pub point: ShadingPoint,
    pub wo: Vec3,
    /// What the mirrors leave of its light.
    pub throughput: Vec3,
    /// Number of mirrors.
    pub mirrors: u32,
}

/// Most mirrors one after another. Between two parallel ones of 90 % a fifth of the light is left.
const MOST_MIRRORS: u32 = 16;

/// Follows mirrors until something else is seen; what shines in them is added to the layers. `None` if nothing is lit.
pub(crate) fn follow_mirrors(
    picture: &Picture<'_>,
    Seen { hit, ray, tint }: Seen,
    sums: &mut PixelSum,
) -> Option<View> {
    let Picture { scene, lights, .. } = *picture;
    let wo = -ray.direction;
    let point = scene.shading_point(&hit).facing(wo);
    let mut view = View {
        hit,
        point,
        wo,
        throughput: tint,
        mirrors: 0,
    };
    while is_mirror(&view.point) {
        if view.mirrors == MOST_MIRRORS {
            return None;
        }
        view.mirrors += 1;
        // The middle of the lobe: with u = 0 the visible normal is the normal but for α.
        let normal = view.point.shading_normal;
        let wi = (normal * (2.0 * normal.dot(view.wo)) - view.wo).normalize();
        view.throughput *= bsdf::albedo::specular(&view.point, normal.dot(view.wo).clamp(0.0, 1.0));
        let ray: Ray = ray_from(&view.hit, wi);
        let look = scene.look(&ray, |part, end, tint| {
            lights.along(part.origin, part.direction, end, |met| {
                let radiance = view.throughput * tint * met.radiance;
                sums.add(Some(met.light), view.mirrors, radiance);
            });
        });
        view.throughput *= look.tint;
        light_met(
            scene,
            lights,
            look.ray.origin,
            look.ray.direction,
            look.hit.as_ref(),
            None,
            |light, radiance, _| {
                sums.add(Some(light), view.mirrors, view.throughput * radiance);
            },
        );
        view.hit = look.hit?;
        view.wo = -look.ray.direction;
        view.point = scene.shading_point(&view.hit).facing(view.wo);
    }
    Some(view)
}

/// A metal as smooth as materials can be.
fn is_mirror(point: &ShadingPoint) -> bool {
    !point.lambert
        && point.gloss == Gloss::Ggx
        && point.alpha <= MIN_ALPHA
        && point.diffuse == Vec3::ZERO
        && point.layers.is_none()
}

#[cfg(test)]
mod tests;
