//! What is baked, and what comes of it.

use crate::params::{BakeParams, CutParams, Omittable};
use relight_format as format;
use relight_scene::light::LightTrack;
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;
use relight_scene::traced::Shading;
use std::sync::Arc;

/// An asset and what making it took.
#[derive(Debug)]
pub struct Baked {
    /// What goes into the file; depends on scene, parameters and seed only.
    pub asset: format::Asset,
    /// What varies from run to run.
    pub stats: BakeStats,
}

/// What a bake took.
#[derive(Clone, Debug, Default)]
pub struct BakeStats {
    /// Wall-clock seconds per stage, in order.
    pub seconds: Vec<(&'static str, f64)>,
    /// Thread-seconds spent casting rays, divided by the threads ([`crate::timed`] says how it is measured).
    pub ray_tracing_seconds: f64,
    /// Worker threads.
    pub threads: usize,
    /// Memory that reconstructed rows took, bytes.
    pub row_bytes: u64,
}

/// What is baked.
#[derive(Clone)]
pub struct Request<'a> {
    /// The scene.
    pub scene: Arc<Scene>,
    /// How materials are evaluated.
    pub shading: Shading,
    /// How.
    pub params: &'a BakeParams,
    /// The only sequence that the asset will play, if known; then what it cannot use is left out.
    pub lights: Option<&'a Sequence>,
    /// Identifies the scene's file.
    pub source_hash: u64,
    /// Memory of the machine, bytes, if known: a bake that surely needs more is refused before points are spread.
    pub memory: Option<u64>,
}

impl<'a> Request<'a> {
    /// A scene with all its materials, for any lights; of no file, on a machine of any size.
    pub fn new(scene: Arc<Scene>, params: &'a BakeParams) -> Request<'a> {
        Request {
            scene,
            shading: Shading::Full,
            params,
            lights: None,
            source_hash: 0,
            memory: None,
        }
    }

    /// The cuts to make: `--cuts auto` makes none without an environment to see.
    pub(crate) fn wanted_cuts(&self) -> Option<&'a CutParams> {
        let params = self.params;
        (params.cuts.as_ref()).filter(|_| params.keeps(Omittable::Cuts) || self.uses_cuts())
    }

    /// Whether cuts are wanted for what they do, not because nothing may be left out.
    pub(crate) fn uses_cuts(&self) -> bool {
        let shines = |s: &Sequence| s.lights.iter().any(LightTrack::is_distant);
        (self.params.cuts.as_ref()).is_some_and(|cuts| !cuts.if_used || self.lights.is_none_or(shines))
    }
}
