//! Renders the reference scenes with `path` and compares them with another renderer's images.
//!
//! `cargo run --release -p relight-render --example reference -- REFERENCE_DIR SCENE_DIR OUT_DIR [SPP [NAME…]]`
//!
//! Every reference is rendered twice with half of the samples and different seeds. The table has, for `full`
//! and `indirect`, relMSE against the reference; the reference's own noise (from its NAME.json); ours (a
//! quarter of the relMSE between the halves); and the rest, which is what the two renderers disagree about.
//! Rectangles and spheres get black bodies here, since the references were rendered with such.
//! OUT_DIR gets NAME.png: reference left, ours right; full above, indirect below; NAME.error.png, the relative
//! error of both; and NAME.exr.

use glam::{Affine3A, Vec3, Vec4};
use relight_render::layers::RenderSize;
use relight_render::path::{self, PathSettings};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::image::{
    ExrHeader, FloatImage, Layers, Limits, contact_sheet, display_encoded, error_map, metrics, read_exr,
    tone_mapped, write_exr, write_png,
};
use relight_scene::light::LightKind;
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::material::Material;
use relight_scene::scene::{Instance, Mesh, Scene};
use relight_scene::sequence::{Sequence, read_sequence};
use relight_scene::traced::{Shading, TracedScene};
use serde_json::Value;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// The references: README of their folder.
const NAMES: [&str; 7] = [
    "sponza_dabrovic_point",
    "sponza_dabrovic_sun",
    "sponza_crytek_point",
    "sibenik_points",
    "modern_hall_emissive",
    "stanford_bunny_env",
    "pbr_table_panel",
];

/// Reflections at most, as the references have them.
const MAX_BOUNCES: u32 = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [references, scenes, out, rest @ ..] = arguments.as_slice() else {
        return Err("usage: reference REFERENCE_DIR SCENE_DIR OUT_DIR [SPP [NAME…]]".into());
    };
    let spp: u32 = rest.first().map_or(Ok(512), |spp| spp.parse())?;
    let chosen = |name: &str| rest.len() < 2 || rest[1..].iter().any(|r| r == name);
    std::fs::create_dir_all(out)?;
    println!(
        "| reference | layer | relMSE | reference noise | own noise | rest | mean, ours / theirs | spp | s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for name in NAMES.into_iter().filter(|name| chosen(name)) {
        compare(
            name,
            Path::new(references),
            Path::new(scenes),
            Path::new(out),
            spp,
        )?;
    }
    Ok(())
}

fn compare(name: &str, references: &Path, scenes: &Path, out: &Path, spp: u32) -> Result<(), Box<dyn Error>> {
    let about: Value =
        serde_json::from_str(&std::fs::read_to_string(references.join(format!("{name}.json")))?)?;
    let text = |key: &str| about[key].as_str().ok_or(format!("{name}.json lacks {key}"));
    let (width, height) = text("size")?.split_once('x').ok_or("size is WxH")?;
    let size = RenderSize {
        width: width.parse()?,
        height: height.parse()?,
    };
    let mut scene = import(&scenes.join(text("scene")?), &ImportOptions::default())?;
    let sequence = read_sequence(&references.join(text("sequence")?))?;
    add_bodies(&mut scene, &sequence);
    let camera = scene.cameras.first().ok_or("no camera")?.at(0.0);
    let traced = TracedScene::new(Arc::new(scene), Shading::Lambert)?;
    let emitters = SceneEmitters::new(&traced);
    let lights = LightSet::new(&emitters, &sequence.lights, 0.0)?;

    let started = Instant::now();
    let mut halves = Vec::new();
    for seed in 0..2 {
        let settings = PathSettings {
            spp: spp / 2,
            max_bounces: Some(MAX_BOUNCES),
            seed,
            light_layers: false,
        };
        halves.push(path::render(&traced, &lights, &camera, size, &settings, &())?);
    }
    let seconds = started.elapsed().as_secs_f64();

    let (mut sheet, mut errors) = (Vec::new(), Vec::new());
    let mut result = Layers::new(size.width, size.height);
    for (theirs, ours) in [("full", "beauty"), ("indirect", "indirect")] {
        let file = references.join(format!("{name}.{theirs}.exr"));
        let reference = read_exr(&file, &Limits::default())?
            .rgb("beauty")
            .ok_or("reference lacks R, G, B")?;
        let [a, b] = [0, 1].map(|i| halves[i].rgb(ours).unwrap_or_default());
        let mean = average(&a, &b);
        let raw = metrics::relmse(&mean, &reference)?;
        let own = metrics::relmse(&a, &b)? / 4.0;
        let noise = about[theirs]["noise_relmse"].as_f64().ok_or("no noise_relmse")?;
        let (_, bias) = metrics::bias(&mean, &reference)?;
        println!(
            "| {name} | {theirs} | {raw:.5} | {noise:.5} | {own:.5} | {:+.5} | {:+.3} % | {spp} | {seconds:.0} |",
            raw - noise - own,
            bias * 100.0
        );
        result.push_rgb(ours, &mean.pixels);
        errors.push(error_map(&mean, &reference)?);
        sheet.extend([exposed(&reference, &reference), exposed(&mean, &reference)]);
    }
    write_png(
        &out.join(format!("{name}.error.png")),
        &display_encoded(&contact_sheet(&errors, 1)?),
    )?;
    write_exr(&out.join(format!("{name}.exr")), &result, &ExrHeader::new(), true)?;
    write_png(
        &out.join(format!("{name}.png")),
        &tone_mapped(&contact_sheet(&sheet, 2)?, 0.0),
    )?;
    Ok(())
}

fn average(a: &FloatImage, b: &FloatImage) -> FloatImage {
    let mix =
        |(p, q): (&[f32; 3], &[f32; 3])| ((Vec3::from_array(*p) + Vec3::from_array(*q)) * 0.5).to_array();
    FloatImage {
        width: a.width,
        height: a.height,
        pixels: a.pixels.iter().zip(&b.pixels).map(mix).collect(),
    }
}

/// The image with an exposure that brings the reference's mean to a middle grey of 0.2.
fn exposed(image: &FloatImage, reference: &FloatImage) -> FloatImage {
    let sum: f64 = reference
        .pixels
        .as_flattened()
        .iter()
        .map(|&v| f64::from(v))
        .sum();
    let mean = (sum / (reference.pixels.len() * 3) as f64) as f32;
    let gain = if mean > 0.0 { 0.2 / mean } else { 1.0 };
    let pixels = image.pixels.iter().map(|p| p.map(|v| v * gain)).collect();
    FloatImage {
        width: image.width,
        height: image.height,
        pixels,
    }
}

/// Gives rectangles and spheres of the sequence a black body, a hair behind the emitting surface: in the
/// references' renderer they are things that block light, in relight they are light alone.
fn add_bodies(scene: &mut Scene, sequence: &Sequence) {
    let material = scene.materials.len() as u32;
    scene.materials.push(Material {
        base_color: Vec4::W,
        metallic: 0.0,
        ..Material::default()
    });
    for light in &sequence.lights {
        let mut mesh = Mesh {
            material,
            ..Mesh::default()
        };
        match &light.kind {
            LightKind::Rect {
                center,
                edge_u,
                edge_v,
                ..
            } => {
                let (u, v) = (edge_u.at(0.0), edge_v.at(0.0));
                let behind = center.at(0.0) - u.cross(v).normalize() * (1e-4 * u.length());
                let corner = |a: f32, b: f32| behind + u * a + v * b;
                mesh.positions = vec![
                    corner(-0.5, -0.5),
                    corner(0.5, -0.5),
                    corner(0.5, 0.5),
                    corner(-0.5, 0.5),
                ];
                mesh.triangles = vec![[0, 1, 2], [0, 2, 3]];
            }
            LightKind::Sphere { center, radius, .. } => {
                let (rows, columns) = (32u32, 64u32);
                for i in 0..=rows {
                    for k in 0..columns {
                        let (theta, phi) = (
                            std::f32::consts::PI * i as f32 / rows as f32,
                            std::f32::consts::TAU * k as f32 / columns as f32,
                        );
                        let d = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                        mesh.positions.push(center.at(0.0) + d * (radius.at(0.0) * 0.999));
                    }
                }
                for i in 0..rows {
                    for k in 0..columns {
                        let [a, b] = [k, (k + 1) % columns].map(|k| i * columns + k);
                        mesh.triangles
                            .extend([[a, b, a + columns], [b, b + columns, a + columns]]);
                    }
                }
            }
            _ => continue,
        }
        scene.instances.push(Instance {
            mesh: scene.meshes.len() as u32,
            world_from_mesh: Affine3A::IDENTITY,
        });
        scene.meshes.push(mesh);
    }
}
