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
        assert!(shown(&doc, None).is_ok());
        let error = shown(&doc, Some("beach")).unwrap_err().to_string();
        assert!(error.contains(&what), "{error}");
    }
}
