//! Textures and base colours at a point of a triangle.

use super::corner::Corner;
use super::scene::TracedScene;
use crate::material::TextureUse;
use crate::texture::{ColorSpace, DecodedTexture};
use glam::{Vec2, Vec4};

/// Where a triangle's emission is looked up.
pub(crate) struct EmissionTexture<'a> {
    /// Index of the texture.
    pub index: u32,
    pub texels: &'a DecodedTexture,
    /// Coordinates of its vertices, transformed.
    pub uvs: [Vec2; 3],
}

impl TracedScene {
    /// The texture's value, or white where the material uses none.
    pub(crate) fn texture_value(
        &self,
        usage: &Option<TextureUse>,
        corner: &Corner<'_>,
        space: ColorSpace,
    ) -> Vec4 {
        let Some(usage) = usage else { return Vec4::ONE };
        match &self.textures[usage.texture as usize] {
            Some(texture) => texture.sample_at(usage, corner.uv(usage.uv_set), space),
            None => Vec4::ONE,
        }
    }

    /// What a triangle's emission is looked up in; `None` where it has no texture.
    pub(crate) fn emission_texture(&self, triangle: u32) -> Option<EmissionTexture<'_>> {
        let (material, corner) = self.corner_of(triangle, [0.0; 2]);
        let usage = self.materials[material as usize].emission_texture.as_ref()?;
        Some(EmissionTexture {
            index: usage.texture,
            texels: self.textures[usage.texture as usize].as_ref()?,
            uvs: (corner.vertex_uvs(usage.uv_set)).map(|uv| usage.texture_from_mesh.transform_point2(uv)),
        })
    }

    /// How fast a height texture (mean of red, green and blue) rises with the texture's coordinates u and v, from
    /// one texel to the next; `None` where the texture is not decoded.
    pub(crate) fn texture_slope(&self, usage: &TextureUse, corner: &Corner<'_>) -> Option<Vec2> {
        let texture = self.textures[usage.texture as usize].as_ref()?;
        let uv = usage.texture_from_mesh.transform_point2(corner.uv(usage.uv_set));
        let (width, height) = texture.size();
        let size = Vec2::new(width as f32, height as f32);
        let level = |offset: Vec2| {
            let value = texture.sample(uv + offset / size, ColorSpace::Linear);
            value.truncate().element_sum() / 3.0
        };
        Some(Vec2::new(
            (level(Vec2::new(0.5, 0.0)) - level(Vec2::new(-0.5, 0.0))) * size.x,
            (level(Vec2::new(0.0, 0.5)) - level(Vec2::new(0.0, -0.5))) * size.y,
        ))
    }

    /// Base colour and alpha: factor × texture × vertex colour, clamped to what a surface can reflect.
    pub(crate) fn base_color(&self, material: u32, corner: &Corner<'_>) -> Vec4 {
        let material = &self.materials[material as usize];
        let texture = self.texture_value(&material.base_color_texture, corner, ColorSpace::Srgb);
        let color = material.base_color * texture * corner.color();
        // NaN becomes 0.
        color.max(Vec4::ZERO).min(Vec4::ONE)
    }

    pub(super) fn alpha(&self, triangle: u32, barycentric: [f32; 2]) -> f32 {
        let (instance, corner) = self.corner(triangle, barycentric);
        self.base_color(instance.material, &corner).w
    }
}
