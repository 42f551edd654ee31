//! One asset's self-consistency.

use super::case::Measure;
use super::fresh;
use super::stage::Stage;
use crate::failure::Failure;
use glam::{DVec3, Vec3};
use relight_format::{self as format, Limits};
use relight_play::Player;
use relight_play::near::near;
use relight_play::open::{Sections, asset_hash};
use relight_play::transfer::Transfer;
use relight_render::expose::expose;
use relight_transport::bounce::{MOST_ALBEDO, TOLERANCE, solve_double};
use relight_transport::sparse::{largest_row_sum, row};
use relight_transport::spectrum::spectral_radius;
use std::path::Path;

/// Rows of the images whose coverage is measured.
const HEIGHT: usize = 180;
/// Cameras that are looked through.
const MOST_CAMERAS: usize = 8;

/// What was found, each with the stage in which it was.
pub type Found = Vec<(String, Measure)>;

/// Checks an asset. Damage that keeps it from being read is an error: the command ends with code 1.
///
/// # Errors
/// The file cannot be read, is damaged, or its parts do not fit.
pub fn check(path: &Path, seed: u64, stage: &Stage) -> Result<Found, Failure> {
    let mut found: Found = Vec::new();
    let mut add = |now: &str, measures: Vec<Measure>| {
        found.extend(measures.into_iter().map(|m| (now.to_owned(), m)));
    };
    stage.at("file");
    let asset = format::read_file(path, &Limits::default())
        .map_err(|error| anyhow::anyhow!("{}: {error}", path.display()))?;
    let summary = format::read_summary(path)?;
    let hash = asset_hash(path)?;
    add("file", file(&asset, summary.file_bytes)?);
    let (tree, cuts, estimates) = (
        asset.light_tree.clone(),
        asset.cuts.clone(),
        asset.estimates.clone(),
    );
    let player = Player::of_asset(asset, hash, path, Sections::All)?;
    if let Some(transfer) = &player.prepared.transfer {
        stage.at("basis");
        add("basis", basis(transfer));
        stage.at("coverage");
        add("coverage", coverage(&player, transfer));
        stage.at("bounces");
        add("bounces", bounces(transfer));
        add("bounces", fresh::form_factors(&player, transfer, seed));
        stage.at("links");
        add("links", fresh::links(&player, transfer, seed));
        stage.at("light");
        add("light", light(transfer));
    }
    if let (Some(tree), Some(cuts)) = (&tree, &cuts) {
        stage.at("cuts");
        let stated = estimates
            .iter()
            .flat_map(|e| &e.values)
            .find(|e| e.0 == "cut_rms_error")
            .map(|e| e.1);
        add("cuts", fresh::cuts(&player, tree, cuts, stated));
    }
    Ok(found)
}

/// Reading has checked all checksums and the structure; what was read must also be what would be written.
fn file(asset: &format::Asset, bytes: u64) -> Result<Vec<Measure>, Failure> {
    let again = format::write_asset(asset)?;
    Ok(vec![
        Measure::none(
            "file: sections that are damaged",
            0,
            "their checksums and structure hold, or it could not have been read",
        ),
        Measure::new(
            "file: bytes that writing it again changes",
            (again.len() as f64 - bytes as f64).abs(),
            0.0,
            "what was quantised once stays",
        ),
    ])
}

fn basis(transfer: &Transfer) -> Vec<Measure> {
    let (parents, ranges) = transfer.parents();
    let mut off: f64 = 0.0;
    let mut orphans = 0;
    let finer = ranges.range(0).end..parents.rows();
    for i in finer.clone() {
        let weights = row(parents, i).map(|e| f64::from(e.1));
        if weights.len() == 0 {
            orphans += 1;
        } else {
            off = off.max((weights.sum::<f64>() - 1.0).abs());
        }
    }
    let ones = transfer.senders.pulled(&vec![Vec3::ONE; transfer.finest.len()]);
    let of_cluster = |v: &Vec3| *v != Vec3::ZERO;
    let means = (ones.iter().flatten().filter(|v| of_cluster(v)))
        .map(|v| (f64::from(v.x) - 1.0).abs())
        .fold(0.0, f64::max);
    vec![
        Measure::new(
            "basis: a constant carried to finer levels",
            off,
            1e-5,
            "some twenty f32 weights that sum to 1",
        ),
        Measure::new(
            "basis: points that no coarser level predicts",
            orphans as f64 / finer.len().max(1) as f64,
            0.05,
            "share; they keep all of their own links, which costs bytes, not light; with walls between some (0.022 of \
             a Sponza with leaves)",
        ),
        Measure::new(
            "basis: a constant's mean over clusters",
            means,
            1e-5,
            "weights that sum to 1 in f32",
        ),
    ]
}

/// What cameras see that no function covers.
fn coverage(player: &Player, transfer: &Transfer) -> Vec<Measure> {
    let (mut seen, mut fallen, mut bare) = (0usize, 0usize, 0usize);
    let mut row = Vec::new();
    for track in player.scene().cameras.iter().take(MOST_CAMERAS) {
        let aspect = track.aspect.filter(|a| a.is_finite() && *a > 0.0).unwrap_or(1.5);
        let width = ((HEIGHT as f32 * aspect) as usize).clamp(1, 4 * HEIGHT);
        let shown = expose(&player.prepared.scene, &track.at(0.0), width, HEIGHT, 1);
        for hit in shown.hits.iter().flatten() {
            seen += 1;
            row.clear();
            transfer.finest.functions_at(hit.position, hit.normal, &mut row);
            if row.is_empty() {
                fallen += 1;
                let near = near(&player.prepared, (hit.position, hit.normal));
                bare += usize::from(near.is_none_or(|near| near.points.is_empty()));
            }
        }
    }
    if seen == 0 {
        return Vec::new();
    }
    let share = |count: usize| count as f64 / seen as f64;
    vec![
        Measure::new(
            "coverage: visible places that take the nearest point",
            share(fallen),
            0.005,
            "share of what the cameras see; thin rims and crevices (0.08 % of Sponza's, measured before we began)",
        ),
        Measure::new(
            "coverage: visible places without indirect light",
            share(bare),
            0.001,
            "share; black specks",
        ),
    ]
}

/// Products that the solver may need: see docs/notebook/stability.md.
const MOST_PRODUCTS: f64 = 60.0;

fn bounces(transfer: &Transfer) -> Vec<Measure> {
    let (k, _, albedo) = transfer.bounces();
    if k.nnz() == 0 {
        return Vec::new();
    }
    let brightest = albedo
        .iter()
        .map(|a| f64::from(a.max_element()))
        .fold(0.0, f64::max);
    let brightest = brightest.min(MOST_ALBEDO);
    let radius = (0..3)
        .map(|c| {
            let rho: Vec<f64> = albedo.iter().map(|a| f64::from(a[c]).min(MOST_ALBEDO)).collect();
            spectral_radius(k, &rho).upper
        })
        .fold(0.0, f64::max);
    let mut emitted = vec![Vec3::ZERO; k.rows()];
    emitted[k.rows() / 3] = Vec3::ONE;
    let (_, solve) = solve_double(k, &emitted, albedo, None, TOLERANCE);
    vec![
        Measure::none(
            "bounces: negative weights",
            k.data().iter().filter(|w| **w < 0.0 || w.is_nan()).count(),
            "a bounce carries light, not darkness",
        ),
        Measure::new(
            "bounces: largest row sum less 1",
            (largest_row_sum(k) - 1.0).max(0.0),
            1e-6,
            "no surface receives more than all others send; rounding of some hundred weights",
        ),
        Measure::new(
            "bounces: spectral radius",
            radius,
            brightest * (1.0 + 1e-6),
            "at most the largest albedo, so that every bounce carries less light than the one before",
        ),
        Measure::new(
            "bounces: products to solve for light from one cluster",
            f64::from(solve.iterations),
            MOST_PRODUCTS,
            "at any albedo; a series would take ln(10⁻⁵·(1 − ρ))/ln(radius)",
        ),
        Measure::none(
            "bounces: not solved to 10⁻⁵·(1 − ρ)",
            usize::from(!solve.converged),
            "10⁻⁵ of the light",
        ),
    ]
}

/// All operators together under even light: every value a number, and no more light than albedo allows.
fn light(transfer: &Transfer) -> Vec<Measure> {
    let (values, _) = transfer.indirect_from_direct(&vec![Vec3::ONE; transfer.finest.len()]);
    let normals = &transfer.finest.normals;
    let irradiance: Vec<DVec3> = (values.iter().zip(normals))
        .map(|(v, n)| v.irradiance(*n).as_dvec3())
        .collect();
    let broken = irradiance.iter().filter(|e| !e.is_finite()).count();
    let sum = |sign: f64| {
        irradiance
            .iter()
            .map(|e| (*e * sign).max(DVec3::ZERO).element_sum())
            .sum::<f64>()
    };
    let (below, above) = (sum(-1.0), sum(1.0));
    let albedo = transfer
        .albedo
        .iter()
        .map(|a| f64::from(a.max_element()))
        .fold(0.0, f64::max);
    let albedo = albedo.min(MOST_ALBEDO);
    let most = irradiance.iter().map(|e| e.max_element()).fold(0.0, f64::max);
    vec![
        Measure::none("light: values that are no numbers", broken, "all are"),
        Measure::new(
            "light: negative share of indirect light",
            if above > 0.0 { below / above } else { below },
            1e-3,
            "what the final clamp at zero may add",
        ),
        Measure::new(
            "light: most indirect over direct light",
            most,
            1.1 * albedo / (1.0 - albedo),
            "ρ/(1 − ρ) of the largest albedo, if all were so; a tenth more for ringing",
        ),
    ]
}
