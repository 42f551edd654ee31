//! A triangle scene as the source of emissive lights.

use super::emitters::{EmissiveTriangle, Emitters};
use crate::traced::TracedScene;
use glam::{DVec3, Vec3};

/// Points per triangle over which a textured emission is averaged: it only decides how often the triangle is
/// drawn, and a miss of some small bright spot costs variance, not light, where BRDF samples find it, too.
const TEXTURE_SAMPLES: u32 = 64;

/// Smallest share of a textured triangle's largest possible emission that it is drawn by, so that every spot
/// on it has some chance.
const SMALLEST_SHARE: f32 = 0.01;

/// The emissive triangles of a [`TracedScene`], of which it keeps a clone. Unlit materials are no lights and are left out.
pub struct SceneEmitters {
    scene: TracedScene,
    triangles: Vec<EmissiveTriangle>,
}

impl SceneEmitters {
    /// Collects them; triangles without area or with vertices that are not finite emit nothing.
    pub fn new(scene: &TracedScene) -> SceneEmitters {
        let mut triangles = Vec::new();
        for &primitive in scene.emissive_triangles() {
            let material = scene.material(primitive);
            let vertices = scene.triangle_positions(primitive);
            let area = scene.triangle_area(primitive);
            if material.unlit || !vertices.iter().all(|v| v.is_finite()) || area.is_nan() || area <= 0.0 {
                continue;
            }
            let mut mean_radiance = mean_emission(scene, primitive);
            if material.emission_texture.is_some() {
                mean_radiance = mean_radiance.max(material.emission * SMALLEST_SHARE);
            }
            triangles.push(EmissiveTriangle {
                primitive,
                vertices,
                mean_radiance,
                material: scene.material_of(primitive),
                double_sided: material.double_sided,
            });
        }
        SceneEmitters {
            scene: scene.clone(),
            triangles,
        }
    }
}

fn mean_emission(scene: &TracedScene, primitive: u32) -> Vec3 {
    let material = scene.material(primitive);
    let plain = material.emission_texture.is_none() && scene.coverage(primitive, [1.0 / 3.0; 2]) == 1.0;
    if plain {
        return scene.emission(primitive, [1.0 / 3.0; 2]);
    }
    let mut sum = DVec3::ZERO;
    for i in 0..TEXTURE_SAMPLES {
        // Roberts' R2 sequence, folded from the square onto the triangle.
        let [a, b] = [0.754_877_67_f32, 0.569_840_3].map(|step| ((i as f32 + 0.5) * step).fract());
        let barycentric = if a + b > 1.0 { [1.0 - a, 1.0 - b] } else { [a, b] };
        let covered = scene.coverage(primitive, barycentric);
        sum += (scene.emission(primitive, barycentric) * covered).as_dvec3();
    }
    (sum / f64::from(TEXTURE_SAMPLES)).as_vec3()
}

impl Emitters for SceneEmitters {
    fn emissive_triangles(&self) -> &[EmissiveTriangle] {
        &self.triangles
    }

    fn material_names(&self) -> Vec<String> {
        self.scene
            .scene()
            .materials
            .iter()
            .map(|material| material.name.clone())
            .collect()
    }

    fn emitted(&self, primitive: u32, barycentric: [f32; 2]) -> Vec3 {
        self.scene.emission(primitive, barycentric)
    }

    fn coverage(&self, primitive: u32, barycentric: [f32; 2]) -> f32 {
        self.scene.coverage(primitive, barycentric)
    }
}
