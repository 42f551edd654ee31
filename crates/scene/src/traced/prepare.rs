//! From a scene to a traced scene: checks, expansion of instances, decoding of textures.

use super::panes::is_tinted;
use super::scene::{Shading, TracedInstance, TracedScene, TracedSceneError};
use crate::material::{AlphaMode, Material};
use crate::rays::TriangleBvh;
use crate::scene::{Mesh, Scene};
use crate::texture::{DecodedTexture, decode_texture};
use glam::{Affine3A, Mat3A, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

impl TracedScene {
    /// Expands the instances, builds the ray caster and decodes the textures that `shading` needs.
    /// Triangles with vertices that are not finite are never hit and never emit.
    ///
    /// # Errors
    /// A texture cannot be decoded, or the scene contradicts itself (see [`TracedSceneError`]).
    pub fn new(scene: Arc<Scene>, shading: Shading) -> Result<TracedScene, TracedSceneError> {
        prepare(scene, shading)
    }

    /// Puts other materials in the place of the scene's, in the same order, and decodes the textures that they
    /// newly use. Rays keep passing where they passed before: alpha modes, base colours' alpha and, where alpha
    /// matters, base colour textures must be those of the scene.
    ///
    /// # Errors
    /// There are fewer materials than in the scene, one uses a texture that does not exist, or a texture cannot
    /// be decoded.
    pub fn set_materials(&mut self, materials: Vec<Material>) -> Result<(), TracedSceneError> {
        set_materials(self, materials)
    }
}

fn prepare(scene: Arc<Scene>, shading: Shading) -> Result<TracedScene, TracedSceneError> {
    check_references(&scene)?;
    let textures = decode_used_textures(&scene, shading)?;
    let Expanded {
        positions,
        triangles,
        instances,
        instance_of_triangle,
    } = expand(&scene, shading, &textures)?;
    let bvh = TriangleBvh::build(&positions, &triangles);
    let opaque = instances.iter().all(|instance| instance.opaque);
    let meshes = || {
        let meshes = scene.instances.iter().map(|i| &scene.meshes[i.mesh as usize]);
        meshes.map(|mesh| (mesh, &scene.materials[mesh.material as usize]))
    };
    let is_pane = |material: &Material| matches!(material.alpha_mode, AlphaMode::Pane { .. });
    let panes = shading == Shading::Full && meshes().any(|(_, material)| is_pane(material));
    let tinted = panes && meshes().any(|(mesh, material)| is_tinted(material, !mesh.colors.is_empty()));
    let solid = instances.iter().any(|instance| instance.solid);
    let mut traced = TracedScene {
        materials: scene.materials.clone(),
        scene,
        shading,
        bvh: Arc::new(bvh),
        instances: instances.into(),
        instance_of_triangle: instance_of_triangle.into(),
        textures,
        emissive: Arc::default(),
        opaque,
        panes,
        tinted,
        solid,
        occluders: Arc::default(),
    };
    traced.emissive = emissive(&traced);
    Ok(traced)
}

/// World indices, rising, of the triangles whose material can emit and whose vertices are finite.
fn emissive(scene: &TracedScene) -> Arc<[u32]> {
    (0..scene.triangle_count() as u32)
        .filter(|&triangle| can_emit(scene.material(triangle)) && scene.bvh.triangle(triangle).is_some())
        .collect()
}

/// See [`TracedScene::set_materials`].
fn set_materials(scene: &mut TracedScene, materials: Vec<Material>) -> Result<(), TracedSceneError> {
    let count = scene.scene.materials.len();
    check(
        || "the last instance".into(),
        "material",
        count.saturating_sub(1) as u32,
        materials.len().max(usize::from(count == 0)),
    )?;
    for (at, material) in materials.iter().enumerate() {
        check_textures(at, material, &scene.scene)?;
    }
    for mesh in &scene.scene.meshes {
        for index in used_textures(&materials[mesh.material as usize], scene.shading) {
            let slot = &mut scene.textures[index as usize];
            if slot.is_none() {
                let texture = &scene.scene.textures[index as usize];
                *slot = Some(Arc::new(decode_texture(texture, index as usize)?));
            }
        }
    }
    let emits = |materials: &[Material]| -> Vec<bool> { materials.iter().map(can_emit).collect() };
    let others_emit = emits(&materials) != emits(&scene.materials);
    scene.materials = materials;
    if others_emit {
        scene.emissive = emissive(scene);
    }
    Ok(())
}

fn can_emit(material: &Material) -> bool {
    material.unlit || material.emission.max_element() > 0.0
}

fn check(
    from: impl Fn() -> String,
    kind: &'static str,
    index: u32,
    count: usize,
) -> Result<(), TracedSceneError> {
    if (index as usize) < count {
        return Ok(());
    }
    Err(TracedSceneError::Reference {
        from: from(),
        kind,
        index,
        count,
    })
}

fn check_references(scene: &Scene) -> Result<(), TracedSceneError> {
    for (at, instance) in scene.instances.iter().enumerate() {
        check(
            || format!("instance {at}"),
            "mesh",
            instance.mesh,
            scene.meshes.len(),
        )?;
    }
    for (at, mesh) in scene.meshes.iter().enumerate() {
        let from = || format!("mesh {at}");
        check(from, "material", mesh.material, scene.materials.len())?;
        let expected = mesh.positions.len();
        for &vertex in mesh.triangles.iter().flatten() {
            check(from, "vertex", vertex, expected)?;
        }
        let lengths = [
            ("normals", mesh.normals.len()),
            ("tangents", mesh.tangents.len()),
            ("colours", mesh.colors.len()),
        ];
        let uv_lengths = mesh.uvs.iter().map(|set| ("texture coordinates", set.len()));
        for (attribute, found) in lengths.into_iter().chain(uv_lengths) {
            if found != 0 && found != expected {
                return Err(TracedSceneError::AttributeLength {
                    mesh: at,
                    attribute,
                    found,
                    expected,
                });
            }
        }
    }
    for (at, material) in scene.materials.iter().enumerate() {
        check_textures(at, material, scene)?;
    }
    Ok(())
}

fn check_textures(at: usize, material: &Material, scene: &Scene) -> Result<(), TracedSceneError> {
    for usage in used_textures(material, Shading::Full) {
        check(
            || format!("material {at} ('{}')", material.name),
            "texture",
            usage,
            scene.textures.len(),
        )?;
    }
    Ok(())
}

/// Textures that evaluating a material looks up.
fn used_textures(material: &Material, shading: Shading) -> impl Iterator<Item = u32> + '_ {
    let always = [material.base_color_texture, material.emission_texture];
    let full = [
        material.metallic_roughness_texture,
        material.normal_texture,
        material.specular_texture,
        material.bump.map(|bump| bump.texture),
    ];
    let further =
        (material.extensions.iter()).flat_map(|extensions| extensions.textures().map(|usage| *usage));
    let full = full
        .into_iter()
        .chain(further)
        .filter(move |_| shading == Shading::Full);
    always
        .into_iter()
        .chain(full)
        .flatten()
        .map(|usage| usage.texture)
}

fn decode_used_textures(
    scene: &Scene,
    shading: Shading,
) -> Result<Vec<Option<Arc<DecodedTexture>>>, TracedSceneError> {
    let mut used = vec![false; scene.textures.len()];
    for mesh in &scene.meshes {
        for texture in used_textures(&scene.materials[mesh.material as usize], shading) {
            used[texture as usize] = true;
        }
    }
    let decoded: Vec<_> = scene
        .textures
        .par_iter()
        .zip(&used)
        .enumerate()
        .map(|(index, (texture, &used))| {
            used.then(|| decode_texture(texture, index).map(Arc::new))
                .transpose()
        })
        .collect();
    // The first error in order, whichever thread found one first.
    Ok(decoded.into_iter().collect::<Result<_, _>>()?)
}

struct Expanded {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    instances: Vec<TracedInstance>,
    instance_of_triangle: Vec<u32>,
}

fn expand(
    scene: &Scene,
    shading: Shading,
    textures: &[Option<Arc<DecodedTexture>>],
) -> Result<Expanded, TracedSceneError> {
    let count = |of: fn(&Mesh) -> usize| -> Result<usize, TracedSceneError> {
        let total: u64 = scene
            .instances
            .iter()
            .map(|instance| of(&scene.meshes[instance.mesh as usize]) as u64)
            .sum();
        u32::try_from(total)
            .map(|total| total as usize)
            .map_err(|_| TracedSceneError::TooLarge)
    };
    let mut positions = Vec::with_capacity(count(|mesh| mesh.positions.len())?);
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(count(|mesh| mesh.triangles.len())?);
    let mut instance_of_triangle = Vec::with_capacity(triangles.capacity());
    let mut instances = Vec::with_capacity(scene.instances.len());
    let solid: Vec<bool> = (scene.meshes.iter())
        .map(|mesh| {
            let material = &scene.materials[mesh.material as usize];
            shading == Shading::Full && material.is_solid_glass() && mesh.is_closed()
        })
        .collect();
    for (at, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh as usize];
        let mirrored = instance.world_from_mesh.matrix3.determinant() < 0.0;
        let first_vertex = positions.len() as u32;
        instances.push(TracedInstance {
            first_triangle: triangles.len() as u32,
            mesh: instance.mesh,
            material: mesh.material,
            normal_from_mesh: normal_from_mesh(&instance.world_from_mesh),
            mirrored,
            opaque: is_opaque(mesh, &scene.materials[mesh.material as usize], shading, textures),
            solid: solid[instance.mesh as usize],
        });
        positions.extend(
            mesh.positions
                .iter()
                .map(|&position| instance.world_from_mesh.transform_point3(position)),
        );
        triangles.extend(mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|vertex| first_vertex + vertex);
            if mirrored { [a, c, b] } else { [a, b, c] }
        }));
        instance_of_triangle.resize(triangles.len(), at as u32);
    }
    Ok(Expanded {
        positions,
        triangles,
        instances,
        instance_of_triangle,
    })
}

/// Matrix for normals: the cofactors of the linear part, which is its inverse transposed times the
/// determinant, so that it exists for flattened instances, too; times the determinant's sign, so that fronts
/// stay fronts. Scaled to entries of at most 1, so that no scale under- or overflows.
fn normal_from_mesh(world_from_mesh: &Affine3A) -> Mat3A {
    let m = &world_from_mesh.matrix3;
    let largest = m
        .to_cols_array()
        .iter()
        .fold(0.0f32, |largest, entry| largest.max(entry.abs()));
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis / largest);
    let cofactors = Mat3A::from_cols(y.cross(z), z.cross(x), x.cross(y));
    if x.dot(cofactors.x_axis) < 0.0 {
        -cofactors
    } else {
        cofactors
    }
}

/// Whether no ray gets through anywhere on the mesh, whatever the material calls itself.
fn is_opaque(
    mesh: &Mesh,
    material: &Material,
    shading: Shading,
    textures: &[Option<Arc<DecodedTexture>>],
) -> bool {
    let needed = match material.alpha_mode {
        AlphaMode::Opaque => return true,
        AlphaMode::Pane { .. } => return shading == Shading::Lambert,
        AlphaMode::Mask { cutoff } => cutoff,
        AlphaMode::Blend => 1.0,
    };
    let texture_is_opaque =
        material
            .base_color_texture
            .is_none_or(|usage| match &textures[usage.texture as usize] {
                Some(texture) => !texture.has_alpha(),
                None => true,
            });
    let lowest_vertex_alpha = mesh
        .colors
        .iter()
        .fold(1.0f32, |lowest, color| lowest.min(color.w));
    texture_is_opaque && material.base_color.w * lowest_vertex_alpha >= needed
}
