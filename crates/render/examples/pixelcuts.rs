//! Pixelcuts against brute force over the same points: error and time over their settings, and the paper's figure 4.
//!
//! `cargo run --release -p relight-render --example pixelcuts -- SCENE.glb SEQ.json WIDTHxHEIGHT VPLS OUT_DIR [lambert]
//! [AREA_SAMPLES] [brief]`
//!
//! One eye ray per pixel, the same in all. relMSE: metrics of `compare` (ε = 0.01 of the mean², top 0.1 % trimmed).
//! Times are wall-clock of one run each, brute force first and last (first only if `brief`); divide by it. OUT_DIR gets brute.png,
//! figure4a.png (one tree, no filter), figure4b.png (as by default) and their errors; `brief` leaves the
//! sweeps out.

use relight_render::brute::{self, PointsSettings};
use relight_render::layers::RenderSize;
use relight_render::many_lights::{PointLights, PointSettings};
use relight_render::pixelcuts::{self, PixelcutsSettings, PixelcutsStats};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::image::{FloatImage, Layers, display_encoded, error_map, metrics, tone_mapped, write_png};
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::sequence::{SequenceCamera, read_sequence};
use relight_scene::traced::{Shading, TracedScene};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, sequence, size, vpls, out, rest @ ..] = arguments.as_slice() else {
        return Err(
            "usage: pixelcuts SCENE.glb SEQ.json WxH VPLS OUT_DIR [lambert] [AREA_SAMPLES] [brief]".into(),
        );
    };
    let out = Path::new(out);
    std::fs::create_dir_all(out)?;
    let (width, height) = size.split_once('x').ok_or("size is WxH")?;
    let size = RenderSize {
        width: width.parse()?,
        height: height.parse()?,
    };
    let asked = |word: &str| rest.iter().any(|r| r == word);
    let scene = import(Path::new(scene), &ImportOptions::default())?;
    let sequence = read_sequence(Path::new(sequence))?;
    let camera = match &sequence.camera {
        Some(SequenceCamera::Own(track)) => track.at(0.0),
        Some(SequenceCamera::Node(name)) => {
            let named = scene.cameras.iter().find(|camera| camera.name == *name);
            named.ok_or("no such camera")?.at(0.0)
        }
        None => scene.cameras.first().ok_or("no camera")?.at(0.0),
    };
    let shading = if asked("lambert") {
        Shading::Lambert
    } else {
        Shading::Full
    };
    let traced = TracedScene::new(Arc::new(scene), shading)?;
    let emitters = SceneEmitters::new(&traced);
    let lights = LightSet::new(&emitters, &sequence.lights, 0.0)?;
    let started = Instant::now();
    let settings = PointSettings {
        vpls: vpls.parse()?,
        area_samples: rest.iter().find_map(|r| r.parse().ok()),
        ..PointSettings::default()
    };
    let points = PointLights::new(&traced, &lights, &settings);
    println!(
        "{} points, {} of them virtual, in {:.3} s; {width}x{height}, {} threads\n",
        points.len(),
        points.len() - points.direct,
        started.elapsed().as_secs_f64(),
        rayon::current_num_threads()
    );

    let brute = |packets| -> Result<(Layers, f64), Box<dyn Error>> {
        let started = Instant::now();
        let settings = PointsSettings {
            spp: 1,
            seed: 0,
            light_layers: false,
            packets,
        };
        let (layers, rays) = brute::render_points(&traced, &lights, &points, &camera, size, &settings, &())?;
        let seconds = started.elapsed().as_secs_f64();
        let per_pixel = rays as f64 / (size.width * size.height) as f64;
        println!("brute force, packets {packets}: {seconds:.2} s, {per_pixel:.1} shadow rays per pixel");
        Ok((layers, seconds))
    };
    let (truth, first) = brute(true)?;
    let standard = PixelcutsSettings::default();
    let mut table = Vec::new();
    let mut run = |what: String, settings: PixelcutsSettings| -> Result<Layers, Box<dyn Error>> {
        let started = Instant::now();
        let (layers, stats) = pixelcuts::render(&traced, &lights, &points, &camera, size, &settings, &())?;
        table.push((
            what,
            started.elapsed().as_secs_f64(),
            errors(&layers, &truth)?,
            stats,
        ));
        Ok(layers)
    };
    let good = run("standard".into(), standard)?;
    let one = PixelcutsSettings {
        trees: 1,
        filter: false,
        ..standard
    };
    let blocky = run("figure 4a: 1 tree, no filter".into(), one)?;
    let unfiltered = PixelcutsSettings {
        filter: false,
        ..standard
    };
    let _ = run("16 trees, no filter".into(), unfiltered)?;
    if !asked("brief") {
        for clusters in [128, 512, 8192] {
            run(
                format!("{clusters} clusters"),
                PixelcutsSettings { clusters, ..standard },
            )?;
        }
        for trees in [1, 4, 64] {
            run(format!("{trees} trees"), PixelcutsSettings { trees, ..standard })?;
        }
        for degree in 0..=3 {
            let settings = PixelcutsSettings {
                degree,
                flat: false,
                ..standard
            };
            run(format!("all by harmonics of degree {degree}"), settings)?;
        }
        for threshold in [1.0, 0.1, 0.001] {
            run(
                format!("refined above {threshold}"),
                PixelcutsSettings {
                    threshold,
                    ..standard
                },
            )?;
        }
    }
    let again = run("standard again".into(), standard)?;
    assert_eq!(
        good.layer("beauty").map(|l| &l.data),
        again.layer("beauty").map(|l| &l.data)
    );
    let last = if asked("brief") { first } else { brute(true)?.1 };
    print(&table, 0.5 * (first + last));

    let truth = truth.rgb("beauty").unwrap_or_default();
    for (name, layers) in [("figure4b", &good), ("figure4a", &blocky)] {
        let image = layers.rgb("beauty").unwrap_or_default();
        write_png(
            &out.join(format!("{name}.png")),
            &tone_mapped(&exposed(&image, &truth), 0.0),
        )?;
        write_png(
            &out.join(format!("{name}.error.png")),
            &display_encoded(&error_map(&image, &truth)?),
        )?;
    }
    write_png(
        &out.join("brute.png"),
        &tone_mapped(&exposed(&truth, &truth), 0.0),
    )?;
    Ok(())
}

/// relMSE of beauty and indirect, and the relative bias of the beauty's mean.
fn errors(found: &Layers, truth: &Layers) -> Result<[f64; 3], Box<dyn Error>> {
    let image = |layers: &Layers, name| layers.rgb(name).unwrap_or_default();
    let beauty = [found, truth].map(|layers| image(layers, "beauty"));
    let indirect = [found, truth].map(|layers| image(layers, "indirect"));
    let (_, bias) = metrics::bias(&beauty[0], &beauty[1])?;
    Ok([
        metrics::relmse(&beauty[0], &beauty[1])?,
        metrics::relmse(&indirect[0], &indirect[1])?,
        bias,
    ])
}

fn print(table: &[(String, f64, [f64; 3], PixelcutsStats)], brute: f64) {
    println!(
        "\n| settings | s | brute / this | relMSE beauty | indirect | bias | rays per pixel | nodes per pixel | eye | exact | \
         estimate | trees | cuts | scatter | shade ms |"
    );
    println!("|{}", " --- |".repeat(15));
    for (what, seconds, [beauty, indirect, bias], stats) in table {
        let t = &stats.times;
        let per_point = |n: u64| n as f64 / stats.points.max(1) as f64;
        println!(
            "| {what} | {seconds:.2} | {:.1} | {beauty:.5} | {indirect:.5} | {:+.2} % | {:.1} | {:.1} | {:.0} | {:.0} | \
             {:.0} | {:.0} | {:.0} | {:.0} | {:.0} |",
            brute / seconds,
            bias * 100.0,
            per_point(stats.shadow_rays),
            per_point(stats.clusters),
            t.eye,
            t.exact,
            t.estimate,
            t.trees,
            t.cuts,
            t.scatter,
            t.shade
        );
    }
}

/// The image with an exposure that brings the reference's mean to a middle grey of 0.2.
fn exposed(image: &FloatImage, reference: &FloatImage) -> FloatImage {
    let values = reference.pixels.as_flattened();
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len().max(1) as f64;
    let gain = if mean > 0.0 { (0.2 / mean) as f32 } else { 1.0 };
    FloatImage {
        pixels: image.pixels.iter().map(|p| p.map(|v| v * gain)).collect(),
        ..image.clone()
    }
}
