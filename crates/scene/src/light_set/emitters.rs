//! What lights need to know of surfaces that emit.

use super::parts::EmissivePart;
use glam::Vec3;

/// A triangle that can emit.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissiveTriangle {
    /// Its index among the scene's triangles, as in [`crate::surface::SurfaceHit::primitive`].
    pub primitive: u32,
    /// World space, counter-clockwise seen from the front.
    pub vertices: [Vec3; 3],
    /// Mean emitted radiance over the triangle, RGB, W/(m² sr): decides how often it is drawn.
    pub mean_radiance: Vec3,
    /// What is drawn of a textured one instead of all of it; what is in none of them is dark.
    pub parts: Option<Vec<EmissivePart>>,
    /// Index of its material.
    pub material: u32,
    /// Whether it emits on both sides.
    pub double_sided: bool,
}

/// What lights need to know of a scene that has emissive materials.
pub trait Emitters: Sync {
    /// All triangles that can emit, in a fixed order.
    fn emissive_triangles(&self) -> &[EmissiveTriangle];
    /// Names of all materials, by index.
    fn material_names(&self) -> Vec<String>;
    /// Radiance that a primitive emits at the place with these barycentric weights of vertices 1 and 2,
    /// texture included, before any light's scale.
    fn emitted(&self, primitive: u32, barycentric: [f32; 2]) -> Vec3;
    /// How much of a surface there is at that place (alpha masks and blending), 0 to 1.
    fn coverage(&self, _primitive: u32, _barycentric: [f32; 2]) -> f32 {
        1.0
    }
}

/// A scene in which nothing emits.
pub struct NoEmitters;

impl Emitters for NoEmitters {
    fn emissive_triangles(&self) -> &[EmissiveTriangle] {
        &[]
    }
    fn material_names(&self) -> Vec<String> {
        Vec::new()
    }
    fn emitted(&self, _: u32, _: [f32; 2]) -> Vec3 {
        Vec3::ZERO
    }
}
