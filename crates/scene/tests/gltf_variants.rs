//! KHR_materials_variants in hand-made files. Independent truth: the extension's specification, worked out by hand.
#![cfg(feature = "gltf")]

mod gltf_support;

use gltf_support::Doc;
use relight_scene::gltf::{ImportError, ImportOptions, import};
use relight_scene::scene::Scene;
use serde_json::json;

/// A shoe of one primitive: leather, at the beach canvas, in snow and at night fur.
fn shoe() -> Doc {
    let mut doc = Doc::triangle();
    doc.set(
        "/materials",
        json!([{ "name": "leather" }, { "name": "canvas" }, { "name": "fur" }]),
    );
    doc.set(
        "/extensions",
        json!({ "KHR_materials_variants": { "variants": [{ "name": "beach" }, { "name": "snow" }, { "name": "night" },
            { "name": "plain" }] } }),
    );
    doc.set("/meshes/0/primitives/0/material", json!(0));
    doc.set(
        "/meshes/0/primitives/0/extensions",
        json!({ "KHR_materials_variants": { "mappings": [
            { "variants": [0], "material": 1 }, { "variants": [1, 2], "material": 2 }] } }),
    );
    doc.set("/extensionsUsed", json!(["KHR_materials_variants"]));
    doc
}

fn shown(doc: &Doc, variant: Option<&str>) -> Result<Scene, ImportError> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("shoe.glb");
    std::fs::write(&file, doc.glb()).unwrap();
    let options = ImportOptions {
        variant: variant.map(str::to_owned),
        ..ImportOptions::default()
    };
    import(&file, &options)
}

#[test]
fn a_variant_gives_primitives_its_materials_and_leaves_others_as_they_are() {
    for (variant, material) in [
        (None, "leather"),
        (Some("beach"), "canvas"),
        (Some("snow"), "fur"),
        (Some("night"), "fur"),
        (Some("plain"), "leather"),
    ] {
        let scene = shown(&shoe(), variant).unwrap();
        assert_eq!(scene.materials[scene.meshes[0].material as usize].name, material);
        let note = &scene.notes[0];
        assert!(
            note.contains(r#"there are "beach", "snow", "night", "plain""#),
            "{note}"
        );
        assert_eq!(note.contains("is imported"), variant.is_some(), "{note}");
    }
}

#[test]
fn an_unknown_variant_is_answered_by_the_names_there_are() {
    let error = shown(&shoe(), Some("Beach")).unwrap_err().to_string();
    assert!(
        error.ends_with(
            r#"shoe.glb: there is no variant "Beach"; choose one of "beach", "snow", "night", "plain""#
        ),
        "{error}"
    );
    let error = shown(&Doc::triangle(), Some("beach")).unwrap_err().to_string();
    assert!(error.contains("the file has none"), "{error}");
}

#[test]
fn broken_mappings_are_told_by_place_if_a_variant_is_wanted() {
    let mapping = "/meshes/0/primitives/0/extensions/KHR_materials_variants/mappings/0";
    let place = "meshes[0].primitives[0].extensions.KHR_materials_variants.mappings[0]";
    for (key, value, what) in [
        (
            "material",
            json!(7),
            format!("{place}.material: is 7, but there are only 3 materials"),
        ),
        (
            "variants",
            json!([9]),
            format!("{place}.variants[0]: is 9, but there are only 4 variants"),
        ),
    ] {
        let mut doc = shoe();
        doc.set(&format!("{mapping}/{key}"), value);
        let scene = shown(&doc, None).unwrap();
        let left_out = "primitives with broken mappings of material variants, which are left out: 1";
        assert!(
            scene.notes.iter().any(|note| note == left_out),
            "{:?}",
            scene.notes
        );
        // What is right of the others stays.
        assert_eq!(scene.variants[1].materials, [[0, 2]]);
        let error = shown(&doc, Some("beach")).unwrap_err().to_string();
        assert!(error.contains(&what), "{error}");
    }
}

#[test]
fn without_a_choice_all_variants_are_kept() {
    let scene = shown(&shoe(), None).unwrap();
    let found: Vec<(&str, &[[u32; 2]])> = (scene.variants.iter())
        .map(|variant| (variant.name.as_str(), variant.materials.as_slice()))
        .collect();
    let expected: [(&str, &[[u32; 2]]); 4] = [
        ("beach", &[[0, 1]]),
        ("snow", &[[0, 2]]),
        ("night", &[[0, 2]]),
        ("plain", &[]),
    ];
    assert_eq!(found, expected);
    assert_eq!(scene.materials.len(), 3);
    // One that is chosen is imported alone.
    assert!(shown(&shoe(), Some("beach")).unwrap().variants.is_empty());
}

/// Four primitives of leather: two that turn to canvas at the beach, one to fur, one stays; and one without a material.
#[test]
fn primitives_that_share_a_material_but_not_what_replaces_it_get_copies() {
    let mut doc = shoe();
    let mapped = |material: usize| json!({ "KHR_materials_variants": { "mappings": [{ "variants": [0], "material": material }] } });
    let attributes = json!({ "POSITION": 0 });
    // Different points, so that no primitive is another one's copy.
    let others: Vec<usize> = (1..5)
        .map(|i| doc.floats(&[0.0, 0.0, i as f32, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3"))
        .collect();
    doc.set(
        "/meshes/0/primitives",
        json!([
            { "attributes": attributes, "material": 0 },
            { "attributes": { "POSITION": others[0] }, "material": 0, "extensions": mapped(1) },
            { "attributes": { "POSITION": others[1] }, "material": 0, "extensions": mapped(1) },
            { "attributes": { "POSITION": others[2] }, "material": 0, "extensions": mapped(2) },
            { "attributes": { "POSITION": others[3] }, "extensions": mapped(2) },
        ]),
    );
    let scene = shown(&doc, None).unwrap();
    let numbers: Vec<u32> = scene.meshes.iter().map(|mesh| mesh.material).collect();
    // 3 is that of primitives without a material.
    assert_eq!(numbers, [0, 4, 4, 5, 3]);
    assert_eq!(scene.variants[0].materials, [[4, 1], [5, 2], [3, 2]]);
    let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["leather", "canvas", "fur", "", "leather", "leather"]);
}

/// A primitive without a material whose only triangle comes to nothing leaves no pair that points beyond the materials.
#[test]
fn pairs_never_point_beyond_the_materials() {
    let mut doc = shoe();
    let none = doc.floats(&[], "VEC3");
    doc.push(
        "/meshes/0/primitives",
        json!({ "attributes": { "POSITION": none }, "extensions": { "KHR_materials_variants": { "mappings": [
            { "variants": [0], "material": 1 }] } } }),
    );
    let scene = shown(&doc, None).unwrap();
    for &[of, by] in scene.variants.iter().flat_map(|variant| &variant.materials) {
        assert!((of.max(by) as usize) < scene.materials.len(), "{of} {by}");
    }
}

/// A scene that can be shown is, whatever is wrong with the materials of variants that nobody asked for.
#[test]
fn variants_with_broken_materials_are_left_out() {
    let mut doc = shoe();
    doc.set("/images", json!([{ "uri": "gone.png" }]));
    doc.set("/textures", json!([{ "source": 0 }]));
    doc.set(
        "/materials/1/pbrMetallicRoughness",
        json!({ "baseColorTexture": { "index": 0 } }),
    );
    let scene = shown(&doc, None).unwrap();
    assert!(scene.variants.is_empty());
    let said =
        |note: &String| note.starts_with("variants of materials are left out") && note.contains("gone.png");
    assert!(scene.notes.iter().any(said), "{:?}", scene.notes);
    assert!(
        shown(&doc, Some("beach"))
            .unwrap_err()
            .to_string()
            .contains("gone.png")
    );
    assert!(shown(&doc, Some("snow")).is_ok());
}
