//! KHR_materials_ior, _specular, _clearcoat, _sheen, _anisotropy and _iridescence in hand-made files: what is read, and what it is at
//! a point.
#![cfg(feature = "gltf")]

mod gltf_support;

use glam::Vec3;
use gltf_support::Doc;
use relight_scene::image::{Image8, encode_png};
use relight_scene::material::Extensions;
use relight_scene::scene::Scene;
use relight_scene::shading::{Gloss, ShadingPoint};
use relight_scene::traced::{Shading, TracedScene};
use serde_json::{Value, json};
use std::sync::Arc;

/// A triangle with coordinates, images of one texel as textures, and a white dielectric with extensions.
fn with(texels: &[[u8; 4]], extensions: Value) -> Doc {
    let mut doc = Doc::triangle();
    let uv = doc.floats(&[0., 0., 1., 0., 0., 1.], "VEC2");
    let primitive = json!({ "attributes": { "POSITION": 0, "TEXCOORD_0": uv }, "material": 0 });
    doc.set("/meshes/0/primitives/0", primitive);
    for key in ["images", "textures"] {
        doc.set(&format!("/{key}"), json!([]));
    }
    for texel in texels {
        let image = Image8 {
            width: 1,
            height: 1,
            rgba8: vec![*texel],
        };
        let view = doc.view(&encode_png("t", &image).unwrap());
        let source = doc.push("/images", json!({ "bufferView": view, "mimeType": "image/png" }));
        doc.push("/textures", json!({ "source": source }));
    }
    let names: Vec<&String> = extensions.as_object().unwrap().keys().collect();
    doc.set("/extensionsRequired", json!(names));
    let pbr = json!({ "metallicFactor": 0, "roughnessFactor": 0.5 });
    doc.set(
        "/materials",
        json!([{ "pbrMetallicRoughness": pbr, "extensions": extensions }]),
    );
    doc
}

fn extensions(scene: &Scene) -> Extensions {
    *scene.materials[0].extensions.clone().expect("extensions")
}

fn point(scene: Scene) -> ShadingPoint {
    let traced = TracedScene::new(Arc::new(scene), Shading::Full).unwrap();
    let hit = traced.surface_at(0, [0.3, 0.3], true);
    traced.shading_point(&hit)
}

/// What a texel's channel is, sRGB or not.
fn srgb(code: u8) -> f32 {
    let x = f32::from(code) / 255.0;
    if x <= 0.04045 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

#[test]
fn index_and_specular_change_what_a_dielectric_mirrors() {
    let texels = [[255, 255, 255, 128], [255, 188, 0, 255]];
    let scene = with(
        &texels,
        json!({
            "KHR_materials_ior": { "ior": 2.0 },
            "KHR_materials_specular": { "specularFactor": 0.8, "specularTexture": { "index": 0 },
                "specularColorFactor": [0.5, 1.0, 1.0], "specularColorTexture": { "index": 1 } }
        }),
    )
    .scene();
    let strength = 0.8 * 128.0 / 255.0;
    let f0 = Vec3::new(0.5, srgb(188), 0.0) * (strength / 9.0);
    let found = point(scene);
    assert!((found.f0 - f0).abs().max_element() < 1e-5, "{} {f0}", found.f0);
    assert!((found.f90 - strength).abs() < 1e-6);
    let veil = found.veil.unwrap();
    assert!((veil[0] - f0.max_element()).abs() < 1e-5 && veil[1] == found.f90);
    // An index of 0 mirrors all, whatever the colour asks for beyond that.
    let scene = with(&[], json!({ "KHR_materials_ior": { "ior": 0 } })).scene();
    assert_eq!(point(scene).f0, Vec3::ONE);
    // What changes nothing is nothing.
    let scene = with(
        &[],
        json!({ "KHR_materials_ior": { "ior": 1.5 }, "KHR_materials_specular": {} }),
    )
    .scene();
    assert_eq!(scene.materials[0].extensions, None);
}

#[test]
fn clearcoat_and_sheen_lie_over_the_rest() {
    let texels = [
        [128, 0, 0, 255],
        [0, 64, 0, 255],
        [255, 0, 188, 51],
        [128, 255, 255, 255],
    ];
    let scene = with(
        &texels,
        json!({
            "KHR_materials_clearcoat": { "clearcoatFactor": 0.9, "clearcoatTexture": { "index": 0 },
                "clearcoatRoughnessFactor": 0.8, "clearcoatRoughnessTexture": { "index": 1 },
                "clearcoatNormalTexture": { "index": 3, "scale": 0.5 } },
            "KHR_materials_sheen": { "sheenColorFactor": [1.0, 0.5, 0.25], "sheenColorTexture": { "index": 2 },
                "sheenRoughnessFactor": 0.5, "sheenRoughnessTexture": { "index": 2 } }
        }),
    )
    .scene();
    assert_eq!(extensions(&scene).clearcoat_normal_scale, 0.5);
    let found = point(scene);
    let layers = found.layers.unwrap();
    let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-5, "{a} {b}");
    near(layers.coat, 0.9 * 128.0 / 255.0);
    near(layers.coat_alpha, (0.8 * 64.0 / 255.0f32).powi(2));
    near(layers.sheen.x, 1.0);
    near(layers.sheen.y, 0.0);
    near(layers.sheen.z, 0.25 * srgb(188));
    near(layers.sheen_alpha, (0.5f32 * 0.2).powi(2));
    // The clearcoat's own map leans its normal towards +v by half the way, the surface's has none.
    let lean = layers.coat_normal.dot(found.shading_normal);
    near(lean, 1.0 / (1.0f32 + 0.25).sqrt() * 1.0);
    assert_eq!(found.shading_normal, found.normal);
}

#[test]
fn anisotropy_widens_the_lobe_along_its_direction() {
    // Along the bitangent (green 1), turned by a right angle: against the tangent.
    let scene = with(
        &[[128, 255, 128, 255]],
        json!({ "KHR_materials_anisotropy": { "anisotropyStrength": 1.0, "anisotropyRotation": std::f32::consts::FRAC_PI_2,
            "anisotropyTexture": { "index": 0 } } }),
    )
    .scene();
    let Gloss::GgxAnisotropic { alpha, tangent } = point(scene).gloss else {
        panic!("no anisotropic lobe");
    };
    let strength = 128.0f32 / 255.0;
    assert!(
        (alpha[0] - (0.25 + 0.75 * strength * strength)).abs() < 1e-5 && (alpha[1] - 0.25).abs() < 1e-6,
        "{alpha:?}"
    );
    // The coordinates rise along the triangle's x.
    assert!(tangent.dot(Vec3::NEG_X) > 0.9999, "{tangent}");
}

#[test]
fn films_colour_what_is_mirrored_and_say_that_it_is_a_mean() {
    let film = json!({ "KHR_materials_iridescence": { "iridescenceFactor": 1.0, "iridescenceIor": 2.0,
        "iridescenceThicknessMinimum": 100.0, "iridescenceThicknessMaximum": 500.0, "iridescenceThicknessTexture": { "index": 0 } } });
    let scene = with(&[[0, 128, 0, 255]], film).scene();
    assert!(
        scene
            .notes
            .iter()
            .any(|note| note.contains("mean of their colours")),
        "{:?}",
        scene.notes
    );
    let found = point(scene);
    assert!(
        found.f0.min_element() > 0.04 && found.f0.max_element() > 1.1 * found.f0.min_element(),
        "{}",
        found.f0
    );
    assert_eq!(found.veil, Some([found.f0.max_element(), 1.0]));
}

#[test]
fn what_is_out_of_range_is_clamped_with_a_note_and_what_is_switched_off_is_nothing() {
    let scene = with(
        &[],
        json!({
            "KHR_materials_ior": { "ior": 0.5 },
            "KHR_materials_clearcoat": { "clearcoatFactor": 7, "clearcoatRoughnessFactor": -1 },
            "KHR_materials_iridescence": { "iridescenceFactor": 1, "iridescenceThicknessMaximum": -5 }
        }),
    )
    .scene();
    let e = extensions(&scene);
    assert_eq!((e.ior, e.clearcoat, e.clearcoat_roughness), (1.0, 1.0, 0.0));
    assert_eq!(e.iridescence_thickness[1], 0.0);
    for note in [
        "indices of refraction",
        "clearcoatFactor",
        "clearcoatRoughnessFactor",
        "thicknesses of films",
    ] {
        assert!(
            scene
                .notes
                .iter()
                .any(|n| n.contains(note) && n.contains("clamped")),
            "{note}: {:?}",
            scene.notes
        );
    }
    let off = json!({
        "KHR_materials_clearcoat": { "clearcoatRoughnessFactor": 0.5 }, "KHR_materials_sheen": { "sheenRoughnessFactor": 0.5 },
        "KHR_materials_anisotropy": { "anisotropyRotation": 1 }, "KHR_materials_iridescence": { "iridescenceIor": 1.8 }
    });
    assert_eq!(with(&[], off).scene().materials[0].extensions, None);
    // A texture that is not there is a fault with its place.
    let error = with(&[], json!({ "KHR_materials_sheen": { "sheenColorFactor": [1, 1, 1], "sheenColorTexture": { "index": 3 } } }))
        .import()
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("materials[0].extensions.KHR_materials_sheen.sheenColorTexture.index"),
        "{error}"
    );
}
