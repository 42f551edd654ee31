//! Variants of materials (KHR_materials_variants): kept by a bake, shown by material edits.

use crate::stage::{TINY, complaint, data, edited, folder, inspect_json, relight, sequence};
use relight_scene::image::{FloatImage, read_exr};
use serde_json::json;
use std::path::{Path, PathBuf};

const LIGHT: &str = r#"{"relight_sequence": 1, "lights": [{"name": "l", "type": "point", "position": [0.25, 0.4, 0.15],
    "intensity": [1, 1, 1]}]}"#;

/// One blue texel.
const TEXEL: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNQMDgAAAGEARHAH/FRAAAAAElFTkSuQmCC";

/// The Cornell box with variants: "dusk" paints what is white in green, but the tall block in the colour of a texture; "glass: clear" puts a
/// blended material in place of the right wall's.
fn scene(folder: &Path) -> PathBuf {
    let path = folder.join("varied.glb");
    edited(&data("cornell.glb"), &path, |document| {
        let materials = document["materials"].as_array_mut().unwrap();
        materials.push(json!({ "name": "Painted", "pbrMetallicRoughness": { "metallicFactor": 0, "baseColorTexture": { "index": 0 } } }));
        materials.push(json!({ "name": "Clear", "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 0.2] } }));
        document["images"] = json!([{ "uri": TEXEL }]);
        document["textures"] = json!([{ "source": 0 }]);
        document["extensionsUsed"] = json!(["KHR_materials_emissive_strength", "KHR_materials_variants"]);
        document["extensions"] = json!({ "KHR_materials_variants": { "variants": [{ "name": "dusk" }, { "name": "glass: clear" }] } });
        for mesh in document["meshes"].as_array_mut().unwrap() {
            let (variant, by) = match mesh["name"].as_str().unwrap() {
                "Floor" | "Ceiling" | "Back wall" => (0, 2),
                "Tall block" => (0, 4),
                "Right wall" => (1, 5),
                _ => continue,
            };
            mesh["primitives"][0]["extensions"] = json!({ "KHR_materials_variants": { "mappings": [{ "variants": [variant], "material": by }] } });
        }
    });
    path
}

fn baked(folder: &Path, name: &str, more: &[&str]) -> PathBuf {
    let asset = folder.join(name);
    let mut bake = relight();
    bake.arg("bake").arg(scene(folder)).arg("-o").arg(&asset);
    bake.args(TINY).args(more).assert().success();
    asset
}

fn played(folder: &Path, asset: &Path, integrator: &str, variant: Option<&str>) -> FloatImage {
    let (lights, output) = (sequence(folder, "l.json", LIGHT), folder.join("f.exr"));
    let mut play = relight();
    play.arg("play")
        .arg(asset)
        .arg("--lights")
        .arg(lights)
        .arg("-o")
        .arg(&output);
    play.args([
        "--size",
        "32x32",
        "--spp",
        "4",
        "--float",
        "--integrator",
        integrator,
    ]);
    if let Some(name) = variant {
        let text = json!({ "relight_materials": 1, "variant": name }).to_string();
        play.arg("--materials").arg(sequence(folder, "m.json", &text));
    }
    play.assert().success();
    read_exr(&output, &Default::default())
        .unwrap()
        .rgb("beauty")
        .unwrap()
}

fn mean(image: &FloatImage) -> f64 {
    let sum: f64 = image.pixels.iter().flatten().map(|v| f64::from(*v)).sum();
    sum / (3 * image.pixels.len()) as f64
}

/// Truth: an asset that was baked with the variant alone. Path tracing asks materials only, so no bit differs. The transfer's points and
/// links were chosen for other materials: 5 % of the light, where the variant takes away more than a tenth of it.
#[test]
fn a_variant_shown_by_edits_is_the_one_that_is_baked_alone() {
    let folder = folder();
    let all = baked(folder.path(), "all.relight", &[]);
    let alone = baked(folder.path(), "alone.relight", &["--variant", "dusk"]);
    let plain = played(folder.path(), &all, "path", None);
    let shown = played(folder.path(), &all, "path", Some("dusk"));
    assert_eq!(shown.pixels, played(folder.path(), &alone, "path", None).pixels);
    assert_ne!(shown.pixels, plain.pixels);
    let transfer = |asset: &Path, variant| mean(&played(folder.path(), asset, "transfer", variant));
    let (shown, truth) = (transfer(&all, Some("dusk")), transfer(&alone, None));
    assert!((shown / truth - 1.0).abs() < 0.05, "{shown} instead of {truth}");
    assert!(truth < 0.9 * transfer(&all, None));
}

#[test]
fn inspect_names_variants_and_what_cannot_be_shown_is_refused() {
    let folder = folder();
    let all = baked(folder.path(), "all.relight", &[]);
    assert_eq!(inspect_json(&all)["variants"], json!(["dusk", "glass: clear"]));
    let run = relight().arg("inspect").arg(&all).assert().success();
    let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(text.contains("variants   \"dusk\", \"glass: clear\"\n"), "{text}");
    assert!(!text.contains("variants 0="), "{text}");
    let refused = |asset: &Path, name: &str| {
        let text = json!({ "relight_materials": 1, "variant": name }).to_string();
        let edits = sequence(folder.path(), "m.json", &text);
        let mut play = relight();
        play.arg("play")
            .arg(asset)
            .arg("-o")
            .arg(folder.path().join("f.exr"));
        complaint(play.args(["--size", "8x8"]).arg("--materials").arg(edits), 1)
    };
    let said = refused(&all, "dawn");
    assert!(
        said.contains("m.json") && said.contains("it has \"dusk\", \"glass: clear\""),
        "{said}"
    );
    assert!(refused(&all, "glass: clear").contains("bake with --variant \"glass: clear\""));
    let solved = baked(folder.path(), "solved.relight", &["--solution"]);
    assert!(refused(&solved, "dusk").contains("--solution"));
    assert_eq!(inspect_json(&solved)["variants"], json!([]));
}
