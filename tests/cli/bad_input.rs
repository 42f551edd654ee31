//! Input that cannot be used: one paragraph that says what, where and what to do, exit code 1, nothing written.

use crate::stage::{SQUARE, bake_json, complaint, cornell, data, folder, gltf, names, relight, sequence};
use std::path::Path;

fn bake_complaint(scene: &Path) -> String {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let text = complaint(relight().arg("bake").arg(scene).arg("-o").arg(&asset), 1);
    assert!(names(folder.path()).is_empty());
    text
}

/// Readers differ in which of two they take, so nobody can tell what was meant.
#[test]
fn a_key_given_twice_in_a_scene_is_refused_with_its_place() {
    let room = folder();
    let scene = gltf(room.path(), &SQUARE);
    let text = std::fs::read_to_string(&scene).unwrap();
    let twice = text.replacen("\"mesh\":0", "\"mesh\":0,\n\"mesh\":0", 1);
    assert_ne!(text, twice);
    std::fs::write(&scene, twice).unwrap();
    let mut bake = relight();
    bake.arg("bake")
        .arg(&scene)
        .arg("-o")
        .arg(room.path().join("a.relight"));
    let said = complaint(&mut bake, 1);
    for part in ["scene.gltf", "nodes[0].mesh", "twice", "line 2"] {
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn a_missing_scene_is_named() {
    let text = bake_complaint(Path::new("no-such-scene.glb"));
    assert!(
        text.contains("no-such-scene.glb") && text.contains("check the path"),
        "{text}"
    );
}

#[test]
fn a_truncated_scene_is_an_error_at_every_length() {
    let whole = std::fs::read(data("cornell.glb")).unwrap();
    let folder = folder();
    let scene = folder.path().join("cut.glb");
    for end in [0, 3, 12, 20, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&scene, &whole[..end]).unwrap();
        let text = bake_complaint(&scene);
        assert!(text.contains("cut.glb"), "{text}");
    }
}

/// Results replace files by renaming, which would put a file in the place of a device. A socket stands for all that are no files.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = folder();
    let socket = folder.path().join("socket.exr");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    let lights = data("cornell.lights.json");
    let mut play = relight();
    play.arg("play").arg(cornell()).arg("--lights").arg(lights);
    let mut bake = relight();
    bake.arg("bake").arg(data("cornell.glb"));
    for mut command in [bake, play] {
        let text = complaint(command.arg("-o").arg(&socket), 1);
        assert!(text.contains("socket.exr: is a device or a pipe"), "{text}");
        assert!(std::fs::metadata(&socket).unwrap().file_type().is_socket());
        assert_eq!(names(folder.path()), ["socket.exr"]);
    }
}

#[test]
fn a_scene_without_geometry_is_refused() {
    let folder = folder();
    let scene = folder.path().join("empty.gltf");
    std::fs::write(&scene, r#"{"asset": {"version": "2.0"}}"#).unwrap();
    let text = bake_complaint(&scene);
    assert!(text.contains("empty.gltf"), "{text}");
}

#[test]
fn an_unknown_variant_is_answered_by_those_of_the_file() {
    let room = folder();
    let scene = gltf(room.path(), &SQUARE);
    let text = std::fs::read_to_string(&scene).unwrap();
    let variants =
        r#""extensions":{"KHR_materials_variants":{"variants":[{"name":"beach"},{"name":"snow"}]}},"asset":"#;
    let with = text.replacen("\"asset\":", variants, 1);
    assert_ne!(text, with);
    std::fs::write(&scene, with).unwrap();
    let mut bake = relight();
    bake.arg("bake").arg(&scene).args(["--variant", "winter", "-o"]);
    let said = complaint(bake.arg(room.path().join("a.relight")), 1);
    assert!(
        said.contains(r#"no variant "winter"; choose one of "beach", "snow""#),
        "{said}"
    );
}

#[test]
fn vertices_that_are_no_numbers_are_dropped_and_counted() {
    let folder = folder();
    let mut vertices = SQUARE.to_vec();
    vertices.extend([[f32::NAN, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, f32::INFINITY]]);
    let scene = gltf(folder.path(), &vertices);
    let asset = folder.path().join("a.relight");
    let output = relight()
        .arg("bake")
        .arg(scene)
        .arg("-o")
        .arg(&asset)
        .args([
            "--levels",
            "1",
            "--sender-levels",
            "1",
            "--coarse-radius",
            "0.3",
            "--json",
        ])
        .assert();
    // Refusing such a file would be right, too; dropping in silence would not.
    let output = output.success().get_output().clone();
    let said = crate::stage::json(&output.stdout);
    assert_eq!(said["triangles"], 2);
    assert!(said["notes"].to_string().contains("finite"), "{}", said["notes"]);
}

/// Three vertices on one spot: a file with geometry that no ray ever meets.
/// Disks of 100 m fit nowhere into a box of 0.55 m.
#[test]
fn points_farther_apart_than_the_scene_is_wide_are_one_for_each_plane_at_most() {
    let folder = folder();
    let wide = ["--levels", "11", "--sender-levels", "1", "--coarse-radius", "100"];
    let said = bake_json(&data("cornell.glb"), &folder.path().join("a.relight"), &wide);
    let points = said["points"].as_array().unwrap();
    // Five walls, a lamp, and five faces of each of two blocks.
    let first = points[0].as_u64().unwrap();
    assert!((1..=16).contains(&first), "{points:?}");
    assert!(points[10].as_u64() > Some(10), "{points:?}");
}

/// Disks whose finest are 0.0005/2⁵ m wide. Truth: a maximal Poisson-disk set has 0.70 points per R² (Lagae and Dutré 2008), the
/// box has six walls of 4 m², and each coarser level has a quarter of the points.
#[test]
fn more_points_than_memory_are_refused_with_their_number_before_there_are_any() {
    let (folder, start) = (folder(), std::time::Instant::now());
    let mut bake = relight();
    bake.arg("bake").arg(data("furnace_box.glb")).arg("-o");
    bake.arg(folder.path().join("a.relight"));
    let text = complaint(bake.args(["--levels", "6", "--coarse-radius", "0.0005"]), 1);
    let points = text.split_whitespace().find_map(|word| word.parse::<f64>().ok());
    let expected = 0.70 * 24.0 / (0.0005f64 / 32.0).powi(2) * 4.0 / 3.0;
    let ratio = points.unwrap() / expected;
    // Dart throwing stops a little before its sets are maximal, and measures area by some thousand disks.
    assert!((0.85..1.1).contains(&ratio), "{ratio}: {text}");
    for word in [
        "MB",
        "this machine has",
        "--coarse-radius",
        "--levels",
        "--preset",
    ] {
        assert!(text.contains(word), "{text}");
    }
    assert!(names(folder.path()).is_empty());
    // There are so many that spreading them would take days.
    assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
}

#[test]
fn a_scene_where_nothing_is_reachable_says_so() {
    let folder = folder();
    let text = bake_complaint(&gltf(folder.path(), &[[0.0; 3]; 3]));
    assert!(
        text.contains("--viewpoint") || text.contains("triangle"),
        "{text}"
    );
}

#[test]
fn an_output_that_cannot_be_written_is_named_before_the_work_begins() {
    let folder = folder();
    let file = folder.path().join("file");
    std::fs::write(&file, b"").unwrap();
    for output in [folder.path().to_path_buf(), file.join("a.relight")] {
        let text = complaint(
            relight()
                .arg("bake")
                .arg(data("cornell.glb"))
                .arg("-o")
                .arg(&output),
            1,
        );
        assert!(text.contains(output.to_str().unwrap()), "{text}");
        assert!(!text.contains("Reading"), "{text}");
    }
    let text = complaint(
        relight()
            .arg("play")
            .arg(cornell())
            .arg("-o")
            .arg(file.join("f.exr"))
            .args(["--size", "8x8"]),
        1,
    );
    assert!(text.contains("f.exr"), "{text}");
}

#[test]
fn a_camera_that_does_not_exist_is_answered_with_those_that_do() {
    let folder = folder();
    let frame = folder.path().join("f.exr");
    let text = complaint(
        relight()
            .arg("play")
            .arg(cornell())
            .arg("-o")
            .arg(&frame)
            .args(["--camera", "Attic"]),
        1,
    );
    assert!(
        text.contains("\"Attic\"") && text.contains("\"Camera\""),
        "{text}"
    );
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_wrong_sequence_is_answered_with_the_path_of_the_field() {
    let folder = folder();
    let frame = folder.path().join("f.exr");
    let cases = [
        (
            r#"{"relight_sequence": 1, "lights": [{"name": "a", "type": "point", "position": [0,0,0], "intensity": [1,1,1], "colour": 3}]}"#,
            "lights[0]",
        ),
        (
            r#"{"relight_sequence": 1, "lights": [{"name": "a", "type": "laser"}]}"#,
            "lights[0].type",
        ),
        (
            r#"{"relight_sequence": 1, "lights": [{"name": "a", "type": "point", "position": [0,0], "intensity": [1,1,1]}]}"#,
            "lights[0].position",
        ),
        (r#"{"relight_sequence": 1, "lights": ["#, "line"),
        (
            r#"{"relight_sequence": 1, "lights": [{"name": "a", "type": "environment", "file": "gone.hdr"}]}"#,
            "gone.hdr",
        ),
    ];
    for (text, path) in cases {
        let lights = sequence(folder.path(), "l.json", text);
        for command in ["play", "bake"] {
            let mut run = relight();
            run.arg(command);
            let input = if command == "play" {
                cornell().to_path_buf()
            } else {
                data("cornell.glb")
            };
            let text = complaint(
                run.arg(input).arg("--lights").arg(&lights).arg("-o").arg(&frame),
                1,
            );
            assert!(text.contains("l.json") && text.contains(path), "{text}");
        }
    }
    assert_eq!(names(folder.path()), ["l.json"]);
}

#[test]
fn other_files_are_no_assets_and_no_images() {
    let text = complaint(relight().arg("inspect").arg(data("cornell.glb")), 1);
    assert!(text.contains("cornell.glb"), "{text}");
    let text = complaint(
        relight()
            .arg("play")
            .arg(data("cornell.glb"))
            .args(["-o", "f.exr"]),
        1,
    );
    assert!(text.contains("cornell.glb"), "{text}");
    let text = complaint(
        relight()
            .arg("compare")
            .arg(data("cornell.glb"))
            .arg(data("cornell.glb")),
        1,
    );
    assert!(text.contains("cornell.glb"), "{text}");
}
