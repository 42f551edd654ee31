//! Lights over time, as a player takes them.

use glam::Vec3;
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

/// The lights of a frame, each also at a colour of 1: a lamp that is dimmed stays the same but for that.
pub(crate) struct FrameLights<'a> {
    /// As they are.
    pub lights: LightSet<'a>,
    /// What visibility cuts leave of them, if they take any.
    left: Option<LightSet<'a>>,
    /// What has shadow rays of its own, at a colour of 1.
    pub white: LightSet<'a>,
    /// Per light the part that comes from even directions, where visibility cuts take it; at a colour of 1.
    pub even: Vec<Option<DistantLight>>,
    /// What that, and `white`, are to be multiplied by.
    pub colors: Vec<Vec3>,
}

impl<'a> FrameLights<'a> {
    /// What has shadow rays of its own.
    pub fn shadowed(&self) -> &LightSet<'a> {
        self.left.as_ref().unwrap_or(&self.lights)
    }
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

    /// The same as frames take them; `by_cuts`: visibility cuts take what comes from even directions.
    pub(crate) fn of_frame(&self, time: f64, by_cuts: bool) -> FrameLights<'_> {
        let rig = self.rig();
        let (lights, mut white, colors) = rig.colored_at(time);
        let mut even: Vec<Option<DistantLight>> = self.tracks.iter().map(|_| None).collect();
        let left = by_cuts.then(|| {
            let splits: Vec<Option<Arc<Split>>> = (self.splits.iter().enumerate())
                .map(|(light, kept)| match kept {
                    None if self.directions > 0 && rig.map_changes(light) => {
                        rig.split(light, time, self.directions).map(Arc::new)
                    }
                    kept => kept.clone(),
                })
                .collect();
            even = white.take_distant(|light| splits[light].clone());
            let mut left = rig.at(time);
            left.take_distant(|light| splits[light].clone());
            left
        });
        FrameLights {
            lights,
            left,
            white,
            even,
            colors,
        }
    }
}
