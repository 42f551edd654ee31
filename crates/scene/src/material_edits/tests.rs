//! Statements about material edits: what they change, when, and how they complain.

use super::*;
use crate::material::{AlphaMode, Texture, Wrap};
use crate::material::{Material, Model};
use crate::scene::{Instance, Mesh, Scene, Variant};
use crate::surface::Surfaces;
use crate::traced::{Shading, TracedScene};
use glam::{Affine3A, Vec2, Vec3, Vec4};
use proptest::prelude::*;
use std::sync::Arc;

/// The square from (−1, −1) to (1, 1) in z = 0 that faces +z, u to the right, v down.
fn square(material: u32, with_uvs: bool) -> Mesh {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(Vec2::from);
    let uvs = corners
        .map(|c| Vec2::new(0.5 + 0.5 * c.x, 0.5 - 0.5 * c.y))
        .to_vec();
    Mesh {
        positions: corners.map(|c| c.extend(0.0)).to_vec(),
        uvs: if with_uvs { vec![uvs] } else { Vec::new() },
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material,
        ..Mesh::default()
    }
}

fn named(name: &str) -> Material {
    Material {
        name: name.into(),
        base_color: Vec4::new(0.5, 0.4, 0.3, 0.9),
        metallic: 0.0,
        roughness: 0.5,
        ..Material::default()
    }
}

fn texture(width: u32, height: u32, pixels: &[[u8; 4]]) -> Texture {
    Texture {
        name: "ramp".into(),
        encoded: crate::texture::png(width, height, pixels),
        wrap: [Wrap::Clamp; 2],
        nearest: false,
    }
}

/// Materials: 0 Wood, 1 Wood, 2 Glass (blended), 3 Sign (unlit), 4 Bare (no coordinates). The texture rises from
/// black to white along u.
fn scene() -> Scene {
    let glass = Material {
        alpha_mode: AlphaMode::Blend,
        ..named("Glass")
    };
    let sign = Material {
        unlit: true,
        ..named("Sign")
    };
    let ramp: Vec<[u8; 4]> = (0..=255u8).map(|v| [v, v, v, 255]).collect();
    Scene {
        meshes: (0..5).map(|i| square(i, i != 4)).collect(),
        instances: vec![Instance {
            mesh: 0,
            world_from_mesh: Affine3A::IDENTITY,
        }],
        materials: vec![named("Wood"), named("Wood"), glass, sign, named("Bare")],
        textures: vec![texture(256, 1, &ramp)],
        ..Scene::default()
    }
}

fn read(edits: &str) -> Result<MaterialEdits, String> {
    let text = format!(r#"{{"relight_materials": 1, "edits": [{edits}]}}"#);
    parse_material_edits(&text, &scene(), "edits.json").map_err(|error| error.to_string())
}

fn at(edits: &str, frame: f64) -> Vec<Material> {
    read(edits).unwrap().at(frame, &scene().materials)
}

#[test]
fn edits_change_what_they_name_and_nothing_else() {
    let before = scene().materials;
    let after = at(
        r#"{"material": "Wood", "base_color": [0.1, 0.2, 0.3], "roughness": 0.7}"#,
        0.0,
    );
    for i in [0, 1] {
        let expected = Material {
            // Alpha stays.
            base_color: Vec4::new(0.1, 0.2, 0.3, 0.9),
            roughness: 0.7,
            ..before[i].clone()
        };
        assert_eq!(after[i], expected);
    }
    assert_eq!(after[2..], before[2..]);
    // By number, only that one.
    let after = at(r#"{"material": 1, "model": "lambert"}"#, 0.0);
    assert_eq!(
        (after[0].model, after[1].model),
        (Model::MetallicRoughness, Model::Lambert)
    );
}

#[test]
fn keys_move_and_later_edits_go_on_from_earlier_ones() {
    let edits = r#"{"material": "Wood", "model": "ward", "roughness_u": {"keys": [[0, 0.1], [10, 0.3]]}},
        {"material": 0, "roughness_v": 0.2, "rotation_deg": 90, "specular": 0.5}"#;
    for (frame, expected) in [(0.0, 0.1), (5.0, 0.2), (10.0, 0.3), (99.0, 0.3)] {
        let Model::Ward {
            specular,
            roughness,
            rotation,
        } = at(edits, frame)[0].model
        else {
            panic!("not Ward");
        };
        assert!((roughness[0] - expected).abs() < 1e-6);
        assert_eq!((roughness[1], specular), (0.2, Vec3::splat(0.5)));
        assert!((rotation - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        // The other one of that name keeps the roughness of the source across.
        let Model::Ward { roughness, .. } = at(edits, frame)[1].model else {
            panic!()
        };
        assert_eq!(roughness[1], 0.5);
    }
    let edits = read(edits).unwrap();
    assert!(edits.touches(0) && edits.moves(0) && edits.moves(1) && !edits.moves_normals(0));
    assert!(!edits.touches(2) && !edits.moves(2));
}

#[test]
fn complaints_say_where_what_and_what_there_is() {
    let cases = [
        (
            r#"{"material": "Tin"}"#,
            "edits[0].material: no material of the asset is \"Tin\"; it has \"Bare\", \"Glass\", \"Sign\", \"Wood\"",
        ),
        (
            r#"{"material": 5}"#,
            "edits[0].material: no material of the asset is 5",
        ),
        (
            r#"{"material": 0.5}"#,
            "edits[0].material: invalid type: floating point `0.5`, expected a name, or a number",
        ),
        (
            r#"{"material": null}"#,
            "edits[0].material: invalid type: null, expected a name, or a number",
        ),
        (r#"{"model": "phong"}"#, "edits[0]: missing field `material`"),
        (
            r#"{"material": "Wood"}, {"material": "Wood", "model": "velvet"}"#,
            "edits[1].model: unknown variant `velvet`, expected one of `metallic_roughness`, `lambert`, `phong`, `ward`",
        ),
        (
            r#"{"material": "Wood", "colour": 1}"#,
            "edits[0].colour: unknown field `colour`, expected one of `material`, `model`, `base_color`, `base_color_texture`, `metallic`, `roughness`",
        ),
        (
            r#"{"material": "Wood", "exponent": 3}"#,
            "edits[0].exponent: no parameter of the model metallic_roughness",
        ),
        (
            r#"{"material": "Wood", "model": "lambert", "roughness": 0.3}"#,
            "edits[0].roughness: no parameter of the model lambert; it has base_color, base_color_texture, normal_texture",
        ),
        (
            r#"{"material": "Wood", "model": "phong", "metallic": 1}"#,
            "edits[0].metallic: no parameter of the model phong",
        ),
        (
            r#"{"material": "Wood", "roughness": 1.5}"#,
            "edits[0].roughness: expected a number from 0 to 1, found 1.5",
        ),
        (
            r#"{"material": "Wood", "base_color": [0, 0, 2]}"#,
            "edits[0].base_color[2]: expected a number from 0 to 1",
        ),
        (
            r#"{"material": "Wood", "base_color": "red"}"#,
            "edits[0].base_color: invalid type: string \"red\", expected a number or 3 numbers (RGB)",
        ),
        (
            r#"{"material": "Wood", "roughness": {"keys": [[0, 0.1], [5, 7]]}}"#,
            "edits[0].roughness.keys[1][1]: expected a number from 0 to 1, found 7",
        ),
        (
            r#"{"material": "Wood", "model": "phong", "exponent": 1e7}"#,
            "edits[0].exponent: expected a number from 0 to 1000000",
        ),
        (
            r#"{"material": "Wood", "model": "phong", "exponent": 5, "roughness": 0.1}"#,
            "edits[0].exponent: either exponent or roughness",
        ),
        (
            r#"{"material": "Wood", "model": "ward", "roughness_u": 0.5, "roughness": 0.1}"#,
            "edits[0].roughness_u: either",
        ),
        (
            r#"{"material": "Glass", "alpha": 0.5}"#,
            "edits[0].alpha: visibility cannot be edited",
        ),
        (
            r#"{"material": "Glass", "base_color_texture": 0}"#,
            "edits[0].base_color_texture: this texture's alpha decides",
        ),
        (
            r#"{"material": "Wood", "base_color_texture": 1}"#,
            "edits[0].base_color_texture: no texture of the asset is 1; it has \"ramp\"",
        ),
        (
            r#"{"material": "Wood", "base_color_texture": [1]}"#,
            "edits[0].base_color_texture: invalid type: sequence, expected a name, or a number",
        ),
        (
            r#"{"material": "Bare", "base_color_texture": "ramp"}"#,
            "edits[0].base_color_texture: the asset has no texture coordinates",
        ),
        (
            r#"{"material": "Wood", "bump_texture": 0}"#,
            "edits[0].bump_texture: it needs a bump_scale",
        ),
        (
            r#"{"material": "Wood", "bump_scale": 0.1}"#,
            "edits[0].bump_scale: it needs a bump_texture",
        ),
        (
            r#"{"material": "Sign", "roughness": 0.1}"#,
            "edits[0].roughness: this material is unlit",
        ),
        (
            r#"{"material": "Wood", "emission": {"keys": [[0, 1]]}}"#,
            "edits[0].emission: no keys here",
        ),
        (
            r#"{"material": "Wood", "emission": -1}"#,
            "edits[0].emission: expected a number from 0 to 1e15",
        ),
        ("3", "edits[0]: invalid type: integer `3`, expected an object"),
    ];
    for (edits, wanted) in cases {
        let message = read(edits).unwrap_err();
        assert!(
            message.starts_with("edits.json: ") && message.contains(wanted),
            "{message}\nlacks\n{wanted}"
        );
    }
    let whole = |text: &str| parse_material_edits(text, &scene(), "e").unwrap_err().to_string();
    assert!(whole("[]").contains("the whole text: invalid type: sequence, expected an object"));
    assert!(whole("{").contains("not valid JSON at line 1"));
    assert!(whole(r#"{"relight_materials": 2, "edits": []}"#).contains("relight_materials: expected 1"));
    assert!(
        whole(r#"{"relight_materials": 1, "edits": {}}"#)
            .contains("edits: invalid type: map, expected a sequence")
    );
}

#[test]
fn what_a_bake_has_fixed_is_refused_by_name() {
    let reflectance = |edits: &str| {
        read(edits)
            .unwrap()
            .refuse_reflectance("fixed")
            .map(|e| e.to_string())
    };
    let refused =
        reflectance(r#"{"material": "Wood", "normal_scale": 0}, {"material": "Wood", "base_color": 0}"#);
    assert_eq!(
        refused.unwrap(),
        "edits.json: edits[1].base_color: fixed (line 1, column 77)"
    );
    let refused = reflectance(r#"{"material": "Wood", "model": "ward", "rotation_deg": 3}"#);
    assert!(refused.unwrap().contains("edits[0].model"));
    assert_eq!(
        reflectance(r#"{"material": "Wood", "normal_scale": 0.5, "emission": 1}"#),
        None
    );
    let emission = read(r#"{"material": "Wood", "emission": 1}"#)
        .unwrap()
        .refuse_emission("gone");
    assert!(emission.unwrap().to_string().contains("edits[0].emission: gone"));
}

fn traced(edits: &str) -> TracedScene {
    let mut traced = TracedScene::new(Arc::new(scene()), Shading::Full).unwrap();
    traced.set_materials(at(edits, 0.0)).unwrap();
    traced
}

/// The first instance's square, `Wood`, at (x, y), which texture coordinate u = (1 + x) / 2 has.
fn point_at(traced: &TracedScene, x: f32, y: f32) -> crate::shading::ShadingPoint {
    let hit = traced.closest_hit(&crate::rays::Ray {
        origin: Vec3::new(x, y, 1.0),
        direction: -Vec3::Z,
        t_min: 0.0,
        t_max: 10.0,
    });
    traced.shading_point(&hit.unwrap())
}

/// A texture that nothing used before is decoded and looked up. Truth: the ramp's texel centres, sRGB to linear.
#[test]
fn newly_used_textures_are_decoded() {
    let plain = traced(r#"{"material": "Wood", "base_color": 1}"#);
    assert_eq!(point_at(&plain, 0.3, 0.2).base_color, Vec3::ONE);
    let textured =
        traced(r#"{"material": "Wood", "base_color": 1, "base_color_texture": "ramp", "model": "lambert"}"#);
    for x in [-0.7f32, 0.1, 0.6] {
        let code = ((0.5 + 0.5 * x) * 256.0 - 0.5) / 255.0;
        let linear = ((code + 0.055) / 1.055).powf(2.4);
        let found = point_at(&textured, x, 0.2).base_color.x;
        assert!((found - linear).abs() < 2e-3, "{x}: {found} {linear}");
    }
    // Roughness is multiplied by green, specular by the texture.
    let rough = traced(r#"{"material": "Wood", "metallic_roughness_texture": 0, "roughness": 0.8}"#);
    let code = (0.75 * 256.0 - 0.5) / 255.0;
    assert!((point_at(&rough, 0.5, 0.2).alpha - (0.8f32 * code).powi(2)).abs() < 1e-3);
}

/// Phong and Ward share out what is not specular: a channel never reflects more than all.
#[test]
fn diffuse_and_specular_factor_stay_within_one() {
    for model in ["phong", "ward"] {
        let t = traced(&format!(
            r#"{{"material": "Wood", "model": "{model}", "base_color": [0.9, 0.2, 1], "specular": [0.3, 0.3, 1]}}"#
        ));
        let p = point_at(&t, 0.1, 0.2);
        assert_eq!((p.f0, p.lambert), (Vec3::new(0.3, 0.3, 1.0), false));
        assert!(
            (p.diffuse - Vec3::new(0.7, 0.2, 0.0)).abs().max_element() < 1e-6,
            "{}",
            p.diffuse
        );
    }
}

/// Ward's tangent follows u, turned by the rotation towards the bitangent (up, v points down).
#[test]
fn the_tangent_follows_the_coordinates() {
    for (degrees, expected) in [
        (0.0, Vec3::X),
        (90.0, Vec3::Y),
        (30.0, Vec3::new(0.75f32.sqrt(), 0.5, 0.0)),
    ] {
        let t = traced(&format!(
            r#"{{"material": "Wood", "model": "ward", "rotation_deg": {degrees}}}"#
        ));
        let crate::shading::Gloss::Ward { tangent, .. } = point_at(&t, 0.1, 0.2).gloss else {
            panic!()
        };
        assert!((tangent - expected).length() < 1e-5, "{degrees}: {tangent}");
    }
}

/// A ramp that rises by 0.3 m over the 2 m of the square leans the normal back by that slope: Blinn 1978 on a plane.
/// Tolerance: the ramp's texels are 8 bits, one code apart.
#[test]
fn a_height_map_leans_the_normal_against_its_slope() {
    let t = traced(r#"{"material": "Wood", "bump_texture": 0, "bump_scale": 0.3}"#);
    let slope = 0.3 * (256.0 / 255.0) / 2.0;
    let expected = Vec3::new(-slope, 0.0, 1.0).normalize();
    let found = point_at(&t, 0.3, -0.2).shading_normal;
    assert!((found - expected).length() < 1e-3, "{found} {expected}");
    // Seen from behind, the same surface.
    let hit = t.surface_at(0, [0.3, 0.3], false);
    assert!((t.shading_point(&hit).shading_normal + expected).length() < 1e-3);
    // A height of nothing leans nothing.
    let t = traced(r#"{"material": "Wood", "bump_texture": 0, "bump_scale": 0}"#);
    assert!((point_at(&t, 0.3, -0.2).shading_normal - Vec3::Z).length() < 1e-6);
}

/// A material that begins to emit becomes an emitter; a clone keeps its own materials.
#[test]
fn clones_keep_their_materials_and_emitters_are_found_again() {
    let plain = TracedScene::new(Arc::new(scene()), Shading::Full).unwrap();
    let mut bright = plain.clone();
    bright
        .set_materials(at(r#"{"material": "Wood", "emission": [1, 2, 3]}"#, 0.0))
        .unwrap();
    assert_eq!(
        (
            plain.emissive_triangles().len(),
            bright.emissive_triangles().len()
        ),
        (0, 2)
    );
    assert_eq!(plain.materials()[0].emission, Vec3::ZERO);
    assert_eq!(bright.emission(0, [0.3, 0.3]), Vec3::new(1.0, 2.0, 3.0));
    assert!(bright.set_materials(Vec::new()).is_err());
}

proptest! {
    /// Any text whatsoever is either read or refused with a message; nothing panics.
    #[test]
    fn mutated_text_never_panics(place in 0usize..400, with in any::<u8>(), cut in 0usize..400) {
        let text = r#"{"relight_materials": 1, "edits": [{"material": "Wood", "model": "ward", "specular": 0.5,
            "roughness_u": {"keys": [[0, 0.1], [9, 1]], "interpolation": "cubic"}, "bump_texture": 0, "bump_scale": 1}]}"#;
        let mut bytes = text.as_bytes().to_vec();
        let place = place % bytes.len();
        bytes[place] = with;
        bytes.truncate(cut.max(1).min(bytes.len()));
        if let Ok(edits) = parse_material_edits(&String::from_utf8_lossy(&bytes), &scene(), "e") {
            let _ = edits.at(3.0, &scene().materials);
        }
    }
}

/// The scene with variants: dark puts Bare in place of the first Wood, clear Glass, lit a textured one.
fn varied() -> Scene {
    let variant = |name: &str, pair: [u32; 2]| Variant {
        name: name.into(),
        materials: vec![pair],
    };
    let mut scene = scene();
    scene.materials[4].base_color = Vec4::new(0.1, 0.1, 0.1, 0.3);
    scene.materials[4].double_sided = true;
    scene.variants = vec![variant("dark", [0, 4]), variant("clear", [0, 2])];
    scene
}

fn parsed(text: &str, scene: &Scene) -> Result<MaterialEdits, String> {
    parse_material_edits(text, scene, "edits.json").map_err(|error| error.to_string())
}

#[test]
fn a_variant_puts_materials_in_place_of_others_and_edits_go_on_from_it() {
    let scene = varied();
    let alone = parsed(r#"{"relight_materials": 1, "variant": "dark"}"#, &scene).unwrap();
    assert!(!alone.is_empty() && alone.touches(0) && !alone.touches(1) && !alone.touches(4));
    let after = alone.at(0.0, &scene.materials);
    let expected = Material {
        name: "Wood".into(),
        ..scene.materials[4].clone()
    };
    assert_eq!(after[0], expected);
    assert_eq!(after[1..], scene.materials[1..]);
    let text = r#"{"relight_materials": 1, "variant": "dark", "edits": [{"material": 0, "roughness": 0.9}]}"#;
    let after = parsed(text, &scene).unwrap().at(0.0, &scene.materials);
    let expected = Material {
        roughness: 0.9,
        ..expected
    };
    assert_eq!(after[0], expected);
}

#[test]
fn wrong_variants_are_answered_with_what_there_is_and_what_helps() {
    let chosen = |name: &str| format!(r#"{{"relight_materials": 1, "variant": "{name}"}}"#);
    for (scene, name, told) in [
        (
            varied(),
            "Dark",
            &["variant: no variant of the asset is \"Dark\"; it has \"clear\", \"dark\""][..],
        ),
        (
            scene(),
            "dark",
            &[
                "variant: the asset has no variants",
                "--variant",
                "--lambert",
                "--solution",
            ],
        ),
        (
            varied(),
            "clear",
            &[
                "in place of \"Wood\" it puts \"Glass\"",
                "bake with --variant \"clear\"",
            ],
        ),
    ] {
        let error = parsed(&chosen(name), &scene).unwrap_err();
        for part in told {
            assert!(error.contains(part), "{error}");
        }
    }
    assert!(parsed(r#"{"relight_materials": 1, "variant": 3}"#, &varied()).is_err());
    // Pairs of a damaged scene change nothing.
    let mut damaged = varied();
    damaged.variants[0].materials = vec![[9, 0], [0, 9]];
    let edits = parsed(&chosen("dark"), &damaged).unwrap();
    assert_eq!(edits.at(0.0, &damaged.materials), damaged.materials);
}

/// Of a pane the colour, too, decides what passes.
#[test]
fn variants_may_not_change_what_panes_let_pass() {
    let mut scene = varied();
    let pane = Material {
        alpha_mode: AlphaMode::Pane { transmission: 1.0 },
        ..named("Pane")
    };
    scene.materials[0] = pane.clone();
    let text = r#"{"relight_materials": 1, "variant": "dark"}"#;
    for (by, fits) in [
        (
            Material {
                roughness: 0.1,
                ..pane.clone()
            },
            true,
        ),
        (
            Material {
                base_color: Vec4::ONE,
                ..pane.clone()
            },
            false,
        ),
        (
            Material {
                metallic: 1.0,
                ..pane.clone()
            },
            false,
        ),
        (
            Material {
                alpha_mode: AlphaMode::Pane { transmission: 0.5 },
                ..pane.clone()
            },
            false,
        ),
        (
            Material {
                alpha_mode: AlphaMode::Opaque,
                ..pane.clone()
            },
            false,
        ),
    ] {
        scene.materials[4] = by;
        assert_eq!(parsed(text, &scene).is_ok(), fits, "{:?}", scene.materials[4]);
    }
}
