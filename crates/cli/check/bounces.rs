//! Bounces that hardly lose light, and operators that were truncated.

use super::case::{Case, Measure, Measured};
use super::sanity::sane;
use super::shapes::{
    LAMP, cuboid, emissive, faces, glowing, join, matt, painted, point, room, scene, sphere,
};
use super::stage::{SIZE, Stage, at_points, coarse, mean, quick};
use glam::{DVec3, Vec3};
use relight_bake::params::BakeParams;
use relight_format::Asset;
use relight_play::FrameSettings;
use relight_play::open::matrix;
use relight_scene::traced::Shading;
use relight_transport::bounce::{TOLERANCE, solve_double};
use relight_transport::random::Stream;
use relight_transport::sparse::{SparseMatrix, build, largest_row_sum};
use relight_transport::spectrum::spectral_radius;

/// Products with the operator that the issue allows at a reflectance of 0.999.
const MOST_PRODUCTS: f64 = 40.0;

/// Stage number of the random stream.
const STAGE: u32 = 0x43;

/// Solves with one cluster alight and albedo `rho`, against the same to 1e-9.
fn stiff(k: &SparseMatrix, rho: f32) -> Vec<Measure> {
    let n = k.rows();
    let mut emitted = vec![Vec3::ZERO; n];
    emitted[n / 3] = Vec3::ONE;
    let albedo = vec![Vec3::splat(rho); n];
    let (exact, _) = solve_double(k, &emitted, &albedo, None, 1e-9);
    let (found, solve) = solve_double(k, &emitted, &albedo, None, TOLERANCE);
    let all = |v: &[DVec3]| v.iter().map(|e| e.x).sum::<f64>();
    let most = exact.iter().map(|e| e.x).fold(0.0, f64::max);
    let off = found
        .iter()
        .zip(&exact)
        .map(|(a, b)| (a.x - b.x).abs())
        .fold(0.0, f64::max);
    let negative = found
        .iter()
        .filter(|e| e.min_element() < 0.0 || !e.is_finite())
        .count();
    let lost = f64::from(1.0 - rho);
    vec![
        Measure::new(
            "products",
            f64::from(solve.iterations),
            MOST_PRODUCTS,
            "the issue's, at 0.999",
        ),
        Measure::new(
            "residual",
            f64::from(solve.residual),
            TOLERANCE * lost * (1.0 + 1e-6),
            "10⁻⁵·(1 − ρ)",
        ),
        Measure::new(
            "all light",
            (all(&found) / all(&exact) - 1.0).abs(),
            TOLERANCE,
            "what that residual allows",
        ),
        Measure::new(
            "worst place",
            off / most,
            TOLERANCE,
            "the same, relative to the brightest",
        ),
        Measure::none("negative or broken values", negative, "light is not negative"),
    ]
}

/// Eight rooms in a row; a hundredth of each wall's view goes through each door, and no two walls see alike.
fn row_of_rooms() -> SparseMatrix {
    const ROOMS: usize = 8;
    const EACH: usize = 40;
    const DOOR: f32 = 0.01;
    let of_wall = |i: usize| {
        let mut stream = Stream::new(0, STAGE, i as u64);
        let mut row = Vec::new();
        let room = i / EACH;
        let seen = room.saturating_sub(1)..(room + 2).min(ROOMS);
        let doors = seen.len() - 1;
        for r in seen {
            let share = if r == room {
                1.0 - doors as f32 * DOOR
            } else {
                DOOR
            };
            let parts: Vec<f32> = (0..EACH).map(|_| stream.uniform()).collect();
            let sum: f32 = parts.iter().sum();
            row.extend((0..EACH).map(|j| ((r * EACH + j) as u32, share * parts[j] / sum)));
        }
        row
    };
    build(ROOMS * EACH, ROOMS * EACH, |i, row| row.extend(of_wall(i)))
}

fn asset_of_sphere(stage: &Stage, albedo: f32) -> Result<Asset, String> {
    let walls = painted(sphere(16, true), |_| Vec3::splat(albedo));
    let scene = scene(
        vec![(walls, matt(Vec3::ONE))],
        Vec3::new(-0.3, 0.1, 0.5),
        Vec3::new(0.6, -0.1, -0.5),
    );
    stage
        .asset(scene, Shading::Lambert, &coarse())
        .map_err(|e| e.to_string())
}

fn stiff_baked(stage: &Stage, rho: f32) -> Measured {
    let mut measures = Vec::new();
    let sphere = asset_of_sphere(stage, 0.99)?;
    let rooms = stage
        .asset(room(), Shading::Lambert, &coarse())
        .map_err(|e| e.to_string())?;
    for (name, asset) in [("sphere", sphere), ("room", rooms)] {
        stage.at("bounces");
        let bounce = asset.bounce.as_ref().ok_or("no bounces")?;
        measures.extend(
            stiff(&matrix(bounce.matrix.clone())?, rho)
                .into_iter()
                .map(|m| Measure {
                    what: format!("{name}: {}", m.what),
                    ..m
                }),
        );
    }
    Ok(measures)
}

/// A room of walls that reflect everything, and one that does so but for a black patch.
fn white(stage: &Stage) -> Measured {
    let mut measures = Vec::new();
    let [left, right, floor, ceiling, back, front] = faces(Vec3::NEG_ONE, Vec3::ONE, true);
    let mut white = floor;
    [&left, &right, &back, &front]
        .into_iter()
        .for_each(|face| join(&mut white, face));
    for (name, top) in [("all white", 1.0f32), ("black ceiling", 0.0)] {
        let parts = vec![
            (white.clone(), matt(Vec3::ONE)),
            (ceiling.clone(), matt(Vec3::splat(top))),
        ];
        let scene = scene(parts, Vec3::new(0.5, 0.4, 0.9), Vec3::new(-0.2, -0.3, -0.4));
        let player = stage.player(scene, &quick())?;
        let light = at_points(stage, &player, &[point(LAMP, 1.0)])?;
        let shot = stage.shot(&player, SIZE)?;
        measures.extend(
            sane(&stage.lit(&player, &shot, &[point(LAMP, 1.0)])?)
                .into_iter()
                .map(|m| Measure {
                    what: format!("{name}: {}", m.what),
                    ..m
                }),
        );
        let gain = light.mean_indirect().x / light.mean_direct().x;
        if top > 0.0 {
            measures.push(Measure::new(
                format!("{name}: indirect over direct light"),
                gain,
                1.03e4,
                "nothing reflects more than 0.9999, so at most 10⁴; 1 % of the solver, and the 2 % of lights/energy",
            ));
        } else {
            let balance = super::lights::balance(&player, &light);
            measures.push(Measure::new(
                format!("{name}: energy balance"),
                balance,
                0.05,
                "all light ends on a sixth of the walls: errors count six times",
            ));
        }
    }
    Ok(measures)
}

/// Whatever ε is, bounces lose light and lose no more than albedo takes.
fn truncated(stage: &Stage, epsilon: f32) -> Measured {
    const RHO: f64 = 0.999;
    let furnace = || {
        let walls = cuboid(Vec3::NEG_ONE, Vec3::ONE, true);
        scene(
            vec![(walls, glowing(0.9))],
            Vec3::new(-0.3, 0.1, 0.5),
            Vec3::new(0.6, -0.1, -0.5),
        )
    };
    let params = BakeParams { epsilon, ..coarse() };
    let mut measures = Vec::new();
    for (name, solution) in [("", false), ("solved by the bake: ", true)] {
        let params = BakeParams {
            solution,
            ..params.clone()
        };
        let asset = stage
            .asset(furnace(), Shading::Lambert, &params)
            .map_err(|e| e.to_string())?;
        if let Some(bounce) = &asset.bounce {
            stage.at("bounces");
            let k = matrix(bounce.matrix.clone())?;
            let radius = spectral_radius(&k, &vec![RHO; k.rows()]);
            measures.extend([
                Measure::new(
                    "largest row sum less 1",
                    largest_row_sum(&k) - 1.0,
                    1e-6,
                    "rows sum to at most 1; a few hundred f32 weights round to that",
                ),
                Measure::new(
                    "spectral radius at 0.999",
                    radius.upper,
                    RHO * (1.0 + 1e-6),
                    "the largest row sum times ρ",
                ),
                Measure::none(
                    "negative weights",
                    k.data().iter().filter(|w| **w < 0.0 || w.is_nan()).count(),
                    "a bounce carries light, not darkness",
                ),
            ]);
        }
        let player = stage.through_file(&asset)?;
        let shot = stage.shot(&player, SIZE)?;
        let settings = FrameSettings {
            point_samples: 16,
            ..FrameSettings::default()
        };
        let lit = stage.lit_with(&player, &shot, &[emissive()], &settings)?;
        measures.extend(sane(&lit).into_iter().map(|m| Measure {
            what: format!("{name}{}", m.what),
            ..m
        }));
        let gain = mean(&lit.indirect).x / mean(&lit.direct).x;
        measures.push(Measure::new(
            format!("{name}indirect over direct light"),
            (gain / 9.0 - 1.0).abs(),
            0.02,
            "ρ/(1 − ρ) = 9, whatever is truncated: twice the bound of the preset for a third of its points",
        ));
    }
    Ok(measures)
}

/// Each further bounce adds less than the one before, and all together what the solver finds.
fn series(stage: &Stage) -> Measured {
    let asset = stage
        .asset(room(), Shading::Lambert, &quick())
        .map_err(|e| e.to_string())?;
    stage.at("bounces");
    let k = matrix(asset.bounce.as_ref().ok_or("no bounces")?.matrix.clone())?;
    let n = k.rows();
    let mut emitted = vec![Vec3::ZERO; n];
    emitted[n / 2] = Vec3::ONE;
    let albedo = vec![Vec3::splat(0.7); n];
    let (all, _) = solve_double(&k, &emitted, &albedo, None, 1e-9);
    let mut kept = 0.0f64;
    let (mut before, mut last) = (vec![0.0; n], f64::INFINITY);
    for bounces in 1..60 {
        let (e, _) = solve_double(&k, &emitted, &albedo, Some(bounces), TOLERANCE);
        let e: Vec<f64> = e.iter().map(|e| e.x).collect();
        let added = (e.iter().zip(&before).map(|(e, before)| e - before)).fold(0.0, f64::max);
        kept = kept.max(added / last);
        (last, before) = (added, e);
    }
    let (sum, _) = solve_double(&k, &emitted, &albedo, Some(60), TOLERANCE);
    let off = sum
        .iter()
        .zip(&all)
        .map(|(a, b)| (a.x - b.x).abs())
        .fold(0.0, f64::max);
    let most = all.iter().map(|e| e.x).fold(0.0, f64::max);
    Ok(vec![
        Measure::new(
            "most that a bounce adds anywhere, against the one before",
            kept,
            0.7 * (1.0 + 1e-4),
            "ρ; stored rows sum to 1 to a ten-thousandth",
        ),
        Measure::new(
            "sixty bounces against all",
            off / most,
            1e-8,
            "0.7^60 = 5e-10 of the rest, and the solver's 1e-9",
        ),
    ])
}

/// All of them.
pub fn cases() -> Vec<Case> {
    let mut cases = vec![
        Case::new(
            "bounce/rooms",
            true,
            "eight rooms in a row, albedo 0.999, one lit: 40 products",
            |stage| {
                stage.at("bounces");
                Ok(stiff(&row_of_rooms(), 0.999))
            },
        ),
        Case::new(
            "bounce/baked",
            true,
            "a sphere and a room, albedo 0.999, one cluster lit: 40 products",
            |stage| stiff_baked(stage, 0.999),
        ),
        Case::new(
            "bounce/white",
            false,
            "walls that reflect all light: a lot of it, but a number",
            white,
        ),
        Case::new(
            "bounce/series",
            false,
            "the series falls, and its sum is the solver's",
            series,
        ),
    ];
    for epsilon in [1e-4f32, 0.025, 0.3, 1.0, 10.0] {
        cases.push(Case::new(
            format!("bounce/epsilon/{epsilon}"),
            epsilon == 10.0,
            "no ε makes light or loses it",
            move |stage| truncated(stage, epsilon),
        ));
    }
    cases
}
