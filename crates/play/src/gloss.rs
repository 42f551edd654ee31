//! What lamps send over glossy surfaces: their lobes in place of the matt reflection that links are for.
//!
//! A link takes a cluster's radiosity to a receiver as if the cluster sent it evenly. Of light that comes from one side, a glossy surface sends
//! most to the other, so that a receiver gets more or less. Of each cluster some points stand for all ([`clusters`]): they know their irradiance and
//! whence the lamp shines, and their BRDF says what they send to this receiver ([`lamp`]); the difference to what is matt goes over weights that
//! are made of the links ([`links`], [`families`]). Each point counts by the mean light around it, not by its own: a shadow's edge that passes one of four points would
//! switch a quarter of the cluster. Lobes are as much wider as the piece of surface is that a place stands for, and as the lamp. All of it is linear in the
//! lamps' light. Light of further reflections comes from all around, and is taken as ever.

mod clusters;
mod disk;
mod families;
mod lamp;
mod links;

use crate::lit::Lit;
use crate::reflections;
use crate::transfer::Transfer;
use clusters::{Clusters, NONE};
use glam::Vec3;
use lamp::LampLight;
use links::LobeLinks;
use rayon::prelude::*;
use relight_render::irradiance::Arrivals;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::pyramid::VectorIrradiance;

/// Glossy points of an asset and the clusters that they stand for.
pub(crate) struct GlossySenders {
    /// Glossy ones of the points that stand for clusters.
    points: Vec<GlossyPoint>,
    /// Of each finest point, which of those it is; [`NONE`] for matt ones and those that stand for no cluster.
    glossy_of: Vec<u32>,
    /// Of each finest point.
    is_glossy: Vec<bool>,
    clusters: Clusters,
    links: LobeLinks,
}

struct GlossyPoint {
    /// Which finest point.
    number: u32,
    shading: ShadingPoint,
    /// What links take it to reflect.
    albedo: Vec3,
}

impl GlossySenders {
    /// Those of the finest points, which lie at `places`; `None` where nothing is glossy enough.
    pub fn new(
        scene: &TracedScene,
        places: &[Option<SurfaceHit>],
        transfer: &Transfer,
    ) -> Option<GlossySenders> {
        let clusters = Clusters::new(transfer);
        let mut numbers: Vec<u32> = clusters.samples.iter().map(|sample| sample.point).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let shading_of = |number: usize| {
            let hit = places[number].as_ref()?;
            let on_triangle = (hit.primitive as usize) < scene.triangle_count();
            on_triangle.then(|| scene.shading_point(hit)).filter(reflects_on)
        };
        let is_glossy: Vec<bool> = (0..transfer.finest.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|number| shading_of(number).is_some())
            .collect();
        let points: Vec<GlossyPoint> = (numbers.into_par_iter())
            .with_min_len(256)
            .filter_map(|number| {
                Some(GlossyPoint {
                    number,
                    shading: shading_of(number as usize)?,
                    albedo: transfer.albedo[number as usize],
                })
            })
            .collect();
        let mut glossy_of = vec![NONE; transfer.finest.len()];
        for (at, point) in (0u32..).zip(&points) {
            glossy_of[point.number as usize] = at;
        }
        if points.is_empty() {
            return None;
        }
        let marks: Vec<Vec3> = is_glossy
            .iter()
            .map(|&is_glossy| Vec3::splat(f32::from(is_glossy)))
            .collect();
        let has_glossy = transfer.senders.pulled(&marks).concat();
        let links = LobeLinks::new(transfer, &clusters, |sender| {
            has_glossy[sender as usize] != Vec3::ZERO
        });
        Some(GlossySenders {
            points,
            glossy_of,
            is_glossy,
            clusters,
            links,
        })
    }

    /// Where the glossy points are that stand for clusters: numbers of finest points.
    pub fn numbers(&self) -> impl Iterator<Item = u32> {
        self.points.iter().map(|point| point.number)
    }

    /// Vector irradiance at all receivers, of all levels: what they get of a lamp's light over lobes, less what they would get if those were
    /// matt. `direct`: its irradiance at the finest points; `arrivals`: the same at [`GlossySenders::numbers`].
    /// `None` where it is nothing.
    pub fn over_lobes(
        &self,
        transfer: &Transfer,
        direct: &[Vec3],
        arrivals: &Arrivals,
    ) -> Option<Vec<VectorIrradiance>> {
        let lit = Lit::of(arrivals)?;
        let light = LampLight::new(self, transfer, direct, lit);
        Some(light.received())
    }

    fn glossy(&self, point: u32) -> Option<usize> {
        let glossy = *self.glossy_of.get(point as usize)?;
        (glossy != NONE).then_some(glossy as usize)
    }
}

/// Whether a lobe matters, as for what the eye sees.
fn reflects_on(point: &ShadingPoint) -> bool {
    reflections::rays(point, point.shading_normal, 1) > 0
}
