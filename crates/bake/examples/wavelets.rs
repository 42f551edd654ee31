//! Visibility in cuts and in Haar wavelets at equal error (Cheslack-Postava et al. 2008, figure 6a): a table of
//! docs/notebook/cuts.md.
//!
//! `cargo run --release -p relight-bake --example wavelets -- SCENE.glb [SCENE.glb …]`
//!
//! Visibility of every direction of an equal-area octahedral map (Clarberg 2008) of 128 × 128: wavelets need a grid,
//! trees a power of two, and both get the same samples. Non-standard two-dimensional Haar transform, largest
//! coefficients first.

use glam::Vec3;
use rayon::prelude::*;
use relight_bake::points::candidates::Candidate;
use relight_bake::points::poisson::{coarse_radius_for, distribute};
use relight_bake::points::viewpoints;
use relight_bake::units::Units;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::cuts::Selector;
use relight_transport::light_tree::{Features, order};
use std::error::Error;
use std::f32::consts::FRAC_PI_4;
use std::path::Path;
use std::sync::Arc;

/// Side of the map.
const SIDE: usize = 128;
/// Sites that are averaged over, and pilots of the tree.
const SITES: usize = 512;
const PILOTS: usize = 512;

fn main() -> Result<(), Box<dyn Error>> {
    let directions: Vec<Vec3> = (0..SIDE * SIDE).map(direction).collect();
    for path in std::env::args().skip(1) {
        let scene = Arc::new(import(Path::new(&path), &ImportOptions::default())?);
        let traced = TracedScene::new(scene.clone(), Shading::Lambert)?;
        let mut eyes = viewpoints::of_cameras(&scene, None);
        if eyes.is_empty() {
            eyes.extend(viewpoints::in_open_space(&traced, 0).0);
        }
        let (radius, _) = coarse_radius_for(&traced, &eyes, 6, 0, Units::none())?;
        let points = distribute(&traced, &eyes, 4, radius, 0, Units::none(), |_| Ok(()))?;
        let all = &points.levels[3].points;
        let chosen = |count: usize, from: usize| -> Vec<Vec<f32>> {
            let places: Vec<&Candidate> = all.iter().skip(from).step_by(all.len().div_ceil(count)).collect();
            places
                .par_iter()
                .map(|site| seen(&traced, site, &directions))
                .collect()
        };
        let (sites, pilots) = (chosen(SITES, 0), chosen(PILOTS, 1));
        println!("\n{path}: {} sites, {} directions", sites.len(), SIDE * SIDE);
        println!("| σ | RMS error | cut, tree by geometry | cut, β = 0.45 | wavelets | cut over wavelets |");
        println!("| --- | --- | --- | --- | --- | --- |");
        let geometric = tree(&directions, &[], 1.0);
        let mixed = tree(&directions, &pilots, 0.45);
        for sigma in [1.0, 1.5, 2.0, 3.0, 4.0] {
            let at = |tree: &[u32]| mean_cut(&sites, tree, sigma);
            let ((by_geometry, _), (by_both, squares)) = (at(&geometric), at(&mixed));
            // As many wavelets as the same total error takes, over all sites.
            let wavelets: f64 = (sites.par_iter())
                .zip(&squares)
                .map(|(seen, &allowed)| wavelets_for(seen, allowed) as f64)
                .sum::<f64>()
                / sites.len() as f64;
            let rms = (squares.iter().sum::<f64>() / (sites.len() * SIDE * SIDE) as f64).sqrt();
            println!(
                "| {sigma} | {rms:.4} | {by_geometry:.0} | {by_both:.0} | {wavelets:.0} | {:.2} |",
                by_both / wavelets
            );
        }
    }
    Ok(())
}

/// Unit direction at the middle of a pixel of the map.
fn direction(i: usize) -> Vec3 {
    let coordinate = |k: usize| (2.0 * k as f32 + 1.0) / SIDE as f32 - 1.0;
    let (u, v) = (coordinate(i % SIDE), coordinate(i / SIDE));
    let d = 1.0 - (u.abs() + v.abs());
    let r = 1.0 - d.abs();
    let phi = if r > 0.0 {
        ((v.abs() - u.abs()) / r + 1.0) * FRAC_PI_4
    } else {
        0.0
    };
    let f = r * (2.0 - r * r).sqrt();
    Vec3::new(
        f * phi.cos() * u.signum(),
        f * phi.sin() * v.signum(),
        (1.0 - r * r) * d.signum(),
    )
}

fn seen(traced: &TracedScene, site: &Candidate, directions: &[Vec3]) -> Vec<f32> {
    let rays: Vec<Ray> = directions
        .iter()
        .map(|&direction| Ray {
            origin: site.origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        })
        .collect();
    let mut occluded = vec![false; rays.len()];
    traced.occluded_packet(&rays, &mut occluded);
    let above = |d: &Vec3| site.geometric_normal.dot(*d) > 0.0;
    (occluded.iter().zip(directions))
        .map(|(&dark, d)| if dark || !above(d) { 0.0 } else { 1.0 })
        .collect()
}

fn tree(directions: &[Vec3], pilots: &[Vec<f32>], beta: f32) -> Vec<u32> {
    let visibility: Vec<i8> = (0..directions.len())
        .flat_map(|light| {
            pilots
                .iter()
                .map(move |pilot| if pilot[light] > 0.0 { 127 } else { -127 })
        })
        .collect();
    order(
        &Features {
            positions: directions,
            normals: directions,
            visibility: &visibility,
            pilots: pilots.len(),
        },
        beta,
    )
}

/// Mean length of the sites' cuts, and each site's sum of squared errors.
fn mean_cut(sites: &[Vec<f32>], tree: &[u32], sigma: f32) -> (f64, Vec<f64>) {
    let found: Vec<(usize, f64)> = sites
        .par_iter()
        .map_init(Selector::default, |selector, seen| {
            let leaves: Vec<f32> = tree.iter().map(|&i| seen[i as usize]).collect();
            let (mut heights, mut values) = (Vec::new(), Vec::new());
            let (_, squares) = selector.select(&leaves, sigma, usize::MAX, &mut heights, &mut values);
            (heights.len(), squares)
        })
        .collect();
    let length = found.iter().map(|f| f.0).sum::<usize>() as f64 / sites.len() as f64;
    (length, found.into_iter().map(|f| f.1).collect())
}

/// Fewest coefficients whose omission of all others costs at most `allowed` in squares.
fn wavelets_for(seen: &[f32], allowed: f64) -> usize {
    let mut map: Vec<f64> = seen.iter().map(|&v| f64::from(v)).collect();
    let mut side = SIDE;
    while side > 1 {
        let half = side / 2;
        let mut out = vec![0.0; side * side];
        for (y, x) in (0..half).flat_map(|y| (0..half).map(move |x| (y, x))) {
            let at = |dy: usize, dx: usize| map[(2 * y + dy) * SIDE + 2 * x + dx];
            let (a, b, c, d) = (at(0, 0), at(0, 1), at(1, 0), at(1, 1));
            out[y * side + x] = 0.5 * (a + b + c + d);
            out[y * side + x + half] = 0.5 * (a - b + c - d);
            out[(y + half) * side + x] = 0.5 * (a + b - c - d);
            out[(y + half) * side + x + half] = 0.5 * (a - b - c + d);
        }
        for (row, out) in map.chunks_mut(SIDE).zip(out.chunks(side)) {
            row[..side].copy_from_slice(out);
        }
        side = half;
    }
    let mut energy: Vec<f64> = map.iter().map(|c| c * c).collect();
    energy.sort_unstable_by(f64::total_cmp);
    let mut left = allowed;
    let dropped = energy.iter().take_while(|&&e| {
        left -= e;
        left >= 0.0
    });
    energy.len() - dropped.count()
}
