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
        baked.tree,
        albedo,
        &baked.links,
        baked.bounce,
        baked.bounce_level,
        get("bounces").map(|b| b.parse().unwrap()),
    );
    transfer.diagnose();
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
    if get("probe").is_some() {
        use relight_scene::rays::Ray;
        use relight_scene::surface::ray_from;
        use relight_transport::sampling::{DirectionSet, Frame};
        let transfer = player.transfer.as_ref().unwrap();
        let mut e = vec![Vec3::ZERO; player.points.len()];
        relight_play::lighting::irradiance_at(&player.scene, &lights, 0, &player.points, 1, 0, &mut e);
        let b: Vec<Vec3> = e.iter().zip(&transfer.albedo).map(|(e, a)| *e * *a).collect();
        let (values, _) = transfer.indirect_from_direct(&e);
        let pulled = transfer.senders.pulled(&b);
        let set = DirectionSet::uniform(512, &mut relight_transport::random::Stream::new(5, 5, 5));
        let mut sums = [0.0f64; 5];
        let mut more = [0.0f64; 2];
        for f in (0..shot.len()).step_by(shot.len() / 400) {
            let Some(hit) = &shot.hits[f] else { continue };
            let frame = Frame::around(hit.geometric_normal);
            let mut est = [0.0f64; 5];
            for d in &set.directions {
                let dir = frame.world_from_local(*d);
                let w = d.z * 2.0 / 512.0 / set.full;
                let ray: Ray = ray_from(hit, dir);
                let Some(h) = player.scene.closest_hit(&ray) else {
                    continue;
                };
                let mut exact = vec![Vec3::ZERO; 1];
                relight_play::lighting::irradiance_at(
                    &player.scene,
                    &lights,
                    0,
                    &[Some(h)],
                    1,
                    0,
                    &mut exact,
                );
                let rho = player.scene.albedo(&h);
                est[0] += f64::from((exact[0] * rho).x * w);
                if let Some(p) = transfer.finest.nearest(h.position, h.normal) {
                    est[1] += f64::from((e[p as usize] * rho).x * w);
                    est[2] += f64::from(b[p as usize].x * w);
                    est[3] += f64::from(
                        pulled[transfer.senders.levels() - 1]
                            [transfer.senders.leaf_of_point[p as usize] as usize]
                            .x
                            * w,
                    );
                }
            }
            let mut v = relight_transport::pyramid::VectorIrradiance::default();
            for &(j, w) in shot.weights.row(f) {
                v.add_carried(
                    &values[j as usize],
                    transfer.finest.normals[j as usize],
                    hit.normal,
                    w,
                );
            }
            est[4] = f64::from(v.irradiance(hit.normal).x);
            // The same gather at the points that the fragment reads.
            let near: Vec<(u32, f32)> = transfer
                .finest
                .nearest(hit.position, hit.normal)
                .map(|p| (p, 1.0))
                .into_iter()
                .collect();
            let (mut at, mut vp) = (0.0f64, 0.0f64);
            for &(j, w) in near.iter() {
                let Some(hp) = &player.points[j as usize] else {
                    continue;
                };
                vp += f64::from(values[j as usize].irradiance(hp.normal).x * w);
                let fp = Frame::around(hp.geometric_normal);
                let mut sum = 0.0f64;
                for d in set.directions.iter() {
                    let dir = fp.world_from_local(*d);
                    let Some(h) = player.scene.closest_hit(&ray_from(hp, dir)) else {
                        continue;
                    };
                    if let Some(p) = transfer.finest.nearest(h.position, h.normal) {
                        sum += f64::from(
                            pulled[2][transfer.senders.leaf_of_point[p as usize] as usize].x * d.z * 2.0
                                / 512.0
                                / set.full,
                        );
                    }
                }
                at += sum * f64::from(w);
            }
            more[0] += at;
            more[1] += vp;
            for i in 0..5 {
                sums[i] += est[i];
            }
        }
        println!(
            "  probe exact {} nearest-E {} nearest-b {} cluster {} operator {} gather-at-points {more:?}",
            sums[0], sums[1], sums[2], sums[3], sums[4]
        );
    }
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
    if let Some(depth) = get("path") {
        use relight_play::{layers, path};
        let cancel = std::sync::atomic::AtomicBool::new(false);
        let watch = layers::Watch {
            cancel: &cancel,
            progress: &|_, _| {},
        };
        let settings = path::PathSettings {
            spp: 32,
            max_bounces: depth.parse().ok(),
            seed: 0,
            light_layers: false,
        };
        let size = layers::RenderSize {
            width: size[0],
            height: size[1],
        };
        let truth = path::render(&player.scene, &lights, &camera, size, &settings, &watch)
            .unwrap_or_else(|_| panic!());
        let truth = truth.rgb("indirect").unwrap();
        let mean: f64 = truth.pixels.iter().map(|p| f64::from(p[0] + p[1] + p[2])).sum();
        let mine: f64 = indirect.iter().map(|p| f64::from(p.x + p.y + p.z)).sum();
        println!(
            "  against path of {depth} reflections: mean {:+.2} %",
            (mine / mean - 1.0) * 100.0
        );
        let reference = relight_scene::image::FloatImage {
            width: size.width,
            height: size.height,
            pixels: indirect.iter().map(|p| p.to_array()).collect(),
        };
        let _ = relight_scene::image::write_png(
            &std::env::temp_dir().join("study_path.png"),
            &relight_scene::image::tone_mapped(&truth, 0.0),
        );
        let _ = relight_scene::image::write_png(
            &std::env::temp_dir().join("study_mine.png"),
            &relight_scene::image::tone_mapped(&reference, 0.0),
        );
    }
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
