//! Bakes scenes of `../shared` with chosen parameters and compares the indirect layer with the independent
//! reference images: the command behind the tables of `docs/transfer.md`.
//!
//! `cargo run --release --example study -- SHARED NAME [key=value …]`
use glam::Vec3;
use relight_bake::params::BakeParams;
use relight_bake::{points, transport};
use relight_play::frame::{LightingSettings, Player};
use relight_play::shot;
use relight_play::transfer::Transfer;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::light_set::{LightRig, SceneEmitters};
use relight_scene::sequence::read_sequence;
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let shared = Path::new(&args[0]);
    let name = &args[1];
    let get = |key: &str| {
        args[2..]
            .iter()
            .find_map(|a| a.strip_prefix(key).and_then(|a| a.strip_prefix('=')))
            .map(str::to_owned)
    };
    let number = |key: &str, default: f64| get(key).map_or(default, |v| v.parse().expect("a number"));
    let meta: serde_json::Value =
        serde_json::from_slice(&std::fs::read(shared.join(format!("reference/{name}.json"))).unwrap())
            .unwrap();
    let start = Instant::now();
    let scene_file = shared.join("scenes").join(meta["scene"].as_str().unwrap());
    let scene = Arc::new(import(&scene_file, &ImportOptions::default()).unwrap());
    let traced = TracedScene::new(scene.clone(), Shading::Lambert).unwrap();
    let load = start.elapsed().as_secs_f64();
    let size: Vec<usize> = meta["size"]
        .as_str()
        .unwrap()
        .split('x')
        .map(|v| v.parse().unwrap())
        .collect();
    let camera = scene.cameras[0].at(0.0);

    let params = BakeParams {
        levels: number("levels", 6.0) as usize,
        sender_levels: number("senders", 3.0) as usize,
        epsilon: number("epsilon", 0.025) as f32,
        rays: number("rays", 512.0) as usize,
        ..BakeParams::default()
    };
    let viewpoints: Vec<Vec3> = vec![camera.position];
    let start = Instant::now();
    let (radius, _) = points::coarse_radius_for(&traced, &viewpoints, params.levels, 0).unwrap();
    let radius = number("radius", f64::from(radius)) as f32;
    let distributed = points::distribute(&traced, &viewpoints, params.levels, radius, params.seed, |_| {
        Ok(())
    })
    .unwrap();
    let points_s = start.elapsed().as_secs_f64();
    let counts: Vec<usize> = distributed.levels.iter().map(|l| l.points.len()).collect();
    println!(
        "{name}: load {load:.2}s points {points_s:.2}s R0 {radius:.3} {counts:?} candidates {}",
        distributed.candidates
    );
    let start = Instant::now();
    let baked = transport::transport(&traced, distributed, &params, |v| v, |_| Ok(())).unwrap();
    let refine_s = start.elapsed().as_secs_f64();
    let per_level: Vec<usize> = {
        let mut first = 0;
        counts
            .iter()
            .map(|&c| {
                let links = baked.links.row_offsets[first + c] - baked.links.row_offsets[first];
                first += c;
                links as usize
            })
            .collect()
    };
    println!(
        "  refine {refine_s:.2}s links {} {per_level:?} bounce {} gathered {:?} rays {:.1}M lost {}",
        baked.links.len(),
        baked.bounce.entries.len(),
        baked.gathered,
        baked.rays as f64 / 1e6,
        baked.lost
    );
    let levels = transport::levels_of(&baked.points);
    let albedo = baked.points.levels[levels.len() - 1]
        .points
        .iter()
        .map(|p| p.albedo)
        .collect();
    let start = Instant::now();
    let transfer = Transfer::new(
        levels,
        params.sender_levels,
        albedo,
        &baked.links,
        baked.bounce,
        baked.bounce_level,
        get("bounces").map(|b| b.parse().unwrap()),
    );
    let player = Player::new(traced, Some(transfer));
    let prepare_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let mut shot = shot::expose(
        &player.scene,
        &camera,
        size[0],
        size[1],
        number("spp", 16.0) as u32,
    );
    let expose_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    shot.weigh(&player.transfer.as_ref().unwrap().finest);
    let weigh_s = start.elapsed().as_secs_f64();
    let sequence = read_sequence(&shared.join(format!("reference/{name}.lights.json"))).unwrap();
    let emitters = SceneEmitters::new(&player.scene);
    let rig = LightRig::new(&emitters, &sequence.lights).unwrap();
    let lights = rig.at(0.0);
    let settings = LightingSettings {
        pixel_samples: 16,
        point_samples: 16,
        seed: 0,
        per_light: false,
    };
    let (_, _) = player.light(&shot, &lights, &settings);
    let (lit, times) = player.light(&shot, &lights, &settings);
    println!(
        "  prepare {prepare_s:.2}s expose {expose_s:.2}s weigh {weigh_s:.2}s fragments {} uncovered {} {times:?} {:?}",
        shot.len(),
        shot.uncovered(),
        lit.transfer
    );
    let indirect = shot.resolve(&lit.indirect);
    compare(shared, name, "indirect", &meta, &indirect, size[0], size[1]);
    let full: Vec<Vec3> = (0..shot.len())
        .map(|f| lit.emission[f] + lit.direct[f] + lit.indirect[f].max(Vec3::ZERO))
        .collect();
    compare(
        shared,
        name,
        "full",
        &meta,
        &shot.resolve(&full),
        size[0],
        size[1],
    );
    let _ = player.scene.bounds();
}

fn compare(
    shared: &Path,
    name: &str,
    layer: &str,
    meta: &serde_json::Value,
    image: &[Vec3],
    w: usize,
    h: usize,
) {
    use relight_scene::image;
    let file = shared.join(format!("reference/{name}.{layer}.exr"));
    let reference = image::read_exr(&file, &image::Limits::default()).unwrap();
    let reference = reference.rgb("beauty").unwrap();
    let mine = image::FloatImage {
        width: w,
        height: h,
        pixels: image.iter().map(|p| p.to_array()).collect(),
    };
    let noise = meta[layer]["noise_relmse"].as_f64().unwrap();
    let relmse = image::metrics::relmse(&mine, &reference).unwrap();
    let mean = |i: &image::FloatImage| {
        i.pixels
            .iter()
            .map(|p| f64::from(p[0] + p[1] + p[2]))
            .sum::<f64>()
    };
    let bad = mine
        .pixels
        .iter()
        .filter(|p| p.iter().any(|v| !v.is_finite()))
        .count();
    println!(
        "  {layer}: relMSE {relmse:.5} - noise {noise:.5} = {:.5}, mean {:+.2} %, bad {bad}",
        relmse - noise,
        (mean(&mine) / mean(&reference) - 1.0) * 100.0
    );
    let map = image::error_map(&mine, &reference).unwrap();
    for (what, picture) in [("mine", &mine), ("ref", &reference), ("err", &map)] {
        let path = std::env::temp_dir().join(format!("study_{name}_{layer}_{what}.png"));
        let _ = image::write_png(&path, &image::tone_mapped(picture, 0.0));
    }
}
