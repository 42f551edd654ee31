//! `relight export --what lightmap`: surfaces' light as a texture.

use crate::stage::{
    TINY, bake_json, complaint, cornell, data, folder, gltf, json, names, relight, sequence, yard,
};
use glam::{DVec2, Vec2, Vec3};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::image::{FloatImage, Limits, read_exr};
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::{Shading, TracedScene};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// What a lookup of a texture gives: bilinear, borders clamped.
pub fn looked_up(map: &FloatImage, uv: Vec2) -> Vec3 {
    let size = DVec2::new(map.width as f64, map.height as f64);
    let at = (uv.as_dvec2() * size - 0.5).clamp(DVec2::ZERO, size - 1.0);
    let (low, share) = (at.floor(), at.fract().as_vec2());
    let texel = |dx: usize, dy: usize| {
        let (x, y) = (low.x as usize + dx, low.y as usize + dy);
        Vec3::from(map.pixels[y.min(map.height - 1) * map.width + x.min(map.width - 1)])
    };
    let row = |dy| texel(0, dy).lerp(texel(1, dy), share.x);
    row(0).lerp(row(1), share.y)
}

fn exr(file: &Path) -> FloatImage {
    read_exr(file, &Limits::default()).unwrap().rgb("beauty").unwrap()
}

/// Exports a lightmap; what it says.
pub fn export(asset: &Path, output: &Path, more: &[&str]) -> Value {
    let mut run = relight();
    run.arg("export")
        .arg(asset)
        .args(["--what", "lightmap", "--json", "-o"]);
    let run = run.arg(output).args(more).assert().success();
    json(&run.get_output().stdout)
}

/// The JSON and the binary chunk of a .glb.
fn glb(file: &Path) -> (Value, Vec<u8>) {
    let bytes = std::fs::read(file).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(8)), (&b"glTF"[..], bytes.len()));
    let length = word(12);
    (
        serde_json::from_slice(&bytes[20..20 + length]).unwrap(),
        bytes[28 + length..].to_vec(),
    )
}

/// The numbers of an accessor.
fn accessor<const N: usize>((json, bytes): &(Value, Vec<u8>), index: &Value) -> Vec<[f32; N]> {
    let own = &json["accessors"][index.as_u64().unwrap() as usize];
    let view = &json["bufferViews"][own["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let count = own["count"].as_u64().unwrap() as usize;
    let numbers: Vec<f32> = bytes[start..start + 4 * N * count]
        .chunks(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    numbers.as_chunks::<N>().0.to_vec()
}

/// The level square of 10 m under one lamp. Truths: E = I cos θ / d² at every place of it, by bilinear lookups with the coordinates of the
/// scene that is written; no indirect light; the same in the .ktx2 and, to a step, in the picture within the scene. Tolerance: at
/// the border a lookup takes the light of up to half a texel (0.04 m) beside, and E changes by 3 / 2h = 75 % per metre at most.
#[test]
fn a_level_square_has_the_irradiance_of_its_lamp() {
    let folder = folder();
    let asset = yard(folder.path());
    let lamp = r#"{ "relight_sequence": 1, "lights": [
        { "name": "lamp", "type": "point", "position": [1, 2, -0.5], "intensity": [8, 4, 2] } ] }"#;
    let lights = sequence(folder.path(), "lamp.json", lamp);
    let out = folder.path().join("out");
    let said = export(
        &asset,
        &out,
        &["--size", "128", "--lights", lights.to_str().unwrap()],
    );
    assert_eq!(said["facts"]["maps"][0][0], "lightmap");
    let map = exr(&out.join("lightmap.exr"));
    assert_eq!((map.width, map.height), (128, 128));
    let scene = glb(&out.join("lightmap.glb"));
    let attributes = &scene.0["meshes"][0]["primitives"][0]["attributes"];
    let positions = accessor::<3>(&scene, &attributes["POSITION"]);
    let uvs = accessor::<2>(&scene, &attributes["TEXCOORD_1"]);
    let truth = |p: Vec3| {
        let to = Vec3::new(1.0, 2.0, -0.5) - p;
        Vec3::new(8.0, 4.0, 2.0) * to.y / to.length().powi(3)
    };
    // Anywhere on the square: between the first corners, which are a triangle.
    let (mut worst, mut sum) = (0.0f32, 0.0);
    for i in 0..100 {
        for j in 0..100 - i {
            let (v, w) = (i as f32 / 99.0, j as f32 / 99.0);
            let place = |corners: [Vec3; 3]| {
                corners[0] + (corners[1] - corners[0]) * v + (corners[2] - corners[0]) * w
            };
            let at = place([0, 1, 2].map(|k| Vec3::from(positions[k])));
            let uv = place([0, 1, 2].map(|k| Vec2::from(uvs[k]).extend(0.0))).truncate();
            let off = (looked_up(&map, uv) - truth(at)).abs() / truth(at);
            worst = worst.max(off.max_element());
            sum += off.x;
        }
    }
    assert!(worst < 0.03, "{worst}");
    assert!(sum / 5050.0 < 0.003, "{}", sum / 5050.0);
    let texture = std::fs::read(out.join("lightmap.ktx2")).unwrap();
    let texels = &texture[texture.len() - 8 * 128 * 128..];
    for (texel, pixel) in texels.chunks(8).zip(&map.pixels) {
        let half = |k: usize| half::f16::from_le_bytes([texel[2 * k], texel[2 * k + 1]]).to_f32();
        assert_eq!([half(0), half(1), half(2)], *pixel);
    }
    let number = |at: usize| u32::from_le_bytes(texture[at..at + 4].try_into().unwrap());
    // Format, across, down, not deep.
    assert_eq!(
        [number(12), number(20), number(24), number(28)],
        [97, 128, 128, 0]
    );

    let output = folder.path().join("indirect");
    export(
        &asset,
        &output,
        &[
            "--size",
            "16",
            "--part",
            "indirect",
            "--lights",
            lights.to_str().unwrap(),
        ],
    );
    let dark = exr(&output.join("lightmap.exr"));
    assert!(
        dark.pixels.iter().flatten().all(|v| *v < 1e-4),
        "a plane lights nothing"
    );
}

/// Truth: light adds up; half precision.
#[test]
fn maps_of_lights_sum_to_the_one_of_all() {
    let folder = folder();
    let two = r#"{ "relight_sequence": 1, "lights": [
        { "name": "lamp/1", "type": "point", "position": [0.2, 0.4, 0.1], "intensity": [0.3, 0.2, 0.1] },
        { "name": "blue: \u00fc", "type": "point", "position": [0.4, 0.2, 0.05], "intensity": [0.01, 0.02, 0.1] } ] }"#;
    let lights = sequence(folder.path(), "two.json", two);
    let run = |more: &[&str], name: &str| {
        let out = folder.path().join(name);
        let size = ["--size", "64", "--lights", lights.to_str().unwrap()];
        export(cornell(), &out, &[&size[..], more].concat());
        out
    };
    let each = run(&["--per-light"], "each");
    assert_eq!(
        names(&each),
        [
            "README.txt",
            "lightmap.exr",
            "lightmap.glb",
            "lightmap.ktx2",
            "lightmap_000_lamp_1.exr",
            "lightmap_000_lamp_1.ktx2",
            "lightmap_001_blue_ ü.exr",
            "lightmap_001_blue_ ü.ktx2"
        ]
    );
    let of = |folder: &Path, name: &str| exr(&folder.join(name)).pixels;
    let (first, second) = (
        of(&each, "lightmap_000_lamp_1.exr"),
        of(&each, "lightmap_001_blue_ ü.exr"),
    );
    let sum: Vec<[f32; 3]> = first
        .iter()
        .zip(&second)
        .map(|(a, b)| [0, 1, 2].map(|k| a[k] + b[k]))
        .collect();
    let all = of(&each, "lightmap.exr");
    let together = of(&run(&[], "all"), "lightmap.exr");
    let (direct, indirect) = (
        of(&run(&["--part", "direct"], "direct"), "lightmap.exr"),
        of(&run(&["--part", "indirect"], "indirect"), "lightmap.exr"),
    );
    let parts: Vec<[f32; 3]> = direct
        .iter()
        .zip(&indirect)
        .map(|(a, b)| [0, 1, 2].map(|k| a[k] + b[k]))
        .collect();
    let mean = all.iter().flatten().sum::<f32>() / (3.0 * all.len() as f32);
    assert!(mean > 0.0 && indirect.iter().flatten().sum::<f32>() > 0.0);
    let off = |a: &[[f32; 3]]| {
        let each = a.iter().flatten().zip(all.iter().flatten());
        each.map(|(a, b)| (a - b).abs() / (b + mean))
            .fold(0.0f32, f32::max)
    };
    for (what, other) in [("lights", &sum), ("at once", &together), ("parts", &parts)] {
        assert!(off(other) < 4e-3, "{what}: {}", off(other));
    }
    let text = std::fs::read_to_string(each.join("README.txt")).unwrap();
    for said in ["lightmap_000_lamp_1  \"lamp/1\"", "three.js", "Bevy", "Godot"] {
        assert!(text.contains(said), "{said}");
    }
}

/// The same bytes by any number of threads.
#[test]
fn maps_do_not_hang_on_threads() {
    let folder = folder();
    let lights = sequence(folder.path(), "lamp.json", crate::stage::TINY_LIGHT);
    let files: Vec<Vec<Vec<u8>>> = ["1", "3"]
        .iter()
        .map(|threads| {
            let out = folder.path().join(threads);
            export(
                cornell(),
                &out,
                &[
                    "--size",
                    "32",
                    "--threads",
                    threads,
                    "--lights",
                    lights.to_str().unwrap(),
                ],
            );
            names(&out)
                .iter()
                .map(|name| std::fs::read(out.join(name)).unwrap())
                .collect()
        })
        .collect();
    assert_eq!(files[0], files[1]);
}

#[test]
fn what_cannot_be_a_map_is_said() {
    let folder = folder();
    let out = folder.path().join("out");
    let refused = |asset: &Path, more: &[&str], code: i32| {
        let mut run = relight();
        run.arg("export")
            .arg(asset)
            .args(["--what", "lightmap", "-o"])
            .arg(&out)
            .args(more);
        complaint(&mut run, code)
    };
    let text = refused(cornell(), &["--uv", "1"], 1);
    assert!(text.contains("set 1") && text.contains("--uv auto"), "{text}");
    let none = sequence(
        folder.path(),
        "none.json",
        r#"{ "relight_sequence": 1, "lights": [] }"#,
    );
    let text = refused(cornell(), &["--lights", none.to_str().unwrap()], 2);
    assert!(text.contains("--lights SEQ.json"), "{text}");
    assert!(refused(cornell(), &["--frame", "9"], 2).contains("frames 0 to"));
    for more in [
        ["--size", "0"],
        ["--size", "5000"],
        ["--size", "x"],
        ["--uv", "8"],
        ["--uv", "second"],
        ["--part", "x"],
    ] {
        let mut run = relight();
        run.arg("export")
            .arg(cornell())
            .args(["--what", "lightmap", "-o"])
            .arg(&out)
            .args(more);
        run.assert().code(2);
    }
    for more in [
        &["--uv", "auto"][..],
        &["--size", "64"],
        &["--part", "all"],
        &["--per-light"],
    ] {
        let mut run = relight();
        run.arg("export")
            .arg(cornell())
            .args(["--what", "points", "-o"])
            .arg(&out)
            .args(more);
        assert!(complaint(&mut run, 2).contains("--what lightmap"));
    }
    // The coordinates of a texture that all faces show.
    let table = folder.path().join("table.relight");
    let few = [
        "--levels",
        "2",
        "--sender-levels",
        "1",
        "--coarse-radius",
        "0.5",
        "--keep",
        "materials",
    ];
    bake_json(&data("table.glb"), &table, &few);
    let text = refused(&table, &["--uv", "0"], 1);
    assert!(text.contains("set 0") && text.contains("--uv auto"), "{text}");
    // Files that are read, or others of the same names, are not lost.
    let scene = gltf(folder.path(), &crate::stage::SQUARE);
    std::fs::create_dir_all(&out).unwrap();
    std::fs::copy(&scene, out.join("lightmap.exr")).unwrap();
    let text = refused(cornell(), &["--size", "64"], 1);
    assert!(
        text.contains("lightmap.exr") && text.contains("--force"),
        "{text}"
    );
    assert_eq!(names(&out), ["lightmap.exr"]);
}

/// What matt surfaces of a scene with a lightmap send to its camera, a ray through the middle of each pixel: albedo E / π, `None` where none or
/// an edge is seen.
fn shown(scene: &Path, map: &FloatImage, size: usize) -> Vec<Option<Vec3>> {
    let scene = import(scene, &ImportOptions::default()).unwrap();
    let traced = TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap();
    let camera = traced.scene().cameras[0].at(0.0);
    let hits: Vec<Option<SurfaceHit>> = (0..size * size)
        .map(|i| {
            let at = Vec2::new((i % size) as f32, (i / size) as f32) + 0.5;
            let ray = Ray::endless(camera.position, camera.direction(at, Vec2::splat(size as f32)));
            traced.closest_hit(&ray)
        })
        .collect();
    // World index of each instance's first triangle.
    let own = traced.scene();
    let counts = own
        .instances
        .iter()
        .map(|i| own.meshes[i.mesh as usize].triangles.len() as u32);
    let firsts: Vec<u32> = counts
        .scan(0, |next, count| Some(std::mem::replace(next, *next + count)))
        .collect();
    (0..size * size)
        .map(|i| {
            let hit = hits[i]?;
            let (x, y) = (i % size, i / size);
            let inside = x > 0 && y > 0 && x + 1 < size && y + 1 < size;
            let flat = |j: usize| hits[j].is_some_and(|h| h.normal.dot(hit.normal) > 0.99);
            let alone = inside
                && [
                    i - size - 1,
                    i - size,
                    i - size + 1,
                    i - 1,
                    i + 1,
                    i + size - 1,
                    i + size,
                    i + size + 1,
                ]
                .into_iter()
                .all(flat);
            let point = traced.shading_point(&hit);
            if !alone || point.emission != Vec3::ZERO {
                return None;
            }
            let instance = traced.instance_of(hit.primitive) as usize;
            let mesh = &own.meshes[own.instances[instance].mesh as usize];
            let corners = mesh.triangles[(hit.primitive - firsts[instance]) as usize];
            let uv = |k: usize| mesh.uvs[1][corners[k] as usize];
            let [v, w] = hit.barycentric;
            let uv = uv(0) * (1.0 - v - w) + uv(1) * v + uv(2) * w;
            Some(point.diffuse * looked_up(map, uv) * std::f32::consts::FRAC_1_PI)
        })
        .collect()
}

/// Bias of the mean, and mean squared error over the squared mean, of pixels that show one surface.
fn off(shown: &[Option<Vec3>], truth: &FloatImage) -> (f64, f64) {
    let pairs = || (shown.iter().zip(&truth.pixels)).filter_map(|(a, b)| Some(((*a)?, Vec3::from(*b))));
    let count = pairs().count() as f64;
    assert!(count > 0.5 * truth.pixels.len() as f64, "{count}");
    let mean = |f: &dyn Fn((Vec3, Vec3)) -> f64| pairs().map(f).sum::<f64>() / count;
    let truth = mean(&|(_, b)| f64::from(b.element_sum()));
    let bias = mean(&|(a, _)| f64::from(a.element_sum())) / truth - 1.0;
    let squared = mean(&|(a, b)| f64::from((a - b).length_squared()));
    (bias, 3.0 * squared / (truth * truth))
}

/// The Cornell box under its own lamp, seen through its lightmap. Truths: of direct light the path tracer, of indirect light the frame of the
/// same asset, whose basis is coarse here. The scene that is written is read back by relight's own importer.
#[test]
fn a_room_seen_through_its_map_is_the_room() {
    let folder = folder();
    let asset = folder.path().join("box.relight");
    bake_json(
        &data("cornell.glb"),
        &asset,
        &[&TINY[..], &["--lambert"]].concat(),
    );
    let lights = data("cornell.lights.json");
    let size = 96;
    let frame = |integrator: &[&str], layer: &str| {
        let file = folder.path().join("frame.exr");
        let mut play = relight();
        play.arg("play")
            .arg(&asset)
            .arg("--lights")
            .arg(&lights)
            .args(integrator);
        play.args(["--size", "96x96", "--layers", "direct,indirect", "--force", "-o"])
            .arg(&file);
        play.assert().success();
        read_exr(&file, &Limits::default()).unwrap().rgb(layer).unwrap()
    };
    for (part, integrator) in [
        ("direct", &["--integrator", "path", "--spp", "256"][..]),
        ("indirect", &["--integrator", "transfer"]),
    ] {
        let out = folder.path().join(part);
        export(
            &asset,
            &out,
            &[
                "--size",
                "256",
                "--part",
                part,
                "--lights",
                lights.to_str().unwrap(),
            ],
        );
        let map = exr(&out.join("lightmap.exr"));
        let seen = shown(&out.join("lightmap.glb"), &map, size);
        let (bias, error) = off(&seen, &frame(integrator, part));
        println!("{part}: bias {:.4}, squared error {error:.5}", bias);
        assert!(bias.abs() < 0.01, "{part}: {bias}");
        assert!(error < 0.004, "{part}: {error}");
    }
}
