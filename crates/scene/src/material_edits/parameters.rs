//! Which models and parameters there are, and what each accepts.

use crate::bsdf::MAX_EXPONENT;
use crate::material::{Material, Model};
use crate::sequence::fields::Range;
use crate::shading::DIELECTRIC_F0;
use glam::Vec3;

/// A model without its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ModelName {
    MetallicRoughness,
    Lambert,
    Phong,
    Ward,
}

impl ModelName {
    pub(super) const ALL: [ModelName; 4] = [
        ModelName::MetallicRoughness,
        ModelName::Lambert,
        ModelName::Phong,
        ModelName::Ward,
    ];

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
        Parameter::ALL.into_iter().filter(move |p| p.belongs_to(self))
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

/// What a parameter accepts.
#[derive(Clone, Copy)]
pub(super) enum Accepts {
    Number(Range),
    /// A number or RGB, each in 0..=1.
    Reflectance,
    /// A number or RGB, each at least 0, no keys.
    Radiance,
    Texture,
}

impl Parameter {
    const ALL: [Parameter; 16] = [
        Parameter::BaseColor,
        Parameter::BaseColorTexture,
        Parameter::Metallic,
        Parameter::Roughness,
        Parameter::RoughnessU,
        Parameter::RoughnessV,
        Parameter::RotationDeg,
        Parameter::MetallicRoughnessTexture,
        Parameter::Specular,
        Parameter::SpecularTexture,
        Parameter::Exponent,
        Parameter::NormalTexture,
        Parameter::NormalScale,
        Parameter::BumpTexture,
        Parameter::BumpScale,
        Parameter::Emission,
    ];

    pub(super) fn named(name: &str) -> Option<Parameter> {
        Parameter::ALL.into_iter().find(|p| p.name() == name)
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Parameter::BaseColor => "base_color",
            Parameter::BaseColorTexture => "base_color_texture",
            Parameter::Metallic => "metallic",
            Parameter::Roughness => "roughness",
            Parameter::RoughnessU => "roughness_u",
            Parameter::RoughnessV => "roughness_v",
            Parameter::RotationDeg => "rotation_deg",
            Parameter::MetallicRoughnessTexture => "metallic_roughness_texture",
            Parameter::Specular => "specular",
            Parameter::SpecularTexture => "specular_texture",
            Parameter::Exponent => "exponent",
            Parameter::NormalTexture => "normal_texture",
            Parameter::NormalScale => "normal_scale",
            Parameter::BumpTexture => "bump_texture",
            Parameter::BumpScale => "bump_scale",
            Parameter::Emission => "emission",
        }
    }

    pub(super) fn accepts(self) -> Accepts {
        match self {
            Parameter::BaseColor | Parameter::Specular => Accepts::Reflectance,
            Parameter::Emission => Accepts::Radiance,
            Parameter::BaseColorTexture
            | Parameter::MetallicRoughnessTexture
            | Parameter::SpecularTexture
            | Parameter::NormalTexture
            | Parameter::BumpTexture => Accepts::Texture,
            Parameter::Metallic | Parameter::Roughness | Parameter::RoughnessU | Parameter::RoughnessV => {
                Accepts::Number(Range::Within(0.0, 1.0))
            }
            Parameter::Exponent => Accepts::Number(Range::Within(0.0, MAX_EXPONENT as f64)),
            Parameter::RotationDeg | Parameter::NormalScale | Parameter::BumpScale => {
                Accepts::Number(Range::Any)
            }
        }
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
