//! Reads material edits. Everything is checked against the scene: names, models, parameters, ranges, textures and
//! their coordinates; the message holds the path of the field.

use super::parameters::{Accepts, ModelName, Parameter};
use super::{Edit, MaterialEdits, MaterialEditsError, Setting, texture_place};
use crate::animated::Animated;
use crate::material::{AlphaMode, Material};
use crate::scene::Scene;
use crate::sequence::fields::{
    Field, FieldError, Range, animated, complain, expected, join, object, required, scalar, text, vector,
};
use glam::Vec3;
use serde_json::{Map, Value};
use std::path::Path;

/// The version of the format that this program reads, the value of `relight_materials`.
const VERSION: u64 = 1;

/// What looks like a parameter of visibility.
const VISIBILITY: [&str; 7] = [
    "alpha",
    "alpha_mode",
    "alpha_cutoff",
    "opacity",
    "transparency",
    "coverage",
    "visible",
];

/// At most this many names are listed in a message.
const MOST_LISTED: usize = 60;

/// Reads material edits for a scene.
///
/// # Errors
/// See [`MaterialEditsError`].
pub fn read_material_edits(path: &Path, scene: &Scene) -> Result<MaterialEdits, MaterialEditsError> {
    let text = std::fs::read_to_string(path).map_err(|source| MaterialEditsError::Read {
        file: path.to_owned(),
        source,
    })?;
    parse_material_edits(&text, scene, &path.display().to_string())
}

/// Reads material edits for a scene from their text; `name` stands for the file in messages.
///
/// # Errors
/// See [`MaterialEditsError`].
pub fn parse_material_edits(
    text: &str,
    scene: &Scene,
    name: &str,
) -> Result<MaterialEdits, MaterialEditsError> {
    let value: Value = serde_json::from_str(text).map_err(|error| {
        let message = error.to_string();
        // The place is a field of its own; the parser's message repeats it at its end.
        let end = message.rfind(" at line ").unwrap_or(message.len());
        MaterialEditsError::Syntax {
            name: name.into(),
            line: error.line(),
            column: error.column(),
            message: message[..end].into(),
        }
    })?;
    let edits = edits(&value, scene).map_err(|FieldError { path, message }| MaterialEditsError::Field {
        name: name.into(),
        path,
        message,
    })?;
    Ok(MaterialEdits {
        name: name.into(),
        edits,
    })
}

fn edits(value: &Value, scene: &Scene) -> Field<Vec<Edit>> {
    if !value.is_object() {
        return expected("the whole file", "an object", value);
    }
    let map = object(value, "", &["relight_materials", "edits"])?;
    let version = required(map, "", "relight_materials")?;
    if version.as_u64() != Some(VERSION) {
        return expected("relight_materials", &VERSION.to_string(), version);
    }
    let list = match required(map, "", "edits")? {
        Value::Array(list) => list,
        other => return expected("edits", "a list", other),
    };
    let mut reader = Reader {
        scene,
        materials: scene.materials.clone(),
    };
    list.iter()
        .enumerate()
        .map(|(i, value)| reader.edit(value, &format!("edits[{i}]")))
        .collect()
}

struct Reader<'a> {
    scene: &'a Scene,
    /// The materials as the edits so far leave them.
    materials: Vec<Material>,
}

impl Reader<'_> {
    fn edit(&mut self, value: &Value, path: &str) -> Field<Edit> {
        let Value::Object(map) = value else {
            return expected(path, "an object", value);
        };
        let materials = self.materials_of(required(map, path, "material")?, &join(path, "material"))?;
        let model = map
            .get("model")
            .map(|value| model(value, &join(path, "model")))
            .transpose()?;
        let mut changes = Vec::new();
        for (field, value) in map {
            if field == "material" || field == "model" {
                continue;
            }
            let field_path = join(path, field);
            let parameter = self.parameter(field, &field_path, model, &materials)?;
            changes.push((
                parameter,
                self.setting(parameter, value, &field_path, &materials)?,
            ));
        }
        // Textures first: a bump's scale belongs to its texture.
        changes.sort_by_key(|change| !matches!(change.1, Setting::Texture(_)));
        check_together(map, path)?;
        let edit = Edit {
            path: path.into(),
            materials,
            model,
            changes,
        };
        self.check_bump(&edit, path)?;
        for &index in &edit.materials {
            edit.apply(0.0, &mut self.materials[index as usize]);
        }
        Ok(edit)
    }

    /// Indices of the materials that a name or a number means.
    fn materials_of(&self, value: &Value, path: &str) -> Field<Vec<u32>> {
        let found: Vec<u32> = match value {
            Value::String(name) => (0u32..)
                .zip(&self.materials)
                .filter(|(_, material)| material.name == *name)
                .map(|(index, _)| index)
                .collect(),
            Value::Number(number) => (number.as_u64())
                .filter(|&index| index < self.materials.len() as u64)
                .map(|index| index as u32)
                .into_iter()
                .collect(),
            _ => return expected(path, "the name of a material, or its number", value),
        };
        if found.is_empty() {
            let names = self.materials.iter().map(|m| format!("{:?}", m.name)).collect();
            return complain(
                path,
                format!("no material of the asset is {value}; it has {}", listed(names)),
            );
        }
        Ok(found)
    }

    /// The parameter that a field means, if it belongs to all these materials' model.
    fn parameter(
        &self,
        field: &str,
        path: &str,
        model: Option<ModelName>,
        materials: &[u32],
    ) -> Field<Parameter> {
        if VISIBILITY.contains(&field) {
            return complain(
                path,
                "visibility cannot be edited: which rays a surface stops is part of the baked transport; change it \
                 in the scene and bake again",
            );
        }
        let parameter = Parameter::named(field);
        for &index in materials {
            let material = &self.materials[index as usize];
            if material.unlit && model.is_none() {
                match parameter {
                    Some(Parameter::BaseColor) => continue,
                    _ => {
                        return complain(
                            path,
                            "this material is unlit: it only shows its base_color; give it a model to light it",
                        );
                    }
                }
            }
            let model = model.unwrap_or_else(|| ModelName::of_material(material));
            if !parameter.is_some_and(|p| p.belongs_to(model)) {
                let known: Vec<&str> = model.parameters().map(Parameter::name).collect();
                return complain(
                    path,
                    format!(
                        "no parameter of the model {}; it has {}",
                        model.name(),
                        known.join(", ")
                    ),
                );
            }
        }
        match parameter {
            Some(parameter) => Ok(parameter),
            // `materials` is never empty, so this has been said above.
            None => complain(path, "unknown parameter"),
        }
    }

    fn setting(&self, parameter: Parameter, value: &Value, path: &str, materials: &[u32]) -> Field<Setting> {
        Ok(match parameter.accepts() {
            Accepts::Number(range) => Setting::Number(animated(value, path, |v, p| scalar(v, p, range))?),
            Accepts::Reflectance => Setting::Color(animated(value, path, |v, p| {
                color(v, p, Range::Within(0.0, 1.0))
            })?),
            Accepts::Radiance if value.is_object() => {
                return complain(
                    path,
                    "no keys here: animate the `scale` of an `emissive` light in the lighting sequence",
                );
            }
            Accepts::Radiance => Setting::Color(Animated::Constant(color(value, path, Range::NonNegative)?)),
            Accepts::Texture => Setting::Texture(self.texture(parameter, value, path, materials)?),
        })
    }

    fn texture(
        &self,
        parameter: Parameter,
        value: &Value,
        path: &str,
        materials: &[u32],
    ) -> Field<Option<u32>> {
        let of_alpha = |&index: &u32| self.materials[index as usize].alpha_mode != AlphaMode::Opaque;
        if parameter == Parameter::BaseColorTexture && materials.iter().any(of_alpha) {
            return complain(
                path,
                "this texture's alpha decides which rays the surface stops, which is part of the baked transport; \
                 change it in the scene and bake again",
            );
        }
        let textures = &self.scene.textures;
        let found = match value {
            Value::Null => return Ok(None),
            Value::Number(number) => (number.as_u64()).filter(|&index| index < textures.len() as u64),
            Value::String(name) => (textures.iter())
                .position(|texture| texture.name == *name)
                .map(|index| index as u64),
            _ => return expected(path, "the number of a texture, its name, or null", value),
        };
        let Some(found) = found else {
            let names = textures.iter().map(|t| format!("{:?}", t.name)).collect();
            return complain(
                path,
                format!("no texture of the asset is {value}; it has {}", listed(names)),
            );
        };
        for &index in materials {
            let set = texture_place(&self.materials[index as usize], parameter).uv_set as usize;
            let lacks = self
                .scene
                .meshes
                .iter()
                .any(|mesh| mesh.material == index && mesh.uvs.get(set).is_none_or(Vec::is_empty));
            if lacks {
                return complain(
                    path,
                    "the asset has no texture coordinates for this material: they are left out where the scene \
                     uses no texture",
                );
            }
        }
        Ok(Some(found as u32))
    }

    fn check_bump(&self, edit: &Edit, path: &str) -> Field<()> {
        let set = |parameter| edit.changes.iter().find(|change| change.0 == parameter);
        let texture = set(Parameter::BumpTexture).map(|change| change.1 != Setting::Texture(None));
        let scale = set(Parameter::BumpScale).is_some();
        for &index in &edit.materials {
            let has = self.materials[index as usize].bump.is_some();
            if scale && !texture.unwrap_or(has) {
                return complain(&join(path, "bump_scale"), "it needs a bump_texture");
            }
            if texture == Some(true) && !scale && !has {
                return complain(
                    &join(path, "bump_texture"),
                    "it needs a bump_scale, the height of white above black in metres",
                );
            }
        }
        Ok(())
    }
}

fn model(value: &Value, path: &str) -> Field<ModelName> {
    let name = text(value, path)?;
    match ModelName::ALL.into_iter().find(|model| model.name() == name) {
        Some(model) => Ok(model),
        None => {
            let known: Vec<&str> = ModelName::ALL.iter().map(|model| model.name()).collect();
            complain(
                path,
                format!("unknown model {name:?}; known: {}", known.join(", ")),
            )
        }
    }
}

/// Refuses pairs of fields that set the same thing.
fn check_together(map: &Map<String, Value>, path: &str) -> Field<()> {
    for (a, b) in [
        ("exponent", "roughness"),
        ("roughness_u", "roughness"),
        ("roughness_v", "roughness"),
    ] {
        if map.contains_key(a) && map.contains_key(b) {
            return complain(&join(path, a), format!("either {a} or {b}, not both"));
        }
    }
    Ok(())
}

/// One number for all channels, or RGB.
fn color(value: &Value, path: &str, range: Range) -> Field<Vec3> {
    if value.is_number() {
        return Ok(Vec3::splat(scalar(value, path, range)?));
    }
    if !value.is_array() {
        return expected(path, "a number or 3 numbers (RGB)", value);
    }
    vector(value, path, range)
}

/// Names with commas; the rest counted where there are many.
fn listed(mut names: Vec<String>) -> String {
    names.sort();
    names.dedup();
    let count = names.len();
    names.truncate(MOST_LISTED);
    match count {
        0 => "none".into(),
        _ if count > MOST_LISTED => format!("{} and {} more", names.join(", "), count - MOST_LISTED),
        _ => names.join(", "),
    }
}
