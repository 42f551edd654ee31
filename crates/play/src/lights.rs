//! Lights over time, as a player takes them.

use glam::Vec3;
use relight_scene::light::{EnvironmentMap, LightKind, LightTrack};
use relight_scene::light_set::{
    DistantLight, LightRig, LightSet, LightSetError, PreparedLights, SceneEmitters, Split,
};
use relight_scene::traced::TracedScene;
use std::sync::Arc;

/// Lights over time with all that is prepared of them once: tables of environments and of emissive surfaces, and what of
/// environments goes through visibility cuts. Any number of shots and frames may share them.
pub struct Lights {
    tracks: Vec<LightTrack>,
    emitters: Arc<SceneEmitters>,
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
        Lights::prepared(scene, tracks, directions, None)
    }

    /// The same after others of the scene: what these share with those is not prepared again.
    ///
    /// # Errors
    /// As [`Lights::new`].
    pub fn again(
        &self,
        scene: &TracedScene,
        tracks: &[LightTrack],
        directions: u32,
    ) -> Result<Lights, LightSetError> {
        Lights::prepared(scene, tracks, directions, Some(self))
    }

    fn prepared(
        scene: &TracedScene,
        tracks: &[LightTrack],
        directions: u32,
        before: Option<&Lights>,
    ) -> Result<Lights, LightSetError> {
        let (emitters, known) = match before {
            Some(before) if before.emitters.are_of(scene) => {
                (before.emitters.clone(), before.prepared.clone())
            }
            // Materials have changed; maps have not.
            Some(before) => (Arc::new(SceneEmitters::new(scene)), before.prepared.of_maps()),
            None => (Arc::new(SceneEmitters::new(scene)), PreparedLights::default()),
        };
        let mut lights = Lights {
            prepared: known.again(&*emitters, tracks)?,
            tracks: tracks.to_vec(),
            emitters,
            splits: vec![None; tracks.len()],
            directions,
        };
        if directions > 0 {
            lights.splits = (0..tracks.len())
                .map(|light| {
                    let before = before.filter(|before| before.directions == directions);
                    let known = before.and_then(|before| before.split_of(lights.map_of(light)?));
                    known.or_else(|| lights.new_split(light))
                })
                .collect();
        }
        Ok(lights)
    }

    /// The map of an environment that has one.
    fn map_of(&self, light: usize) -> Option<&Arc<EnvironmentMap>> {
        match &self.tracks[light].kind {
            LightKind::Environment { maps, .. } => maps.only(),
            _ => None,
        }
    }

    /// The parts of a map, if a light of this set has it.
    fn split_of(&self, map: &Arc<EnvironmentMap>) -> Option<Arc<Split>> {
        let has = |light: &usize| self.map_of(*light).is_some_and(|own| Arc::ptr_eq(own, map));
        (0..self.tracks.len())
            .find(has)
            .and_then(|light| self.splits[light].clone())
    }

    /// The parts of a light's map, if it is an environment of one.
    fn new_split(&self, light: usize) -> Option<Arc<Split>> {
        let rig = self.rig();
        let changes = rig.map_changes(light);
        (!changes).then(|| rig.split(light, 0.0, self.directions).map(Arc::new))?
    }

    fn rig(&self) -> LightRig<'_> {
        LightRig::with(&*self.emitters, &self.tracks, self.prepared.clone())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, traced};
    use relight_scene::animated::Animated;
    use relight_scene::light::EnvironmentMaps;
    use relight_scene::material::Material;

    fn sky(map: &Arc<EnvironmentMap>) -> LightTrack {
        LightTrack {
            name: "sky".into(),
            kind: LightKind::Environment {
                maps: EnvironmentMaps::of_frames(vec![map.clone()]).unwrap(),
                file: "sky.hdr".into(),
                scale: Animated::Constant(Vec3::ONE),
                rotation_deg: Animated::Constant(0.0),
            },
        }
    }

    fn lamps(scale: f32) -> LightTrack {
        LightTrack {
            name: "lamps".into(),
            kind: LightKind::Emissive {
                material: None,
                scale: Animated::Constant(Vec3::splat(scale)),
            },
        }
    }

    /// Truth: lights that were prepared without others before. What is shared is the same, not only equal.
    #[test]
    fn maps_and_surfaces_that_lights_had_before_are_prepared_once() {
        let glowing = Material {
            emission: Vec3::ONE,
            ..matt(0.5, 0.0)
        };
        let mut scene = traced(
            vec![level(1.0, 0.0, 0), level(1.0, 1.0, 1)],
            vec![matt(0.5, 0.0), glowing],
        );
        let map = |left: f32| {
            Arc::new(EnvironmentMap {
                width: 2,
                height: 1,
                pixels: vec![Vec3::splat(left), Vec3::ONE],
            })
        };
        let (one, other) = (map(3.0), map(5.0));
        let power = |lights: &Lights| -> Vec<Vec3> {
            let set = lights.at(0.0);
            (0..set.len()).map(|light| set.power(light, 1.0)).collect()
        };
        let first = Lights::new(&scene, &[sky(&one), lamps(1.0)], 64).unwrap();
        let tracks = [lamps(2.0), sky(&one), sky(&other)];
        let again = first.again(&scene, &tracks, 64).unwrap();
        assert_eq!(power(&again), power(&Lights::new(&scene, &tracks, 64).unwrap()));
        assert!(Arc::ptr_eq(&again.emitters, &first.emitters));
        let split = |lights: &Lights, light: usize| lights.splits[light].clone().unwrap();
        assert!(Arc::ptr_eq(&split(&again, 1), &split(&first, 0)));
        assert!(!Arc::ptr_eq(&split(&again, 2), &split(&first, 0)));
        let mut materials = scene.materials().to_vec();
        materials[1].emission = Vec3::splat(8.0);
        scene.set_materials(materials).unwrap();
        let edited = again.again(&scene, &tracks, 64).unwrap();
        assert_eq!(power(&edited)[0], 8.0 * power(&again)[0]);
        assert!(Arc::ptr_eq(&split(&edited, 1), &split(&first, 0)));
    }
}
