//! Progressive radiosity in the meshless basis, on surfaces of any kind.
//!
//! Source: Lehtinen et al. 2008, section 5.1 and figure 6 (the solver itself is only named there). What is
//! here: bounce by bounce, the light of the last one is gathered at the points, coarse levels first. A point's
//! coefficient is the difference between what it gathers and what its parents say (equation 7); where the
//! coefficients of all its parents have become small, it gathers nothing and takes their word. The bounces add
//! up until what is left of the series is small.
//!
//! Unlike the transfer operator (`crate::links::operators`) nothing is precomputed for other lights: the cost of a
//! bounce follows where its light varies, and rays are cast only for points that need them, once.
//!
//! Rays are cosine-distributed, so that each carries the same share of the irradiance and a gather is the mean
//! of the radiosities met: no bounce can amplify light by more than the largest albedo. A ray that ends on a
//! surface takes the radiosity of the nearest finest point. Emission is no concern of this module: what
//! sources send directly is an input, at the points.

use crate::error::BakeError;
use crate::points::candidates::Candidate;
use crate::points::poisson::PointLevels;
use crate::points::poisson::levels_of;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
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
}

/// Stage number of the directions' random stream.
const STAGE: u32 = 5;
/// A ray that meets nothing.
const MISSED: u32 = u32::MAX;
/// A ray that meets a surface without points.
const LOST: u32 = u32::MAX - 1;

/// Solves for the indirect irradiance at the points.
///
/// `direct`: irradiance straight from the sources at the finest level's points. `step(bounce, remainder)` is
/// told of each bounce and may stop the solution.
///
/// # Errors
/// [`BakeError::Parameter`] if `direct` has another length than the finest level or `rays` is 0, and whatever
/// `step` returns.
pub fn solve(
    surfaces: &dyn Surfaces,
    points: &PointLevels,
    direct: &[Vec3],
    params: &RadiosityParams,
    mut step: impl FnMut(u32, f32) -> Result<(), BakeError>,
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
        step(out.bounces, out.remainder)?;
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
    Ok(out)
}

/// Irradiance straight from a point light of `intensity` (W/sr, RGB) at `position`: the simplest input of
/// [`solve`].
pub fn from_point_light(surfaces: &dyn Surfaces, place: &Candidate, position: Vec3, intensity: Vec3) -> Vec3 {
    let way = position - place.origin;
    let squared = way.length_squared();
    let cosine = way.dot(place.normal) / squared.sqrt();
    let ray = Ray {
        origin: place.origin,
        direction: way,
        t_min: 0.0,
        t_max: 1.0,
    };
    // Not so for a light on the very place, where the cosine is no number.
    let faces = cosine > 0.0 && way.dot(place.geometric_normal) > 0.0;
    if faces && !surfaces.occluded(&ray) {
        intensity * (cosine / squared)
    } else {
        Vec3::ZERO
    }
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::links::operators::{Viewers, transport};
    use crate::params::BakeParams;
    use crate::points::poisson::distribute;
    use crate::units::Units;
    use glam::DVec3;
    use relight_scene::gltf::{ImportOptions, import};
    use relight_scene::implicit::{ImplicitSurface, Sdf};
    use relight_scene::traced::{Shading, TracedScene};
    use relight_transport::pyramid::push;
    use std::path::Path;
    use std::sync::Arc;

    /// A hollow implicit ball of radius 1, seen from inside, and its points on three levels.
    pub(crate) fn hollow(albedo: f32) -> (ImplicitSurface, PointLevels) {
        let sdf = Sdf::Sphere {
            center: DVec3::ZERO,
            radius: 1.0,
        };
        let ball = ImplicitSurface::new(sdf, (Vec3::splat(-1.0), Vec3::splat(1.0)), Vec3::splat(albedo));
        let points = distribute(
            &ball,
            &[Vec3::new(0.1, 0.2, -0.1)],
            3,
            0.4,
            0,
            Units::none(),
            |_| Ok(()),
        )
        .unwrap();
        (ball, points)
    }

    fn finest(points: &PointLevels) -> &[Candidate] {
        &points.levels[points.levels.len() - 1].points
    }

    fn mean(values: &[Vec3]) -> f32 {
        values.iter().map(|e| e.x).sum::<f32>() / values.len() as f32
    }

    #[test]
    fn an_evenly_lit_furnace_reaches_its_analytic_value_everywhere() {
        for rho in [0.0f32, 0.5, 0.9] {
            let (ball, points) = hollow(rho);
            let direct = vec![Vec3::ONE; finest(&points).len()];
            let params = RadiosityParams::default();
            let solution = solve(&ball, &points, &direct, &params, |_, _| Ok(())).unwrap();
            assert_eq!(solution.lost, 0, "the ball is closed");
            let exact = rho / (1.0 - rho);
            for e in &solution.irradiance {
                // Every ray meets the same light: no noise, only the series' cut-off remains.
                assert!(
                    e.x <= exact * (1.0 + 1e-4) && e.x >= exact * (1.0 - 1e-4 - params.remainder),
                    "albedo {rho}: {e} instead of {exact}"
                );
            }
            assert_eq!(solution.gathered[2], 0, "even light needs no third level");
        }
    }

    #[test]
    fn uneven_light_in_a_ball_becomes_even_at_the_first_bounce() {
        // In a ball every place sees every other with the same form factor: E_ind = ρ⟨E_d⟩/(1 − ρ) everywhere.
        // E_d = 1 + z: ⟨E_d⟩ = 1.
        let rho = 0.6;
        let (ball, points) = hollow(rho);
        let direct: Vec<Vec3> = finest(&points)
            .iter()
            .map(|p| Vec3::splat(1.0 + p.position.z))
            .collect();
        let params = RadiosityParams {
            remainder: 1e-4,
            ..RadiosityParams::default()
        };
        let solution = solve(&ball, &points, &direct, &params, |_, _| Ok(())).unwrap();
        let exact = rho / (1.0 - rho);
        // E_d deviates by 1/√3. Unstratified rays would give gathers of the first bounce, ρ = 40 % of the total, a
        // standard error of 1/√3/√512 = 2.6 %; the set is stratified and does better. Errors of later bounces are
        // of second order.
        let worst = solution
            .irradiance
            .iter()
            .fold(0.0f32, |m, e| m.max((e.x / exact - 1.0).abs()));
        assert!(worst < 0.026, "{worst}");
        // The set is shared, but turned with every normal: its errors cancel over the ball.
        let all = mean(&solution.irradiance);
        assert!((all / exact - 1.0).abs() < 0.005, "{all} instead of {exact}");
    }

    #[test]
    fn intensity_changes_no_decision() {
        let (ball, points) = hollow(0.5);
        let of = |scale: f32| {
            let direct: Vec<Vec3> = finest(&points)
                .iter()
                .map(|p| Vec3::splat(scale * (p.position.x > 0.0) as u8 as f32))
                .collect();
            solve(
                &ball,
                &points,
                &direct,
                &RadiosityParams::default(),
                |_, _| Ok(()),
            )
            .unwrap()
        };
        let (one, dim) = (of(1.0), of(2f32.powi(-60)));
        assert_eq!((one.bounces, &one.gathered), (dim.bounces, &dim.gathered));
        for (a, b) in one.irradiance.iter().zip(&dim.irradiance) {
            assert_eq!(*a * 2f32.powi(-60), *b, "a power of two changes no digit");
        }
    }

    #[test]
    fn a_solution_needs_light_for_every_finest_point_and_can_be_stopped() {
        let (ball, points) = hollow(0.5);
        let params = RadiosityParams::default();
        assert!(matches!(
            solve(&ball, &points, &[Vec3::ONE], &params, |_, _| Ok(())),
            Err(BakeError::Parameter { .. })
        ));
        let direct = vec![Vec3::ONE; finest(&points).len()];
        let stop = |_, _| Err(BakeError::Stopped);
        assert!(matches!(
            solve(&ball, &points, &direct, &params, stop),
            Err(BakeError::Stopped)
        ));
    }

    /// The Cornell box with a point light in its middle, 1 W/sr: direct irradiance at the finest of four levels.
    fn cornell() -> (TracedScene, PointLevels, Vec<Vec3>) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/cornell.glb");
        let scene = Arc::new(import(&file, &ImportOptions::default()).unwrap());
        let traced = TracedScene::new(scene.clone(), Shading::Lambert).unwrap();
        let eye = scene.cameras[0].at(0.0).position;
        let points = distribute(&traced, &[eye], 4, 0.12, 0, Units::none(), |_| Ok(())).unwrap();
        let (low, high) = traced.bounds().unwrap();
        let lamp = low.lerp(high, 0.5).with_y(0.45);
        let direct = finest(&points)
            .iter()
            .map(|p| from_point_light(&traced, p, lamp, Vec3::ONE))
            .collect();
        (traced, points, direct)
    }

    /// Mean absolute difference of the red channels.
    fn apart(a: &[Vec3], b: &[Vec3]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a.x - b.x).abs()).sum::<f32>() / a.len() as f32
    }

    #[test]
    fn what_refinement_leaves_out_stays_below_its_threshold() {
        let (traced, points, direct) = cornell();
        let adaptive = RadiosityParams::default();
        let of = |params| solve(&traced, &points, &direct, &params, |_, _| Ok(())).unwrap();
        let (some, every) = (
            of(adaptive),
            of(RadiosityParams {
                refine: 0.0,
                ..adaptive
            }),
        );
        // Truth: the same gathers at all points, so that noise is the same and only the choice of points differs.
        let scale = brightest(&every.irradiance);
        let difference = apart(&some.irradiance, &every.irradiance) / scale;
        assert!(difference < adaptive.refine, "{difference} of the brightest");
        assert!(
            some.rays * 2 < every.rays,
            "{} of {} rays: most are saved",
            some.rays,
            every.rays
        );
    }

    /// One bounce by this solver and by the transfer operator, over the same points.
    #[test]
    fn one_bounce_is_what_the_transfer_operator_gives() {
        let (traced, placed, direct) = cornell();
        let params = RadiosityParams {
            most_bounces: 1,
            ..RadiosityParams::default()
        };
        let solution = solve(&traced, &placed, &direct, &params, |_, _| Ok(())).unwrap();
        let radiosity: Vec<Vec3> = finest(&placed)
            .iter()
            .zip(&direct)
            .map(|(p, e)| p.albedo * *e)
            .collect();
        let (low, high) = traced.bounds().unwrap();
        let middle = [low.midpoint(high)];
        let baked = transport(
            &traced,
            placed,
            Viewers {
                viewpoints: &middle,
                cameras: &[],
            },
            &BakeParams::default(),
            |v| v,
            Units::none(),
            &|_| Ok(()),
        )
        .unwrap();
        let levels = levels_of(&baked.points);
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let sent = baked.tree.coefficients(&baked.tree.pulled(&radiosity));
        let mut values = baked.links.apply(&sent);
        let normals: Vec<Vec3> = levels.iter().flat_map(|l| l.normals.iter().copied()).collect();
        push(
            &mut values,
            &normals,
            &ranges,
            &fine_from_coarse(&levels, |_, _| false),
        );

        let range = ranges.range(levels.len() - 1);
        let ours = &solution.irradiance[range.clone()];
        let theirs: Vec<Vec3> = range.map(|i| values[i].irradiance(normals[i])).collect();
        let (a, b) = (mean(ours), mean(&theirs));
        // Both gather with 512 rays at the finest points, and T leaves out links of up to 0.025: a few per cent of
        // the mean at a point. Measured: means 2.3 % apart (4,096 rays at every point agree with this solver's to
        // 0.1 %), points 6 %; the bounds are twice that.
        assert!((a / b - 1.0).abs() < 0.05, "means {a} and {b}");
        let difference = apart(ours, &theirs) / b;
        assert!(difference < 0.12, "mean difference {difference} of the mean");
    }
}
