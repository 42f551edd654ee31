//! Lights over time, as a player takes them.

use relight_scene::light::LightTrack;
use relight_scene::light_set::{
    DistantLight, LightRig, LightSet, LightSetError, PreparedLights, SceneEmitters, Split,
};
use relight_scene::traced::TracedScene;
use std::sync::Arc;

/// Lights over time with all that is prepared of them once: tables of environments and of emissive surfaces, and what of
/// environments goes through visibility cuts. Any number of shots and frames may share them.
pub struct Lights {
    tracks: Vec<LightTrack>,
    emitters: SceneEmitters,
    prepared: PreparedLights,
    /// Per light the parts of its environment, if that is the same at all times.
    splits: Vec<Option<Arc<Split>>>,
    /// How many even directions visibility cuts know of; 0 without.
    directions: u32,
}

/// The lights of a frame as visibility cuts take them.
pub(crate) struct Distant<'a> {
    /// What has shadow rays of its own.
    pub near: LightSet<'a>,
    /// Per light the part that comes from even directions.
    pub lights: Vec<Option<DistantLight>>,
}

impl Lights {
    /// Prepares lights of a scene whose surfaces may shine; `directions`: how many even ones visibility cuts know of, 0
    /// without ([`crate::PreparedScene::directions`]).
    ///
    /// # Errors
    /// A light names a material that does not emit.
    pub fn new(scene: &TracedScene, tracks: &[LightTrack], directions: u32) -> Result<Lights, LightSetError> {
        let emitters = SceneEmitters::new(scene);
        let prepared = PreparedLights::new(&emitters, tracks)?;
        let mut lights = Lights {
            tracks: tracks.to_vec(),
            emitters,
            prepared,
            splits: vec![None; tracks.len()],
            directions,
        };
        if directions > 0 {
            let rig = lights.rig();
            lights.splits = (0..tracks.len())
                .map(|light| {
                    let changes = rig.map_changes(light);
                    (!changes).then(|| rig.split(light, 0.0, directions).map(Arc::new))?
                })
                .collect();
        }
        Ok(lights)
    }

    fn rig(&self) -> LightRig<'_> {
        LightRig::with(&self.emitters, &self.tracks, self.prepared.clone())
    }

    /// What shines when, in the order of light layers.
    pub fn tracks(&self) -> &[LightTrack] {
        &self.tracks
    }

    /// Whether an environment or a sky is among them.
    pub fn any_distant(&self) -> bool {
        self.tracks.iter().any(LightTrack::is_distant)
    }

    /// The lights at a time, in frames of their sequence.
    pub fn at(&self, time: f64) -> LightSet<'_> {
        self.rig().at(time)
    }

    /// The same with what comes from even directions apart.
    pub(crate) fn distant_at(&self, time: f64) -> Distant<'_> {
        let rig = self.rig();
        let mut near = rig.at(time);
        let lights = near.take_distant(|light| match &self.splits[light] {
            None if self.directions > 0 && rig.map_changes(light) => {
                rig.split(light, time, self.directions).map(Arc::new)
            }
            kept => kept.clone(),
        });
        Distant { near, lights }
    }
}
