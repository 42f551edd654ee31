//! What a scene and its lights cannot use does not go into the asset.
//!
//! Every omission says what, why, and how many bytes it would have taken before compression.

use crate::params::{BakeParams, Omittable};
use glam::{Vec2, Vec3, Vec4};
use relight_format::LeftOut;
use relight_scene::light::LightKind;
use relight_scene::material::{AlphaMode, Extensions, Material, TextureUse};
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, stage_to_json};
use relight_scene::traced::Shading;

/// A scene reduced to what relighting it can use, and what went.
#[derive(Debug)]
pub struct Pruned {
    /// The scene to store. Triangles, instances and materials keep their order and number.
    pub scene: Scene,
    /// What was left out.
    pub left_out: Vec<LeftOut>,
    /// Whether the scene's own lights are kept.
    pub keeps_lights: bool,
    /// Whether emission is kept.
    pub keeps_emission: bool,
}

/// Leaves out what `shading` and `lights` cannot use. `lights`: the only sequence that will be played, if the
/// bake was told.
pub fn prune(scene: &Scene, shading: Shading, lights: Option<&Sequence>, params: &BakeParams) -> Pruned {
    let mut pruned = Pruned {
        scene: scene.clone(),
        left_out: Vec::new(),
        keeps_lights: true,
        keeps_emission: true,
    };
    if let Some(sequence) = lights {
        if !params.keeps(Omittable::Lights) {
            own_lights(&mut pruned, sequence);
        }
        if !params.keeps(Omittable::Emission) {
            emission(&mut pruned, sequence);
        }
    }
    if params.keeps(Omittable::Materials) {
        return pruned;
    }
    if shading == Shading::Lambert {
        glossy_maps(&mut pruned);
    }
    tangents(&mut pruned);
    coordinates(&mut pruned);
    colors(&mut pruned);
    textures(&mut pruned);
    pruned
}

/// Adds an entry.
pub fn note(left_out: &mut Vec<LeftOut>, what: impl Into<String>, why: &str, saved_bytes: usize) {
    left_out.push(LeftOut {
        what: what.into(),
        why: why.into(),
        saved_bytes: saved_bytes as u64,
    });
}

/// A number of things.
pub fn plural(count: usize, what: &str) -> String {
    let digits = count.to_string();
    let grouped: Vec<&str> = (digits.as_bytes().rchunks(3).rev())
        .map(|group| std::str::from_utf8(group).unwrap_or_default())
        .collect();
    format!(
        "{} {what}{}",
        grouped.join(","),
        if count == 1 { "" } else { "s" }
    )
}

fn own_lights(pruned: &mut Pruned, sequence: &Sequence) {
    let own = &mut pruned.scene.sequence;
    pruned.keeps_lights = false;
    let before = stage_to_json(&[], own).len();
    let count = own.lights.len();
    own.lights.clear();
    own.camera = None;
    (own.frames, own.fps) = (sequence.frames, sequence.fps);
    if count > 0 {
        let saved = before.saturating_sub(stage_to_json(&[], own).len());
        note(
            &mut pruned.left_out,
            plural(count, "light") + " of the scene",
            "the sequence given with --lights replaces them; --keep lights keeps them",
            saved,
        );
    }
}

fn emission(pruned: &mut Pruned, sequence: &Sequence) {
    if sequence
        .lights
        .iter()
        .any(|light| matches!(light.kind, LightKind::Emissive { .. }))
    {
        return;
    }
    let emits = |m: &Material| !m.unlit && (m.emission != Vec3::ZERO || m.emission_texture.is_some());
    let mut count = 0;
    for material in pruned.scene.materials.iter_mut().filter(|m| emits(m)) {
        count += 1;
        material.emission = Vec3::ZERO;
        material.emission_texture = None;
    }
    // Unlit materials shine, too; nothing of them can be left out.
    pruned.keeps_emission = count == 0;
    if count > 0 {
        note(
            &mut pruned.left_out,
            format!("emission of {}", plural(count, "material")),
            "the sequence given with --lights has no `emissive` light; --keep emission keeps it",
            count * 12,
        );
    }
}

fn glossy_maps(pruned: &mut Pruned) {
    let mut count = 0;
    for material in &mut pruned.scene.materials {
        count += usize::from(material.normal_texture.take().is_some());
        count += usize::from(material.metallic_roughness_texture.take().is_some());
        if let Some(extensions) = material.extensions.take() {
            count += extensions.textures().into_iter().flatten().count();
            // What a pane mirrors decides what passes.
            if let AlphaMode::Pane { .. } = material.alpha_mode {
                material.extensions = Some(Box::new(Extensions {
                    ior: extensions.ior,
                    specular: extensions.specular,
                    specular_color: extensions.specular_color,
                    ..Extensions::default()
                }));
            }
        }
    }
    if count > 0 {
        note(
            &mut pruned.left_out,
            format!("{} of normals, metalness or roughness", plural(count, "use")),
            "--lambert ignores them; their textures are listed below if nothing else needs them",
            count * 29,
        );
    }
}

fn tangents(pruned: &mut Pruned) {
    let Scene {
        meshes, materials, ..
    } = &mut pruned.scene;
    let (mut count, mut bytes) = (0, 0);
    for mesh in meshes {
        let used = materials.get(mesh.material as usize).is_some_and(|m| {
            m.normal_texture.is_some() || m.extensions.as_ref().is_some_and(|e| e.needs_tangents())
        });
        if !used && !mesh.tangents.is_empty() {
            count += 1;
            bytes += mesh.tangents.len() * 5;
            mesh.tangents = Vec::new();
        }
    }
    if count > 0 {
        let what = format!("tangents of {}", plural(count, "mesh").replace("meshs", "meshes"));
        note(
            &mut pruned.left_out,
            what,
            "neither a normal map nor an anisotropic lobe uses them",
            bytes,
        );
    }
}

fn uses(material: &mut Material) -> impl Iterator<Item = &mut TextureUse> {
    material.source_textures_mut().flatten()
}

/// Keeps the sets that a mesh's material looks up, renumbered.
fn coordinates(pruned: &mut Pruned) {
    let Scene {
        meshes, materials, ..
    } = &mut pruned.scene;
    let used: Vec<Vec<u32>> = materials
        .iter_mut()
        .map(|material| {
            let mut sets: Vec<u32> = uses(material).map(|usage| usage.uv_set).collect();
            sets.sort_unstable();
            sets.dedup();
            uses(material).for_each(|usage| {
                usage.uv_set = sets.binary_search(&usage.uv_set).unwrap_or(0) as u32;
            });
            sets
        })
        .collect();
    let (mut count, mut bytes) = (0, 0);
    for mesh in meshes {
        let wanted = used.get(mesh.material as usize).map_or(&[][..], Vec::as_slice);
        let sets = std::mem::take(&mut mesh.uvs);
        for (i, set) in sets.into_iter().enumerate() {
            if wanted.contains(&(i as u32)) {
                mesh.uvs.push(set);
            } else {
                count += usize::from(!set.is_empty());
                bytes += set.len() * size_of::<Vec2>();
            }
        }
    }
    if count > 0 {
        let what = plural(count, "set") + " of texture coordinates";
        note(&mut pruned.left_out, what, "no texture uses them", bytes);
    }
}

fn colors(pruned: &mut Pruned) {
    let (mut count, mut bytes) = (0, 0);
    for mesh in &mut pruned.scene.meshes {
        if !mesh.colors.is_empty() && mesh.colors.iter().all(|c| *c == Vec4::ONE) {
            count += 1;
            bytes += mesh.colors.len() * size_of::<Vec4>();
            mesh.colors = Vec::new();
        }
    }
    if count > 0 {
        let what = format!(
            "vertex colours of {}",
            plural(count, "mesh").replace("meshs", "meshes")
        );
        note(&mut pruned.left_out, what, "they are all white", bytes);
    }
}

fn textures(pruned: &mut Pruned) {
    let Scene {
        meshes,
        materials,
        textures,
        ..
    } = &mut pruned.scene;
    let mut material_used = vec![false; materials.len()];
    for mesh in meshes.iter() {
        if let Some(used) = material_used.get_mut(mesh.material as usize) {
            *used = true;
        }
    }
    let mut used = vec![false; textures.len()];
    for (material, material_used) in materials.iter_mut().zip(&material_used) {
        if *material_used {
            uses(material).for_each(|usage| used[usage.texture as usize] = true);
        } else {
            // No triangle shows it: it stays for its name and number alone.
            material.source_textures_mut().for_each(|usage| *usage = None);
        }
    }
    let mut new_index = Vec::with_capacity(used.len());
    let mut kept = 0u32;
    for used in &used {
        new_index.push(kept);
        kept += u32::from(*used);
    }
    for material in materials.iter_mut() {
        uses(material).for_each(|usage| usage.texture = new_index[usage.texture as usize]);
    }
    let mut left_out = Vec::new();
    let mut i = 0;
    textures.retain(|texture| {
        let keep = used[i];
        if !keep {
            let name = if texture.name.is_empty() {
                format!("{i}")
            } else {
                format!("{:?}", texture.name)
            };
            note(
                &mut left_out,
                format!("texture {name}"),
                "no triangle's material uses it for what is kept",
                texture.encoded.len(),
            );
        }
        i += 1;
        keep
    });
    pruned.left_out.extend(left_out);
}
