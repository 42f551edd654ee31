//! Lights and emissive materials of a glTF document, set to what a sequence says.
//!
//! Names are those that the importer gives: a light's node's, else its own, else "light"; of equal ones the second is `NAME.1`, in the
//! order in which the scene lists its nodes.

use crate::options::LightUnitsName;
use anyhow::{Result, bail};
use glam::Vec3;
use relight_scene::gltf::EMISSIVE;
use relight_scene::light::{LightKind, LightTrack};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::PI;

const PUNCTUAL: &str = "KHR_lights_punctual";
const PHOTOMETRIC: &str = "EXT_lights_ies";
const AREA: &str = "EXT_lights_area";
/// In the order in which the importer takes those of a node.
const EXTENSIONS: [&str; 3] = [PUNCTUAL, PHOTOMETRIC, AREA];
/// Kinds of lights that their extension has no word for, or several.
const LAMP: &str = "ies";
const RECTANGLE: &str = "area";
const STRENGTH: &str = "KHR_materials_emissive_strength";

/// What a sequence says at a frame.
pub struct Strengths {
    /// By name, in the file's units: kind and RGB.
    lights: BTreeMap<String, (&'static str, Vec3)>,
    /// Of materials by name, and of all.
    emissive: Vec<(Option<String>, Vec3)>,
    /// Names of what glTF can't hold.
    others: Vec<String>,
}

impl Strengths {
    /// Of some lights.
    pub fn of(tracks: &[LightTrack], frame: f64, units: LightUnitsName) -> Strengths {
        let per_sr = if units == LightUnitsName::Raw {
            4.0 * PI
        } else {
            1.0
        };
        let mut all = Strengths {
            lights: BTreeMap::new(),
            emissive: Vec::new(),
            others: Vec::new(),
        };
        for track in tracks {
            let held = match &track.kind {
                LightKind::Point { intensity, .. } => Some(("point", intensity.at(frame) * per_sr)),
                LightKind::Spot { intensity, .. } => Some(("spot", intensity.at(frame) * per_sr)),
                LightKind::Directional { irradiance, .. } => Some(("directional", irradiance.at(frame))),
                LightKind::Ies { scale, .. } => Some((LAMP, scale.at(frame))),
                LightKind::Rect { radiance, .. } => Some((RECTANGLE, radiance.at(frame))),
                LightKind::Emissive { material, scale } => {
                    all.emissive.push((material.clone(), scale.at(frame)));
                    continue;
                }
                _ => None,
            };
            match held {
                Some(light) => {
                    all.lights.insert(track.name.clone(), light);
                }
                None => all.others.push(track.name.clone()),
            }
        }
        all
    }

    /// What a material's emission is multiplied by.
    fn scale_of(&self, material: &str) -> Vec3 {
        let of = |name: &Option<String>| name.as_deref().is_none_or(|name| name == material);
        (self.emissive.iter())
            .filter(|(name, _)| of(name))
            .map(|(_, scale)| *scale)
            .sum()
    }
}

/// What was set.
#[derive(Debug, Default, Serialize)]
pub struct Mixed {
    /// Names of lights.
    pub lights: Vec<String>,
    /// Names of emissive materials.
    pub materials: Vec<String>,
    /// Lights of the scene that the sequence doesn't name, dark in the copy.
    pub dark: Vec<String>,
    /// Lights of the sequence that the scene doesn't have, or has of another kind, or that glTF can't hold.
    pub left_out: Vec<String>,
    /// Whether animations of the scene move what was set, and win over it.
    pub animated: bool,
}

impl Mixed {
    /// In words.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.dark.is_empty() {
            notes.push(format!(
                "dark, since the sequence doesn't name them: {}",
                self.dark.join(", ")
            ));
        }
        if !self.left_out.is_empty() {
            notes.push(format!(
                "not in the copy, since the scene has no such light of that kind: {}",
                self.left_out.join(", ")
            ));
        }
        if self.animated {
            notes.push("the scene's animations of lights or emission stay, and win over what was set".into());
        }
        notes
    }
}

/// Sets lights and emission.
///
/// # Errors
/// Nothing of the sequence is in the scene, or the document is broken.
pub fn mix(document: &mut Value, strengths: &Strengths) -> Result<Mixed> {
    let animations = document["animations"].to_string();
    // Parts of the paths of KHR_animation_pointer.
    let moved = [
        "/KHR_lights_punctual/",
        "/EXT_lights_area/",
        "/EXT_lights_ies/",
        "/emissiveFactor",
        "/emissiveStrength",
    ];
    let mut mixed = Mixed {
        left_out: strengths.others.clone(),
        animated: moved.iter().any(|path| animations.contains(path)),
        ..Mixed::default()
    };
    let missing = set_lights(document, strengths, &mut mixed)?;
    set_emission(document, strengths, &mut mixed);
    if mixed.lights.is_empty() && mixed.materials.is_empty() && !missing.is_empty() {
        let has: Vec<&str> = mixed.dark.iter().map(String::as_str).collect();
        bail!(
            "has none of the sequence's lights ({}); it has {}: give the scene that the sequence was made for",
            missing.join(", "),
            if has.is_empty() {
                "none".to_owned()
            } else {
                has.join(", ")
            }
        );
    }
    mixed.left_out.extend(missing);
    Ok(mixed)
}

/// Nodes of the scene that is shown, in the importer's order, each once.
fn shown(document: &Value) -> Vec<usize> {
    let numbers = |list: &Value| -> Vec<usize> {
        let entries = list.as_array().into_iter().flatten();
        entries.filter_map(|n| Some(n.as_u64()? as usize)).collect()
    };
    let scene = document["scene"].as_u64().unwrap_or(0) as usize;
    let count = document["nodes"].as_array().map_or(0, Vec::len);
    let roots = match document["scenes"].get(scene) {
        Some(scene) => numbers(&scene["nodes"]),
        None => {
            let nodes = document["nodes"].as_array().into_iter().flatten();
            let children: BTreeSet<usize> = nodes.flat_map(|node| numbers(&node["children"])).collect();
            (0..count).filter(|i| !children.contains(i)).collect()
        }
    };
    let mut order = Vec::new();
    let mut seen = vec![false; count];
    let mut stack: Vec<usize> = roots.into_iter().rev().collect();
    while let Some(node) = stack.pop() {
        if seen.get(node).is_none_or(|&seen| seen) {
            continue;
        }
        seen[node] = true;
        order.push(node);
        stack.extend(numbers(&document["nodes"][node]["children"]).into_iter().rev());
    }
    order
}

/// Returns the sequence's lights that the scene lacks.
fn set_lights(document: &mut Value, strengths: &Strengths, mixed: &mut Mixed) -> Result<Vec<String>> {
    let mut missing: BTreeSet<&String> = strengths.lights.keys().collect();
    let mut taken = BTreeSet::from([EMISSIVE.to_owned()]);
    let mut used = BTreeSet::new();
    let nodes = shown(document);
    let pairs = nodes
        .iter()
        .flat_map(|&node| EXTENSIONS.map(|extension| (node, extension)));
    for (node, extension) in pairs {
        let Some(index) = document["nodes"][node]["extensions"][extension]["light"].as_u64() else {
            continue;
        };
        let Some(light) = document["extensions"][extension]["lights"].get(index as usize) else {
            bail!(
                "nodes[{node}] names light {index} of {extension}, which it doesn't have; export the scene again"
            );
        };
        if !light.is_object() {
            bail!("light {index} of {extension} is no object; export the scene again");
        }
        let own = name_of(&document["nodes"][node]).or_else(|| name_of(light));
        let name = unique(own.as_deref().unwrap_or("light"), &mut taken);
        let kind = match extension {
            PHOTOMETRIC => LAMP,
            AREA => RECTANGLE,
            _ => light["type"].as_str().unwrap_or_default(),
        };
        let strength = match strengths.lights.get(&name).filter(|(of, _)| *of == kind) {
            Some((_, strength)) => {
                missing.remove(&name);
                mixed.lights.push(name);
                *strength
            }
            None => {
                mixed.dark.push(name);
                Vec3::ZERO
            }
        };
        if extension == PHOTOMETRIC {
            set_strength(
                &mut document["nodes"][node]["extensions"][extension],
                "multiplier",
                strength,
            );
            continue;
        }
        let mut light = light.clone();
        set_strength(&mut light, "intensity", strength);
        // Several nodes may share a light, and now differ.
        let Some(lights) = document["extensions"][extension]["lights"].as_array_mut() else {
            continue;
        };
        if used.insert((extension, index)) {
            lights[index as usize] = light;
        } else {
            lights.push(light);
            let new = lights.len() - 1;
            document["nodes"][node]["extensions"][extension]["light"] = new.into();
        }
    }
    Ok(missing.into_iter().cloned().collect())
}

/// What an object is called, if anything.
fn name_of(object: &Value) -> Option<String> {
    let name = object["name"].as_str().filter(|name| !name.is_empty());
    name.map(str::to_owned)
}

/// A colour of at most 1, and what it is multiplied by.
fn set_strength(light: &mut Value, factor: &str, strength: Vec3) {
    let most = strength.max_element();
    if most > 0.0 {
        light["color"] = rgb(strength / most);
    }
    light[factor] = number(most);
}

fn set_emission(document: &mut Value, strengths: &Strengths, mixed: &mut Mixed) {
    let mut extended = false;
    for material in document["materials"].as_array_mut().into_iter().flatten() {
        let factor: Vec<f32> = (material["emissiveFactor"].as_array().into_iter().flatten())
            .map(|v| v.as_f64().unwrap_or(0.0) as f32)
            .collect();
        let strength = material["extensions"][STRENGTH]["emissiveStrength"]
            .as_f64()
            .unwrap_or(1.0) as f32;
        let extensions = &material["extensions"];
        let (&[r, g, b], true) = (factor.as_slice(), extensions.is_null() || extensions.is_object()) else {
            continue;
        };
        let emission = Vec3::new(r, g, b) * strength;
        if emission == Vec3::ZERO {
            continue;
        }
        let name = material["name"].as_str().unwrap_or_default().to_owned();
        let emission = emission * strengths.scale_of(&name);
        let most = emission.max_element().max(1.0);
        material["emissiveFactor"] = rgb(emission / most);
        if most > 1.0 || !material["extensions"][STRENGTH].is_null() {
            material["extensions"][STRENGTH] = json!({ "emissiveStrength": number(most) });
            extended = true;
        }
        if emission == Vec3::ZERO {
            mixed.dark.push(name);
        } else {
            mixed.materials.push(name);
        }
    }
    if extended {
        let mut names: BTreeSet<String> = (document["extensionsUsed"].as_array().into_iter().flatten())
            .filter_map(|name| name.as_str().map(str::to_owned))
            .collect();
        names.insert(STRENGTH.to_owned());
        document["extensionsUsed"] = names.into_iter().collect::<Vec<_>>().into();
    }
}

/// As the importer makes names differ.
fn unique(name: &str, taken: &mut BTreeSet<String>) -> String {
    let numbered = (1u64..).map(|number| format!("{name}.{number}"));
    let mut candidates = std::iter::once(name.to_owned()).chain(numbered);
    // There are more numbers than names.
    candidates
        .find(|name| taken.insert(name.clone()))
        .unwrap_or_default()
}

fn rgb(color: Vec3) -> Value {
    color.to_array().map(number).to_vec().into()
}

/// As short as reads back to the same.
fn number(value: f32) -> Value {
    value.to_string().parse::<f64>().unwrap_or(0.0).into()
}
