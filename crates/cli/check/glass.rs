//! Panes that light goes through, and lamps that shine as they were measured.

use super::case::{Case, Measure, Measured};
use super::lights::balance;
use super::sanity::sane;
use super::shapes::{LAMP, matt, point, quad, room, scene, sky, sphere, sun, track};
use super::stage::{SIZE, Stage, at_points, coarse, difference, mean, quick};
use glam::Vec3;
use relight_scene::animated::Animated;
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::material::{AlphaMode, Extensions, Material};
use relight_scene::photometry::Photometry;
use relight_scene::scene::{Mesh, Scene};
use relight_scene::traced::{Shading, TracedScene};
use std::sync::Arc;

/// All light that is not mirrored passes, times the colour.
fn glass(color: Vec3, ior: f32) -> Material {
    Material {
        roughness: 0.0,
        metallic: 0.0,
        alpha_mode: AlphaMode::Pane { transmission: 1.0 },
        extensions: Some(Box::new(Extensions {
            ior,
            ..Extensions::default()
        })),
        ..matt(color)
    }
}

/// A ball of clear glass in an even sky: what it mirrors and what passes are the sky again.
fn furnace(stage: &Stage) -> Measured {
    let mut measures = Vec::new();
    for ior in [1.0f32, 1.5, 2.4] {
        let ball = scene(
            vec![(sphere(16, false), glass(Vec3::ONE, ior))],
            Vec3::new(0.0, 0.0, 2.0),
            Vec3::ZERO,
        );
        let traced = TracedScene::new(Arc::new(ball), Shading::Full).map_err(|e| e.to_string())?;
        let layers = stage.traced(&traced, &[sky(1.0)])?;
        let pixels = layers.rgb("beauty").unwrap_or_default().pixels;
        let all = pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / pixels.len().max(1) as f64;
        measures.push(Measure::new(
            format!("index {ior}: light against the sky's"),
            (all - 1.0).abs(),
            0.01,
            "clear glass neither makes nor takes light; noise of 36,864 paths",
        ));
    }
    Ok(measures)
}

/// A level square of 4 m.
fn plate(y: f32) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(2.0 * x, y, 2.0 * z);
    quad(
        [
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
            corner(1.0, -1.0),
            corner(-1.0, -1.0),
        ],
        1,
    )
}

/// A floor under some panes, seen from below them.
fn under(panes: &[(Vec3, f32)]) -> Scene {
    let mut parts = vec![(plate(0.0), matt(Vec3::splat(0.5)))];
    for (i, &(color, ior)) in panes.iter().enumerate() {
        parts.push((plate(1.0 + 0.1 * i as f32), glass(color, ior)));
    }
    scene(parts, Vec3::new(0.0, 0.9, 0.01), Vec3::ZERO)
}

/// Sunlight from above through panes: each takes what Fresnel's term mirrors at normal incidence, and its colour.
fn panes(stage: &Stage) -> Measured {
    let noon = [sun(Vec3::NEG_Y, 2.0)];
    let direct = |scene: Scene| -> Result<_, String> {
        // As Lambert, panes would be walls.
        let asset = (stage.asset(scene, Shading::Full, &coarse())).map_err(|e| e.to_string())?;
        let player = stage.through_file(&asset)?;
        let shot = stage.shot(&player, SIZE)?;
        let lit = stage.lit(&player, &shot, &noon)?;
        Ok((mean(&lit.direct), sane(&lit)))
    };
    let (open, _) = direct(under(&[]))?;
    let mut measures = Vec::new();
    for panes in [
        vec![(Vec3::ONE, 1.5f32)],
        vec![(Vec3::new(0.9, 0.5, 0.1), 1.5)],
        vec![(Vec3::new(0.9, 0.8, 0.7), 1.5), (Vec3::new(0.5, 1.0, 0.8), 2.0)],
    ] {
        let (found, sanity) = direct(under(&panes))?;
        let share = panes.iter().fold(Vec3::ONE, |share, (color, ior)| {
            let root = (ior - 1.0) / (ior + 1.0);
            share * *color * (1.0 - root * root)
        });
        let name = format!("{} panes of {}", panes.len(), panes[0].0);
        measures.extend(sanity.into_iter().map(|m| Measure {
            what: format!("{name}: {}", m.what),
            ..m
        }));
        measures.push(Measure::new(
            format!("{name}: light over that without them"),
            (found / open / share.as_dvec3() - 1.0).abs().max_element(),
            1e-3,
            "Π (1 − ((n − 1)/(n + 1))²) × colour, exact but for rounding",
        ));
    }
    Ok(measures)
}

/// A lamp that was measured, here with the same candela in all directions or only downwards.
fn measured(candela: &str) -> Result<LightTrack, String> {
    let file =
        format!("IES:LM-63-2019\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0\n1 1 60\n0 89.9 90 180\n0\n{candela}\n");
    let profile = Photometry::parse(&file).map_err(|e| e.to_string())?;
    let kind = LightKind::Ies {
        profile: Arc::new(profile),
        file,
        position: Animated::Constant(LAMP),
        direction: Animated::Constant(Vec3::NEG_Y),
        up: Animated::Constant(Vec3::Y),
        scale: Animated::Constant(Vec3::ONE),
    };
    Ok(track("measured", kind))
}

/// A measured lamp in the room: like the point light that it was measured like, and no light goes missing.
fn lamps(stage: &Stage) -> Measured {
    let player = stage.player(room(), &quick())?;
    let shot = stage.shot(&player, SIZE)?;
    let lit = |track: LightTrack| stage.lit(&player, &shot, &[track]);
    let (even, plain) = (lit(measured("7 7 7 7")?)?, lit(point(LAMP, 7.0))?);
    let mut measures = sane(&even);
    for (name, found, truth) in [
        ("direct", &even.direct, &plain.direct),
        ("indirect", &even.indirect, &plain.indirect),
    ] {
        measures.push(Measure::new(
            format!("{name} light against a point light's"),
            difference(found, truth),
            1e-4,
            "the same intensity in all directions, but for rounding",
        ));
    }
    let down = at_points(stage, &player, &[measured("7 7 0 0")?])?;
    measures.push(Measure::new(
        "energy balance of a lamp that shines down",
        balance(&player, &down),
        0.04,
        "what closed walls absorb is what falls on them: twice what a lamp all around may be off, since half of the walls have bounced light alone",
    ));
    Ok(measures)
}

/// All of them.
pub fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "glass/furnace",
            true,
            "a ball of clear glass in an even sky can't be seen",
            furnace,
        ),
        Case::new(
            "glass/panes",
            true,
            "sunlight through panes is what Fresnel and their colours leave",
            panes,
        ),
        Case::new(
            "lights/measured",
            true,
            "a lamp measured as even is a point light",
            lamps,
        ),
    ]
}
