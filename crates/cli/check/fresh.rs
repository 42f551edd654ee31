//! An asset's operators against rays that know nothing of it.

use super::case::Measure;
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use relight_bake::cuts::light_samples::Lights;
use relight_bake::points::candidates::Candidate;
use relight_format as format;
use relight_play::Player;
use relight_play::transfer::Transfer;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_transport::basis::NearestPoint;
use relight_transport::cuts::{Cut, SiteCuts};
use relight_transport::light_tree::sphere_direction;
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere, r2};
use relight_transport::senders::weight;
use relight_transport::sparse::row;

/// Stage numbers of the random streams.
const STAGE_FIELD: u32 = 0x40;
const STAGE_RAYS: u32 = 0x41;
const STAGE_CLUSTERS: u32 = 0x42;

/// Receivers that are looked at, and rays of each: half a million rays, a noise of some 2 % each and 0.2 % of the mean.
const RECEIVERS: usize = 192;
const RAYS: u32 = 4096;

/// Evenly chosen points that found their surface.
fn chosen(player: &Player, count: usize) -> Vec<(usize, SurfaceHit)> {
    let all = &player.prepared.points;
    let wanted = count.min(all.len());
    (0..wanted)
        .filter_map(|i| {
            let p = (2 * i + 1) * all.len() / (2 * wanted);
            all[p].filter(|hit| hit.primitive != u32::MAX).map(|hit| (p, hit))
        })
        .collect()
}

/// Calls `met` with the finest point that each of `rays` cosine-distributed rays meets, or that it meets none: the sky, what
/// has no points, or the surface itself, from which no light comes (as of the BRDFs of `scene`).
fn gather(
    player: &Player,
    nearest: &NearestPoint,
    hit: &SurfaceHit,
    rays: u32,
    stream: &mut Stream,
    mut met: impl FnMut(u32, Option<u32>),
) {
    let frame = Frame::around(hit.normal);
    let start = Vec2::new(stream.uniform(), stream.uniform());
    for i in 0..rays {
        let direction = frame.world_from_local(cosine_hemisphere(r2(i, start)));
        let there = (direction.dot(hit.geometric_normal) > 0.0)
            .then(|| player.prepared.scene.closest_hit(&ray_from(hit, direction)))
            .flatten();
        met(
            i,
            there.and_then(|there| nearest.at(there.position, there.normal)),
        );
    }
}

/// Radiosities at the finest points: even; waves as long as the scene and a quarter of it, in a direction per channel.
fn fields(transfer: &Transfer, seed: u64) -> Vec<Vec<Vec3>> {
    let positions = &transfer.finest.positions;
    let low = positions.iter().fold(Vec3::INFINITY, |m, p| m.min(*p));
    let high = positions.iter().fold(Vec3::NEG_INFINITY, |m, p| m.max(*p));
    let size = (high - low).max_element().max(f32::MIN_POSITIVE);
    let mut fields = vec![vec![Vec3::ONE; positions.len()]];
    for (i, waves) in [1.0f32, 4.0].into_iter().enumerate() {
        let mut s = Stream::new(seed, STAGE_FIELD, i as u64);
        let mut number = || s.uniform();
        let turns = [0; 3].map(|_| {
            let d = Vec3::new(number() - 0.5, number() - 0.5, number() - 0.5).normalize_or(Vec3::X);
            (
                d * (waves * std::f32::consts::TAU / size),
                number() * std::f32::consts::TAU,
            )
        });
        let at = |p: &Vec3| {
            let wave = |(k, phase): (Vec3, f32)| 1.0 + (k.dot(*p - low) + phase).cos();
            Vec3::new(wave(turns[0]), wave(turns[1]), wave(turns[2]))
        };
        fields.push(positions.iter().map(at).collect());
    }
    fields
}

/// T against fresh rays.
pub fn links(player: &Player, transfer: &Transfer, seed: u64) -> Vec<Measure> {
    let number = |name: &str, otherwise: f64| {
        player
            .provenance
            .setting(name)
            .and_then(|v| v.parse().ok())
            .unwrap_or(otherwise)
    };
    let (epsilon, rays) = (number("epsilon", 0.018), number("rays", 320.0));
    let nearest = NearestPoint::new(&transfer.finest);
    let fields = fields(transfer, seed);
    let stored: Vec<_> = fields.iter().map(|field| transfer.of_radiosity(field)).collect();
    let places = chosen(player, RECEIVERS);
    let truths: Vec<Vec<DVec3>> = places
        .par_iter()
        .map(|(p, hit)| {
            let mut sums = vec![DVec3::ZERO; fields.len()];
            let mut stream = Stream::new(seed, STAGE_RAYS, *p as u64);
            gather(player, &nearest, hit, RAYS, &mut stream, |_, met| {
                if let Some(met) = met {
                    for (sum, field) in sums.iter_mut().zip(&fields) {
                        *sum += field[met as usize].as_dvec3();
                    }
                }
            });
            sums.iter().map(|s| *s / f64::from(RAYS)).collect()
        })
        .collect();
    let mut measures = Vec::new();
    let names = ["even light", "long waves", "short waves"];
    for (f, name) in names.into_iter().enumerate() {
        let (mut found, mut truth) = (DVec3::ZERO, DVec3::ZERO);
        let (mut apart, mut size, mut most) = (0.0, 0.0, 0.0f64);
        for ((p, hit), sums) in places.iter().zip(&truths) {
            let e = stored[f][*p].irradiance(hit.normal).as_dvec3();
            found += e;
            truth += sums[f];
            apart += (e - sums[f]).length_squared();
            size += sums[f].length_squared();
            most = most.max(e.max_element());
        }
        if size == 0.0 {
            continue;
        }
        measures.push(Measure::new(
            format!("links: {name}, mean against fresh rays"),
            (found / truth - 1.0).abs().max_element(),
            0.02,
            "the bias that issue 1 allows, 2 %",
        ));
        measures.push(Measure::new(
            format!("links: {name}, RMS against fresh rays"),
            (apart / size).sqrt(),
            4.0 * epsilon + 2.0 / rays.sqrt(),
            "four links of ε dropped, and two standard errors of the bake's rays",
        ));
        if f == 0 {
            measures.push(Measure::new(
                "links: most irradiance from even light",
                most,
                1.0 + epsilon * 4.0,
                "a hemisphere full of radiosity 1 gives 1; four links of ε that ring",
            ));
        }
    }
    measures
}

/// Clusters whose rows are looked at; places in each, and rays of each.
const CLUSTERS: usize = 24;
const PLACES: usize = 96;
const PLACE_RAYS: u32 = 256;

/// Form factors of the bounce operator against fresh rays.
pub fn form_factors(player: &Player, transfer: &Transfer, seed: u64) -> Vec<Measure> {
    let (k, level, _) = transfer.bounces();
    if k.nnz() == 0 {
        return Vec::new();
    }
    let nearest = NearestPoint::new(&transfer.finest);
    let cluster_of_point = transfer.senders.cluster_of_point(level);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); k.rows()];
    for (p, &c) in cluster_of_point.iter().enumerate() {
        members[c as usize].push(p as u32);
    }
    let full: Vec<usize> = (0..k.rows())
        .filter(|&c| row(k, c).len() > 0 && members[c].len() >= 8)
        .collect();
    let wanted = CLUSTERS.min(full.len());
    // Two estimates from half of the rays each say what noise the comparison has of its own.
    let rows: Vec<(f64, f64)> = (0..wanted)
        .into_par_iter()
        .map(|i| {
            let cluster = full[(2 * i + 1) * full.len() / (2 * wanted)];
            let mut halves = [vec![0.0f64; k.rows()], vec![0.0f64; k.rows()]];
            let mut mass = [0.0f64; 2];
            let own = &members[cluster];
            let count = PLACES.min(own.len());
            for j in 0..count {
                let p = own[(2 * j + 1) * own.len() / (2 * count)] as usize;
                let Some(hit) = player.prepared.points[p] else {
                    continue;
                };
                let share = f64::from(weight(transfer.senders.importance[p]));
                let half = j % 2;
                mass[half] += share * f64::from(PLACE_RAYS);
                let mut stream = Stream::new(seed, STAGE_CLUSTERS, p as u64);
                gather(player, &nearest, &hit, PLACE_RAYS, &mut stream, |_, met| {
                    if let Some(met) = met {
                        halves[half][cluster_of_point[met as usize] as usize] += share;
                    }
                });
            }
            let both = mass[0] + mass[1];
            let fresh = |c: usize| (halves[0][c] + halves[1][c]) / both;
            let mut stored = vec![0.0f64; k.rows()];
            row(k, cluster).for_each(|(c, w)| stored[c as usize] = f64::from(w));
            let apart: f64 = (0..k.rows()).map(|c| (stored[c] - fresh(c)).abs()).sum();
            // The mean of two halves differs by half as much as they from each other.
            let noise: f64 = (0..k.rows())
                .map(|c| (halves[0][c] / mass[0] - halves[1][c] / mass[1]).abs())
                .sum();
            (apart / 2.0, noise / 4.0)
        })
        .collect();
    let mean = |of: fn(&(f64, f64)) -> f64| rows.iter().map(of).sum::<f64>() / rows.len().max(1) as f64;
    vec![Measure::new(
        "bounces: light that rows send elsewhere than fresh rays",
        mean(|r| r.0),
        0.05 + 3.0 * mean(|r| r.1),
        "5 % dropped as small; the fresh rays' own noise, and the bake's, of half as many rays or less",
    )]
}

/// Sites whose cuts are looked at.
const SITES: usize = 96;

/// Cuts against a ray at every light above the horizon.
pub fn cuts(
    player: &Player,
    tree: &format::LightTree,
    cuts: &format::Cuts,
    stated: Option<f64>,
) -> Vec<Measure> {
    let lights = match &tree.lights {
        format::LightSamples::Environment { order } => {
            let count = order.len() as u32;
            Lights::Directions {
                order: order.clone(),
                directions: order.iter().map(|&i| sphere_direction(i, count)).collect(),
            }
        }
        // Their exact places are not in the file.
        format::LightSamples::Surface { .. } => return Vec::new(),
    };
    let rows = SiteCuts {
        offsets: cuts.row_offsets.clone(),
        heights: cuts.heights.clone(),
        values: cuts.values.clone(),
    };
    let scene = &player.prepared.scene;
    let sums: Vec<(f64, f64, f64, f64)> = chosen(player, SITES)
        .into_par_iter()
        .map(|(p, hit)| {
            let site = Candidate::at(scene, &hit, 0);
            let (mut count, mut squares, mut seen, mut stored) = (0.0, 0.0, 0.0, 0.0);
            let cut: Cut = rows.cut(p);
            for (node, value) in cut.nodes() {
                for light in node.first()..node.end() {
                    let factor = lights.factor(&site, light as usize);
                    if factor.is_nan() {
                        continue;
                    }
                    let dark = scene.occluded(&lights.ray(&site, light as usize));
                    let truth = if dark { 0.0 } else { f64::from(factor) };
                    count += 1.0;
                    squares += (truth - f64::from(value)).powi(2);
                    seen += truth;
                    stored += f64::from(value);
                }
            }
            (count, squares, seen, stored)
        })
        .collect();
    let sum = |of: fn(&(f64, f64, f64, f64)) -> f64| sums.iter().map(of).sum::<f64>();
    let (count, seen) = (sum(|s| s.0), sum(|s| s.2));
    if count == 0.0 {
        return Vec::new();
    }
    let rms = (sum(|s| s.1) / count).sqrt();
    let stated = stated.unwrap_or(f64::NAN);
    let mut measures = vec![Measure::new(
        "cuts: RMS error against fresh rays",
        rms,
        1.15 * stated + 0.03,
        "the bake's own figure, 15 % for the few sites, and what lies between its rays (docs/notebook/cuts.md: 0.03)",
    )];
    if seen > 0.0 {
        measures.push(Measure::new(
            "cuts: mean visibility against fresh rays",
            (sum(|s| s.3) / seen - 1.0).abs(),
            0.02,
            "the bias that docs/notebook/cuts.md allows",
        ));
    }
    measures
}
