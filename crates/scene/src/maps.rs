//! Environment maps over time, and the files that they are in.

use crate::animated::Interpolation;
use glam::Vec3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// An equirectangular image of radiance from all directions ([`crate::environment`] says which pixel is where).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvironmentMap {
    /// Pixels across.
    pub width: usize,
    /// Pixels down; row 0 looks up (+Y).
    pub height: usize,
    /// Linear RGB radiance, row by row. Finite and non-negative.
    pub pixels: Vec<Vec3>,
}

/// Where the maps of an environment are.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum MapFile {
    /// In one file, or with `####` for a number in one for each frame.
    One(String),
    /// In one file for each key.
    Keys {
        /// Frames, which rise, and files; at least one.
        keys: Vec<(f64, String)>,
        /// From one to the next; never cubic, which would leave the range of both.
        interpolation: Interpolation,
    },
}

impl MapFile {
    /// All names, in order.
    pub fn names(&self) -> Vec<&str> {
        match self {
            MapFile::One(name) => vec![name],
            MapFile::Keys { keys, .. } => keys.iter().map(|key| key.1.as_str()).collect(),
        }
    }
}

impl<T: Into<String>> From<T> for MapFile {
    fn from(name: T) -> MapFile {
        MapFile::One(name.into())
    }
}

impl<'de> Deserialize<'de> for MapFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<MapFile, D::Error> {
        deserializer.deserialize_any(MapFileVisitor)
    }
}

struct MapFileVisitor;

/// As it stands in the JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeysForm {
    keys: Vec<(f64, String)>,
    #[serde(default)]
    interpolation: Interpolation,
}

impl<'de> Visitor<'de> for MapFileVisitor {
    type Value = MapFile;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the name of a file, or an object with keys")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<MapFile, E> {
        Ok(MapFile::One(name.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<MapFile, A::Error> {
        let KeysForm { keys, interpolation } = KeysForm::deserialize(MapAccessDeserializer::new(map))?;
        if keys.is_empty() {
            return Err(A::Error::custom("expected at least one [frame, file]"));
        }
        if let Some(pair) = keys.windows(2).find(|pair| pair[1].0 <= pair[0].0) {
            return Err(A::Error::custom(format_args!(
                "frames of keys must rise, but {} follows {}",
                pair[1].0, pair[0].0
            )));
        }
        if interpolation == Interpolation::Cubic {
            return Err(A::Error::custom("maps are blended by step or linear, not cubic"));
        }
        Ok(MapFile::Keys { keys, interpolation })
    }
}

impl JsonSchema for MapFile {
    fn schema_name() -> Cow<'static, str> {
        "MapFile".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "anyOf": [
                { "type": "string" },
                {
                    "description": "Files at frames, and how to go from one map to the next. Before the first and after the last key the \
                        nearest one's map shines.",
                    "type": "object",
                    "properties": {
                        "keys": {
                            "description": "Pairs of frame and file; frames rise and may be fractions.",
                            "type": "array",
                            "minItems": 1,
                            "items": {
                                "type": "array",
                                "prefixItems": [{ "type": "number" }, { "type": "string" }],
                                "minItems": 2,
                                "maxItems": 2
                            }
                        },
                        "interpolation": {
                            "description": "Whether one map holds until the next, or both are blended.",
                            "default": "linear",
                            "enum": ["step", "linear"]
                        }
                    },
                    "required": ["keys"],
                    "additionalProperties": false
                }
            ]
        })
    }
}

/// The maps of an environment: one for all frames, one for each (the first for frame 0), or those of keys. Clones share them.
#[derive(Clone, Debug)]
pub struct EnvironmentMaps {
    maps: Arc<[Arc<EnvironmentMap>]>,
    keys: Option<Arc<Keys>>,
}

/// When which map shines.
#[derive(Debug)]
struct Keys {
    /// A frame for each map, rising.
    frames: Vec<f64>,
    blends: bool,
    /// What was blended last: after which map, with which share of the next (as bits).
    last: Mutex<Option<(usize, u64, Arc<EnvironmentMap>)>>,
}

impl PartialEq for EnvironmentMaps {
    fn eq(&self, other: &EnvironmentMaps) -> bool {
        let keys = |maps: &EnvironmentMaps| maps.keys.as_ref().map(|keys| (keys.frames.clone(), keys.blends));
        self.maps == other.maps && keys(self) == keys(other)
    }
}

/// One map without pixels.
impl Default for EnvironmentMaps {
    fn default() -> EnvironmentMaps {
        Arc::new(EnvironmentMap::default()).into()
    }
}

impl From<Arc<EnvironmentMap>> for EnvironmentMaps {
    fn from(map: Arc<EnvironmentMap>) -> EnvironmentMaps {
        EnvironmentMaps {
            maps: Arc::new([map]),
            keys: None,
        }
    }
}

impl EnvironmentMaps {
    /// A map for each frame; `None` without any.
    pub fn of_frames(maps: Vec<Arc<EnvironmentMap>>) -> Option<EnvironmentMaps> {
        (!maps.is_empty()).then(|| EnvironmentMaps {
            maps: maps.into(),
            keys: None,
        })
    }

    /// Maps at rising frames, at least one. Blended, all have one size; else one holds until the next.
    ///
    /// # Errors
    /// The indices of two maps of different sizes that would have to be blended.
    pub fn of_keys(
        keys: Vec<(f64, Arc<EnvironmentMap>)>,
        blends: bool,
    ) -> Result<EnvironmentMaps, Option<(usize, usize)>> {
        let (frames, maps): (Vec<f64>, Vec<Arc<EnvironmentMap>>) = keys.into_iter().unzip();
        let size = |map: &EnvironmentMap| (map.width, map.height);
        let other = maps.iter().position(|map| size(map) != size(&maps[0]));
        if maps.is_empty() {
            return Err(None);
        }
        if let (true, Some(other)) = (blends, other) {
            return Err(Some((other - 1, other)));
        }
        Ok(EnvironmentMaps {
            maps: maps.into(),
            keys: Some(Arc::new(Keys {
                frames,
                blends,
                last: Mutex::new(None),
            })),
        })
    }

    /// The map at a time. Of one for each frame, that of the frame which has begun, before the first and after the last the nearest one;
    /// of keys, the last one's or, where maps are blended, that mean of the last and the next. The same time gives the same map, not only an equal one,
    /// while no other time was asked for in between.
    pub fn at(&self, frame: f64) -> Arc<EnvironmentMap> {
        let Some(keys) = &self.keys else {
            let index = frame.clamp(0.0, self.maps.len().saturating_sub(1) as f64);
            // There is at least one, and NaN becomes 0.
            return self.maps[index as usize].clone();
        };
        let next = keys.frames.partition_point(|&other| other <= frame);
        let before = next.saturating_sub(1);
        if next == 0 || next == self.maps.len() || !keys.blends {
            return self.maps[before].clone();
        }
        let share = (frame - keys.frames[before]) / (keys.frames[next] - keys.frames[before]);
        if share <= 0.0 {
            return self.maps[before].clone();
        }
        let mut last = keys.last.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some((at, bits, map)) if (*at, *bits) == (before, share.to_bits()) => map.clone(),
            _ => {
                let map = Arc::new(blended(&self.maps[before], &self.maps[next], share as f32));
                *last = Some((before, share.to_bits(), map.clone()));
                map
            }
        }
    }

    /// The map, if it is the same at all frames.
    pub fn only(&self) -> Option<&Arc<EnvironmentMap>> {
        match &*self.maps {
            [map] => Some(map),
            _ => None,
        }
    }

    /// All of them, in order.
    pub fn all(&self) -> &[Arc<EnvironmentMap>] {
        &self.maps
    }

    /// The same maps for each of a file's names: what a reader without files is to be given.
    pub fn by_name(&self, file: &MapFile) -> Vec<(String, EnvironmentMaps)> {
        match file {
            MapFile::One(name) => vec![(name.clone(), self.clone())],
            MapFile::Keys { keys, .. } => (keys.iter().zip(&*self.maps))
                .map(|(key, map)| (key.1.clone(), map.clone().into()))
                .collect(),
        }
    }
}

/// The mean of two maps of one size, with a share of the second.
fn blended(a: &EnvironmentMap, b: &EnvironmentMap, share: f32) -> EnvironmentMap {
    EnvironmentMap {
        width: a.width,
        height: a.height,
        pixels: (a.pixels.iter().zip(&b.pixels))
            .map(|(a, b)| *a * (1.0 - share) + *b * share)
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: usize, radiance: f32) -> Arc<EnvironmentMap> {
        Arc::new(EnvironmentMap {
            width,
            height: 1,
            pixels: vec![Vec3::splat(radiance); width],
        })
    }

    /// Truth: the definition, by hand.
    #[test]
    fn maps_of_keys_hold_or_are_blended() {
        let maps = |blends| {
            EnvironmentMaps::of_keys(
                vec![(2.0, map(2, 1.0)), (4.0, map(2, 5.0)), (8.0, map(2, 3.0))],
                blends,
            )
            .unwrap()
        };
        let at = |maps: &EnvironmentMaps, frame: f64| maps.at(frame).pixels[1].x;
        let (steps, blends) = (maps(false), maps(true));
        for (frame, held, mean) in [
            (-3.0, 1.0, 1.0),
            (2.0, 1.0, 1.0),
            (3.0, 1.0, 3.0),
            (3.5, 1.0, 4.0),
            (4.0, 5.0, 5.0),
            (7.0, 5.0, 3.5),
            (8.0, 3.0, 3.0),
            (99.0, 3.0, 3.0),
        ] {
            assert_eq!((at(&steps, frame), at(&blends, frame)), (held, mean), "{frame}");
        }
        assert!(at(&blends, f64::NAN).is_finite());
        assert!(Arc::ptr_eq(&blends.at(3.0), &blends.at(3.0)), "not blended anew");
        let wrong = vec![(0.0, map(2, 1.0)), (1.0, map(3, 1.0))];
        assert_eq!(EnvironmentMaps::of_keys(wrong.clone(), true), Err(Some((0, 1))));
        assert!(EnvironmentMaps::of_keys(wrong, false).is_ok());
    }
}
