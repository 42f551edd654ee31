//! From the asset's arrays back to the scene's types: the counterpart of `relight_bake::convert`.

use glam::{Affine2, Affine3A, Mat2, Mat3A, Vec2, Vec3, Vec3A, Vec4};
use relight_format as format;
use relight_scene::material::{AlphaMode, Extensions, Material, Texture, TextureUse, Wrap};
use relight_scene::scene::{Instance, Mesh, Variant};

/// Meshes, in the asset's order. Takes the arrays over where their layout allows.
pub fn meshes(meshes: Vec<format::Mesh>) -> Vec<Mesh> {
    meshes.into_iter().map(mesh).collect()
}

fn mesh(mesh: format::Mesh) -> Mesh {
    let vectors = |values: Vec<[f32; 3]>| values.into_iter().map(Vec3::from).collect();
    let four = |values: Vec<[f32; 4]>| values.into_iter().map(Vec4::from).collect();
    Mesh {
        positions: vectors(mesh.positions),
        normals: mesh.normals.map(vectors).unwrap_or_default(),
        tangents: mesh.tangents.map(four).unwrap_or_default(),
        uvs: mesh
            .uvs
            .into_iter()
            .map(|set| set.into_iter().map(Vec2::from).collect())
            .collect(),
        colors: mesh.colors.map(four).unwrap_or_default(),
        triangles: mesh.triangles,
        material: mesh.material,
    }
}

/// A placed mesh.
pub fn instance(instance: &format::Instance) -> Instance {
    let m = &instance.world_from_mesh;
    let column = |i: usize| Vec3A::new(m[i], m[4 + i], m[8 + i]);
    Instance {
        mesh: instance.mesh,
        world_from_mesh: Affine3A {
            matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
            translation: column(3),
        },
    }
}

/// Variants of so many materials from what the setting says; none if any line is wrong. SPEC 6.1.1.
pub fn variants(lines: &str, materials: usize) -> Vec<Variant> {
    let number = |text: &str| text.parse().ok().filter(|&number| (number as usize) < materials);
    let pair = |text: &str| {
        let (of, by) = text.split_once('=')?;
        Some([number(of)?, number(by)?])
    };
    let variant = |line: &str| {
        let (pairs, name) = line.split_once(": ")?;
        Some(Variant {
            name: name.to_owned(),
            materials: pairs.split_terminator(' ').map(pair).collect::<Option<_>>()?,
        })
    };
    lines
        .split('\n')
        .map(variant)
        .collect::<Option<_>>()
        .unwrap_or_default()
}

/// A material.
pub fn material(material: format::Material) -> Material {
    Material {
        base_color: material.base_color.into(),
        base_color_texture: material.base_color_texture.map(texture_use),
        metallic: material.metallic,
        roughness: material.roughness,
        metallic_roughness_texture: material.metallic_roughness_texture.map(texture_use),
        normal_texture: material.normal_texture.map(texture_use),
        normal_scale: material.normal_scale,
        emission: material.emissive.into(),
        emission_texture: material.emissive_texture.map(texture_use),
        alpha_mode: match material.alpha_mode {
            format::AlphaMode::Opaque => AlphaMode::Opaque,
            format::AlphaMode::Mask(cutoff) => AlphaMode::Mask { cutoff },
            format::AlphaMode::Blend => AlphaMode::Blend,
            format::AlphaMode::Pane(transmission) => AlphaMode::Pane { transmission },
        },
        double_sided: material.double_sided,
        unlit: material.unlit,
        name: material.name,
        ..Material::default()
    }
}

/// What further extensions say of a material.
pub fn extensions(e: format::MaterialExtensions) -> Extensions {
    let texture = |usage: Option<Box<format::TextureRef>>| usage.map(|usage| texture_use(*usage));
    Extensions {
        ior: e.ior,
        specular: e.specular,
        specular_color: e.specular_color.into(),
        clearcoat: e.clearcoat,
        clearcoat_roughness: e.clearcoat_roughness,
        clearcoat_normal_scale: e.clearcoat_normal_scale,
        sheen_color: e.sheen_color.into(),
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
        ..Extensions::default()
    }
}

/// Puts what further extensions say of a pane to those that it has.
pub fn glass(glass: format::MaterialGlass, material: &mut Material) {
    let extensions = material.extensions.get_or_insert_default();
    extensions.thickness = glass.thickness;
    extensions.absorption = glass.absorption.into();
    extensions.transmission_texture = glass.transmission_texture.map(|usage| texture_use(*usage));
}

fn texture_use(usage: format::TextureRef) -> TextureUse {
    let [a, b, tx, c, d, ty] = usage.transform;
    TextureUse {
        texture: usage.texture,
        uv_set: usage.uv_set.into(),
        texture_from_mesh: Affine2 {
            matrix2: Mat2::from_cols(Vec2::new(a, c), Vec2::new(b, d)),
            translation: Vec2::new(tx, ty),
        },
    }
}

/// A texture; the asset keeps no names, so it is called by its number.
pub fn texture((index, texture): (usize, format::Texture)) -> Texture {
    let wrap = |wrap| match wrap {
        format::Wrap::Repeat => Wrap::Repeat,
        format::Wrap::MirroredRepeat => Wrap::Mirror,
        format::Wrap::ClampToEdge => Wrap::Clamp,
    };
    Texture {
        name: format!("texture {index}"),
        encoded: texture.bytes,
        wrap: [wrap(texture.wrap_u), wrap(texture.wrap_v)],
        nearest: texture.filter == format::Filter::Nearest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_are_read_as_bakes_write_them_and_none_where_a_line_is_wrong() {
        let variant = |name: &str, materials: &[[u32; 2]]| Variant {
            name: name.into(),
            materials: materials.to_vec(),
        };
        let read = variants("0=1 2=0: a: b\n: \n1=2: c", 3);
        let expected = [
            variant("a: b", &[[0, 1], [2, 0]]),
            variant("", &[]),
            variant("c", &[[1, 2]]),
        ];
        assert_eq!(read, expected);
        for wrong in [
            "",
            "name",
            "0=1",
            "0=3: a",
            "3=0: a",
            "0: a",
            "=: a",
            "0=1=2: a",
            "-1=0: a",
            "0=1  2=0: a",
            "0=1: a\n",
            "0=99999999999: a",
        ] {
            assert_eq!(variants(wrong, 3), [], "{wrong:?}");
        }
    }
}
