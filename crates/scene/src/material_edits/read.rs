//! Reads material edits. What [`super::form`] can't say is checked against the scene: names, parameters of the model,
//! textures and their coordinates.

use super::edit::{Chosen, Edit, MaterialEdits, Setting, texture_place};
use super::form::{EditForm, EditsFile, Given, NameOrNumber, RefuseVisibility};
use super::parameters::{ModelName, Parameter};
use crate::animated::Animated;
use crate::json::decode::{Document, read_text};
use crate::json::error::JsonError;
use crate::json::path::JsonPath;
use crate::material::{AlphaMode, Extensions, Material};
use crate::scene::Scene;
use serde_json::value::RawValue;
use std::path::Path;

/// At most this many names are listed in a message.
const MOST_LISTED: usize = 60;

/// Reads material edits for a scene.
///
/// # Errors
/// See [`JsonError`].
pub fn read_material_edits(path: &Path, scene: &Scene) -> Result<MaterialEdits, JsonError> {
    let text = read_text(path, "material edits")?;
    parse_material_edits(&text, scene, &path.display().to_string())
}

/// Reads material edits for a scene from their text; `name` stands for the file in messages.
///
/// # Errors
/// See [`JsonError`].
pub fn parse_material_edits(text: &str, scene: &Scene, name: &str) -> Result<MaterialEdits, JsonError> {
    let document = Document { name, text };
    let file: EditsFile<&RawValue> = document.decode(text, &JsonPath::default())?;
    let mut reader = Reader {
        document,
        scene,
        materials: scene.materials.clone(),
    };
    let variant = file.variant.map(|name| reader.variant(&name)).transpose()?;
    let edits = (file.edits.iter().enumerate())
        .map(|(i, edit)| reader.edit(edit.get(), &JsonPath::default().key("edits").index(i)))
        .collect::<Result<_, _>>()?;
    Ok(MaterialEdits {
        name: name.into(),
        variant,
        edits,
    })
}

struct Reader<'a> {
    document: Document<'a>,
    scene: &'a Scene,
    /// The materials as the edits so far leave them.
    materials: Vec<Material>,
}

impl<'a> Reader<'a> {
    fn edit(&mut self, text: &'a str, path: &JsonPath) -> Result<Edit, JsonError> {
        let _: RefuseVisibility = self.document.decode(text, path)?;
        let form: EditForm = self.document.decode(text, path)?;
        let materials = self.materials_of(&form.material, &path.key("material"))?;
        let model = form.model;
        let mut changes = Vec::new();
        for (parameter, given) in form.changes() {
            let path = path.key(parameter.name());
            self.check_model(parameter, &path, model, &materials)?;
            changes.push((parameter, self.setting(parameter, given, &path, &materials)?));
        }
        let edit = Edit {
            path: path.to_string(),
            place: path.place(self.document.text),
            materials,
            model,
            changes,
        };
        self.check_together(&edit, path)?;
        self.check_bump(&edit, path)?;
        for &index in &edit.materials {
            edit.apply(0.0, &mut self.materials[index as usize]);
        }
        Ok(edit)
    }

    /// The variant of that name.
    fn variant(&mut self, name: &str) -> Result<Chosen, JsonError> {
        let path = JsonPath::default().key("variant");
        let Some(variant) = self.scene.variants.iter().find(|variant| variant.name == name) else {
            let names = listed(self.scene.variants.iter().map(|variant| &variant.name));
            let message = match self.scene.variants.len() {
                0 => "the asset has no variants of materials: the scene has none, or it was baked with --variant, --lambert or \
                      --solution"
                    .to_owned(),
                _ => format!("no variant of the asset is {name:?}; it has {names}"),
            };
            return self.refuse(&path, message);
        };
        for &[of, by] in &variant.materials {
            let [of, by] = [of, by].map(|index| self.scene.materials.get(index as usize));
            if let (Some(of), Some(by)) = (of, by)
                && stops_other_rays(of, by)
            {
                let message = format!(
                    "in place of {:?} it puts {:?}, which stops other rays, and that is part of the baked transport: bake with \
                     --variant {name:?}",
                    of.name, by.name
                );
                return self.refuse(&path, message);
            }
        }
        let chosen = Chosen {
            materials: variant.materials.clone(),
            place: path.place(self.document.text),
        };
        chosen.apply(&self.scene.materials, &mut self.materials);
        Ok(chosen)
    }

    fn refuse<T>(&self, path: &JsonPath, message: impl Into<String>) -> Result<T, JsonError> {
        Err(self.document.error(path, message))
    }

    /// Indices of the materials that a name or a number means.
    fn materials_of(&self, wanted: &NameOrNumber, path: &JsonPath) -> Result<Vec<u32>, JsonError> {
        let means = |index: u32, material: &Material| match wanted {
            NameOrNumber::Name(name) => material.name == *name,
            NameOrNumber::Number(number) => u64::from(index) == *number,
        };
        let found: Vec<u32> = (0u32..)
            .zip(&self.materials)
            .filter(|&(index, material)| means(index, material))
            .map(|(index, _)| index)
            .collect();
        if found.is_empty() {
            let names = listed(self.materials.iter().map(|material| &material.name));
            return self.refuse(
                path,
                format!("no material of the asset is {wanted}; it has {names}"),
            );
        }
        Ok(found)
    }

    /// Refuses a parameter that does not belong to all these materials' model.
    fn check_model(
        &self,
        parameter: Parameter,
        path: &JsonPath,
        model: Option<ModelName>,
        materials: &[u32],
    ) -> Result<(), JsonError> {
        for &index in materials {
            let material = &self.materials[index as usize];
            if material.unlit && model.is_none() {
                if parameter == Parameter::BaseColor {
                    continue;
                }
                let message =
                    "this material is unlit: it only shows its base_color; give it a model to light it";
                return self.refuse(path, message);
            }
            let model = model.unwrap_or_else(|| ModelName::of_material(material));
            if !parameter.belongs_to(model) {
                let known: Vec<&str> = model.parameters().map(Parameter::name).collect();
                let (model, known) = (model.name(), known.join(", "));
                return self.refuse(path, format!("no parameter of the model {model}; it has {known}"));
            }
        }
        Ok(())
    }

    fn setting(
        &self,
        parameter: Parameter,
        given: Given,
        path: &JsonPath,
        materials: &[u32],
    ) -> Result<Setting, JsonError> {
        Ok(match given {
            Given::Color(Animated::Keys { .. }) if parameter == Parameter::Emission => {
                let message =
                    "no keys here: animate the `scale` of an `emissive` light in the lighting sequence";
                return self.refuse(path, message);
            }
            Given::Number(value) => Setting::Number(value),
            Given::Color(value) => Setting::Color(value),
            Given::Texture(wanted) => Setting::Texture(self.texture(parameter, wanted, path, materials)?),
        })
    }

    fn texture(
        &self,
        parameter: Parameter,
        wanted: Option<NameOrNumber>,
        path: &JsonPath,
        materials: &[u32],
    ) -> Result<Option<u32>, JsonError> {
        let of_alpha = |&index: &u32| self.materials[index as usize].alpha_mode != AlphaMode::Opaque;
        if parameter == Parameter::BaseColorTexture && materials.iter().any(of_alpha) {
            return self.refuse(
                path,
                "this texture's alpha decides which rays the surface stops, which is part of the baked transport; \
                 change it in the scene and bake again",
            );
        }
        let textures = &self.scene.textures;
        let Some(wanted) = wanted else {
            return Ok(None);
        };
        let found = match &wanted {
            NameOrNumber::Number(number) => (0..textures.len()).find(|&index| index as u64 == *number),
            NameOrNumber::Name(name) => textures.iter().position(|texture| texture.name == *name),
        };
        let Some(found) = found else {
            let names = listed(textures.iter().map(|texture| &texture.name));
            return self.refuse(
                path,
                format!("no texture of the asset is {wanted}; it has {names}"),
            );
        };
        for &index in materials {
            let set = texture_place(&self.materials[index as usize], parameter).uv_set as usize;
            let lacks = (self.scene.meshes.iter())
                .any(|mesh| mesh.material == index && mesh.uvs.get(set).is_none_or(Vec::is_empty));
            if lacks {
                return self.refuse(
                    path,
                    "the asset has no texture coordinates for this material: they are left out where the scene \
                     uses no texture",
                );
            }
        }
        Ok(Some(found as u32))
    }

    /// Refuses pairs of fields that set the same thing.
    fn check_together(&self, edit: &Edit, path: &JsonPath) -> Result<(), JsonError> {
        let set = |parameter| edit.changes.iter().any(|change| change.0 == parameter);
        for (a, b) in [
            (Parameter::Exponent, Parameter::Roughness),
            (Parameter::RoughnessU, Parameter::Roughness),
            (Parameter::RoughnessV, Parameter::Roughness),
        ] {
            if set(a) && set(b) {
                let (a, b) = (a.name(), b.name());
                return self.refuse(&path.key(a), format!("either {a} or {b}, not both"));
            }
        }
        Ok(())
    }

    fn check_bump(&self, edit: &Edit, path: &JsonPath) -> Result<(), JsonError> {
        let set = |parameter| edit.changes.iter().find(|change| change.0 == parameter);
        let texture = set(Parameter::BumpTexture).map(|change| change.1 != Setting::Texture(None));
        let scale = set(Parameter::BumpScale).is_some();
        for &index in &edit.materials {
            let has = self.materials[index as usize].bump.is_some();
            if scale && !texture.unwrap_or(has) {
                return self.refuse(&path.key("bump_scale"), "it needs a bump_texture");
            }
            if texture == Some(true) && !scale && !has {
                return self.refuse(
                    &path.key("bump_texture"),
                    "it needs a bump_scale, the height of white above black in metres",
                );
            }
        }
        Ok(())
    }
}

/// Whether a material lets other rays pass than another.
fn stops_other_rays(a: &Material, b: &Material) -> bool {
    let alpha = |m: &Material| (m.base_color.w, m.base_color_texture);
    let metallic = |m: &Material| (m.metallic, m.metallic_roughness_texture);
    let mirrored = |m: &Material| {
        let none = Extensions::default();
        let e = m.extensions.as_deref().unwrap_or(&none);
        let solid = (e.thickness, e.absorption, e.transmission_texture);
        (e.ior, e.specular, e.specular_color, solid)
    };
    let pane = |m: &Material| (m.base_color, metallic(m), mirrored(m));
    let differs = match a.alpha_mode {
        AlphaMode::Opaque => false,
        AlphaMode::Mask { .. } | AlphaMode::Blend => alpha(a) != alpha(b),
        AlphaMode::Pane { .. } => alpha(a) != alpha(b) || pane(a) != pane(b),
    };
    differs || a.alpha_mode != b.alpha_mode
}

/// Names with quotes and commas; the rest counted where there are many.
fn listed<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let mut names: Vec<String> = names.map(|name| format!("{name:?}")).collect();
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
