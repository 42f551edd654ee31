//! References to textures, with KHR_texture_transform.

use super::json::At;
use crate::material::TextureUse;
use glam::{Affine2, Vec2};

/// Sets of texture coordinates that are imported. Files with more than two are rare.
pub(super) const MAX_UV_SETS: u64 = 8;

/// The texture that a member refers to.
pub(super) fn parse_use(at: &At, key: &str, textures: usize) -> Option<TextureUse> {
    let info = at.object(key)?;
    let texture = info.required_index("index", textures, "textures")?;
    let mut uv_set = info.uint("texCoord").unwrap_or(0);
    let mut texture_from_mesh = Affine2::IDENTITY;
    if let Some(transform) = info.extension("KHR_texture_transform") {
        uv_set = transform.uint("texCoord").unwrap_or(uv_set);
        let offset = transform.floats("offset").map_or(Vec2::ZERO, Vec2::from);
        let scale = transform.floats("scale").map_or(Vec2::ONE, Vec2::from);
        // Counter-clockwise as one sees the image, whose v axis points down: the negative angle in (u, v).
        let rotation = -transform.float("rotation").unwrap_or(0.0);
        texture_from_mesh = Affine2::from_scale_angle_translation(scale, rotation, offset);
    }
    if uv_set >= MAX_UV_SETS {
        info.fault_at(
            "texCoord",
            format!("is {uv_set}; at most {MAX_UV_SETS} sets of coordinates are imported"),
        );
        return None;
    }
    Some(TextureUse {
        texture: texture as u32,
        uv_set: uv_set as u32,
        texture_from_mesh,
    })
}
