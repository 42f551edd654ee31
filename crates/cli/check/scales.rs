//! Scenes and lights of all sizes, cameras of all angles, threads of any number: the same light.

use super::case::{Case, Measure, Measured};
use super::sanity::sane;
use super::shapes::{LAMP, camera, point, room, scaled};
use super::stage::{SIZE, Stage, coarse, difference, seeds_apart};
use glam::Vec3;
use relight_format as format;
use relight_play::frame::light::Lit;
use relight_scene::scene::Scene;
use relight_scene::traced::Shading;

/// Light of the room with all lengths times `factor`: with the lamp's intensity times its square all light stays.
fn at_scale(stage: &Stage, factor: f32) -> Result<Lit, String> {
    let lamp = point(LAMP * factor, factor * factor);
    stage.picture(scaled(room(), factor), &coarse(), &[lamp])
}

const TWO: &str = "a power of two changes no digit and no decision";
const TEN: &str = "rounding moves points and links: twice what another seed changes, measured beside it";

fn scale(stage: &Stage, factor: f32, exact: bool) -> Measured {
    let (one, other) = (at_scale(stage, 1.0)?, at_scale(stage, factor)?);
    let mut measures = sane(&other);
    let (bound, why) = if exact {
        (0.0, TWO)
    } else {
        (
            seeds_apart(stage, room, &coarse(), &[point(LAMP, 1.0)], &one)?,
            TEN,
        )
    };
    let edges = if exact { 0.0 } else { 1e-3 };
    measures.extend([
        Measure::new(
            "direct light",
            difference(&other.direct, &one.direct),
            edges,
            if exact {
                TWO
            } else {
                "pixels at edges alone may see another surface"
            },
        ),
        Measure::new(
            "indirect light",
            difference(&other.indirect, &one.indirect),
            bound,
            why,
        ),
    ]);
    Ok(measures)
}

/// The same asset under a lamp of any strength.
fn intensity(stage: &Stage, factors: &[(f32, f64)]) -> Measured {
    let player = stage.player(room(), &coarse())?;
    let shot = stage.shot(&player, SIZE)?;
    let one = stage.lit(&player, &shot, &[point(LAMP, 1.0)])?;
    let mut measures = Vec::new();
    for &(factor, bound) in factors {
        let other = stage.lit(&player, &shot, &[point(LAMP, factor)])?;
        measures.extend(sane(&other).into_iter().map(|m| Measure {
            what: format!("{} at {factor:e}", m.what),
            ..m
        }));
        // Back in f64: f32 would leave its range.
        let back = |v: &[Vec3]| -> Vec<Vec3> {
            v.iter()
                .map(|v| (v.as_dvec3() / f64::from(factor)).as_vec3())
                .collect()
        };
        let why = if bound == 0.0 {
            TWO
        } else {
            "linear in the light to f32's rounding"
        };
        for (layer, a, b) in [
            ("direct light", &other.direct, &one.direct),
            ("indirect light", &other.indirect, &one.indirect),
        ] {
            measures.push(Measure::new(
                format!("{layer} at {factor:e}"),
                difference(&back(a), b),
                bound,
                why,
            ));
        }
    }
    Ok(measures)
}

/// One bake and one frame on one thread and on three.
fn threads(stage: &Stage) -> Measured {
    let run = |count: usize| -> Result<(Vec<u8>, Lit), String> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .map_err(|e| e.to_string())?;
        pool.install(|| {
            let asset = stage
                .asset(room(), Shading::Lambert, &coarse())
                .map_err(|e| e.to_string())?;
            let bytes = format::write_asset(&asset).map_err(|e| e.to_string())?;
            let player = stage.through_file(&asset)?;
            let shot = stage.shot(&player, SIZE)?;
            Ok((bytes, stage.lit(&player, &shot, &[point(LAMP, 1.0)])?))
        })
    };
    let ((bytes, one), (more_bytes, three)) = (run(1)?, run(3)?);
    let differing = bytes.iter().zip(&more_bytes).filter(|(a, b)| a != b).count()
        + bytes.len().abs_diff(more_bytes.len());
    let pixels = (one.direct.iter().zip(&three.direct))
        .chain(one.indirect.iter().zip(&three.indirect))
        .filter(|(a, b)| a != b)
        .count();
    Ok(vec![
        Measure::none(
            "bytes of the asset that differ",
            differing,
            "bytes do not depend on threads",
        ),
        Measure::none("pixels that differ", pixels, "images do not depend on threads"),
    ])
}

/// Writing what was read gives the same bytes.
fn round_trip(stage: &Stage) -> Measured {
    let asset = stage
        .asset(room(), Shading::Lambert, &coarse())
        .map_err(|e| e.to_string())?;
    let text = |e: format::FormatError| e.to_string();
    let bytes = format::write_asset(&asset).map_err(text)?;
    let read = format::read_asset(&bytes, &format::Limits::default()).map_err(text)?;
    let again = format::write_asset(&read).map_err(text)?;
    let differing =
        bytes.iter().zip(&again).filter(|(a, b)| a != b).count() + bytes.len().abs_diff(again.len());
    Ok(vec![Measure::none(
        "bytes that differ",
        differing,
        "what is quantised once stays",
    )])
}

/// Cameras that see nearly nothing, nearly everything, from a wall and from within matter.
fn cameras(stage: &Stage) -> Measured {
    let player = stage.player(room(), &coarse())?;
    let mut measures = Vec::new();
    for (name, eye, target, vfov) in [
        ("0.001° wide", Vec3::new(0.5, 0.4, 0.9), Vec3::ZERO, 1e-3),
        ("179.9° wide", Vec3::new(0.5, 0.4, 0.9), Vec3::ZERO, 179.9),
        ("upon a wall", Vec3::new(1.0, 0.0, 0.0), Vec3::ZERO, 70.0),
        ("in a corner", Vec3::ONE, Vec3::ZERO, 70.0),
        ("within the block", Vec3::new(-0.2, -0.5, -0.1), Vec3::X, 70.0),
        ("upon its own target", Vec3::ZERO, Vec3::ZERO, 70.0),
        ("outside, looking away", Vec3::splat(5.0), Vec3::splat(9.0), 70.0),
    ] {
        let camera = camera(eye, target, vfov).at(0.0);
        let shot = stage.shot_of(&player, &camera, SIZE, 4, None);
        let lit = stage.lit(&player, &shot, &[point(LAMP, 1.0)])?;
        measures.extend(sane(&lit).into_iter().map(|m| Measure {
            what: format!("{}: {}", name, m.what),
            ..m
        }));
    }
    Ok(measures)
}

/// A scene far from the origin: 1 m of room at a distance where f32 resolves 8 µm.
fn far_away(stage: &Stage) -> Measured {
    let offset = Vec3::new(128.0, -64.0, 64.0);
    let moved = |mut scene: Scene| -> Scene {
        scene
            .meshes
            .iter_mut()
            .flat_map(|m| &mut m.positions)
            .for_each(|p| *p += offset);
        let track = &scene.cameras[0];
        scene.cameras = vec![camera(
            track.position.at(0.0) + offset,
            track.look_at.at(0.0) + offset,
            70.0,
        )];
        scene
    };
    let here = stage.picture(room(), &coarse(), &[point(LAMP, 1.0)])?;
    let there = stage.picture(moved(room()), &coarse(), &[point(LAMP + offset, 1.0)])?;
    let bound = seeds_apart(stage, room, &coarse(), &[point(LAMP, 1.0)], &here)?;
    let mut measures = sane(&there);
    measures.push(Measure::new(
        "direct light",
        difference(&there.direct, &here.direct),
        0.02,
        "shadow edges move by 8 µm",
    ));
    measures.push(Measure::new(
        "indirect light",
        difference(&there.indirect, &here.indirect),
        bound,
        TEN,
    ));
    Ok(measures)
}

/// All of them.
pub fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = [
        ("2^-13", 2f32.powi(-13), true),
        ("2^17", 2f32.powi(17), true),
        ("1e-4", 1e-4, false),
        ("1e5", 1e5, false),
    ]
    .into_iter()
    .map(|(name, factor, exact)| {
        Case::new(
            format!("scale/{name}"),
            name == "2^17",
            "all lengths times a factor, intensity times its square: the same light",
            move |stage| scale(stage, factor, exact),
        )
    })
    .collect();
    cases.push(Case::new(
        "intensity",
        true,
        "light from 1e-20 to 1e20: the same image times the intensity",
        |stage| {
            let factors = [
                (2f32.powi(-66), 0.0),
                (2f32.powi(66), 0.0),
                (1e-20, 1e-5),
                (1e20, 1e-5),
            ];
            intensity(stage, &factors)
        },
    ));
    cases.push(Case::new(
        "threads",
        false,
        "one thread and three: the same bytes and pixels",
        threads,
    ));
    cases.push(Case::new(
        "round-trip",
        false,
        "an asset that was read is written as it was",
        round_trip,
    ));
    cases.push(Case::new(
        "cameras",
        false,
        "any place and angle of view gives light that is a number",
        cameras,
    ));
    cases.push(Case::new(
        "far-from-origin",
        false,
        "a room 160 times its size away from the origin: the same light",
        far_away,
    ));
    cases
}
