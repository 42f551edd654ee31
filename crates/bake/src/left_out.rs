//! What a scene and its lights cannot use does not go into the asset.
//!
//! Every omission says what, why, and how many bytes it would have taken before compression.

use crate::convert::{MOST_OF_NAMES, variant_lines};
use crate::params::{BakeParams, Omittable};
use glam::{Vec2, Vec3, Vec4};
use relight_format::LeftOut;
use relight_scene::light::LightKind;
use relight_scene::material::{AlphaMode, Extensions, Material, TextureUse};
use relight_scene::scene::{Scene, Variant, replacements, shown_as};
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
    variants(&mut pruned, shading, params.solution);
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

fn variants(pruned: &mut Pruned, shading: Shading, solution: bool) {
    let why = match (shading, solution) {
        (Shading::Lambert, _) => "materials baked with --lambert take no edits".to_owned(),
        (_, true) => "--solution fixes how much materials reflect".to_owned(),
        _ if variant_lines(&pruned.scene.variants).is_none() => {
            format!("what they replace takes more than {MOST_OF_NAMES} bytes to say")
        }
        _ => return,
    };
    let count = std::mem::take(&mut pruned.scene.variants).len();
    if count > 0 {
        let what = plural(count, "variant") + " of materials";
        note(&mut pruned.left_out, what, &why, 0);
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
        meshes,
        materials,
        variants,
        ..
    } = &mut pruned.scene;
    let replacements = replacements(variants);
    let (mut count, mut bytes) = (0, 0);
    for mesh in meshes {
        let used = shown_as(mesh.material, &replacements)
            .flat_map(|material| materials.get(material as usize))
            .any(|m| m.normal_texture.is_some() || m.extensions.as_ref().is_some_and(|e| e.needs_tangents()));
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

/// For each material the first of those that the same meshes may show: variants put one in place of another.
fn shown_alike(materials: usize, variants: &[Variant]) -> Vec<usize> {
    // Each leads to an earlier one, or is the first itself.
    let mut earlier: Vec<usize> = (0..materials).collect();
    let first = |earlier: &mut [usize], mut material: usize| {
        while earlier[material] != material {
            earlier[material] = earlier[earlier[material]];
            material = earlier[material];
        }
        material
    };
    for &[a, b] in variants.iter().flat_map(|variant| &variant.materials) {
        let [a, b] = [a, b].map(|material| first(&mut earlier, material as usize));
        earlier[a.max(b)] = a.min(b);
    }
    (0..materials)
        .map(|material| first(&mut earlier, material))
        .collect()
}

/// Keeps the sets that a mesh's materials look up, renumbered.
fn coordinates(pruned: &mut Pruned) {
    let Scene {
        meshes,
        materials,
        variants,
        ..
    } = &mut pruned.scene;
    let alike = shown_alike(materials.len(), variants);
    let mut used: Vec<Vec<u32>> = vec![Vec::new(); materials.len()];
    for (material, &first) in materials.iter_mut().zip(&alike) {
        used[first].extend(uses(material).map(|usage| usage.uv_set));
    }
    for sets in &mut used {
        sets.sort_unstable();
        sets.dedup();
    }
    for (material, &first) in materials.iter_mut().zip(&alike) {
        uses(material).for_each(|usage| {
            usage.uv_set = used[first].binary_search(&usage.uv_set).unwrap_or(0) as u32;
        });
    }
    let (mut count, mut bytes) = (0, 0);
    for mesh in meshes {
        let first = alike.get(mesh.material as usize);
        let wanted = first.map_or(&[][..], |&first| used[first].as_slice());
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
        variants,
        textures,
        ..
    } = &mut pruned.scene;
    let mut material_used = vec![false; materials.len()];
    let replacements = variants
        .iter()
        .flat_map(|variant| &variant.materials)
        .map(|[_, by]| *by);
    for material in meshes.iter().map(|mesh| mesh.material).chain(replacements) {
        if let Some(used) = material_used.get_mut(material as usize) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine2;
    use relight_scene::material::{Texture, Wrap};
    use relight_scene::scene::Mesh;

    fn used(texture: u32, uv_set: u32) -> Option<TextureUse> {
        Some(TextureUse {
            texture,
            uv_set,
            texture_from_mesh: Affine2::IDENTITY,
        })
    }

    fn texture(name: &str) -> Texture {
        Texture {
            name: name.into(),
            encoded: name.as_bytes().to_vec(),
            wrap: [Wrap::Repeat; 2],
            nearest: false,
        }
    }

    /// A triangle of material 0 with three sets of coordinates, told apart by their numbers, and tangents. Material 0 looks up nothing,
    /// the variant's colours by set 2 and normals by set 1; nobody shows material 2.
    fn scene() -> Scene {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            tangents: vec![Vec4::X; 3],
            uvs: (0..3).map(|set| vec![Vec2::splat(set as f32); 3]).collect(),
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let by = Material {
            base_color_texture: used(2, 2),
            normal_texture: used(1, 1),
            ..Material::default()
        };
        let unused = Material {
            base_color_texture: used(0, 0),
            ..Material::default()
        };
        Scene {
            meshes: vec![mesh],
            materials: vec![Material::default(), by, unused],
            textures: vec![texture("unused"), texture("normals"), texture("colours")],
            variants: vec![Variant {
                name: "v".into(),
                materials: vec![[0, 1]],
            }],
            ..Scene::default()
        }
    }

    #[test]
    fn what_variants_look_up_is_kept() {
        let pruned = prune(&scene(), Shading::Full, None, &BakeParams::default()).scene;
        assert_eq!(pruned.variants, scene().variants);
        assert_eq!(pruned.meshes[0].tangents.len(), 3);
        assert_eq!(
            pruned.meshes[0].uvs,
            [vec![Vec2::splat(1.0); 3], vec![Vec2::splat(2.0); 3]]
        );
        let names: Vec<&str> = pruned.textures.iter().map(|t| t.name.as_str()).collect();
        assert_eq!(names, ["normals", "colours"]);
        assert_eq!(pruned.materials[1].base_color_texture, used(1, 1));
        assert_eq!(pruned.materials[1].normal_texture, used(0, 0));
        assert_eq!(pruned.materials[2].base_color_texture, None);
    }

    #[test]
    fn variants_that_nobody_can_show_are_left_out_with_what_they_need() {
        let solution = BakeParams {
            solution: true,
            ..BakeParams::default()
        };
        let mut long = scene();
        long.variants[0].name = "x".repeat(MOST_OF_NAMES);
        for (scene, shading, params, why) in [
            (scene(), Shading::Lambert, &BakeParams::default(), "--lambert"),
            (scene(), Shading::Full, &solution, "--solution"),
            (long, Shading::Full, &BakeParams::default(), "1048576 bytes"),
        ] {
            let pruned = prune(&scene, shading, None, params);
            assert!(pruned.scene.variants.is_empty() && pruned.scene.textures.is_empty());
            assert!(pruned.scene.meshes[0].tangents.is_empty() && pruned.scene.meshes[0].uvs.is_empty());
            let told = |l: &LeftOut| l.what == "1 variant of materials" && l.why.contains(why);
            assert!(pruned.left_out.iter().any(told), "{:?}", pruned.left_out);
        }
    }
}
