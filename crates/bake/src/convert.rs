//! A scene as the asset stores it.
//!
//! Only `format` knows bytes: this is the one place where the scene's types become the file's. `play` has the
//! way back.

use glam::{Affine2, Vec3, Vec4};
use relight_format as format;
use relight_scene::camera::CameraTrack;
use relight_scene::material::{AlphaMode, Extensions, Material, Texture, TextureUse, Wrap};
use relight_scene::scene::{Instance, Mesh, Scene, Variant};
use relight_scene::sequence::{camera_to_json, stage_to_json};

/// Meshes and instances.
pub fn geometry(scene: &Scene) -> format::Geometry {
    format::Geometry {
        meshes: scene.meshes.iter().map(mesh).collect(),
        instances: scene.instances.iter().map(instance).collect(),
    }
}

/// Most bytes of a setting that names many things: more is no longer read at a glance, as provenance is.
pub const MOST_OF_NAMES: usize = 1 << 20;

/// Names of instances as the setting `objects` has them, line by line; `None` if none has a name, or all are too long together.
pub fn object_lines(names: &[String]) -> Option<String> {
    let lines: Vec<String> = (names.iter())
        .map(|name| name.replace(char::is_control, " "))
        .collect();
    let text = lines.join("\n");
    (names.iter().any(|name| !name.is_empty()) && text.len() <= MOST_OF_NAMES).then_some(text)
}

/// Variants of materials as the setting `variants` has them, line by line; `None` if there are none, or all are too long together.
pub fn variant_lines(variants: &[Variant]) -> Option<String> {
    let line = |variant: &Variant| {
        let pairs: Vec<String> = (variant.materials.iter())
            .map(|[of, by]| format!("{of}={by}"))
            .collect();
        let name = variant.name.replace(char::is_control, " ");
        format!("{}: {name}", pairs.join(" "))
    };
    let lines: Vec<String> = variants.iter().map(line).collect();
    let text = lines.join("\n");
    (!lines.is_empty() && text.len() <= MOST_OF_NAMES).then_some(text)
}

/// Materials, in the scene's order.
pub fn materials(scene: &Scene) -> Vec<format::Material> {
    scene.materials.iter().map(material).collect()
}

/// What further extensions say of the materials that have any.
pub fn material_extensions(scene: &Scene) -> Vec<format::MaterialExtensions> {
    (0u32..)
        .zip(&scene.materials)
        .filter_map(|(index, material)| Some(extensions(index, material.extensions.as_ref()?)))
        .collect()
}

/// What further extensions say of the panes that have any.
pub fn material_glass(scene: &Scene) -> Vec<format::MaterialGlass> {
    let glass = |(index, material): (u32, &Material)| {
        let e = material.extensions.as_ref()?;
        e.have_glass().then(|| format::MaterialGlass {
            material: index,
            thickness: e.thickness,
            absorption: e.absorption.to_array(),
            transmission_texture: e.transmission_texture.map(|usage| Box::new(texture_ref(usage))),
        })
    };
    (0u32..).zip(&scene.materials).filter_map(glass).collect()
}

/// Images with their samplers, in the scene's order.
pub fn textures(scene: &Scene) -> Vec<format::Texture> {
    scene.textures.iter().map(texture).collect()
}

/// Cameras and the scene's own lights.
pub fn stage(scene: &Scene) -> format::Stage {
    format::Stage {
        json: stage_to_json(&scene.cameras, &scene.sequence),
    }
}

/// Names that tell cameras apart, with spaces between them: hashes of what the file says of each.
pub fn camera_hashes(tracks: &[&CameraTrack]) -> String {
    let hash = |track: &&CameraTrack| {
        let text = camera_to_json(track);
        format!("{:016x}", format::content_hash(text.as_bytes()))
    };
    tracks.iter().map(hash).collect::<Vec<_>>().join(" ")
}

fn mesh(mesh: &Mesh) -> format::Mesh {
    fn some<T>(values: Vec<T>) -> Option<Vec<T>> {
        (!values.is_empty()).then_some(values)
    }
    format::Mesh {
        positions: mesh.positions.iter().map(Vec3::to_array).collect(),
        normals: some(mesh.normals.iter().map(|n| unit(*n).to_array()).collect()),
        uvs: mesh
            .uvs
            .iter()
            .map(|set| set.iter().map(|uv| uv.to_array()).collect())
            .collect(),
        colors: some(mesh.colors.iter().map(Vec4::to_array).collect()),
        tangents: some(mesh.tangents.iter().map(|t| tangent(*t)).collect()),
        triangles: mesh.triangles.clone(),
        material: mesh.material,
    }
}

/// Files have zero normals on collapsed triangles, which no ray ever hits: any unit vector does.
fn unit(v: Vec3) -> Vec3 {
    v.try_normalize().unwrap_or(Vec3::Y)
}

fn tangent(t: Vec4) -> [f32; 4] {
    unit(t.truncate())
        .extend(if t.w < 0.0 { -1.0 } else { 1.0 })
        .to_array()
}

fn instance(instance: &Instance) -> format::Instance {
    let m = instance.world_from_mesh;
    let [x, y, z, t] = [
        m.matrix3.x_axis,
        m.matrix3.y_axis,
        m.matrix3.z_axis,
        m.translation,
    ]
    .map(|v| v.to_array());
    let row = |i: usize| [x[i], y[i], z[i], t[i]];
    let mut rows = [0.0; 12];
    for i in 0..3 {
        rows[4 * i..4 * i + 4].copy_from_slice(&row(i));
    }
    format::Instance {
        mesh: instance.mesh,
        world_from_mesh: rows,
    }
}

fn material(material: &Material) -> format::Material {
    format::Material {
        name: material.name.clone(),
        base_color: material.base_color.to_array(),
        metallic: material.metallic,
        roughness: material.roughness,
        emissive: material.emission.to_array(),
        alpha_mode: match material.alpha_mode {
            AlphaMode::Opaque => format::AlphaMode::Opaque,
            AlphaMode::Mask { cutoff } => format::AlphaMode::Mask(cutoff),
            AlphaMode::Blend => format::AlphaMode::Blend,
            AlphaMode::Pane { transmission } => format::AlphaMode::Pane(transmission),
        },
        double_sided: material.double_sided,
        unlit: material.unlit,
        normal_scale: material.normal_scale,
        base_color_texture: material.base_color_texture.map(texture_ref),
        metallic_roughness_texture: material.metallic_roughness_texture.map(texture_ref),
        normal_texture: material.normal_texture.map(texture_ref),
        emissive_texture: material.emission_texture.map(texture_ref),
    }
}

fn extensions(material: u32, e: &Extensions) -> format::MaterialExtensions {
    let texture = |usage: Option<TextureUse>| usage.map(|usage| Box::new(texture_ref(usage)));
    format::MaterialExtensions {
        material,
        ior: e.ior,
        specular: e.specular,
        specular_color: e.specular_color.to_array(),
        clearcoat: e.clearcoat,
        clearcoat_roughness: e.clearcoat_roughness,
        clearcoat_normal_scale: e.clearcoat_normal_scale,
        sheen_color: e.sheen_color.to_array(),
        sheen_roughness: e.sheen_roughness,
        anisotropy: e.anisotropy,
        anisotropy_rotation: e.anisotropy_rotation,
        iridescence: e.iridescence,
        iridescence_ior: e.iridescence_ior,
        iridescence_thickness: e.iridescence_thickness,
        specular_texture: texture(e.specular_texture),
        specular_color_texture: texture(e.specular_color_texture),
        clearcoat_texture: texture(e.clearcoat_texture),
        clearcoat_roughness_texture: texture(e.clearcoat_roughness_texture),
        clearcoat_normal_texture: texture(e.clearcoat_normal_texture),
        sheen_color_texture: texture(e.sheen_color_texture),
        sheen_roughness_texture: texture(e.sheen_roughness_texture),
        anisotropy_texture: texture(e.anisotropy_texture),
        iridescence_texture: texture(e.iridescence_texture),
        iridescence_thickness_texture: texture(e.iridescence_thickness_texture),
    }
}

fn texture_ref(usage: TextureUse) -> format::TextureRef {
    let Affine2 {
        matrix2: m,
        translation: t,
    } = usage.texture_from_mesh;
    format::TextureRef {
        texture: usage.texture,
        // Sets are renumbered to those in use, of which there are at most eight.
        uv_set: u8::try_from(usage.uv_set).unwrap_or(u8::MAX),
        transform: [m.x_axis.x, m.y_axis.x, t.x, m.x_axis.y, m.y_axis.y, t.y],
    }
}

fn texture(texture: &Texture) -> format::Texture {
    // JPEG files start with the marker SOI, FF D8; whatever else is decoded is PNG.
    let mime = if texture.encoded.starts_with(&[0xff, 0xd8]) {
        "image/jpeg"
    } else {
        "image/png"
    };
    let [u, v] = texture.wrap.map(|wrap| match wrap {
        Wrap::Repeat => format::Wrap::Repeat,
        Wrap::Mirror => format::Wrap::MirroredRepeat,
        Wrap::Clamp => format::Wrap::ClampToEdge,
    });
    format::Texture {
        bytes: texture.encoded.clone(),
        mime: mime.into(),
        wrap_u: u,
        wrap_v: v,
        filter: if texture.nearest {
            format::Filter::Nearest
        } else {
            format::Filter::Linear
        },
    }
}
