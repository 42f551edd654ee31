//! A triangle scene as the source of emissive lights.

use super::emitters::{EmissiveTriangle, Emitters};
use super::parts::{EmissivePart, subdivide};
use crate::environment::luminance;
use crate::material::AlphaMode;
use crate::texture_range::TextureRange;
use crate::traced::{EmissionTexture, TracedScene};
use glam::{DVec2, DVec3, Vec3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Points of each part over which emission is averaged; its range bounds what they may miss.
const SAMPLES: u32 = 16;

/// Smallest share of its brightest spot that a part is drawn by, so that a spot that the samples missed has some chance.
const SMALLEST_SHARE: f32 = 1.0 / 16.0;

/// Most parts of all textured triangles together.
const MOST_PARTS: usize = 1 << 14;

/// Share of the light of textured triangles whose place within them may stay unknown.
const ACCURACY: f64 = 0.05;

/// The emissive triangles of a [`TracedScene`], of which it keeps a clone. Unlit materials are no lights and are left out.
pub struct SceneEmitters {
    scene: TracedScene,
    triangles: Vec<EmissiveTriangle>,
}

impl SceneEmitters {
    /// Collects them; triangles without area or with vertices that are not finite emit nothing.
    pub fn new(scene: &TracedScene) -> SceneEmitters {
        let mut triangles = Vec::new();
        let mut textured: Vec<(usize, EmissionTexture)> = Vec::new();
        for &primitive in scene.emissive_triangles() {
            let material = scene.material(primitive);
            let vertices = scene.triangle_positions(primitive);
            let area = scene.triangle_area(primitive);
            if material.unlit || !vertices.iter().all(|v| v.is_finite()) || area.is_nan() || area <= 0.0 {
                continue;
            }
            let texture = scene.emission_texture(primitive);
            let mut mean_radiance = mean_emission(scene, primitive, &EmissivePart::whole(0.0));
            if texture.is_none() && material.alpha_mode != AlphaMode::Opaque {
                mean_radiance = mean_radiance.max(material.emission * SMALLEST_SHARE);
            }
            textured.extend(texture.map(|texture| (triangles.len(), texture)));
            triangles.push(EmissiveTriangle {
                primitive,
                vertices,
                mean_radiance,
                parts: None,
                material: scene.material_of(primitive),
                double_sided: material.double_sided,
            });
        }
        divide(scene, &textured, &mut triangles);
        SceneEmitters {
            scene: scene.clone(),
            triangles,
        }
    }

    /// Whether they are those of a scene, with the materials that it has now.
    pub fn are_of(&self, scene: &TracedScene) -> bool {
        Arc::ptr_eq(self.scene.scene(), scene.scene())
            && self.scene.shading() == scene.shading()
            && self.scene.materials() == scene.materials()
    }
}

/// Divides triangles by their textures.
fn divide(scene: &TracedScene, textured: &[(usize, EmissionTexture)], triangles: &mut [EmissiveTriangle]) {
    let mut ranges: BTreeMap<(u32, u32), TextureRange> = BTreeMap::new();
    for (i, texture) in textured {
        let material = triangles[*i].material;
        let factor = scene.materials()[material as usize].emission;
        (ranges.entry((texture.index, material)))
            .or_insert_with(|| TextureRange::new(texture.texels, factor));
    }
    let areas: Vec<f64> = (textured.iter())
        .map(|(i, _)| f64::from(scene.triangle_area(triangles[*i].primitive)))
        .collect();
    let parts = subdivide(&areas, MOST_PARTS, ACCURACY, |k, corners| {
        let (i, texture) = &textured[k];
        let [a, b, c] = texture.uvs.map(|uv| uv.as_dvec2());
        let uv = corners.map(|w| a + (b - a) * f64::from(w.x) + (c - a) * f64::from(w.y));
        let (low, high) = (uv[0].min(uv[1]).min(uv[2]), uv[0].max(uv[1]).max(uv[2]));
        ranges[&(texture.index, triangles[*i].material)].within(low, high)
    });
    for ((i, _), mut parts) in textured.iter().zip(parts) {
        let triangle = &mut triangles[*i];
        let mut mean = DVec3::ZERO;
        for part in &mut parts {
            let radiance = mean_emission(scene, triangle.primitive, part);
            mean += radiance.as_dvec3() * part.share();
            part.luminance = luminance(radiance).max(part.luminance * SMALLEST_SHARE);
        }
        triangle.mean_radiance = mean.as_vec3();
        triangle.parts = Some(parts);
    }
}

/// Mean over a part of a triangle of what it emits where it covers.
fn mean_emission(scene: &TracedScene, primitive: u32, part: &EmissivePart) -> Vec3 {
    let at = |within: DVec2| {
        let barycentric = part.barycentric(within).as_vec2().to_array();
        scene.emission(primitive, barycentric) * scene.coverage(primitive, barycentric)
    };
    let material = scene.material(primitive);
    if material.emission_texture.is_none() && material.alpha_mode == AlphaMode::Opaque {
        return at(DVec2::splat(1.0 / 3.0));
    }
    let mut sum = DVec3::ZERO;
    for i in 0..SAMPLES {
        // Roberts' R2 sequence, folded from the square onto the triangle.
        let [a, b] = [0.754_877_666_2, 0.569_840_290_9].map(|step| ((f64::from(i) + 0.5) * step).fract());
        let within = if a + b > 1.0 { [1.0 - a, 1.0 - b] } else { [a, b] };
        sum += at(within.into()).as_dvec3();
    }
    (sum / f64::from(SAMPLES)).as_vec3()
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
