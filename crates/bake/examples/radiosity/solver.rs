//! Progressive radiosity in the meshless basis, on surfaces of any kind.
//!
//! Source: Lehtinen et al. 2008, section 5.1 and figure 6 (the solver itself is only named there). What is
//! here: bounce by bounce, the light of the last one is gathered at the points, coarse levels first. A point's
//! coefficient is the difference between what it gathers and what its parents say (equation 7); where the
//! coefficients of all its parents have become small, it gathers nothing and takes their word. The bounces add
//! up until what is left of the series is small.
//!
//! Unlike the transfer operator (`relight_bake::links::operators`) nothing is precomputed for other lights: the cost of a
//! bounce follows where its light varies, and rays are cast only for points that need them, once.
//!
//! Rays are cosine-distributed, so that each carries the same share of the irradiance and a gather is the mean
//! of the radiosities met: no bounce can amplify light by more than the largest albedo. A ray that ends on a
//! surface takes the radiosity of the nearest finest point. Emission is no concern of this module: what
//! sources send directly is an input, at the points.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_bake::error::BakeError;
use relight_bake::points::poisson::{PointLevels, levels_of};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::pyramid::{LevelRanges, fine_from_coarse};
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere, r2};
use relight_transport::sparse::row;
use std::ops::Range;

/// How exact a solution is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiosityParams {
    /// Rays per gather. Noise of an unstratified gather is the radiosities' deviation over the square root.
    pub rays: usize,
    /// Relative to the brightest irradiance so far: a coefficient of a bounce below this needs no finer level.
    pub refine: f32,
    /// Relative to the brightest irradiance of all: below this the rest of the series is left out.
    pub remainder: f32,
    /// Most bounces, for reflectances so near 1 that the series hardly ends.
    pub most_bounces: u32,
    /// Seed of the directions.
    pub seed: u64,
}

impl Default for RadiosityParams {
    fn default() -> Self {
        RadiosityParams {
            rays: 512,
            refine: 0.02,
            remainder: 0.002,
            most_bounces: 1000,
            seed: 0,
        }
    }
}

/// A radiosity solution.
#[derive(Clone, Debug, Default)]
pub struct Radiosity {
    /// Indirect irradiance (of one bounce and more) at the points of all levels, coarsest first, linear RGB.
    pub irradiance: Vec<Vec3>,
    /// Bounces that were computed.
    pub bounces: u32,
    /// Upper bound of what the rest of the series would add anywhere, over the brightest irradiance; infinite
    /// if some albedo is 1.
    pub remainder: f32,
    /// Per level how many points gathered in at least one bounce.
    pub gathered: Vec<usize>,
    /// Rays cast.
    pub rays: u64,
    /// Rays that met a surface without a point anywhere near.
    pub lost: u64,
    /// Directions of every gather, unit vectors about a normal of +z, cosine-distributed.
    pub directions: Vec<Vec3>,
    /// Per point of all levels the finest point that each of its rays met, beyond the last where it met none; empty where
    /// the point took its parents' word.
    pub hits: Vec<Vec<u32>>,
}

/// Stage number of the directions' random stream.
const STAGE: u32 = 5;
/// A ray that meets nothing.
const MISSED: u32 = u32::MAX;
/// A ray that meets a surface without points.
const LOST: u32 = u32::MAX - 1;

/// Solves for the indirect irradiance at the points.
///
/// `direct`: irradiance straight from the sources at the finest level's points.
///
/// # Errors
/// [`BakeError::Parameter`] if `direct` has another length than the finest level or `rays` is 0.
pub fn solve(
    surfaces: &dyn Surfaces,
    points: &PointLevels,
    direct: &[Vec3],
    params: &RadiosityParams,
) -> Result<Radiosity, BakeError> {
    let levels = levels_of(points);
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let finest = check(&levels, &ranges, direct, params)?;
    let Some(field) = levels.last().map(NearestPoint::new) else {
        return Ok(Radiosity::default());
    };
    let parents = fine_from_coarse(&levels, |_, _| false);
    let places: Vec<_> = points.levels.iter().flat_map(|l| &l.points).collect();
    let albedo: Vec<Vec3> = places[finest.clone()].iter().map(|p| p.albedo).collect();
    let reflecting = brightest(&albedo);
    let directions = cosine_directions(params);

    let mut total = vec![Vec3::ZERO; ranges.total()];
    let mut hits: Vec<Vec<u32>> = vec![Vec::new(); ranges.total()];
    let mut radiosity: Vec<Vec3> = albedo.iter().zip(direct).map(|(rho, e)| *rho * *e).collect();
    let mut out = Radiosity::default();
    while out.bounces < params.most_bounces {
        let mut bounce = vec![Vec3::ZERO; ranges.total()];
        let mut coefficients = vec![0.0f32; ranges.total()];
        let scale = brightest(&total);
        for level in 0..ranges.levels() {
            let range = ranges.range(level);
            let (coarser, rest) = bounce.split_at_mut(range.start);
            let small = params.refine * scale.max(brightest(coarser));
            let (of_coarser, own_coefficients) = coefficients.split_at_mut(range.start);
            rest[..range.len()]
                .par_iter_mut()
                .zip(&mut own_coefficients[..range.len()])
                .zip(&mut hits[range.clone()])
                .with_min_len(16)
                .enumerate()
                .for_each(|(local, ((value, coefficient), hits))| {
                    let i = range.start + local;
                    let mut row = row(&parents, i);
                    let predicted: Vec3 = row.clone().map(|(k, w)| coarser[k as usize] * w).sum();
                    *value = predicted;
                    // The coarsest level's own values are no differences: the second level is always asked.
                    let word_taken = level > 1 && row.len() > 0;
                    if word_taken && row.all(|(k, _)| of_coarser[k as usize] <= small) {
                        return;
                    }
                    if hits.is_empty() {
                        *hits = cast(
                            surfaces,
                            &field,
                            places[i].origin,
                            places[i].geometric_normal,
                            &directions,
                        );
                    }
                    *value = gathered(hits, &radiosity);
                    *coefficient = (*value - predicted).abs().max_element();
                });
        }
        out.bounces += 1;
        total.iter_mut().zip(&bounce).for_each(|(t, b)| *t += *b);
        out.remainder = remainder(reflecting, brightest(&bounce), brightest(&total));
        if out.remainder <= params.remainder {
            break;
        }
        radiosity = albedo
            .iter()
            .zip(&bounce[finest.clone()])
            .map(|(rho, e)| *rho * *e)
            .collect();
    }
    out.irradiance = total;
    out.gathered = (0..ranges.levels())
        .map(|l| hits[ranges.range(l)].iter().filter(|h| !h.is_empty()).count())
        .collect();
    out.rays = hits.iter().map(|h| h.len() as u64).sum();
    out.lost = hits.iter().flatten().filter(|&&h| h == LOST).count() as u64;
    (out.hits, out.directions) = (hits, directions);
    Ok(out)
}

fn check(
    levels: &[Level],
    ranges: &LevelRanges,
    direct: &[Vec3],
    params: &RadiosityParams,
) -> Result<Range<usize>, BakeError> {
    let finest = if levels.is_empty() {
        0..0
    } else {
        ranges.range(levels.len() - 1)
    };
    if direct.len() != finest.len() {
        return Err(BakeError::Parameter {
            name: "length of the direct irradiance",
            found: direct.len().to_string(),
            expected: "the number of points on the finest level",
        });
    }
    if params.rays == 0 {
        let expected = "at least 1";
        return Err(BakeError::Parameter {
            name: "rays per gather",
            found: "0".into(),
            expected,
        });
    }
    Ok(finest)
}

fn brightest(values: &[Vec3]) -> f32 {
    values.iter().fold(0.0, |m, v| m.max(v.max_element()))
}

/// A bounce's brightest irradiance bounds the next one's over the largest albedo, and so on: a geometric series.
fn remainder(albedo: f32, bounce: f32, total: f32) -> f32 {
    let left = bounce * albedo;
    if left <= 0.0 {
        0.0
    } else if albedo >= 1.0 {
        f32::INFINITY
    } else {
        left / ((1.0 - albedo) * total)
    }
}

/// All gathers share one set, so that differences between neighbours are not mostly noise.
fn cosine_directions(params: &RadiosityParams) -> Vec<Vec3> {
    let mut s = Stream::new(params.seed, STAGE, 0);
    let start = Vec2::new(s.uniform(), s.uniform());
    (0..params.rays as u32)
        .map(|i| cosine_hemisphere(r2(i, start)))
        .collect()
}

/// For each ray the nearest finest point to where it ends.
fn cast(
    surfaces: &dyn Surfaces,
    field: &NearestPoint,
    origin: Vec3,
    normal: Vec3,
    directions: &[Vec3],
) -> Vec<u32> {
    let frame = Frame::around(normal);
    directions
        .iter()
        .map(|&local| {
            let direction = frame.world_from_local(local);
            let ray = Ray {
                origin,
                direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            match surfaces.closest_hit(&ray) {
                Some(hit) => field.at(hit.position, hit.normal).unwrap_or(LOST),
                None => MISSED,
            }
        })
        .collect()
}

/// Irradiance: the mean of the radiosities met (equation 16 under cosine-distributed rays).
fn gathered(hits: &[u32], radiosity: &[Vec3]) -> Vec3 {
    let sum: Vec3 = hits.iter().filter_map(|&h| radiosity.get(h as usize)).sum();
    sum / hits.len() as f32
}
