//! What do bits cost? Errors of operators and images against the bits of every quantised section of the file: the
//! command behind the table in docs/notebook/stability.md.
//!
//! `cargo run --release --example quantisation [operators|cuts]`, in the repository root: operators in the Cornell box,
//! cuts on the table, which sees the sky. A few minutes each.
//!
//! Each row quantises one section and leaves all others exact; operators are found over what a reader would see, as in a
//! bake. *Operator*: RMS difference of indirect irradiance at the finest points under six lamps, relative to its RMS,
//! from the same without any quantisation. *Image*: relMSE of indirect light. What another seed of the rays changes is
//! the floor below which bits buy nothing.

use glam::{DVec3, Vec3};
use relight_bake::cuts::light_samples::{Lights, in_tree};
use relight_bake::cuts::visibility::site_cuts;
use relight_bake::links::operators::{Transport, Viewers, transport};
use relight_bake::links::solution::solution;
use relight_bake::params::{BakeParams, CutParams, Preset};
use relight_bake::points::poisson::{PointLevels, coarse_radius_for, distribute, levels_of};
use relight_bake::points::viewpoints;
use relight_bake::units::Units;
use relight_format::codec::{cut, octahedral};
use relight_play::cuts::VisibilityCuts;
use relight_play::transfer::Transfer;
use relight_play::{CutSites, FrameSettings, Integrator, Player, PreparedScene, Shot, ShotSettings};
use relight_render::lighting::irradiance_at;
use relight_scene::animated::Animated;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::image::Layers;
use relight_scene::light::{EnvironmentMap, LightKind, LightTrack};
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::scene::Scene;
use relight_scene::sequence::read_sequence;
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::cuts::SiteCuts;
use relight_transport::random::Stream;
use relight_transport::sparse::{SparseMatrix, zero};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Bits per element; `None` leaves it exact.
#[derive(Clone, Copy, Debug, Default)]
struct Bits {
    /// Positions, in steps of the disk radius over 2^bits.
    position: Option<u32>,
    /// Each of the two octahedral coordinates.
    normal: Option<u32>,
    /// Along the smoothstep of SPEC 6.6.3.
    albedo: Option<u32>,
    /// Mantissa of link vectors.
    link: Option<u32>,
    /// Fractions of a row's largest weight.
    bounce: Option<u32>,
    /// The same of the baked solution, if it takes the bounces' place.
    solution: Option<Solved>,
}

/// How a solution's weights are kept.
#[derive(Clone, Copy, Debug)]
enum Solved {
    Exact,
    Bits(u32),
}

/// What everything is measured in.
struct Study {
    scene: Arc<Scene>,
    traced: TracedScene,
    lights: Vec<LightTrack>,
    params: BakeParams,
    eyes: Vec<Vec3>,
    lamps: Vec<Vec3>,
}

/// Pixels along each side.
const SIZE: usize = 96;

struct Outcome {
    /// Indirect irradiance at the points under each lamp.
    irradiance: Vec<Vec<Vec3>>,
    /// Indirect light of the image.
    image: Vec<Vec3>,
}

impl Study {
    fn new(scene: &str, lights: &str) -> Result<Study, Box<dyn Error>> {
        let scene = Arc::new(import(Path::new(scene), &ImportOptions::default())?);
        let traced = TracedScene::new(scene.clone(), Shading::Lambert)?;
        let params = BakeParams {
            levels: 4,
            ..BakeParams::preset(Preset::Draft)
        };
        let eyes = viewpoints::of_cameras(&scene, None);
        let low = eyes.first().ok_or("the scene has no camera")?;
        let mut s = Stream::new(7, 0, 0);
        let mut jitter = || 0.2 * (s.uniform() - 0.5);
        let lamps = (0..6)
            .map(|_| *low + Vec3::new(jitter(), jitter(), jitter()))
            .collect();
        Ok(Study {
            traced,
            lights: read_sequence(Path::new(lights))?.lights,
            params,
            eyes,
            lamps,
            scene,
        })
    }

    fn points(&self) -> Result<PointLevels, Box<dyn Error>> {
        let (radius, _) = coarse_radius_for(&self.traced, &self.eyes, 6, 0, Units::none())?;
        Ok(distribute(
            &self.traced,
            &self.eyes,
            self.params.levels,
            radius,
            0,
            Units::none(),
            |_| Ok(()),
        )?)
    }

    fn run(&self, bits: Bits, seed: u64) -> Result<Outcome, Box<dyn Error>> {
        let mut points = self.points()?;
        for level in &mut points.levels {
            for place in &mut level.points {
                if let Some(b) = bits.position {
                    let step = level.disk_radius / (1u64 << b) as f32;
                    place.position = (place.position / step).round() * step;
                }
                if let Some(b) = bits.normal {
                    place.normal = octahedral_rounded(place.normal, b);
                }
                if let Some(b) = bits.albedo {
                    place.albedo = Vec3::from(place.albedo.to_array().map(|a| smoothstep_rounded(a, b)));
                }
            }
        }
        let params = BakeParams {
            seed,
            ..self.params.clone()
        };
        let link = |v: Vec3| bits.link.map_or(v, |b| mantissa_rounded(v, b));
        let Transport {
            points,
            tree,
            separations,
            links,
            mut bounce,
            bounce_level,
            ..
        } = transport(
            &self.traced,
            points,
            Viewers {
                viewpoints: &self.eyes,
                cameras: &[],
            },
            &params,
            link,
            Units::none(),
            &|_| Ok(()),
        )?;
        if let Some(b) = bits.bounce {
            fractions_rounded(&mut bounce, b);
        }
        let finest = points.levels.last().ok_or("no points")?;
        let albedo: Vec<Vec3> = finest.points.iter().map(|p| p.albedo).collect();
        let solved = match bits.solution {
            Some(how) => {
                let epsilon = params.epsilon;
                let none = Units::none();
                let mut solved = solution(
                    &bounce,
                    bounce_level,
                    &tree,
                    &albedo,
                    None,
                    epsilon,
                    none,
                    &|_| Ok(()),
                )?;
                if let Solved::Bits(b) = how {
                    solved
                        .channels
                        .iter_mut()
                        .for_each(|channel| fractions_rounded(channel, b));
                }
                Some(solved)
            }
            None => None,
        };
        let mut transfer = Transfer::new(
            levels_of(&points),
            &separations.pairs,
            separations.near,
            tree,
            albedo,
            &links,
            bounce,
            bounce_level,
            None,
        );
        if let Some(solved) = solved {
            transfer.use_solution(solved.level, solved.channels);
        }
        let player = Player::new(PreparedScene::new(self.traced.clone(), Some(transfer), None));
        let mut irradiance = Vec::new();
        for &lamp in &self.lamps {
            irradiance.push(self.under(&player, lamp)?);
        }
        let shot = self.shot(&player, Integrator::Transfer)?;
        let lights = player.lights(&self.lights)?;
        let frame = player.frame(&shot, &lights, 0.0, &settings())?;
        Ok(Outcome {
            irradiance,
            image: layer(&frame.layers, "indirect"),
        })
    }

    fn shot(&self, player: &Player, integrator: Integrator) -> Result<Shot, Box<dyn Error>> {
        let settings = ShotSettings {
            integrator,
            width: SIZE,
            height: SIZE,
            samples: Some(1),
            sites: Some(CutSites::Around),
            ..ShotSettings::default()
        };
        Ok(player.shot(&self.scene.cameras[0].at(0.0), &settings)?)
    }

    fn under(&self, player: &Player, lamp: Vec3) -> Result<Vec<Vec3>, Box<dyn Error>> {
        let prepared = &player.prepared;
        let transfer = prepared.transfer.as_ref().ok_or("no points")?;
        let kind = LightKind::Point {
            position: Animated::Constant(lamp),
            intensity: Animated::Constant(Vec3::ONE),
        };
        let tracks = [LightTrack {
            name: "lamp".into(),
            kind,
        }];
        let emitters = SceneEmitters::new(&prepared.scene);
        let lights = LightSet::new(&emitters, &tracks, 0.0)?;
        let mut direct = vec![Vec3::ZERO; transfer.finest.len()];
        irradiance_at(
            &prepared.scene,
            &lights,
            0,
            &prepared.points,
            prepared.footprint(),
            1,
            0,
            &mut direct,
        );
        let (values, _) = transfer.indirect_from_direct(&direct);
        Ok((values.iter().zip(&transfer.finest.normals))
            .map(|(v, n)| v.irradiance(*n))
            .collect())
    }
}

fn settings() -> FrameSettings {
    FrameSettings {
        pixel_samples: 1,
        illumination_cut: 256,
        ..FrameSettings::default()
    }
}

fn layer(layers: &Layers, name: &str) -> Vec<Vec3> {
    let pixels = layers.rgb(name).unwrap_or_default().pixels;
    pixels.into_iter().map(Vec3::from).collect()
}

/// Two coordinates of `bits` each, as the file's two of twelve.
fn octahedral_rounded(n: Vec3, bits: u32) -> Vec3 {
    Vec3::from(octahedral::decode(octahedral::encode(n.to_array(), bits), bits))
}

fn smoothstep_rounded(albedo: f32, bits: u32) -> f32 {
    let codes = (1u32 << bits) - 1;
    let value = |code: u32| {
        let t = f64::from(code) / f64::from(codes);
        t * t * (3.0 - 2.0 * t)
    };
    let (mut low, mut high) = (0, codes);
    while high - low > 1 {
        let middle = (low + high) / 2;
        if value(middle) <= f64::from(albedo) {
            low = middle
        } else {
            high = middle
        }
    }
    let nearer = |c: u32| (value(c) - f64::from(albedo)).abs();
    value(if nearer(low) <= nearer(high) { low } else { high }) as f32
}

/// Three mantissas under one exponent, the largest component's with `bits` bits.
fn mantissa_rounded(v: Vec3, bits: u32) -> Vec3 {
    let largest = f64::from(v.abs().max_element());
    if largest == 0.0 {
        return v;
    }
    let step = 2f64.powi(largest.log2().floor() as i32 + 1 - bits as i32);
    ((v.as_dvec3() / step).round() * step).as_vec3()
}

/// Fractions of a row's largest weight, scaled back to the row's sum.
fn fractions_rounded(k: &mut SparseMatrix, bits: u32) {
    let codes = ((1u64 << bits) - 1) as f32;
    for mut row in k.outer_iterator_mut() {
        let sum: f64 = row.data().iter().map(|w| f64::from(*w)).sum();
        let largest = row.data().iter().copied().fold(0.0f32, f32::max);
        row.map_inplace(|w| (w / largest * codes).round() / codes * largest);
        let rounded: f64 = row.data().iter().map(|w| f64::from(*w)).sum();
        if rounded > 0.0 {
            row.map_inplace(|w| (f64::from(*w) * sum / rounded) as f32);
        }
    }
}

/// RMS difference over RMS.
fn apart(a: &[Vec<Vec3>], b: &[Vec<Vec3>]) -> f64 {
    let pairs = || a.iter().flatten().zip(b.iter().flatten());
    let off: f64 = pairs()
        .map(|(a, b)| (a.as_dvec3() - b.as_dvec3()).length_squared())
        .sum();
    let size: f64 = pairs().map(|(_, b)| b.as_dvec3().length_squared()).sum();
    (off / size).sqrt()
}

/// relMSE with 1 % of the squared mean, as `compare` has it, nothing trimmed.
fn relmse(a: &[Vec3], b: &[Vec3]) -> f64 {
    let mean = b.iter().map(|v| v.as_dvec3()).sum::<DVec3>().element_sum() / (3.0 * b.len() as f64);
    let floor = 0.01 * mean * mean;
    let sum: f64 = (a.iter().zip(b))
        .map(|(a, b)| {
            let (a, b) = (a.as_dvec3(), b.as_dvec3());
            ((a - b) * (a - b) / (b * b + floor)).element_sum() / 3.0
        })
        .sum();
    sum / a.len() as f64
}

/// Cuts under an even sky with a bright band, values in `factor` times the file's steps.
fn cuts(study: &Study) -> Result<(), Box<dyn Error>> {
    let points = study.points()?;
    let sites = &points.levels.last().ok_or("no points")?.points;
    // With fewer directions nearly all cuts go down to the leaves, whose values are 0 and 1.
    let params = CutParams::default();
    let leaves = in_tree(
        &study.traced,
        sites,
        &Lights::directions(params.lights),
        params.beta,
    );
    let made = site_cuts(&study.traced, sites, &leaves, &params, (Units::none(), 0), |_| {
        Ok(())
    })?;
    let Lights::Directions { directions, .. } = &leaves.lights else {
        return Err("no directions".into());
    };
    let map = EnvironmentMap {
        width: 32,
        height: 16,
        pixels: (0..512)
            .map(|i| Vec3::splat(if i / 32 == 5 { 8.0 } else { 0.5 }))
            .collect(),
    };
    let tracks = [LightTrack {
        name: "sky".into(),
        kind: LightKind::Environment {
            map: Arc::new(map),
            file: String::new(),
            scale: Animated::Constant(Vec3::ONE),
            rotation_deg: Animated::Constant(0.0),
        },
    }];
    let image = |factor: Option<f64>| -> Result<(Vec<f32>, Vec<Vec3>), Box<dyn Error>> {
        let mut values = made.cuts.values.clone();
        if let Some(factor) = factor {
            for (value, &height) in values.iter_mut().zip(&made.cuts.heights) {
                let steps = (f64::from(cut::steps(height, params.sigma())) * factor)
                    .ceil()
                    .max(1.0);
                *value = ((f64::from(*value) * steps).round() / steps) as f32;
            }
        }
        let cuts = SiteCuts {
            values: values.clone(),
            ..made.cuts.clone()
        };
        // Sites only need the points; links may be anything.
        let transfer = bare_transfer(&points);
        let cuts = VisibilityCuts::of_directions(cuts, directions);
        let prepared = PreparedScene::new(study.traced.clone(), Some(transfer), Some(cuts));
        let player = Player::new(prepared);
        let shot = study.shot(&player, Integrator::Cuts)?;
        let frame = player.frame(&shot, &player.lights(&tracks)?, 0.0, &settings())?;
        Ok((values, layer(&frame.layers, "direct")))
    };
    let (exact_values, exact) = image(None)?;
    println!("\n| cut values, steps per unit | RMS of the values | image, relMSE |\n| --- | --- | --- |");
    for factor in [0.125, 0.25, 0.5, 1.0, 2.0] {
        let (values, found) = image(Some(factor))?;
        let squares: f64 = values
            .iter()
            .zip(&exact_values)
            .map(|(a, b)| f64::from(a - b).powi(2))
            .sum();
        let file = if factor == 1.0 { " (the file)" } else { "" };
        println!(
            "| {factor} × 2·√2^height/σ{file} | {:.2e} | {:.2e} |",
            (squares / values.len() as f64).sqrt(),
            relmse(&found, &exact)
        );
    }
    println!(
        "\nThe cuts' own error, which the steps must not add to: RMS {:.3}.",
        made.rms_error
    );
    Ok(())
}

/// Points without operators.
fn bare_transfer(points: &PointLevels) -> Transfer {
    let levels = levels_of(points);
    let receivers: usize = levels.iter().map(|l| l.len()).sum();
    let finest = levels.last().map_or(0, |l| l.len());
    let tree =
        relight_transport::senders::SenderTree::new(&[1], vec![0; finest], Vec::new(), vec![0; finest]);
    let links = relight_transport::links::Links {
        receivers: receivers as u32,
        senders: 1,
        row_offsets: vec![0; receivers + 1],
        ..Default::default()
    };
    Transfer::new(
        levels,
        &[],
        Vec::new(),
        tree,
        vec![Vec3::ZERO; finest],
        &links,
        zero(1, 1),
        0,
        None,
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    let part = std::env::args().nth(1);
    if part.as_deref() != Some("cuts") {
        operators("data/cornell.glb", "data/cornell.lights.json")?;
    }
    if part.as_deref() != Some("operators") {
        cuts(&Study::new("data/table.glb", "data/table_window.lights.json")?)?;
    }
    Ok(())
}

/// Points, links and bounces under lamps and the lights of a sequence.
fn operators(scene: &str, lights: &str) -> Result<(), Box<dyn Error>> {
    let study = Study::new(scene, lights)?;
    let exact = study.run(Bits::default(), 0)?;
    let other = study.run(Bits::default(), 1)?;
    println!("{scene}, {lights}, {} finest points\n", exact.irradiance[0].len());
    println!("| section | bits | operator | image, relMSE |\n| --- | --- | --- | --- |");
    let row = |name: &str, bits: &str, found: &Outcome, exact: &Outcome| {
        println!(
            "| {name} | {bits} | {:.2e} | {:.2e} |",
            apart(&found.irradiance, &exact.irradiance),
            relmse(&found.image, &exact.image)
        );
    };
    let noted = |bits: u32, file: u32| format!("{bits}{}", if bits == file { " (the file)" } else { "" });
    row("another seed of the rays", "–", &other, &exact);
    type Set = fn(u32) -> Bits;
    let sections: [(&str, &[u32], u32, Set); 5] = [
        ("positions, radius over 2^bits", &[2, 4, 6, 8, 10], 8, |b| Bits {
            position: Some(b),
            ..Bits::default()
        }),
        ("normals, each of two", &[5, 6, 8, 10, 12, 14], 12, |b| Bits {
            normal: Some(b),
            ..Bits::default()
        }),
        ("albedo", &[4, 6, 8, 10, 12, 14], 12, |b| Bits {
            albedo: Some(b),
            ..Bits::default()
        }),
        ("links, mantissa", &[3, 4, 6, 8, 10, 12], 10, |b| Bits {
            link: Some(b),
            ..Bits::default()
        }),
        ("bounces, of a row's largest", &[4, 6, 8, 12, 16], 16, |b| Bits {
            bounce: Some(b),
            ..Bits::default()
        }),
    ];
    for (name, all, file, set) in sections {
        for &bits in all {
            row(name, &noted(bits, file), &study.run(set(bits), 0)?, &exact);
        }
    }
    let with_solution = |how| Bits {
        solution: Some(how),
        ..Bits::default()
    };
    let solved = study.run(with_solution(Solved::Exact), 0)?;
    row("a solution instead of bounces", "–", &solved, &exact);
    for bits in [4, 6, 8, 12, 16] {
        let found = study.run(with_solution(Solved::Bits(bits)), 0)?;
        row("solution, of a row's largest", &noted(bits, 16), &found, &solved);
    }
    Ok(())
}
