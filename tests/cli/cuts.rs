//! Visibility cuts: baked on demand, played where they are, refused where they are not.

use crate::stage::{
    TINY, bake_json, complaint, cornell, data, folder, inspect_json, json, mean, names, relight, sky,
};
use relight_scene::image::{FloatImage, Layers, Limits, read_exr};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// Few lights, few points: fractions of a second.
const FEW: [&str; 6] = ["--cuts", "environment", "--cut-lights", "1024", "--sigma", "6"];

/// The table of objects with cuts, baked once for all tests, and what the bake said.
fn table() -> (&'static Path, &'static Value) {
    static ASSET: OnceLock<(TempDir, PathBuf, Value)> = OnceLock::new();
    let (_, asset, said) = ASSET.get_or_init(|| {
        let folder = folder();
        let asset = folder.path().join("table.relight");
        let said = bake(&asset, &[]);
        (folder, asset, said)
    });
    (asset, said)
}

/// Truth: what was measured lies below what equation 5 allows, and that is by hand σ √(2K / lights) of the file's σ; with nodes of light
/// that err by 5e-4 of it that makes 0.05 % (equation 8).
#[test]
fn inspect_says_what_the_paper_predicts_beside_what_was_measured() {
    let (asset, _) = table();
    let cuts = &inspect_json(asset)["cuts"];
    let number = |key: &str| cuts[key].as_f64().unwrap();
    let by_hand = number("sigma") * (2.0 * number("mean_length") / 1024.0).sqrt();
    assert!(
        (number("predicted_rms_error") / by_hand - 1.0).abs() < 1e-6,
        "{cuts}"
    );
    assert!(
        number("rms_error") > 0.0 && number("rms_error") <= number("predicted_rms_error"),
        "{cuts}"
    );
    assert!(
        (number("predicted_light_error") / number("sigma") - 5e-4).abs() < 1e-9,
        "{cuts}"
    );
    let output = relight()
        .arg("inspect")
        .arg(asset)
        .assert()
        .success()
        .get_output()
        .clone();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.contains("light of an environment by at most 0.05 %"),
        "{text}"
    );
}

fn bake(asset: &Path, more: &[&str]) -> Value {
    let coarse = ["--levels", "2", "--sender-levels", "1", "--coarse-radius", "0.1"];
    bake_json(&data("table.glb"), asset, &[&coarse, &FEW[..], more].concat())
}

fn direct(frame: &Path) -> FloatImage {
    let layers: Layers = read_exr(frame, &Limits::default()).unwrap();
    layers.rgb("direct").unwrap()
}

fn play(asset: &Path, lights: &Path, frame: &Path, more: &[&str]) -> assert_cmd::assert::Assert {
    relight()
        .arg("play")
        .arg(asset)
        .arg("--lights")
        .arg(lights)
        .arg("-o")
        .arg(frame)
        .args(["--size", "96x54", "--float"])
        .args(more)
        .assert()
        .success()
}

#[test]
fn the_json_of_a_bake_says_what_cuts_there_are_and_what_they_cost() {
    let (_, said) = table();
    let cuts = &said["cuts"];
    assert_eq!(
        (&cuts["mode"], &cuts["lights"]),
        (&"environment".into(), &1024.into())
    );
    let finest = said["points"].as_array().unwrap().last().unwrap();
    assert_eq!(&cuts["sites"], finest);
    let number = |key: &str| cuts[key].as_f64().unwrap();
    assert!((number("elements") / number("sites") - number("mean_length")).abs() < 1e-6);
    // σ = 6 at 32 768 lights is 1.06 at 1024: no node may hold more than 1.13 of squared error, and none more than a
    // variance of a quarter.
    assert!(number("rms_error") > 0.0 && number("rms_error") < 0.5);
    let stored = said["bytes"]["cuts"]["stored"].as_f64().unwrap();
    assert!(stored / number("elements") < 1.5, "bytes an element");
    assert!(said["seconds"]["cuts"].as_f64().unwrap() > 0.0);
}

/// Where σ would want more nodes, `--cut-nodes` is the limit.
#[test]
fn no_cut_has_more_nodes_than_are_asked_for() {
    let folder = folder();
    let said = bake(&folder.path().join("few.relight"), &["--cut-nodes", "5"]);
    let mean = said["cuts"]["mean_length"].as_f64().unwrap();
    assert!(mean > 4.0 && mean <= 5.0, "{mean}");
    assert_eq!(said["settings"]["cut_nodes"], "5");
    let free = &table().1["cuts"];
    assert!(free["mean_length"].as_f64().unwrap() > 10.0, "{free}");
}

#[test]
fn without_cuts_an_asset_has_no_section_for_them() {
    let said = inspect_json(cornell());
    assert!(said["cuts"].is_null());
    assert!(said["bytes"].get("cuts").is_none() && said["bytes"].get("light_tree").is_none());
    let folder = folder();
    let frame = folder.path().join("f.exr");
    let text = complaint(
        relight()
            .arg("play")
            .arg(cornell())
            .args(["--integrator", "cuts", "-o"])
            .arg(&frame),
        1,
    );
    assert!(text.contains("--cuts environment"), "{text}");
}

#[test]
fn cuts_light_like_paths() {
    let (asset, _) = table();
    let folder = folder();
    let frame = |name: &str, more: &[&str]| {
        let frame = folder.path().join(name);
        play(asset, &data("table_window.lights.json"), &frame, more);
        direct(&frame)
    };
    let cuts = frame("cuts.exr", &["--integrator", "cuts"]);
    let path = frame(
        "path.exr",
        &["--integrator", "path", "--spp", "64", "--max-bounces", "1"],
    );
    // Directions 6° apart and points 5 cm apart blur shadows, but all of the light is there.
    let ratio = mean(&cuts) / mean(&path);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    assert!(cuts.pixels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
}

#[test]
fn auto_takes_environments_by_cuts_and_says_so() {
    let (asset, _) = table();
    let folder = folder();
    let frame = folder.path().join("f.exr");
    let run = play(asset, &data("table_window.lights.json"), &frame, &["--json"]);
    let words = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(
        words.contains("visibility cuts") && words.contains("transfer"),
        "{words}"
    );
    let said = json(&run.get_output().stdout);
    for time in ["illumination_cut", "shade"] {
        assert!(said["frames"][0][time].as_f64().unwrap() >= 0.0);
    }
    assert_eq!(said["frames"][0]["illumination_cut_nodes"], 128);

    // A lamp is no environment.
    let run = play(
        asset,
        &data("table.lights.json"),
        &frame,
        &["--frames", "0", "--json"],
    );
    let words = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(words.contains("shadow rays (no environment shines)"), "{words}");
    assert!(json(&run.get_output().stdout)["frames"][0].get("shade").is_none());
}

/// Truth: a merged cut tiles the 1024 lights, and has no fewer nodes than those it was made of; so has one with the illumination cut of
/// 128 merged in.
#[test]
fn cut_sizes_and_nodes_are_layers() {
    let folder = folder();
    let (asset, _) = table();
    let window = data("table_window.lights.json");
    let frame = folder.path().join("f.exr");
    play(asset, &window, &frame, &["--layers", "beauty,cut_size,nodes"]);
    let layers = read_exr(&frame, &Limits::default()).unwrap();
    let of = |name: &str| layers.layer(name).unwrap().data.clone();
    let (sizes, nodes) = (of("cut_size"), of("nodes"));
    assert_eq!(
        (layers.layer("nodes").unwrap().channels, sizes.len()),
        (1, nodes.len())
    );
    let shaded: Vec<(f32, f32)> = (sizes.iter().copied().zip(nodes.iter().copied()))
        .filter(|(_, n)| *n > 0.0)
        .collect();
    assert!(
        shaded.len() > sizes.len() / 10,
        "{} of {}",
        shaded.len(),
        sizes.len()
    );
    assert!(
        shaded
            .iter()
            .all(|(size, nodes)| *size <= 1024.5 && *nodes <= 1024.5)
    );
    assert!(sizes.iter().any(|size| *size > 10.0));
    // A pixel whose mirror looks past the cuts is shaded in part.
    let more = shaded
        .iter()
        .filter(|(size, nodes)| *nodes >= (*size).max(127.5))
        .count();
    assert!(more * 10 > shaded.len() * 8, "{more} of {}", shaded.len());
    // The picture is the same without.
    let plain = folder.path().join("plain.exr");
    play(asset, &window, &plain, &["--layers", "beauty"]);
    let plain = read_exr(&plain, &Limits::default()).unwrap();
    assert_eq!(plain.rgb("beauty"), layers.rgb("beauty"));
    assert!(plain.layer("nodes").is_none());

    // Light that is kept from the frame before was shaded with as many.
    let still = folder.path().join("still.json");
    let map = data("window.hdr");
    let text = std::fs::read_to_string(&window).unwrap();
    let text = text.replace("window.hdr", &map.display().to_string());
    std::fs::write(&still, text.replace("\"frames\": 1", "\"frames\": 3")).unwrap();
    let frames = folder.path().join("s_#.exr");
    play(asset, &still, &frames, &["--layers", "nodes", "--frames", "0-2"]);
    for frame in 0..3 {
        let file = folder.path().join(format!("s_{frame}.exr"));
        let again = read_exr(&file, &Limits::default()).unwrap();
        assert_eq!(again.layer("nodes").unwrap().data, nodes, "frame {frame}");
    }

    // Where none are used there is nothing to count.
    let refused = |lights: &str, more: &[&str]| {
        let mut command = relight();
        command
            .arg("play")
            .arg(asset)
            .arg("--lights")
            .arg(data(lights))
            .arg("-o")
            .arg(&frame);
        complaint(command.args(["--layers", "nodes", "--frames", "0"]).args(more), 2)
    };
    let said = refused("table.lights.json", &[]);
    assert!(said.contains("none shines"), "{said}");
    let said = refused("table_window.lights.json", &["--integrator", "path"]);
    assert!(said.contains("leave out --integrator"), "{said}");
}

#[test]
fn assets_and_frames_with_cuts_do_not_depend_on_threads() {
    let (asset, _) = table();
    let folder = folder();
    let one = folder.path().join("one.relight");
    bake(&one, &["--threads", "1"]);
    assert!(
        std::fs::read(&one).unwrap() == std::fs::read(asset).unwrap(),
        "assets differ"
    );
    let bytes = |threads: &str| {
        let frame = folder.path().join(format!("{threads}.exr"));
        play(
            asset,
            &data("table_window.lights.json"),
            &frame,
            &["--threads", threads, "--spp", "2"],
        );
        std::fs::read(frame).unwrap()
    };
    assert!(bytes("1") == bytes("2"), "frames differ");
}

/// A Radiance map of flat RGBE scanlines.
fn map(folder: &Path, name: &str, width: usize, height: usize, rgbe: impl Fn(usize) -> [u8; 4]) -> PathBuf {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    bytes.extend((0..width * height).flat_map(rgbe));
    std::fs::write(folder.join(name), bytes).unwrap();
    sky(folder, name)
}

#[test]
fn maps_of_any_kind_shine_or_stay_dark_but_never_break() {
    let (asset, _) = table();
    let folder = folder();
    let lit = |lights: &Path, integrator: &str| {
        let frame = folder.path().join("f.exr");
        play(
            asset,
            lights,
            &frame,
            &["--integrator", integrator, "--spp", "16"],
        );
        let image = direct(&frame);
        assert!(image.pixels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
        image.pixels.iter().flatten().map(|&v| f64::from(v)).sum::<f64>()
    };
    let grey = |_: usize| [128, 128, 128, 129];
    let single = map(folder.path(), "one.hdr", 1, 1, grey);
    let (cuts, rays) = (lit(&single, "cuts"), lit(&single, "brute"));
    // Even light is dimmed in every corner, and points 5 cm apart blur corners of that size: 5.5 %.
    assert!(cuts > 0.0 && (cuts / rays - 1.0).abs() < 0.08, "{cuts} {rays}");
    let wide = map(folder.path(), "wide.hdr", 32_768, 2, grey);
    assert!((lit(&wide, "cuts") / cuts - 1.0).abs() < 1e-3);
    let black = map(folder.path(), "black.hdr", 8, 4, |_| [0; 4]);
    assert_eq!(lit(&black, "cuts"), 0.0);
    // One pixel of 10⁶ in a map of 64 × 32: a sun, which is not left to directions 6° apart.
    let sun = map(folder.path(), "sun.hdr", 64, 32, |i| {
        if i == 10 * 64 + 32 {
            [244, 244, 244, 148]
        } else {
            [1, 2, 1, 120]
        }
    });
    let (cuts, rays) = (lit(&sun, "cuts"), lit(&sun, "brute"));
    assert!(cuts > 0.0 && (cuts / rays - 1.0).abs() < 0.05, "{cuts} {rays}");
}

#[test]
fn a_tiny_bake_with_cuts_of_the_cornell_box_sees_its_opening() {
    // The box is open to the front only: its sites see a share of the directions.
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let said = bake_json(&data("cornell.glb"), &asset, &[&TINY[..], &FEW].concat());
    assert!(said["cuts"]["mean_length"].as_f64().unwrap() > 10.0);
}

/// A map as OpenEXR, which can hold what Radiance cannot.
fn float_map(
    folder: &Path,
    name: &str,
    width: usize,
    height: usize,
    pixel: impl Fn(usize) -> [f32; 3] + Sync,
) -> PathBuf {
    // Not by relight's own writer, which repairs what is not finite.
    exr::prelude::write_rgb_file(folder.join(name), width, height, |x, y| {
        <(f32, f32, f32)>::from(pixel(y * width + x))
    })
    .unwrap();
    sky(folder, name)
}

#[test]
fn maps_with_impossible_pixels_are_refused_with_the_first_of_them_and_nothing_is_written() {
    let (asset, _) = table();
    let folder = folder();
    for (name, bad) in [
        ("nan.exr", f32::NAN),
        ("negative.exr", -0.5),
        ("infinite.exr", f32::INFINITY),
    ] {
        let lights = float_map(folder.path(), name, 16, 8, |i| {
            if i == 3 * 16 + 5 {
                [1.0, bad, 1.0]
            } else {
                [1.0; 3]
            }
        });
        let before = names(folder.path());
        for integrator in ["cuts", "auto", "brute"] {
            let mut play = relight();
            play.arg("play").arg(asset).arg("--lights").arg(&lights);
            play.args(["--integrator", integrator, "--size", "8x8", "-o"]);
            let text = complaint(play.arg(folder.path().join("f.exr")), 1);
            assert!(
                text.contains(name) && text.contains("column 5, row 3") && text.contains("1 of 128"),
                "{text}"
            );
        }
        assert_eq!(names(folder.path()), before);
    }
}

#[test]
fn a_single_pixel_of_a_million_shines_as_brute_force_says() {
    let (asset, _) = table();
    let folder = folder();
    let lights = float_map(folder.path(), "sun.exr", 64, 32, |i| {
        if i == 9 * 64 + 33 { [1e6; 3] } else { [0.0; 3] }
    });
    let lit = |integrator: &str| {
        let frame = folder.path().join("f.exr");
        play(
            asset,
            &lights,
            &frame,
            &["--integrator", integrator, "--spp", "16"],
        );
        let image = direct(&frame);
        assert!(image.pixels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
        mean(&image)
    };
    let (cuts, rays) = (lit("cuts"), lit("brute"));
    // What of the pixel is not bright by itself is a thousandth; both sample it with few rays.
    assert!(cuts > 0.0 && (cuts / rays - 1.0).abs() < 0.05, "{cuts} {rays}");
}

#[test]
fn a_file_with_cuts_at_vertices_is_refused_with_its_name_and_what_to_do() {
    let name = "version_3_surface.relight";
    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("crates/format/tests/fixtures/vertices")
        .join(name);
    for command in ["inspect", "play"] {
        let mut relight = relight();
        relight.arg(command).arg(&file);
        if command == "play" {
            relight.args(["-o", "never.exr"]);
        }
        let text = complaint(&mut relight, 1);
        assert!(
            text.contains(name) && text.contains("at vertices") && text.contains("bake it again"),
            "{text}"
        );
    }
}
