//! What is glossy of an asset.

use super::clusters::{Clusters, NONE};
use super::links::LobeLinks;
use crate::reflections;
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use std::sync::{Arc, OnceLock};

/// What is glossy of an asset, found when it is first asked for.
#[derive(Default)]
pub(crate) struct Gloss {
    /// Of materials as they are; `None`: nothing is glossy enough.
    senders: OnceLock<Option<GlossySenders>>,
    /// Of materials as they were.
    before: Option<Arc<Weighed>>,
}

impl Gloss {
    /// Glossy ones of the finest points, which lie at `places`; `None` where nothing is glossy enough.
    pub fn senders(
        &self,
        scene: &TracedScene,
        places: &[Option<SurfaceHit>],
        transfer: &Transfer,
    ) -> Option<&GlossySenders> {
        let make = || GlossySenders::new(scene, places, transfer, self.before.as_ref());
        self.senders.get_or_init(make).as_ref()
    }

    /// Materials have changed. What they do not matter to is kept.
    pub fn forget(&mut self) {
        if let Some(senders) = self.senders.take().flatten() {
            self.before = Some(senders.weighed);
        }
    }
}

/// Glossy points of an asset and the clusters that they stand for.
pub(crate) struct GlossySenders {
    /// Glossy ones of the points that stand for clusters.
    pub(super) points: Vec<GlossyPoint>,
    /// Of each finest point, which of those it is; [`NONE`] for matt ones and those that stand for no cluster.
    glossy_of: Vec<u32>,
    /// Of each finest point.
    pub(super) is_glossy: Vec<bool>,
    pub(super) weighed: Arc<Weighed>,
}

/// What depends on materials only by which senders are glossy.
pub(super) struct Weighed {
    pub clusters: Clusters,
    /// Of each sender, whether something of it is.
    has_glossy: Vec<bool>,
    pub links: LobeLinks,
}

/// One of the points that stand for clusters.
pub(super) struct GlossyPoint {
    /// Which finest point.
    number: u32,
    pub shading: ShadingPoint,
    /// What it reflects of even light. Links carry the mean of its cell, which differs in colour, not in where light goes.
    pub albedo: Vec3,
}

impl GlossySenders {
    /// [`Gloss::senders`].
    fn new(
        scene: &TracedScene,
        places: &[Option<SurfaceHit>],
        transfer: &Transfer,
        before: Option<&Arc<Weighed>>,
    ) -> Option<GlossySenders> {
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
        if !is_glossy.contains(&true) {
            return None;
        }
        let weighed = Weighed::new(transfer, &is_glossy, before);
        let mut numbers: Vec<u32> = (weighed.clusters.samples.iter())
            .map(|sample| sample.point)
            .collect();
        numbers.sort_unstable();
        numbers.dedup();
        let points: Vec<GlossyPoint> = (numbers.into_par_iter())
            .with_min_len(256)
            .filter_map(|number| {
                let shading = shading_of(number as usize)?;
                Some(GlossyPoint {
                    number,
                    albedo: bsdf::hemispherical_albedo(&shading),
                    shading,
                })
            })
            .collect();
        let mut glossy_of = vec![NONE; transfer.finest.len()];
        for (at, point) in (0u32..).zip(&points) {
            glossy_of[point.number as usize] = at;
        }
        (!points.is_empty()).then_some(GlossySenders {
            points,
            glossy_of,
            is_glossy,
            weighed,
        })
    }

    /// Where the glossy points are that stand for clusters: numbers of finest points.
    pub fn numbers(&self) -> impl Iterator<Item = u32> {
        self.points.iter().map(|point| point.number)
    }

    /// Which of the glossy points a finest point is.
    pub(super) fn glossy(&self, point: u32) -> Option<usize> {
        let glossy = *self.glossy_of.get(point as usize)?;
        (glossy != NONE).then_some(glossy as usize)
    }
}

impl Weighed {
    /// Of finest points some of which are glossy; what was found before, if it is the same.
    fn new(transfer: &Transfer, is_glossy: &[bool], before: Option<&Arc<Weighed>>) -> Arc<Weighed> {
        let marks: Vec<Vec3> = (is_glossy.iter())
            .map(|&is_glossy| Vec3::splat(f32::from(is_glossy)))
            .collect();
        let marks = transfer.senders.pulled(&marks).concat();
        let has_glossy: Vec<bool> = marks.iter().map(|&mark| mark != Vec3::ZERO).collect();
        if let Some(before) = before.filter(|before| before.has_glossy == has_glossy) {
            return before.clone();
        }
        let clusters = Clusters::new(transfer);
        let links = LobeLinks::new(transfer, &clusters, &has_glossy);
        Arc::new(Weighed {
            clusters,
            has_glossy,
            links,
        })
    }
}

/// Whether a lobe matters, as for what the eye sees.
fn reflects_on(point: &ShadingPoint) -> bool {
    reflections::rays(point, point.shading_normal, 1, 1.0) > 0
}
