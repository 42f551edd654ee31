//! Edits as they are applied.

use super::parameters::{ModelName, Parameter};
use crate::animated::Animated;
use crate::json::error::{JsonError, LineColumn};
use crate::material::{Bump, Material, Model, TextureUse};
use glam::{Affine2, Vec3};

/// Edits of a scene's materials, checked against that scene.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialEdits {
    /// The file, as the caller names it.
    pub(super) name: String,
    /// The variant that the edits go on from.
    pub(super) variant: Option<Chosen>,
    pub(super) edits: Vec<Edit>,
}

/// A variant of materials.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chosen {
    /// Materials that it replaces, and by which.
    pub(super) materials: Vec<[u32; 2]>,
    /// Where it begins in the file.
    pub(super) place: LineColumn,
}

impl Chosen {
    /// Puts materials of a scene in place of others, which keep their names.
    pub(super) fn apply(&self, scene: &[Material], materials: &mut [Material]) {
        for &[of, by] in &self.materials {
            if let (Some(material), Some(by)) = (materials.get_mut(of as usize), scene.get(by as usize)) {
                *material = Material {
                    name: std::mem::take(&mut material.name),
                    ..by.clone()
                };
            }
        }
    }
}

/// Changes to some materials.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Edit {
    /// Its path in the file.
    pub(super) path: String,
    /// Where it begins in the file.
    pub(super) place: LineColumn,
    /// Indices into the scene's materials.
    pub(super) materials: Vec<u32>,
    pub(super) model: Option<ModelName>,
    pub(super) changes: Vec<(Parameter, Setting)>,
}

/// What a parameter becomes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Setting {
    Number(Animated<f32>),
    Color(Animated<Vec3>),
    Texture(Option<u32>),
}

impl Setting {
    fn is_constant(&self) -> bool {
        match self {
            Setting::Number(value) => value.is_constant(),
            Setting::Color(value) => value.is_constant(),
            Setting::Texture(_) => true,
        }
    }
}

impl MaterialEdits {
    /// Whether nothing is changed.
    pub fn is_empty(&self) -> bool {
        self.edits.is_empty() && self.variant.is_none()
    }

    /// The materials at a frame, from those of the scene that the edits were read for.
    pub fn at(&self, frame: f64, scene: &[Material]) -> Vec<Material> {
        let mut materials = scene.to_vec();
        if let Some(variant) = &self.variant {
            variant.apply(scene, &mut materials);
        }
        for edit in &self.edits {
            for &index in &edit.materials {
                if let Some(material) = materials.get_mut(index as usize) {
                    edit.apply(frame, material);
                }
            }
        }
        materials
    }

    /// Whether material `index` is edited.
    pub fn touches(&self, index: u32) -> bool {
        let replaces = |variant: &Chosen| variant.materials.iter().any(|[of, _]| *of == index);
        self.variant.as_ref().is_some_and(replaces)
            || self.edits.iter().any(|edit| edit.materials.contains(&index))
    }

    /// Whether material `index` changes from frame to frame.
    pub fn moves(&self, index: u32) -> bool {
        self.moving(index).next().is_some()
    }

    /// Whether the shading normal on material `index` changes from frame to frame.
    pub fn moves_normals(&self, index: u32) -> bool {
        self.moving(index).any(Parameter::bends_normals)
    }

    fn moving(&self, index: u32) -> impl Iterator<Item = Parameter> {
        self.edits
            .iter()
            .filter(move |edit| edit.materials.contains(&index))
            .flat_map(|edit| &edit.changes)
            .filter(|change| !change.1.is_constant())
            .map(|change| change.0)
    }

    /// A complaint about the first edit that changes how much a surface reflects, if there is one.
    pub fn refuse_reflectance(&self, why: &str) -> Option<JsonError> {
        if let Some(variant) = self
            .variant
            .as_ref()
            .filter(|variant| !variant.materials.is_empty())
        {
            return Some(JsonError::Field {
                name: self.name.clone(),
                path: "variant".into(),
                message: why.into(),
                place: variant.place,
            });
        }
        self.edits.iter().find_map(|edit| {
            let field = edit.model.map(|_| "model").or_else(|| {
                (edit.changes.iter())
                    .find(|change| change.0.changes_reflectance())
                    .map(|change| change.0.name())
            });
            field.map(|field| self.refusal(edit, field, why))
        })
    }

    /// A complaint about the first edit that changes emission, if there is one.
    pub fn refuse_emission(&self, why: &str) -> Option<JsonError> {
        let emission = |edit: &&Edit| edit.changes.iter().any(|c| c.0 == Parameter::Emission);
        let edit = self.edits.iter().find(emission)?;
        Some(self.refusal(edit, Parameter::Emission.name(), why))
    }

    fn refusal(&self, edit: &Edit, field: &str, why: &str) -> JsonError {
        JsonError::Field {
            name: self.name.clone(),
            path: format!("{}.{field}", edit.path),
            message: why.into(),
            place: edit.place,
        }
    }
}

impl Edit {
    pub(super) fn apply(&self, frame: f64, material: &mut Material) {
        if let Some(model) = self.model {
            material.model = model.of(material);
            material.unlit = false;
        }
        for (parameter, setting) in &self.changes {
            match setting {
                Setting::Number(value) => set_number(material, *parameter, value.at(frame)),
                Setting::Color(value) => set_color(material, *parameter, value.at(frame)),
                Setting::Texture(texture) => set_texture(material, *parameter, *texture),
            }
        }
    }
}

fn set_number(material: &mut Material, parameter: Parameter, value: f32) {
    let axis = match parameter {
        Parameter::RoughnessU => 0..1,
        Parameter::RoughnessV => 1..2,
        _ => 0..2,
    };
    match (parameter, &mut material.model) {
        (Parameter::Metallic, _) => material.metallic = value,
        (Parameter::Roughness, Model::Phong { exponent, .. }) => {
            *exponent = None;
            material.roughness = value;
        }
        (
            Parameter::Roughness | Parameter::RoughnessU | Parameter::RoughnessV,
            Model::Ward { roughness, .. },
        ) => roughness[axis].fill(value),
        (Parameter::Roughness, _) => material.roughness = value,
        (Parameter::Exponent, Model::Phong { exponent, .. }) => *exponent = Some(value),
        (Parameter::RotationDeg, Model::Ward { rotation, .. }) => *rotation = value.to_radians(),
        (Parameter::NormalScale, _) => material.normal_scale = value,
        (Parameter::BumpScale, _) => {
            if let Some(bump) = &mut material.bump {
                bump.scale = value;
            }
        }
        // Reading has refused what does not belong to the model.
        _ => {}
    }
}

fn set_color(material: &mut Material, parameter: Parameter, value: Vec3) {
    match (parameter, &mut material.model) {
        (Parameter::BaseColor, _) => material.base_color = value.extend(material.base_color.w),
        (Parameter::Emission, _) => material.emission = value,
        (Parameter::Specular, Model::Phong { specular, .. } | Model::Ward { specular, .. }) => {
            *specular = value;
        }
        _ => {}
    }
}

fn set_texture(material: &mut Material, parameter: Parameter, texture: Option<u32>) {
    let place = texture_place(material, parameter);
    let usage = texture.map(|texture| TextureUse { texture, ..place });
    match parameter {
        Parameter::BaseColorTexture => material.base_color_texture = usage,
        Parameter::MetallicRoughnessTexture => material.metallic_roughness_texture = usage,
        Parameter::NormalTexture => material.normal_texture = usage,
        Parameter::SpecularTexture => material.specular_texture = usage,
        Parameter::BumpTexture => {
            let scale = material.bump.map_or(0.0, |bump| bump.scale);
            material.bump = usage.map(|texture| Bump { texture, scale });
        }
        _ => {}
    }
}

/// Where a material looks a new texture up: as its texture of that kind, else as its first, else plainly.
pub(super) fn texture_place(material: &Material, parameter: Parameter) -> TextureUse {
    let own = match parameter {
        Parameter::BaseColorTexture => material.base_color_texture,
        Parameter::MetallicRoughnessTexture => material.metallic_roughness_texture,
        Parameter::NormalTexture => material.normal_texture,
        Parameter::SpecularTexture => material.specular_texture,
        Parameter::BumpTexture => material.bump.map(|bump| bump.texture),
        _ => None,
    };
    own.or(material.any_texture().copied()).unwrap_or(TextureUse {
        texture: 0,
        uv_set: 0,
        texture_from_mesh: Affine2::IDENTITY,
    })
}
