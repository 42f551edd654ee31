//! Textures and base colours at a point of a triangle.

use super::corner::{Corner, weights};
use super::scene::TracedScene;
use crate::material::TextureUse;
use crate::texture::{ColorSpace, DecodedTexture};
use glam::{Vec2, Vec3, Vec4};

/// Where a triangle's emission is looked up.
pub(crate) struct EmissionTexture<'a> {
    /// Index of the texture.
    pub index: u32,
    pub texels: &'a DecodedTexture,
    /// Coordinates of its vertices, transformed.
    pub uvs: [Vec2; 3],
}

/// Looks up base colours. Neighbours mostly ask of the same triangle: it keeps the last.
pub struct BaseColors<'a> {
    scene: &'a TracedScene,
    last: Option<TriangleColor<'a>>,
}

/// What a triangle's base colour is made of.
struct TriangleColor<'a> {
    triangle: u32,
    factor: Vec4,
    /// Texels, and the vertices' coordinates, transformed.
    texture: Option<(&'a DecodedTexture, [Vec2; 3])>,
    /// The vertices' own.
    colors: Option<[Vec4; 3]>,
}

impl<'a> BaseColors<'a> {
    /// Of a scene.
    pub fn new(scene: &'a TracedScene) -> BaseColors<'a> {
        BaseColors { scene, last: None }
    }

    /// The base colour at a point of a triangle, linear RGB in 0..=1.
    ///
    /// # Panics
    /// `triangle` is not below [`TracedScene::triangle_count`].
    pub fn at(&mut self, triangle: u32, barycentric: [f32; 2]) -> Vec3 {
        match &self.last {
            Some(last) if last.triangle == triangle => last.at(barycentric),
            _ => self
                .last
                .insert(self.scene.triangle_color(triangle))
                .at(barycentric),
        }
    }
}

impl TriangleColor<'_> {
    fn at(&self, barycentric: [f32; 2]) -> Vec3 {
        let weights = weights(barycentric);
        let mut color = self.factor;
        if let Some((texels, uvs)) = &self.texture {
            let uv = (0..3).map(|k| uvs[k] * weights[k]).sum();
            color *= texels.sample(uv, ColorSpace::Srgb);
        }
        if let Some(colors) = &self.colors {
            color *= (0..3).map(|k| colors[k] * weights[k]).sum::<Vec4>();
        }
        reflectable(color).truncate()
    }
}

/// What a surface can reflect; NaN becomes 0.
fn reflectable(color: Vec4) -> Vec4 {
    color.max(Vec4::ZERO).min(Vec4::ONE)
}

impl TracedScene {
    fn triangle_color(&self, triangle: u32) -> TriangleColor<'_> {
        let (material, corner) = self.corner_of(triangle, [0.0; 2]);
        let material = &self.materials[material as usize];
        let texture = material.base_color_texture.as_ref().and_then(|usage| {
            let texels = self.textures[usage.texture as usize].as_deref()?;
            let uvs = corner.vertex_uvs(usage.uv_set);
            Some((texels, uvs.map(|uv| usage.texture_from_mesh.transform_point2(uv))))
        });
        TriangleColor {
            triangle,
            factor: material.base_color,
            texture,
            colors: corner.vertex_colors(),
        }
    }

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
        reflectable(material.base_color * texture * corner.color())
    }

    pub(super) fn alpha(&self, triangle: u32, barycentric: [f32; 2]) -> f32 {
        let (instance, corner) = self.corner(triangle, barycentric);
        self.base_color(instance.material, &corner).w
    }
}
