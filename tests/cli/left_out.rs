//! What a bake leaves out is absent, its list says so, and the image is that of the bake that keeps it.

use crate::stage::{TINY, bake_json, complaint, data, folder, relight, sequence};
use relight_format::{Asset, Limits, read_file};
use relight_scene::image::metrics::relmse;
use relight_scene::image::{Layers, read_exr};
use serde_json::Value;
use std::path::PathBuf;
use tempfile::TempDir;

/// A bake of a scene and what it says of itself.
struct Bake {
    asset: PathBuf,
    said: Value,
}

/// A folder for the bakes of a test.
struct Room {
    folder: TempDir,
    scene: PathBuf,
    lights: PathBuf,
}

impl Room {
    fn new(scene: &str, lights: &str) -> Room {
        Room {
            folder: folder(),
            scene: data(scene),
            lights: data(lights),
        }
    }

    fn bake(&self, name: &str, options: &[&str]) -> Bake {
        let asset = self.folder.path().join(name).with_extension("relight");
        let said = bake_json(&self.scene, &asset, options);
        Bake { asset, said }
    }

    fn play(&self, bake: &Bake) -> Layers {
        let frame = bake.asset.with_extension("exr");
        relight()
            .arg("play")
            .arg(&bake.asset)
            .arg("--lights")
            .arg(&self.lights)
            .arg("-o")
            .arg(&frame)
            .args(["--frames", "0", "--size", "48x48", "--float"])
            .assert()
            .success();
        read_exr(&frame, &Default::default()).unwrap()
    }

    /// relMSE of the beauty of one against the other.
    fn difference(&self, a: &Bake, b: &Bake) -> f64 {
        let [a, b] = [a, b].map(|bake| self.play(bake).rgb("beauty").unwrap());
        assert!(b.pixels.iter().any(|p| p[0] > 0.0), "a black image shows nothing");
        relmse(&a, &b).unwrap()
    }
}

impl Bake {
    /// The entry of the list whose name contains this.
    fn entry(&self, what: &str) -> Option<&Value> {
        let list = self.said["left_out"].as_array().unwrap();
        list.iter().find(|e| e["what"].as_str().unwrap().contains(what))
    }

    fn has(&self, section: &str) -> bool {
        self.said["bytes"].get(section).is_some()
    }

    fn read(&self) -> Asset {
        read_file(&self.asset, &Limits::default()).unwrap()
    }
}

fn with<'a>(options: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [options, more].concat()
}

/// Both bakes: the one that leaves out has an entry of that name with its saving, the one that keeps has none.
fn named_once(lean: &Bake, full: &Bake, what: &str) {
    let entry = lean
        .entry(what)
        .unwrap_or_else(|| panic!("{}", lean.said["left_out"]));
    let saves = |key: &str| entry[key].as_f64().unwrap();
    assert!(saves("saved_bytes") + saves("saved_rays") > 0.0, "{entry}");
    assert!(saves("saved_seconds") >= 0.0, "{entry}");
    assert!(full.entry(what).is_none(), "{}", full.said["left_out"]);
}

#[test]
fn without_an_environment_there_are_no_cuts_of_one() {
    let room = Room::new("cornell.glb", "cornell.lights.json");
    let lamps = room.lights.to_str().unwrap();
    let options = with(
        &TINY,
        &["--lights", lamps, "--cuts", "auto", "--cut-lights", "256"],
    );
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "cuts"]));
    assert!(!lean.has("cuts") && !lean.has("light_tree"));
    assert!(full.has("cuts") && full.has("light_tree"));
    named_once(&lean, &full, "visibility cuts");
    assert_eq!(room.difference(&lean, &full), 0.0);
    let mut play = relight();
    play.arg("play").arg(&lean.asset).args(["--lights", lamps]);
    play.args(["--integrator", "cuts", "-o", "x.exr"]);
    let text = complaint(&mut play, 1);
    assert!(text.contains("--keep cuts"), "{text}");
    // An environment that may shine keeps them.
    let sky = data("table_window.lights.json");
    let sky = [
        "--lights",
        sky.to_str().unwrap(),
        "--cuts",
        "auto",
        "--cut-lights",
        "256",
    ];
    assert!(room.bake("sky", &with(&TINY, &sky)).has("cuts"));
}

#[test]
fn where_only_the_sky_shines_lamps_and_their_matter_are_gone() {
    let folder = folder();
    let sky =
        r#"{"relight_sequence": 1, "lights": [{"name": "sky", "type": "environment", "file": "sky.hdr"}]}"#;
    std::fs::copy(data("sky.hdr"), folder.path().join("sky.hdr")).unwrap();
    let room = Room {
        lights: sequence(folder.path(), "sky.json", sky),
        ..Room::new("cornell.glb", "cornell.lights.json")
    };
    let options = with(&TINY, &["--lights", room.lights.to_str().unwrap()]);
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "lights,emission"]));
    named_once(&lean, &full, "light");
    named_once(&lean, &full, "emission");
    let shines = |bake: &Bake| bake.read().materials.iter().any(|m| m.emissive != [0.0; 3]);
    assert!(!shines(&lean) && shines(&full));
    assert!(lean.read().stage.json.len() < full.read().stage.json.len());
    assert_eq!(room.difference(&lean, &full), 0.0);
}

/// Few points: what is looked at is what materials look up.
const COARSE: [&str; 6] = ["--levels", "2", "--sender-levels", "1", "--coarse-radius", "0.5"];

#[test]
fn matt_surfaces_keep_no_maps_of_gloss_and_normals() {
    let room = Room::new("table.glb", "table_spot.lights.json");
    let options = with(&COARSE, &["--lambert"]);
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "materials"]));
    let [matt, glossy] = [&lean, &full].map(Bake::read);
    let maps = |asset: &Asset| {
        let of = |m: &relight_format::Material| {
            usize::from(m.normal_texture.is_some()) + usize::from(m.metallic_roughness_texture.is_some())
        };
        asset.materials.iter().map(of).sum::<usize>()
    };
    assert!(maps(&matt) == 0 && maps(&glossy) > 0, "{}", maps(&glossy));
    assert!(matt.textures.len() < glossy.textures.len());
    assert!(matt.geometry.meshes.iter().all(|m| m.tangents.is_none()));
    named_once(&lean, &full, "normals, metalness or roughness");
    assert_eq!(room.difference(&lean, &full), 0.0);
}

#[test]
fn a_scene_without_textures_has_no_textures_and_no_coordinates() {
    let room = Room::new("atrium.glb", "atrium_point.lights.json");
    let options = ["--levels", "2", "--sender-levels", "1", "--coarse-radius", "4"];
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "materials"]));
    let sets = |bake: &Bake| {
        bake.read()
            .geometry
            .meshes
            .iter()
            .map(|m| m.uvs.len())
            .sum::<usize>()
    };
    assert!(sets(&lean) < sets(&full));
    named_once(&lean, &full, "texture coordinates");
    assert_eq!(room.difference(&lean, &full), 0.0);
    // And where nothing has a texture, there is no section of any.
    assert!(
        !Room::new("cornell.glb", "cornell.lights.json")
            .bake("box", &TINY)
            .has("textures")
    );
}

#[test]
fn grey_points_have_one_channel() {
    let room = Room::new("furnace_box.glb", "furnace.lights.json");
    // Finer than what links' bits could be spared at: colour alone differs.
    let options = with(&COARSE, &["--epsilon", "0.01"]);
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "precision"]));
    assert!(lean.read().coding.grey && !full.read().coding.grey);
    let raw = |bake: &Bake| bake.said["bytes"]["points"]["raw"].as_f64().unwrap();
    // 12 of 36 bits of albedo beside some nine bytes of place and normal.
    assert!(raw(&lean) < 0.8 * raw(&full), "{} {}", raw(&lean), raw(&full));
    named_once(&lean, &full, "albedo");
    assert_eq!(room.difference(&lean, &full), 0.0);
}

#[test]
fn one_bounce_needs_no_operator_of_further_ones() {
    let room = Room::new("cornell.glb", "cornell.lights.json");
    for bounces in ["1", "2"] {
        let options = with(&TINY, &["--bounces", bounces]);
        let lean = room.bake("lean", &options);
        let full = room.bake("full", &with(&options, &["--keep", "bounces"]));
        assert!(!lean.has("links_bounce") && full.has("links_bounce"));
        named_once(&lean, &full, "bounce operator");
        assert_eq!(room.difference(&lean, &full), 0.0, "{bounces} bounces");
    }
    assert!(
        room.bake("three", &with(&TINY, &["--bounces", "3"]))
            .has("links_bounce")
    );
}

/// What another seed changes is how much two equally good bakes may differ: the mean over three others, since single ones differ twofold.
fn seed_difference(room: &Room, lean: &Bake, options: &[&str]) -> f64 {
    let of = |seed: &&str| room.difference(&room.bake("seed", &with(options, &["--seed", seed])), lean);
    ["1", "2", "3"].iter().map(of).sum::<f64>() / 3.0
}

#[test]
fn surfaces_that_no_light_path_reaches_have_no_points_and_nobody_sees_it() {
    let room = Room::new("cornell.glb", "cornell.lights.json");
    let options = ["--levels", "3", "--sender-levels", "2", "--coarse-radius", "0.08"];
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "points"]));
    let points = |bake: &Bake| -> u64 {
        let points = bake.said["points"].as_array().unwrap();
        points.iter().filter_map(Value::as_u64).sum()
    };
    // The outsides of walls.
    assert!(points(&full) as f64 > 1.3 * points(&lean) as f64);
    assert!(full.entry("% of the surface").is_none());
    // Means over three seeds: single pairs differ twofold.
    let seeds = ["0", "1", "2"];
    let baked = |more: &[&str]| {
        seeds.map(|seed| {
            let name = format!("{seed}-{}", more.len());
            room.bake(&name, &with(&options, &[&["--seed", seed], more].concat()))
        })
    };
    let (lean, full) = (baked(&[]), baked(&["--keep", "points"]));
    let kept: f64 = (0..3).map(|k| room.difference(&full[k], &lean[k])).sum();
    let seed: f64 = (0..3)
        .map(|k| room.difference(&lean[(k + 1) % 3], &lean[k]))
        .sum();
    assert!(kept < 1.5 * seed, "{kept} against {seed} of other seeds");
}

#[test]
fn links_below_significance_change_less_than_another_seed() {
    let room = Room::new("cornell.glb", "cornell.lights.json");
    let lean = room.bake("lean", &TINY);
    let full = room.bake("full", &with(&TINY, &["--epsilon", "1e-7"]));
    let links = |bake: &Bake| bake.said["links_by_operator"]["transfer"].as_f64().unwrap();
    assert!(links(&lean) < 0.5 * links(&full));
    assert!(lean.entry("links below significance").is_some());
    let (dropped, seed) = (
        room.difference(&lean, &full),
        seed_difference(&room, &lean, &TINY),
    );
    assert!(dropped < seed, "{dropped} against {seed} of another seed");
}

#[test]
fn sender_levels_without_links_are_gone() {
    let room = Room::new("cornell.glb", "cornell.lights.json");
    let options = [
        "--levels",
        "4",
        "--sender-levels",
        "4",
        "--coarse-radius",
        "0.2",
        "--epsilon",
        "16",
    ];
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "senders"]));
    let levels = |bake: &Bake| bake.read().senders.unwrap().counts.len();
    assert!(levels(&lean) < levels(&full), "{}", levels(&lean));
    named_once(&lean, &full, "sender level");
    // Means of means against means of points: rounding of f32 sums.
    let difference = room.difference(&lean, &full);
    assert!(difference < 1e-10, "{difference}");
}

#[test]
fn points_that_no_camera_sees_are_not_refined() {
    let room = Room::new("atrium.glb", "atrium_point.lights.json");
    let options = [
        "--levels",
        "3",
        "--sender-levels",
        "2",
        "--coarse-radius",
        "4",
        "--bounces",
        "1",
    ];
    let full = room.bake("full", &options);
    let lean = room.bake("lean", &with(&options, &["--cameras-only"]));
    let links = |bake: &Bake| bake.said["links_by_operator"]["transfer"].as_f64().unwrap();
    assert!(
        links(&lean) < 0.8 * links(&full),
        "{} {}",
        links(&lean),
        links(&full)
    );
    assert!(lean.said["rays"].as_f64() < full.said["rays"].as_f64());
    let entry = lean.entry("gathers").unwrap();
    assert!(entry["saved_rays"].as_u64().unwrap() > 0, "{entry}");
    // Looked at by 480 × 270 rays: a point that slips through between them leaves its place to coarser ones.
    let difference = room.difference(&lean, &full);
    assert!(difference < 1e-5, "{difference}");
    // Another camera would see what was not refined.
    let elsewhere = r#"{"relight_sequence": 1, "camera": {"position": [0.1, 1, 0.2], "look_at": [1, 1, 1], "up": [0, 1, 0],
        "vfov_deg": 60}, "lights": [{"name": "p", "type": "point", "position": [0, 1, 0], "intensity": [1, 1, 1]}]}"#;
    let elsewhere = sequence(room.folder.path(), "elsewhere.json", elsewhere);
    let mut play = relight();
    play.arg("play")
        .arg(&lean.asset)
        .arg("--lights")
        .arg(elsewhere)
        .args(["-o", "x.exr"]);
    let text = complaint(&mut play, 1);
    assert!(text.contains("--cameras-only"), "{text}");
}

#[test]
fn bits_far_below_epsilon_change_nothing_that_shows() {
    let room = Room::new("cornell.glb", "cornell.lights.json");
    let lean = room.bake("lean", &TINY);
    let full = room.bake("full", &with(&TINY, &["--keep", "precision"]));
    assert!(lean.read().coding.short_links && !full.read().coding.short_links);
    named_once(&lean, &full, "mantissas");
    let stored = |bake: &Bake| bake.said["bytes"]["links_transfer"]["stored"].as_f64().unwrap();
    assert!(stored(&lean) < stored(&full));
    // Links off by at most 2⁻⁷ each, of which a row has some twenty.
    let difference = room.difference(&lean, &full);
    assert!(
        difference > 0.0 && difference < (1.0f64 / 128.0).powi(2),
        "{difference}"
    );
    // Where ε is small, they are kept.
    assert!(
        !room
            .bake("fine", &with(&TINY, &["--epsilon", "0.01"]))
            .read()
            .coding
            .short_links
    );
}

#[test]
fn keep_all_leaves_out_nothing_that_an_option_of_keep_names() {
    let room = Room::new("cornell.glb", "cornell.lights.json");
    let lights = room.lights.to_str().unwrap();
    let options = with(
        &TINY,
        &[
            "--lights",
            lights,
            "--cuts",
            "auto",
            "--cut-lights",
            "256",
            "--bounces",
            "1",
        ],
    );
    let lean = room.bake("lean", &options);
    let full = room.bake("full", &with(&options, &["--keep", "all"]));
    let keepable = |bake: &Bake| -> usize {
        let list = bake.said["left_out"].as_array().unwrap();
        list.iter()
            .filter(|e| e["why"].as_str().unwrap().contains("--keep"))
            .count()
    };
    assert!(keepable(&lean) >= 4, "{}", lean.said["left_out"]);
    assert_eq!(keepable(&full), 0, "{}", full.said["left_out"]);
    // The list is in the file.
    let shown = relight()
        .arg("inspect")
        .arg(&lean.asset)
        .assert()
        .success()
        .get_output()
        .stdout
        .clone();
    let shown = String::from_utf8(shown).unwrap();
    assert!(shown.matches("left out ").count() >= 4, "{shown}");
    let (kept, seed) = (
        room.difference(&full, &lean),
        seed_difference(&room, &lean, &options),
    );
    assert!(kept < 1.5 * seed, "{kept} against {seed} of another seed");
}
