//! Studies of lightcuts and reconstruction cuts.
//!
//! `cargo run --release -p relight-render --example lightcuts -- STUDY SCENE.glb SEQUENCE.json WxH [COUNT…]`
//!
//! STUDY is one of
//!
//! * `scaling`: time, shadow rays and nodes per pixel of lightcuts, of every light with a shadow ray, and of Ward 1994,
//!   for COUNT points on the area lights, and errors against every light;
//! * `virtual`: the same for COUNT virtual lights;
//! * `reconstruction`: reconstruction cuts against lightcuts with the same eye rays;
//! * `trees`: time and memory of building, and cuts by trees of exact and of windowed search;
//! * `uncertainty`: errors and nodes for limits on the uncertainty (see `LightcutSettings::uncertainty`).
//! * `bounds`: tightness of the bounds of random nodes at what the camera sees.
//!
//! `-- panels` prints a sequence of 72 rectangular lamps for data/atrium.glb, the studies' interior.
//!
//! Times are those of one core. Contestants run in turns in one process; the image for which every light is evaluated is smaller where there are
//! many lights, and so is then the one it is compared to.

mod tightness;

use glam::Vec3;
use relight_render::brute::{self, PointsSettings};
use relight_render::layers::RenderSize;
use relight_render::lightcuts::{self, EyeRays, LightcutSettings};
use relight_render::many_lights::{PointLights, PointSettings};
use relight_scene::bsdf::Viewed;
use relight_scene::camera::Camera;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::image::{Layers, metrics};
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::rays::Ray;
use relight_scene::sequence::read_sequence;
use relight_scene::surface::{Surfaces, ray_end};
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::light_clusters::{BuildSettings, LightClusters, build};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Seconds that this process has computed for, all threads together: what others do on the machine does not count. Where
/// the system doesn't tell, seconds on the clock times threads.
struct Clock {
    computed: Option<f64>,
    started: Instant,
}

impl Clock {
    fn start() -> Clock {
        Clock {
            computed: Clock::computed(),
            started: Instant::now(),
        }
    }

    fn computed() -> Option<f64> {
        // Fields 14 and 15 of Linux' stat: ticks of 10 ms in user and system mode.
        let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
        let after = stat.rsplit_once(')')?.1;
        let mut fields = after.split_whitespace().skip(11);
        let mut ticks = || fields.next()?.parse::<f64>().ok();
        Some((ticks()? + ticks()?) / 100.0)
    }

    fn seconds(&self) -> f64 {
        match (self.computed, Clock::computed()) {
            (Some(start), Some(end)) => end - start,
            _ => self.started.elapsed().as_secs_f64() * rayon::current_num_threads() as f64,
        }
    }
}

/// Light evaluations that every light at every pixel may take: some seconds.
const BUDGET: f64 = 2e7;

/// Trees that the errors of [`Study::uncertainty`] are means of.
const SEEDS: u64 = 4;

struct Study<'a> {
    scene: &'a TracedScene,
    lights: &'a LightSet<'a>,
    camera: Camera,
    size: RenderSize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.first().is_some_and(|study| study == "panels") {
        println!("{}", panels());
        return Ok(());
    }
    let [study, scene, sequence, size, rest @ ..] = arguments.as_slice() else {
        return Err("usage: lightcuts STUDY SCENE.glb SEQUENCE.json WxH [COUNT…]".into());
    };
    let (width, height) = size.split_once('x').ok_or("size is WxH")?;
    let scene = import(Path::new(scene), &ImportOptions::default())?;
    let sequence = read_sequence(Path::new(sequence))?;
    let camera = scene.cameras.first().ok_or("no camera")?.at(0.0);
    let traced = TracedScene::new(Arc::new(scene), Shading::Full)?;
    let emitters = SceneEmitters::new(&traced);
    let lights = LightSet::new(&emitters, &sequence.lights, 0.0)?;
    let it = Study {
        scene: &traced,
        lights: &lights,
        camera,
        size: RenderSize {
            width: width.parse()?,
            height: height.parse()?,
        },
    };
    let counts: Vec<u32> = rest.iter().map(|n| n.parse()).collect::<Result<_, _>>()?;
    match study.as_str() {
        "scaling" => it.scaling(&counts, false),
        "virtual" => it.scaling(&counts, true),
        "reconstruction" => it.reconstruction(&counts),
        "trees" => it.trees(&counts),
        "bounds" => it.bounds(&counts),
        "uncertainty" => it.uncertainty(&counts),
        _ => Err("no such study".into()),
    }
}

impl Study<'_> {
    fn points(&self, count: u32, virtuals: bool) -> PointLights {
        let settings = PointSettings {
            area_samples: (!virtuals).then_some(count),
            vpls: if virtuals { count } else { 0 },
            environment: count,
            ..PointSettings::default()
        };
        PointLights::new(self.scene, self.lights, &settings)
    }

    fn settings() -> LightcutSettings {
        LightcutSettings {
            spp: 1,
            ..LightcutSettings::default()
        }
    }

    fn scaling(&self, counts: &[u32], virtuals: bool) -> Result<(), Box<dyn Error>> {
        println!(
            "| lights | uncertainty | build s | cuts s | nodes | rays | limited | image for all | cuts µs/px | all µs/px | × | \
             packets × | rays of all | Ward µs/px | Ward rays | within 2 % | mean error | rms |"
        );
        println!("{}", "| --- ".repeat(18) + "|");
        let both = [f32::INFINITY, LightcutSettings::default().uncertainty];
        for (&count, uncertainty) in counts
            .iter()
            .flat_map(|count| both.map(|uncertainty| (count, uncertainty)))
        {
            let settings = LightcutSettings {
                uncertainty,
                ..Self::settings()
            };
            let points = self.points(count, virtuals);
            let start = Clock::start();
            let clusters = lightcuts::trees(self.scene, &points, false, 0);
            let built = start.seconds();
            let start = Clock::start();
            let (_, full) = self.cuts(&points, &clusters, self.size, &settings)?;
            let seconds = start.seconds();

            let pixels = (self.size.width * self.size.height) as f64;
            let shrink = (pixels * points.len() as f64 / BUDGET).max(1.0).sqrt();
            let small = RenderSize {
                width: ((self.size.width as f64 / shrink) as usize).max(4),
                height: ((self.size.height as f64 / shrink) as usize).max(4),
            };
            let pixels = (small.width * small.height) as f64;
            // In turns, three times; medians.
            let (mut by_cuts, mut by_all, mut packed, mut by_ward) = (vec![], vec![], vec![], vec![]);
            let mut last = None;
            for _ in 0..3 {
                let start = Clock::start();
                let cuts = self.cuts(&points, &clusters, small, &settings)?;
                by_cuts.push(start.seconds() * 1e6 / pixels);
                let all = |packets| -> Result<_, Box<dyn Error>> {
                    let settings = PointsSettings {
                        spp: 1,
                        seed: 0,
                        light_layers: false,
                        packets,
                    };
                    let start = Clock::start();
                    let found = brute::render_points(
                        self.scene,
                        self.lights,
                        &points,
                        &self.camera,
                        small,
                        &settings,
                        &(),
                    )?;
                    Ok((start.seconds() * 1e6 / pixels, found))
                };
                let (time, found) = all(false)?;
                by_all.push(time);
                packed.push(all(true)?.0);
                let start = Clock::start();
                let ward_rays = self.ward(&points, small);
                by_ward.push(start.seconds() * 1e6 / pixels);
                last = Some((cuts, found, ward_rays));
            }
            let Some(((image, stats), (reference, all_rays), ward_rays)) = last else {
                continue;
            };
            let [cuts, all, packed, ward] = [by_cuts, by_all, packed, by_ward].map(median);
            let error = Difference::between(&image, &reference);
            let full_pixels = (self.size.width * self.size.height) as f64;
            println!(
                "| {} | {uncertainty} | {built:.2} | {seconds:.2} | {:.0} | {:.0} | {:.2} % | {}x{} | {cuts:.1} | {all:.1} | {:.1} | {:.1} | {:.0} | \
                 {ward:.1} | {:.0} | {:.2} % | {:+.3} % | {:.3} % |",
                points.len(),
                full.nodes as f64 / full_pixels,
                full.shadow_rays as f64 / full_pixels,
                100.0 * stats.limited as f64 / stats.cuts.max(1) as f64,
                small.width,
                small.height,
                all / cuts,
                packed / cuts,
                all_rays as f64 / pixels,
                ward_rays / pixels,
                100.0 * error.within,
                100.0 * error.mean,
                100.0 * error.rms,
            );
        }
        Ok(())
    }

    fn cuts(
        &self,
        points: &PointLights,
        clusters: &LightClusters,
        size: RenderSize,
        settings: &LightcutSettings,
    ) -> Result<(Layers, lightcuts::LightcutStats), Box<dyn Error>> {
        Ok(lightcuts::render(
            self.scene,
            self.lights,
            points,
            clusters,
            &self.camera,
            size,
            settings,
            &(),
        )?)
    }

    /// Ward 1994 as the paper's section 6 compares to it: lights in order of what they would give unoccluded, until
    /// the untested ones could give at most 10 % of the tested ones; those count half. Returns the shadow rays.
    fn ward(&self, points: &PointLights, size: RenderSize) -> f64 {
        use rayon::prelude::*;
        let all = Vec3::new(size.width as f32, size.height as f32, 0.0).truncate();
        (0..size.height)
            .into_par_iter()
            .map(|y| {
                let (mut rays, mut order) = (0.0, Vec::new());
                for x in 0..size.width {
                    let place = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let eye = Ray {
                        origin: self.camera.position,
                        direction: self.camera.direction(place, all),
                        t_min: 0.0,
                        t_max: f32::INFINITY,
                    };
                    let Some(hit) = self.scene.closest_hit(&eye) else {
                        continue;
                    };
                    let wo = -eye.direction;
                    let point = self.scene.shading_point(&hit).facing(wo);
                    let viewed = Viewed::new(&point, wo);
                    order.clear();
                    order.extend((0..points.len()).filter_map(|i| {
                        let radiance = points.unoccluded(i, &hit, &viewed)?;
                        Some((radiance.max_element(), i))
                    }));
                    order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                    let mut left: f64 = order.iter().map(|o| f64::from(o.0)).sum();
                    let mut found = 0.0;
                    for &(radiance, i) in &order {
                        if left <= 0.1 * found {
                            break;
                        }
                        left -= f64::from(radiance);
                        if let Some(ray) = points.shadow_ray(i, &ray_end(&hit)) {
                            rays += 1.0;
                            if !self.scene.occluded(&ray) {
                                found += f64::from(radiance);
                            }
                        }
                    }
                    std::hint::black_box(found + 0.5 * left);
                }
                rays
            })
            .sum()
    }

    fn reconstruction(&self, counts: &[u32]) -> Result<(), Box<dyn Error>> {
        println!(
            "| lights | eye rays | cuts s | reconstruction s | × | relMSE | samples/px | rays/sample | rays/cut | interpolations/cut | rays/px of cuts | rays/px |"
        );
        println!("{}", "| --- ".repeat(12) + "|");
        let pixels = (self.size.width * self.size.height) as f64;
        for &count in counts {
            let points = self.points(count, false);
            let clusters = lightcuts::trees(self.scene, &points, false, 0);
            let settings = LightcutSettings {
                spp: 5,
                ..Self::settings()
            };
            for most in [5, 50] {
                let start = Clock::start();
                let (reference, stats) = self.cuts(&points, &clusters, self.size, &settings)?;
                let by_cuts = start.seconds();
                let start = Clock::start();
                let (image, found) = lightcuts::render_reconstructed(
                    self.scene,
                    self.lights,
                    &points,
                    &clusters,
                    &self.camera,
                    self.size,
                    &settings,
                    EyeRays { least: 5, most },
                    &(),
                )?;
                let seconds = start.seconds();
                let error = metrics::relmse(
                    &image.rgb("beauty").ok_or("no beauty")?,
                    &reference.rgb("beauty").ok_or("no beauty")?,
                )?;
                let cuts = found.cuts.max(1) as f64;
                println!(
                    "| {} | {:.2} | {by_cuts:.2} | {seconds:.2} | {:.1} | {error:.5} | {:.3} | {:.0} | {:.1} | {:.1} | {:.0} | {:.0} |",
                    points.len(),
                    found.eye_rays as f64 / pixels,
                    by_cuts / seconds,
                    found.samples as f64 / pixels,
                    found.sample_rays as f64 / found.samples.max(1) as f64,
                    found.shadow_rays as f64 / cuts,
                    found.interpolations as f64 / cuts,
                    stats.shadow_rays as f64 / pixels,
                    (found.shadow_rays + found.sample_rays) as f64 / pixels,
                );
            }
        }
        Ok(())
    }

    fn uncertainty(&self, counts: &[u32]) -> Result<(), Box<dyn Error>> {
        println!("| lights | uncertainty | nodes/px | rays/px | s | within 2 % | mean error | rms |");
        println!("{}", "| --- ".repeat(8) + "|");
        let pixels = (self.size.width * self.size.height) as f64;
        for &count in counts {
            let points = self.points(count, false);
            // Representatives are drawn once for all pixels: other seeds say what of an error is theirs.
            let trees: Vec<LightClusters> = (0..SEEDS)
                .map(|seed| lightcuts::trees(self.scene, &points, false, seed))
                .collect();
            let settings = PointsSettings {
                spp: 1,
                seed: 0,
                light_layers: false,
                packets: true,
            };
            let (reference, _) = brute::render_points(
                self.scene,
                self.lights,
                &points,
                &self.camera,
                self.size,
                &settings,
                &(),
            )?;
            for uncertainty in [f32::INFINITY, 0.1, 0.05, 0.025, 0.0125] {
                let settings = LightcutSettings {
                    uncertainty,
                    ..Self::settings()
                };
                let [mut nodes, mut rays, mut within, mut mean, mut squares] = [0.0; 5];
                let start = Clock::start();
                for clusters in &trees {
                    let (image, stats) = self.cuts(&points, clusters, self.size, &settings)?;
                    let error = Difference::between(&image, &reference);
                    nodes += stats.nodes as f64 / pixels;
                    rays += stats.shadow_rays as f64 / pixels;
                    within += error.within;
                    mean += error.mean;
                    squares += error.rms * error.rms;
                }
                let n = SEEDS as f64;
                println!(
                    "| {} | {uncertainty} | {:.0} | {:.0} | {:.2} | {:.2} % | {:+.3} % | {:.3} % |",
                    points.len(),
                    nodes / n,
                    rays / n,
                    start.seconds() / n,
                    100.0 * within / n,
                    100.0 * mean / n,
                    100.0 * (squares / n).sqrt(),
                );
            }
        }
        Ok(())
    }

    fn trees(&self, counts: &[u32]) -> Result<(), Box<dyn Error>> {
        println!("| lights | search | build s | bytes/light | nodes/px | rays/px | s |");
        println!("{}", "| --- ".repeat(7) + "|");
        let diagonal = self
            .scene
            .bounds()
            .map_or(0.0, |(low, high)| (high - low).length());
        let pixels = (self.size.width * self.size.height) as f64;
        for &count in counts {
            let points = self.points(count, false);
            let n = points.len();
            for (name, exact, window) in [
                ("exact", usize::MAX, 16),
                ("window 16, then 2048", 2048, 16),
                ("window 16", 2, 16),
                ("window 64, then 2048", 2048, 64),
                ("window 4, then 2048", 2048, 4),
                ("window 1", 2, 1),
            ] {
                // The exact search takes time with the square.
                if exact > n && n > 40_000 {
                    continue;
                }
                let settings = BuildSettings {
                    exact,
                    window,
                    seed: 0,
                };
                let start = Clock::start();
                let clusters = build(&points.lights, &[], diagonal, &settings);
                let built = start.seconds();
                let start = Clock::start();
                let (_, stats) = self.cuts(&points, &clusters, self.size, &Self::settings())?;
                println!(
                    "| {n} | {name} | {built:.2} | {:.0} | {:.1} | {:.1} | {:.2} |",
                    clusters.bytes() as f64 / n as f64,
                    stats.nodes as f64 / pixels,
                    stats.shadow_rays as f64 / pixels,
                    start.seconds()
                );
            }
        }
        Ok(())
    }

    /// For random nodes of up to 4096 lights at what pixels' middles see: the true largest contribution over the bound.
    fn bounds(&self, counts: &[u32]) -> Result<(), Box<dyn Error>> {
        for &count in counts {
            let points = self.points(count, false);
            let clusters = lightcuts::trees(self.scene, &points, false, 0);
            let study =
                tightness::bound_tightness(self.scene, &points, &clusters, &self.camera, self.size, 64);
            println!("{} lights: {study}", points.len());
        }
        Ok(())
    }
}

/// 72 lamps for data/atrium.glb: a grid of 8 by 6 over the court, and 24 under the lower gallery's ceiling.
fn panels() -> String {
    let mut places = Vec::new();
    for i in 0..48 {
        places.push([(i % 8) as f64 * 1.7 - 5.95, 8.6, (i / 8) as f64 * 1.3 - 3.25]);
    }
    for i in 0..8 {
        let x = i as f64 * 2.2 - 7.7;
        places.extend([[x, 5.0, 6.1], [x, 5.0, -6.1]]);
    }
    for i in 0..4 {
        let z = i as f64 * 2.0 - 3.0;
        places.extend([[9.1, 5.0, z], [-9.1, 5.0, z]]);
    }
    let lights: Vec<String> = (places.iter().enumerate())
        .map(|(i, place)| {
            format!(
                "{{\"name\":\"panel{i}\",\"type\":\"rect\",\"center\":{place:?},\"edge_u\":[0.6,0.0,0.0],\
                 \"edge_v\":[0.0,0.0,0.4],\"radiance\":[{}]}}",
                if place[1] > 6.0 {
                    "9.0,8.5,8.0"
                } else {
                    "5.0,4.0,2.8"
                }
            )
        })
        .collect();
    format!(
        "{{ \"relight_sequence\": 1, \"frames\": 1, \"fps\": 24, \"lights\": [\n{}\n]}}",
        lights.join(",\n")
    )
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Errors of an image, in the largest channel.
struct Difference {
    /// Share of lit pixels within 2 %.
    within: f64,
    /// Signed, of the mean.
    mean: f64,
    /// Root mean square of the relative error.
    rms: f64,
}

impl Difference {
    fn between(image: &Layers, reference: &Layers) -> Difference {
        let [a, b] = [image, reference].map(|layers| {
            let [direct, indirect] =
                ["direct", "indirect"].map(|name| layers.rgb(name).unwrap_or_default().pixels);
            direct
                .iter()
                .zip(&indirect)
                .map(|(d, i)| (Vec3::from(*d) + Vec3::from(*i)).max_element())
                .collect::<Vec<f32>>()
        });
        let (mut within, mut lit, mut squares) = (0.0, 0.0, 0.0);
        for (&a, &b) in a.iter().zip(&b) {
            if b > 0.0 {
                let relative = f64::from(a - b) / f64::from(b);
                lit += 1.0;
                within += f64::from(u8::from(relative.abs() <= 0.02));
                squares += relative * relative;
            }
        }
        let sum = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>();
        Difference {
            within: within / lit,
            mean: sum(&a) / sum(&b) - 1.0,
            rms: (squares / lit).sqrt(),
        }
    }
}
