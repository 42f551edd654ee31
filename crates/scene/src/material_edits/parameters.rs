//! Which models and parameters there are, and which belong together.

use crate::material::{Material, Model};
use crate::shading::DIELECTRIC_F0;
use glam::Vec3;
use schemars::JsonSchema;
use serde::Deserialize;

/// A model without its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "Model")]
pub(crate) enum ModelName {
    /// Metallic-roughness of glTF 2.0.
    MetallicRoughness,
    /// Matt.
    Lambert,
    /// Modified Phong with a normalised lobe.
    Phong,
    /// Ward's, anisotropic, with bounded albedo.
    Ward,
}

impl ModelName {
    /// As files have it.
    pub(super) fn name(self) -> &'static str {
        match self {
            ModelName::MetallicRoughness => "metallic_roughness",
            ModelName::Lambert => "lambert",
            ModelName::Phong => "phong",
            ModelName::Ward => "ward",
        }
    }

    pub(super) fn of_material(material: &Material) -> ModelName {
        match material.model {
            Model::MetallicRoughness => ModelName::MetallicRoughness,
            Model::Lambert => ModelName::Lambert,
            Model::Phong { .. } => ModelName::Phong,
            Model::Ward { .. } => ModelName::Ward,
        }
    }

    /// The model as a material gets it: its own parameters if it is of that model already, else the roughness of
    /// the material and the specular factor of a dielectric.
    pub(super) fn of(self, material: &Material) -> Model {
        if ModelName::of_material(material) == self {
            return material.model;
        }
        let specular = Vec3::splat(DIELECTRIC_F0);
        match self {
            ModelName::MetallicRoughness => Model::MetallicRoughness,
            ModelName::Lambert => Model::Lambert,
            ModelName::Phong => Model::Phong {
                specular,
                exponent: None,
            },
            ModelName::Ward => Model::Ward {
                specular,
                roughness: [material.roughness; 2],
                rotation: 0.0,
            },
        }
    }

    /// Parameters of a material of this model.
    pub(super) fn parameters(self) -> impl Iterator<Item = Parameter> {
        let all = Parameter::ALL.into_iter().map(|(parameter, _)| parameter);
        all.filter(move |p| p.belongs_to(self))
    }
}

/// What can be edited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parameter {
    BaseColor,
    BaseColorTexture,
    Metallic,
    Roughness,
    RoughnessU,
    RoughnessV,
    RotationDeg,
    MetallicRoughnessTexture,
    Specular,
    SpecularTexture,
    Exponent,
    NormalTexture,
    NormalScale,
    BumpTexture,
    BumpScale,
    Emission,
}

impl Parameter {
    const ALL: [(Parameter, &str); 16] = [
        (Parameter::BaseColor, "base_color"),
        (Parameter::BaseColorTexture, "base_color_texture"),
        (Parameter::Metallic, "metallic"),
        (Parameter::Roughness, "roughness"),
        (Parameter::RoughnessU, "roughness_u"),
        (Parameter::RoughnessV, "roughness_v"),
        (Parameter::RotationDeg, "rotation_deg"),
        (Parameter::MetallicRoughnessTexture, "metallic_roughness_texture"),
        (Parameter::Specular, "specular"),
        (Parameter::SpecularTexture, "specular_texture"),
        (Parameter::Exponent, "exponent"),
        (Parameter::NormalTexture, "normal_texture"),
        (Parameter::NormalScale, "normal_scale"),
        (Parameter::BumpTexture, "bump_texture"),
        (Parameter::BumpScale, "bump_scale"),
        (Parameter::Emission, "emission"),
    ];

    /// As files have it.
    pub(super) fn name(self) -> &'static str {
        Parameter::ALL[self as usize].1
    }

    pub(super) fn belongs_to(self, model: ModelName) -> bool {
        use ModelName::{Lambert, MetallicRoughness, Phong, Ward};
        match self {
            Parameter::Metallic => model == MetallicRoughness,
            Parameter::Roughness | Parameter::MetallicRoughnessTexture => model != Lambert,
            Parameter::Exponent => model == Phong,
            Parameter::RoughnessU | Parameter::RoughnessV | Parameter::RotationDeg => model == Ward,
            Parameter::Specular | Parameter::SpecularTexture => matches!(model, Phong | Ward),
            _ => true,
        }
    }

    /// Whether it bends the shading normal.
    pub(super) fn bends_normals(self) -> bool {
        matches!(
            self,
            Parameter::NormalTexture | Parameter::NormalScale | Parameter::BumpTexture | Parameter::BumpScale
        )
    }

    /// Whether it changes a surface's total reflectance.
    pub(super) fn changes_reflectance(self) -> bool {
        !self.bends_normals() && !matches!(self, Parameter::Emission | Parameter::RotationDeg)
    }
}
