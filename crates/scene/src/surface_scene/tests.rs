//! Statements about scenes that are read from a description.

use super::*;
use crate::rays::Ray;
use crate::surface::Surfaces;
use std::fs;

const SCENE: &str = r#"{ "relight_scene": 1,
    "camera": { "position": [0, 1, 5], "look_at": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 36, "aspect": 1.25 },
    "boxes": [ { "name": "floor", "min": [-2, -0.1, -2], "max": [2, 0, 2], "albedo": [0.7, 0.6, 0.5] } ],
    "implicits": [ { "name": "ball", "albedo": [0.1, 0.2, 0.3], "bounds": [[-0.5, 0, -0.5], [0.5, 1, 0.5]],
        "sdf": { "smooth_union": { "k": 0.01, "of": [
            { "difference": { "of": [ { "sphere": { "center": [0, 0.5, 0], "radius": 0.4 } },
                                      { "torus": { "center": [0, 0.9, 0], "major": 0.1, "minor": 0.05 } } ] } } ] } } } ],
    "volumes": [ { "name": "cube", "file": "cube.vol", "size": [4, 4, 4], "bounds": [[1, 0, 1], [1.4, 0.4, 1.4]],
        "level": 100, "albedo": [0.9, 0.9, 0.9] } ] }"#;

fn write(folder: &Path, description: &str) -> PathBuf {
    // A cube of 2³ dense samples in an empty border.
    let inner =
        |k: usize| (1..3).contains(&(k % 4)) && (1..3).contains(&(k / 4 % 4)) && (1..3).contains(&(k / 16));
    let samples: Vec<u8> = (0..64).map(|k| if inner(k) { 200 } else { 0 }).collect();
    fs::write(folder.join("cube.vol"), samples).unwrap();
    let path = folder.join("test.scene.json");
    fs::write(&path, description).unwrap();
    path
}

fn error(description: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), description);
    read_surface_scene(&path).err().expect("an error").to_string()
}

/// Truth by hand: what a ray straight down meets, how high, of which colour. Half of 200 is at the level,
/// half way between the centres of the border and the cube: 0.1 below the bounds.
#[test]
fn meshes_implicit_surfaces_and_volumes_stand_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    let scene = read_surface_scene(&write(folder.path(), SCENE)).unwrap();
    for (x, z, height, albedo) in [
        (-1.5, 1.0, 0.0, [0.7, 0.6, 0.5]),
        (0.0, 0.0, 0.9, [0.1, 0.2, 0.3]),
        (1.2, 1.2, 0.3, [0.9, 0.9, 0.9]),
    ] {
        let ray = Ray {
            origin: Vec3::new(x, 3.0, z),
            direction: Vec3::NEG_Y,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let hit = scene.surfaces.closest_hit(&ray).unwrap();
        assert!((hit.position.y - height).abs() < 1e-5, "{hit:?}");
        assert!(
            hit.front && (hit.geometric_normal - Vec3::Y).length() < 1e-3,
            "{hit:?}"
        );
        assert_eq!(scene.surfaces.albedo(&hit), Vec3::from(albedo));
    }
    assert_eq!(scene.camera.aspect, Some(1.25));
}

#[test]
fn boxes_face_outwards() {
    let mesh = box_mesh(Vec3::new(-1.0, -2.0, -3.0), Vec3::new(1.0, 2.0, 3.0), 0);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|k| mesh.positions[k as usize]);
        assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "{triangle:?}");
    }
    // Divergence theorem: a closed surface that faces outwards holds the box's volume.
    let volume: f32 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|k| mesh.positions[k as usize]);
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    assert!((volume - 48.0).abs() < 1e-4);
}

#[test]
fn mistakes_are_named_with_their_place() {
    for (from, to, expected) in [
        (
            "\"relight_scene\": 1",
            "\"relight_scene\": 2",
            "relight_scene: expected 1, the version that this program reads, found 2",
        ),
        (
            "\"radius\": 0.4",
            "\"radius\": -0.4",
            "implicits[0].sdf.smooth_union.of[0].difference.of[0].sphere.radius: expected a number above 0, found -0.4 (line 6, column 86)",
        ),
        (
            "\"radius\": 0.4",
            "\"radius\": 0.4, \"colour\": 1",
            "sphere.colour: unknown field `colour`, expected `center` or `radius`",
        ),
        ("cube.vol", "../cube.vol", "volumes[0].file"),
        ("cube.vol", "/etc/hosts", "volumes[0].file"),
        ("cube.vol", "none.vol", "none.vol"),
        ("[4, 4, 4]", "[4, 4, 5]", "64 bytes for a volume"),
        ("\"level\": 100", "\"level\": -1", "border"),
        (
            "[0.7, 0.6, 0.5]",
            "[1.7, 0.6, 0.5]",
            "boxes[0].albedo[0]: expected a number from 0 to 1, found 1.7",
        ),
        ("\"vfov_deg\": 36", "\"vfov_deg\": 0", "camera.vfov_deg"),
        (
            "[-2, -0.1, -2]",
            "[2, -0.1, -2]",
            "boxes[0].max: from [2, -0.1, -2] to",
        ),
    ] {
        assert!(SCENE.contains(from));
        let message = error(&SCENE.replace(from, to));
        assert!(message.contains(expected), "{to}: {message}");
    }
    assert!(error("{").contains("line 1"));
}

/// The example scene of the repository: every part is seen, the soil through the gap between trunk and rim.
#[test]
fn the_example_scene_shows_all_of_its_parts() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/isosurface.scene.json");
    let scene = read_surface_scene(&path).unwrap();
    let camera = scene.camera.at(0.0);
    let mut seen = vec![0; scene.surfaces.surfaces().len()];
    let size = glam::Vec2::new(160.0, 128.0);
    for k in 0..160 * 128 {
        let pixel = glam::Vec2::new((k % 160) as f32 + 0.5, (k / 160) as f32 + 0.5);
        let direction = camera.direction(pixel, size);
        let ray = Ray {
            origin: camera.position,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        if let Some(hit) = scene.surfaces.closest_hit(&ray) {
            assert!(hit.geometric_normal.dot(direction) <= 0.0 && hit.geometric_normal.is_normalized());
            assert!(hit.normal.is_normalized() && hit.position.is_finite());
            seen[scene.surfaces.surface_of(&hit).unwrap()] += 1;
        }
    }
    assert!(seen.iter().all(|&count| count > 5), "pixels per part: {seen:?}");
}

/// Truth: the same rays against the surfaces themselves. Cells are a hundredth of the ball and half a step of the volume.
#[test]
fn triangles_of_a_description_lie_on_its_surfaces() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), SCENE);
    let surfaces = read_surface_scene(&path).unwrap().surfaces;
    let (scene, bytes) = read_meshed(&path).unwrap();
    assert_eq!(bytes.len(), SCENE.len() + 64);
    assert_eq!(scene.materials.len(), 3);
    let meshed = TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap();
    let (mut same, mut count) = (0, 0);
    for k in 0..2000u32 {
        let turn = |step: f32| (k as f32 * step).fract();
        let (sin, cos) = (std::f32::consts::TAU * turn(0.618_034)).sin_cos();
        let origin = Vec3::new(3.0 * sin, 0.2 + 2.0 * turn(0.754_878), 3.0 * cos);
        let target = Vec3::new(
            1.6 * turn(0.569_84) - 0.4,
            0.8 * turn(0.32),
            1.6 * turn(0.445) - 0.4,
        );
        let ray = Ray {
            origin,
            direction: (target - origin).normalize(),
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let Some(truth) = surfaces.closest_hit(&ray) else {
            continue;
        };
        count += 1;
        if let Some(hit) = meshed.closest_hit(&ray)
            && (hit.t - truth.t).abs() < 5e-3
            && surfaces.albedo(&truth) == meshed.albedo(&hit)
        {
            assert!(hit.front);
            same += 1;
        }
    }
    // The rest grazes an outline or a crease, or meets the cube's rounded edges of two cells.
    assert!(count > 1500 && same > count * 97 / 100, "{same} of {count}");
}
