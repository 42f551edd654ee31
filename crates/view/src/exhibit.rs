//! What is shown, and what tabs are told of it.

use relight_play::Player;
use relight_play::scene::data_uri::is_data_uri;
use relight_play::scene::light::{EnvironmentMaps, LightKind, MapFile};
use relight_play::scene::material::Model;
use relight_play::scene::sequence::{Sequence, stage_to_json};
use relight_play::scene::surface::Surfaces;
use serde_json::{Value, json};
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

/// Environment maps by the names that lights give them.
pub type Maps = HashMap<PathBuf, EnvironmentMaps>;

/// Opens the asset and its first lights anew, or tells in words why not.
pub type Reopen = Box<dyn Fn() -> Result<Exhibit, String> + Send>;

/// An asset and the lights it is shown under at first.
pub struct Exhibit {
    /// The asset, ready to be lit.
    pub player: Player,
    /// The first lights.
    pub sequence: Sequence,
    /// The asset's file as the user calls it, for command lines.
    pub asset: String,
    /// The sequence's file as the user calls it, if the lights come from one.
    pub lights_file: Option<String>,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Exhibit {
    /// The environment maps of the first lights, by the names that tabs are told.
    pub fn maps(&self) -> Maps {
        let (sequence, _) = self.named();
        let maps = sequence.lights.iter().flat_map(|light| match &light.kind {
            LightKind::Environment { maps, file, .. } => maps.by_name(file),
            _ => Vec::new(),
        });
        maps.map(|(name, maps)| (PathBuf::from(name), maps)).collect()
    }

    /// The first lights with names in place of maps that stand in the text, as those of scenes do, and these maps by name: tabs say all lights
    /// again whenever one changes, and browsers keep little.
    fn named(&self) -> (Sequence, HashMap<String, String>) {
        let mut sequence = self.sequence.clone();
        let mut embedded = HashMap::new();
        for light in &mut sequence.lights {
            let LightKind::Environment { file, .. } = &mut light.kind else {
                continue;
            };
            let names: Vec<&mut String> = match file {
                MapFile::One(name) => vec![name],
                MapFile::Keys { keys, .. } => keys.iter_mut().map(|key| &mut key.1).collect(),
            };
            for (i, name) in names
                .into_iter()
                .enumerate()
                .filter(|(_, name)| is_data_uri(name))
            {
                let short = match i {
                    0 => format!("map of {}", light.name),
                    _ => format!("map {} of {}", i + 1, light.name),
                };
                embedded.insert(short.clone(), std::mem::replace(name, short));
            }
        }
        (sequence, embedded)
    }

    /// What a tab is told first, as JSON: cameras, lights, size, materials (`docs/view.md` has the fields).
    pub fn hello(&self) -> Value {
        let scene = self.player.scene();
        let (sequence, embedded) = self.named();
        let stage: Value =
            serde_json::from_str(&stage_to_json(&scene.cameras, &sequence)).unwrap_or(Value::Null);
        let bounds = self.player.prepared.scene.bounds();
        let materials: Vec<Value> = (scene.materials.iter())
            .map(|material| {
                json!({
                    "name": material.name,
                    "base_color": material.base_color.to_array(),
                    "emission": material.emission.to_array(),
                    "model": match material.model {
                        Model::MetallicRoughness => "metallic_roughness",
                        Model::Lambert => "lambert",
                        Model::Phong { .. } => "phong",
                        Model::Ward { .. } => "ward",
                    },
                    "specular": match material.model {
                        Model::Phong { specular, .. } | Model::Ward { specular, .. } => Some(specular.to_array()),
                        _ => None,
                    },
                    "roughness": material.roughness,
                    "metallic": material.metallic,
                })
            })
            .collect();
        // Of several variants of one name the first is meant.
        let mut known = HashSet::new();
        let variants: Vec<Value> = (scene.variants.iter())
            .filter(|variant| known.insert(&variant.name))
            .map(|variant| json!({ "name": variant.name, "materials": variant.materials }))
            .collect();
        let estimates: Option<HashMap<&str, f64>> = (self.player.estimates.as_ref()).map(|e| {
            e.values
                .iter()
                .map(|(name, value)| (name.as_str(), *value))
                .collect()
        });
        json!({ "hello": {
            "version": env!("CARGO_PKG_VERSION"),
            "asset": self.asset,
            "hash": format!("{:016x}", self.player.hash),
            "lights_file": self.lights_file,
            "cameras": stage["cameras"],
            "sequence": stage["sequence"],
            "embedded": embedded,
            "offset": scene.offset.to_array(),
            "bounds": bounds.map(|(low, high)| [low.to_array(), high.to_array()]),
            "triangles": self.player.prepared.scene.triangle_count(),
            "points": self.player.prepared.points.len(),
            "materials": materials,
            "variants": variants,
            "estimates": estimates,
            "levels": self.player.prepared.transfer.as_ref().map_or(0, |transfer| transfer.parents().1.levels()),
            "cuts": self.player.prepared.cuts.is_some(),
        }})
    }
}
