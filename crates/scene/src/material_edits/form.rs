//! Material edits as a file has them.

use super::parameters::{ModelName, Parameter};
use crate::animated::Animated;
use crate::json::keyed::Keyed;
use crate::json::quantity::{Angle, Exponent, Fixed, Plain, Radiance, Reflectance, Share, Version1, given};
use glam::Vec3;
use schemars::JsonSchema;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

/// Material edits, as text or in memory.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EditsFile<E> {
    /// The version of this form.
    #[allow(dead_code, reason = "there is one")]
    relight_materials: Version1,
    /// Name of the asset's variant of materials that edits go on from.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "String")]
    pub(super) variant: Option<String>,
    /// Applied one after the other.
    #[serde(default = "Vec::<E>::new")]
    pub(super) edits: Vec<E>,
}

/// Changes to some materials. What is left out stays as the asset, or the edit before, has it.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Edit")]
pub(crate) struct EditForm {
    /// Name of the materials to change, or the number of one.
    pub(super) material: NameOrNumber,
    /// How the material reflects.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "ModelName")]
    pub(super) model: Option<ModelName>,
    /// Base colour; alpha stays as it is.
    #[serde(default, deserialize_with = "Keyed::<Reflectance>::given")]
    #[schemars(with = "Keyed<Reflectance>")]
    base_color: Option<Animated<Vec3>>,
    /// Multiplies the base colour. Not of materials with alpha.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "Option<NameOrNumber>")]
    base_color_texture: Option<Option<NameOrNumber>>,
    /// 0 dielectric to 1 metal. Of `metallic_roughness` only.
    #[serde(default, deserialize_with = "Keyed::<Share>::given")]
    #[schemars(with = "Keyed<Share>")]
    metallic: Option<Animated<f32>>,
    /// Perceptual roughness (α is its square). Not of `lambert`; of `ward` both ways.
    #[serde(default, deserialize_with = "Keyed::<Share>::given")]
    #[schemars(with = "Keyed<Share>")]
    roughness: Option<Animated<f32>>,
    /// Perceptual roughness along the tangent. Of `ward` only.
    #[serde(default, deserialize_with = "Keyed::<Share>::given")]
    #[schemars(with = "Keyed<Share>")]
    roughness_u: Option<Animated<f32>>,
    /// Perceptual roughness across the tangent. Of `ward` only.
    #[serde(default, deserialize_with = "Keyed::<Share>::given")]
    #[schemars(with = "Keyed<Share>")]
    roughness_v: Option<Animated<f32>>,
    /// Turns the tangent towards the bitangent, degrees. Of `ward` only.
    #[serde(default, deserialize_with = "Keyed::<Angle>::given")]
    #[schemars(with = "Keyed<Angle>")]
    rotation_deg: Option<Animated<f32>>,
    /// Green multiplies roughness, blue the metallic share. Not of `lambert`.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "Option<NameOrNumber>")]
    metallic_roughness_texture: Option<Option<NameOrNumber>>,
    /// Reflectance of the lobe at normal incidence. Of `phong` and `ward`; 0.04 where the model is new.
    #[serde(default, deserialize_with = "Keyed::<Reflectance>::given")]
    #[schemars(with = "Keyed<Reflectance>")]
    specular: Option<Animated<Vec3>>,
    /// Multiplies `specular`. Of `phong` and `ward`.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "Option<NameOrNumber>")]
    specular_texture: Option<Option<NameOrNumber>>,
    /// Exponent of the lobe, instead of `roughness`. Of `phong` only.
    #[serde(default, deserialize_with = "Keyed::<Exponent>::given")]
    #[schemars(with = "Keyed<Exponent>")]
    exponent: Option<Animated<f32>>,
    /// Normals in tangent space.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "Option<NameOrNumber>")]
    normal_texture: Option<Option<NameOrNumber>>,
    /// Multiplies the normal map's x and y.
    #[serde(default, deserialize_with = "Keyed::<Plain>::given")]
    #[schemars(with = "Keyed<Plain>")]
    normal_scale: Option<Animated<f32>>,
    /// A height map: the mean of red, green and blue. Needs `bump_scale`.
    #[serde(default, deserialize_with = "given")]
    #[schemars(with = "Option<NameOrNumber>")]
    bump_texture: Option<Option<NameOrNumber>>,
    /// Height of white above black, metres. Needs `bump_texture`.
    #[serde(default, deserialize_with = "Keyed::<Plain>::given")]
    #[schemars(with = "Keyed<Plain>")]
    bump_scale: Option<Animated<f32>>,
    /// Emitted radiance, W/(m² sr), where an `emissive` light of the sequence lets it shine. No keys.
    #[serde(default, deserialize_with = "Keyed::<Radiance>::given")]
    #[schemars(with = "Fixed<Radiance>")]
    emission: Option<Animated<Vec3>>,
}

/// What an edit gives a parameter.
pub(super) enum Given {
    Number(Animated<f32>),
    Color(Animated<Vec3>),
    /// `None`: no texture.
    Texture(Option<NameOrNumber>),
}

impl EditForm {
    /// The parameters that are given. Textures are first: a bump's scale belongs to its texture.
    pub(super) fn changes(self) -> Vec<(Parameter, Given)> {
        use Parameter as P;
        let textures = [
            (P::BaseColorTexture, self.base_color_texture),
            (P::MetallicRoughnessTexture, self.metallic_roughness_texture),
            (P::SpecularTexture, self.specular_texture),
            (P::NormalTexture, self.normal_texture),
            (P::BumpTexture, self.bump_texture),
        ];
        let colors = [
            (P::BaseColor, self.base_color),
            (P::Specular, self.specular),
            (P::Emission, self.emission),
        ];
        let numbers = [
            (P::Metallic, self.metallic),
            (P::Roughness, self.roughness),
            (P::RoughnessU, self.roughness_u),
            (P::RoughnessV, self.roughness_v),
            (P::RotationDeg, self.rotation_deg),
            (P::Exponent, self.exponent),
            (P::NormalScale, self.normal_scale),
            (P::BumpScale, self.bump_scale),
        ];
        let textures = (textures.into_iter()).filter_map(|(p, given)| Some((p, Given::Texture(given?))));
        let colors = (colors.into_iter()).filter_map(|(p, given)| Some((p, Given::Color(given?))));
        let numbers = (numbers.into_iter()).filter_map(|(p, given)| Some((p, Given::Number(given?))));
        textures.chain(colors).chain(numbers).collect()
    }
}

/// What a material or texture is called: its name or its number in the asset.
#[derive(JsonSchema)]
#[serde(untagged)]
pub(crate) enum NameOrNumber {
    /// Its name.
    Name(String),
    /// Its number in the asset, from 0.
    Number(u64),
}

impl fmt::Display for NameOrNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NameOrNumber::Name(name) => write!(f, "{name:?}"),
            NameOrNumber::Number(number) => write!(f, "{number}"),
        }
    }
}

impl<'de> Deserialize<'de> for NameOrNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NameOrNumberVisitor)
    }
}

struct NameOrNumberVisitor;

impl Visitor<'_> for NameOrNumberVisitor {
    type Value = NameOrNumber;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a name, or a number of the asset's (from 0)")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<NameOrNumber, E> {
        Ok(NameOrNumber::Name(name.into()))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<NameOrNumber, E> {
        Ok(NameOrNumber::Number(number))
    }
}

/// Refuses what looks like a parameter of visibility, and ignores all else.
#[derive(Deserialize)]
pub(super) struct RefuseVisibility {
    #[allow(dead_code, reason = "reading it fails")]
    #[serde(
        alias = "alpha_mode",
        alias = "alpha_cutoff",
        alias = "opacity",
        alias = "transparency",
        alias = "coverage",
        alias = "visible"
    )]
    alpha: Option<Refused>,
}

struct Refused;

impl<'de> Deserialize<'de> for Refused {
    fn deserialize<D: Deserializer<'de>>(_: D) -> Result<Self, D::Error> {
        Err(D::Error::custom(
            "visibility cannot be edited: which rays a surface stops is part of the baked transport; change it in the \
             scene and bake again",
        ))
    }
}
