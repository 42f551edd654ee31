//! Visibility cuts under an environment, over scenes and settings: the command behind the tables of docs/notebook/cuts.md that
//! need no images.
//!
//! `cargo run --release -p relight-bake --example cuts -- SCENE.glb [SCENE.glb …]`
//!
//! Per scene: how fast single and packed shadow rays are, what skipping rays costs, and how long cuts are under a tree
//! by geometry, by pilots and by both, for three σ.

use rayon::prelude::*;
use relight_bake::cuts::light_samples::{Lights, in_tree};
use relight_bake::cuts::visibility::{Cuts, site_cuts};
use relight_bake::params::CutParams;
use relight_bake::points::candidates::Candidate;
use relight_bake::points::poisson::{coarse_radius_for, distribute};
use relight_bake::points::viewpoints;
use relight_bake::units::Units;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Levels of the preset `standard`; sites are the finest points, thinned to this many so that a table takes minutes.
const LEVELS: usize = 6;
const SITES: usize = 1500;
/// Lights: 2¹⁵.
const LIGHTS: u32 = 1 << 15;

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        study(&path)?;
    }
    Ok(())
}

fn study(path: &str) -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(import(Path::new(path), &ImportOptions::default())?);
    let traced = TracedScene::new(scene.clone(), Shading::Lambert)?;
    let sites = sites(&traced, &scene)?;
    println!("\n{path}: {} of its sites, {} lights", sites.len(), LIGHTS);
    let lattice = Lights::directions(LIGHTS);
    let tree = in_tree(&traced, &sites, &lattice, 0.45);
    rates(&traced, &sites, &tree.lights);

    let all = CutParams {
        every_light: true,
        ..CutParams::default()
    };
    println!("| β | σ | rays a site | mean length | RMS error | RMS to every ray | s |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for beta in [1.0, 0.7, 0.45, 0.2, 0.0] {
        let start = Instant::now();
        let tree = in_tree(&traced, &sites, &lattice, beta);
        let built = start.elapsed().as_secs_f64();
        for sigma in if beta == 0.45 {
            vec![1.5, 2.0, 3.0]
        } else {
            vec![2.0]
        } {
            let params = CutParams {
                sigma,
                ..CutParams::default()
            };
            let start = Instant::now();
            let cuts = site_cuts(&traced, &sites, &tree, &params, (Units::none(), 0), |_| Ok(()))?;
            let seconds = start.elapsed().as_secs_f64();
            let truth = site_cuts(
                &traced,
                &sites,
                &tree,
                &CutParams {
                    sigma: 0.01,
                    ..all.clone()
                },
                (Units::none(), 0),
                |_| Ok(()),
            )?;
            println!(
                "| {beta} | {sigma} | {:.0} | {:.0} | {:.4} | {:.4} | {seconds:.2} + tree {built:.2} |",
                cuts.rays as f64 / sites.len() as f64,
                cuts.cuts.heights.len() as f64 / sites.len() as f64,
                cuts.rms_error,
                difference(&cuts, &truth, &sites, &tree.lights),
            );
        }
    }
    Ok(())
}

fn sites(
    traced: &TracedScene,
    scene: &relight_scene::scene::Scene,
) -> Result<Vec<Candidate>, Box<dyn Error>> {
    let mut eyes = viewpoints::of_cameras(scene, None);
    if eyes.is_empty() {
        eyes.extend(viewpoints::in_open_space(traced, 0).0);
    }
    let (radius, _) = coarse_radius_for(traced, &eyes, LEVELS, 0, Units::none())?;
    let points = distribute(traced, &eyes, LEVELS, radius, 0, Units::none(), |_| Ok(()))?;
    let finest = &points.levels[LEVELS - 1].points;
    println!(
        "\n{} finest points, {:.3} m apart",
        finest.len(),
        points.levels[LEVELS - 1].disk_radius
    );
    let step = finest.len().div_ceil(SITES);
    Ok(finest.iter().copied().step_by(step).collect())
}

/// Shadow rays a second: single ones in the order of the lattice, and packets in the order of the tree.
fn rates(traced: &TracedScene, sites: &[Candidate], lights: &Lights) {
    let some: Vec<Candidate> = sites.iter().copied().step_by(20).collect();
    let rays_of = |site: &Candidate| -> Vec<Ray> {
        (0..lights.len())
            .filter(|&light| lights.factor(site, light) > 0.0)
            .map(|light| lights.ray(site, light))
            .collect()
    };
    let timed = |what: &str, cast: &(dyn Fn(&[Ray]) + Sync)| {
        let start = Instant::now();
        let count: usize = (some.par_iter())
            .map(|site| {
                let rays = rays_of(site);
                cast(&rays);
                rays.len()
            })
            .sum();
        let rate = count as f64 / start.elapsed().as_secs_f64() * 1e-6;
        println!("{what}: {rate:.1} M rays/s");
    };
    timed("single", &|rays| {
        let hits = rays.iter().filter(|ray| traced.occluded(ray)).count();
        std::hint::black_box(hits);
    });
    timed("packets", &|rays| {
        let mut occluded = vec![false; rays.len()];
        traced.occluded_packet(rays, &mut occluded);
        std::hint::black_box(occluded);
    });
}

/// Root mean square difference of two sets of cuts over all lights above the sites' horizons.
fn difference(a: &Cuts, b: &Cuts, sites: &[Candidate], lights: &Lights) -> f64 {
    let (count, squares) = (0..sites.len())
        .into_par_iter()
        .map(|site| {
            let (mut count, mut squares) = (0.0, 0.0);
            relight_transport::cuts::merge([a.cuts.cut(site), b.cuts.cut(site)], |node, [x, y]| {
                let counts = |&light: &u32| !lights.factor(&sites[site], light as usize).is_nan();
                let above = (node.first()..node.end()).filter(counts).count() as f64;
                count += above;
                squares += above * f64::from(x - y).powi(2);
            });
            (count, squares)
        })
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    (squares / count).sqrt()
}
