//! KHR_materials_pbrSpecularGlossiness and EXT_texture_webp in hand-made files.
#![cfg(feature = "gltf")]

mod gltf_support;

use glam::{Vec3, Vec4};
use gltf_support::Doc;
use relight_scene::image::{Image8, Limits, decode_ldr, encode_png};
use relight_scene::scene::Scene;
use serde_json::{Value, json};

fn image(width: usize, height: usize, rgba8: &[[u8; 4]]) -> Image8 {
    Image8 {
        width,
        height,
        rgba8: rgba8.to_vec(),
    }
}

/// A triangle with coordinates, the images as textures and a specular-glossiness material.
fn glossy(images: &[Image8], material: Value) -> Doc {
    let mut doc = Doc::triangle();
    let uv = doc.floats(&[0.; 6], "VEC2");
    let primitive = json!({ "attributes": { "POSITION": 0, "TEXCOORD_0": uv }, "material": 0 });
    doc.set("/meshes/0/primitives/0", primitive);
    for key in ["images", "textures"] {
        doc.set(&format!("/{key}"), json!([]));
    }
    for image in images {
        let view = doc.view(&encode_png("t", image).unwrap());
        let source = doc.push("/images", json!({ "bufferView": view, "mimeType": "image/png" }));
        doc.push("/textures", json!({ "source": source }));
    }
    doc.set(
        "/extensionsRequired",
        json!(["KHR_materials_pbrSpecularGlossiness"]),
    );
    doc.set(
        "/materials",
        json!([{
            "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 1, 1], "baseColorTexture": { "index": 0 } },
            "extensions": { "KHR_materials_pbrSpecularGlossiness": material },
        }]),
    );
    doc
}

fn texture(scene: &Scene, index: u32) -> Image8 {
    decode_ldr("t", &scene.textures[index as usize].encoded, &Limits::default()).unwrap()
}

/// Truth: a dielectric (specular 0.04) keeps its diffuse colour; a black diffuse with a coloured specular is a metal of
/// that colour; roughness is one less glossiness.
#[test]
fn factors_of_dielectrics_and_metals_are_converted() {
    let scene = glossy(
        &[],
        json!({ "diffuseFactor": [0.6, 0.3, 0.1, 0.5], "specularFactor": [0.04, 0.04, 0.04], "glossinessFactor": 0.75 }),
    );
    let scene = {
        let mut doc = scene;
        doc.json["materials"][0]["pbrMetallicRoughness"] = json!({});
        doc.scene()
    };
    let material = &scene.materials[0];
    assert!(
        material
            .base_color
            .abs_diff_eq(Vec4::new(0.6, 0.3, 0.1, 0.5), 1e-6),
        "{material:?}"
    );
    assert!(material.metallic.abs() < 1e-6 && (material.roughness - 0.25).abs() < 1e-6);
    let mut doc = glossy(
        &[],
        json!({ "diffuseFactor": [0, 0, 0, 1], "specularFactor": [0.9, 0.6, 0.3] }),
    );
    doc.json["materials"][0]["pbrMetallicRoughness"] = json!({});
    let material = doc.scene().materials[0].clone();
    assert!(
        material
            .base_color
            .truncate()
            .abs_diff_eq(Vec3::new(0.9, 0.6, 0.3), 1e-6),
        "{material:?}"
    );
    assert!((material.metallic - 1.0).abs() < 1e-6 && material.roughness == 0.0);
}

/// The same truths texel by texel: the left half is a dielectric, the right half a metal. The maps differ in size.
#[test]
fn textures_are_converted_texel_by_texel() {
    // sRGB code 56 is 0.0395 in linear light, as near to a dielectric's 0.04 as bytes come.
    let diffuse = image(
        4,
        1,
        &[
            [200, 100, 50, 255],
            [200, 100, 50, 128],
            [0, 0, 0, 255],
            [0, 0, 0, 255],
        ],
    );
    let specular = image(2, 1, &[[56, 56, 56, 255], [250, 200, 100, 51]]);
    let material = json!({ "diffuseTexture": { "index": 0 }, "specularGlossinessTexture": { "index": 1 } });
    let scene = glossy(&[diffuse, specular], material).scene();
    let material = &scene.materials[0];
    assert_eq!(
        (material.base_color, material.metallic, material.roughness),
        (Vec4::ONE, 1.0, 1.0)
    );
    let (base, rough) = (
        material.base_color_texture.unwrap(),
        material.metallic_roughness_texture.unwrap(),
    );
    let (base, rough) = (texture(&scene, base.texture), texture(&scene, rough.texture));
    let near = |found: [u8; 4], expected: [u8; 4]| {
        let far = found.iter().zip(expected).any(|(f, e)| f.abs_diff(e) > 1);
        assert!(!far, "{found:?} for {expected:?}");
    };
    for (i, (color, data)) in [
        ([200, 100, 50, 255], [0, 0, 0, 255]),
        ([200, 100, 50, 128], [0, 0, 0, 255]),
        ([250, 200, 100, 255], [0, 204, 255, 255]),
        ([250, 200, 100, 255], [0, 204, 255, 255]),
    ]
    .into_iter()
    .enumerate()
    {
        near(base.rgba8[i], color);
        near(rough.rgba8[i], data);
    }
}

#[test]
fn maps_that_lie_differently_are_converted_each_with_the_others_mean() {
    let grey = image(1, 1, &[[128, 128, 128, 255]]);
    let specular = image(
        2,
        2,
        &[
            [56, 56, 56, 0],
            [56, 56, 56, 255],
            [56, 56, 56, 0],
            [56, 56, 56, 255],
        ],
    );
    let turned = json!({ "index": 1, "extensions": { "KHR_texture_transform": { "scale": [2, 2] } } });
    let material = json!({ "diffuseTexture": { "index": 0 }, "specularGlossinessTexture": turned });
    let scene = glossy(&[grey, specular], material).scene();
    assert!(
        scene.notes.iter().any(|note| note.contains("converted by means")),
        "{:?}",
        scene.notes
    );
    let material = &scene.materials[0];
    let rough = material.metallic_roughness_texture.unwrap();
    assert_eq!(rough.texture_from_mesh.matrix2.x_axis.x, 2.0);
    let data: Vec<u8> = texture(&scene, rough.texture)
        .rgba8
        .iter()
        .map(|texel| texel[1])
        .collect();
    assert_eq!(data, [255, 0, 255, 0]);
    let base = texture(&scene, material.base_color_texture.unwrap().texture).rgba8;
    assert!(base.len() == 1 && base[0][0].abs_diff(128) <= 1, "{base:?}");
}

/// A WebP file of one red pixel, lossless: written by hand after RFC 9649. Five Huffman codes of one symbol each, so that
/// the pixel takes no bits.
fn red_webp() -> Vec<u8> {
    let mut bits = Vec::new();
    let mut put = |value: u32, count: u32| (0..count).for_each(|i| bits.push(value >> i & 1 != 0));
    put(0, 14); // width − 1
    put(0, 14); // height − 1
    put(0, 1); // alpha is not used
    put(0, 3); // version
    put(0, 1); // no transform
    put(0, 1); // no colour cache
    put(0, 1); // one group of codes
    for symbol in [0u32, 255, 0, 255, 0] {
        // Green, red, blue, alpha, distance: a simple code of one symbol of eight bits.
        put(1, 1);
        put(0, 1);
        put(1, 1);
        put(symbol, 8);
    }
    let mut data = vec![0x2f];
    data.extend(bits.chunks(8).map(|byte| {
        byte.iter()
            .enumerate()
            .fold(0u8, |b, (i, bit)| b | u8::from(*bit) << i)
    }));
    let length = data.len() as u32;
    data.resize(data.len().next_multiple_of(2), 0);
    let mut file = b"RIFF".to_vec();
    file.extend((12 + data.len() as u32).to_le_bytes());
    file.extend(b"WEBPVP8L");
    file.extend(length.to_le_bytes());
    file.extend(data);
    file
}

#[test]
fn webp_textures_are_read_where_there_is_no_other() {
    let mut doc = glossy(&[image(1, 1, &[[0, 255, 0, 255]])], json!({}));
    let view = doc.view(&red_webp());
    let webp = doc.push("/images", json!({ "bufferView": view, "mimeType": "image/webp" }));
    doc.push(
        "/textures",
        json!({ "extensions": { "EXT_texture_webp": { "source": webp } } }),
    );
    doc.push(
        "/textures",
        json!({ "source": 0, "extensions": { "EXT_texture_webp": { "source": webp } } }),
    );
    doc.set("/extensionsRequired", json!(["EXT_texture_webp"]));
    for (index, expected) in [(1, [255, 0, 0, 255]), (2, [0, 255, 0, 255])] {
        let material = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": index } } }]);
        let scene = doc.set("/materials", material).scene();
        let used = scene.materials[0].base_color_texture.unwrap().texture;
        assert_eq!(texture(&scene, used).rgba8, [expected]);
    }
}
