//! Sequences in which light changes little from frame to frame: what flickers, and whether lights add up.

use super::case::{Case, Measure, Measured};
use super::shapes::{LAMP, globe, panel, point, room};
use super::stage::{SIZE, Stage, difference, quick};
use glam::{Vec2, Vec3};
use relight_play::FrameSettings;
use relight_play::choice::{Integrator, Tracer};
use relight_play::shot::ShotSettings;
use relight_render::lightcuts::LightcutSettings;
use relight_render::many_lights::PointSettings;
use relight_render::pixelcuts::PixelcutsSettings;
use relight_scene::image::flicker::Flicker;
use relight_scene::light::LightTrack;

/// Frames of a sequence.
const FRAMES: u32 = 16;

const VIRTUAL: &str =
    "half of all pixels within 0.3 % from frame to frame, 99 of 100 within 3 %: what cuts choose changes";
const WANTED: &str = "a person watches it as a film: half of all pixels within 0.05 % from frame to frame, 99 of 100 within 0.5 %";

/// Flicker of indirect light in the room while `light` moves, 0 to 1.
fn flicker(
    stage: &Stage,
    light: impl Fn(f32) -> LightTrack,
    bounds: [f64; 3],
    why: &'static str,
) -> Measured {
    let player = stage.player(room(), &quick())?;
    let shot = stage.shot(&player, SIZE)?;
    let frames: Result<Vec<Vec<f32>>, String> = (0..FRAMES)
        .map(|frame| {
            let at = frame as f32 / (FRAMES - 1) as f32;
            let lit = stage.lit(&player, &shot, &[light(at)])?;
            Ok(lit.indirect.iter().map(|v| v.element_sum() / 3.0).collect())
        })
        .collect();
    percentiles(frames?, bounds, why)
}

/// How much frames flicker.
fn percentiles(frames: Vec<Vec<f32>>, bounds: [f64; 3], why: &'static str) -> Measured {
    let found = Flicker::of(frames).ok_or("no light")?;
    Ok(vec![
        Measure::new("median", found.median, bounds[0], why),
        Measure::new("99th percentile", found.p99, bounds[1], why),
        Measure::new("99.9th percentile", found.p999, bounds[2], why),
    ])
}

/// Flicker of indirect light in the room by virtual lights while a lamp glides, and their light against transfer's.
fn virtual_lights(stage: &Stage, tracer: Tracer, bounds: [f64; 3]) -> Measured {
    let player = stage.player(room(), &quick())?;
    let camera = player.scene().cameras.first().ok_or("no camera")?.at(0.0);
    let frames = |integrator: Integrator| -> Result<Vec<Vec<f32>>, String> {
        let settings = ShotSettings {
            integrator,
            width: SIZE,
            height: SIZE,
            samples: Some(1),
            ..ShotSettings::default()
        };
        let shot = player.shot(&camera, &settings).map_err(|e| e.to_string())?;
        (0..FRAMES)
            .map(|frame| {
                stage.at("play: frame");
                let at = frame as f32 / (FRAMES - 1) as f32;
                let lamp = point(LAMP + Vec3::X * (0.3 * at), 1.0);
                let lights = player.lights(&[lamp]).map_err(|e| e.to_string())?;
                let frame = player
                    .frame(&shot, &lights, 0.0, &FrameSettings::default())
                    .map_err(|e| e.to_string())?;
                let indirect = frame.layers.rgb("indirect").ok_or("no indirect light")?;
                Ok(indirect
                    .pixels
                    .iter()
                    .map(|p| p.iter().sum::<f32>() / 3.0)
                    .collect())
            })
            .collect()
    };
    let found = frames(tracer.into())?;
    let truth = frames(Integrator::Transfer)?;
    let mean = |frames: &[Vec<f32>]| frames.iter().flatten().map(|&v| f64::from(v)).sum::<f64>();
    let off = (mean(&found) / mean(&truth) - 1.0).abs();
    let mut measures = percentiles(found, bounds, VIRTUAL)?;
    measures.push(Measure::new(
        "mean indirect light against transfer's",
        off,
        0.1,
        "rectangles lose what of them reaches through walls; cuts err by 2 % of a pixel each, on the dark side",
    ));
    Ok(measures)
}

/// Lights apart are all of them together.
fn sums(stage: &Stage) -> Measured {
    let player = stage.player(room(), &quick())?;
    let shot = stage.shot(&player, SIZE)?;
    let tracks = [
        LightTrack {
            name: "near".into(),
            ..point(LAMP, 1.0)
        },
        globe(Vec3::new(-0.5, 0.6, 0.4), 0.1, 30.0),
        panel(Vec3::Y, Vec2::splat(0.5), 1.0),
    ];
    let together = stage.lit(&player, &shot, &tracks)?;
    let mut apart = vec![Vec3::ZERO; together.direct.len()];
    for track in &tracks {
        let lit = stage.lit(&player, &shot, std::slice::from_ref(track))?;
        for (sum, (direct, indirect)) in apart.iter_mut().zip(lit.direct.iter().zip(&lit.indirect)) {
            *sum += *direct + *indirect;
        }
    }
    let all: Vec<Vec3> = (together.direct.iter().zip(&together.indirect))
        .map(|(direct, indirect)| *direct + *indirect)
        .collect();
    let settings = FrameSettings {
        light_layers: true,
        ..FrameSettings::default()
    };
    let layered = stage.lit_with(&player, &shot, &tracks, &settings)?;
    let mut layers = vec![Vec3::ZERO; all.len()];
    for (_, layer) in &layered.lights {
        layers
            .iter_mut()
            .zip(layer)
            .for_each(|(sum, light)| *sum += *light);
    }
    let beauty: Vec<Vec3> = (layered.emission.iter().zip(&layered.direct))
        .zip(&layered.indirect)
        .map(|((emission, direct), indirect)| *emission + *direct + *indirect)
        .collect();
    Ok(vec![
        Measure::new(
            "lights alone against all together",
            difference(&apart, &all),
            1e-4,
            "transport is linear, and a light's noise is its own; bounces are solved to 10⁻⁵",
        ),
        Measure::new(
            "layers of lights against the picture",
            difference(&layers, &beauty),
            1e-5,
            "the picture is their sum",
        ),
    ])
}

/// All of them.
pub fn cases() -> Vec<Case> {
    let wanted = [0.0005, 0.005, 0.03];
    let virtual_wanted = [0.003, 0.03, 0.1];
    let points = PointSettings {
        vpls: 2000,
        ..PointSettings::default()
    };
    vec![
        Case::new(
            "steady/lightcuts",
            true,
            "virtual lights of a lamp that glides stand still",
            move |stage| {
                let tracer = Tracer::Lightcuts {
                    points,
                    cuts: LightcutSettings::default(),
                    reconstruction: false,
                };
                virtual_lights(stage, tracer, virtual_wanted)
            },
        ),
        Case::new(
            "steady/pixelcuts",
            true,
            "virtual lights of a lamp that glides stand still",
            move |stage| {
                let tracer = Tracer::Pixelcuts {
                    points,
                    cuts: PixelcutsSettings::default(),
                };
                virtual_lights(stage, tracer, virtual_wanted)
            },
        ),
        Case::new("steady/sums", true, "lights add up", sums),
        Case::new(
            "steady/lamp",
            true,
            "a lamp that glides lights evenly",
            move |stage| {
                let lamp = |at: f32| point(LAMP + Vec3::X * (0.3 * at), 1.0);
                flicker(stage, lamp, wanted, WANTED)
            },
        ),
        Case::new(
            "steady/globe",
            true,
            "a globe that glides lights evenly",
            move |stage| {
                let lamp = |at: f32| globe(LAMP + Vec3::X * (0.3 * at), 0.1, 30.0);
                flicker(stage, lamp, wanted, WANTED)
            },
        ),
        Case::new(
            "steady/dimmed",
            true,
            "a lamp that is dimmed evenly goes evenly",
            |stage| {
                let lamp = |at: f32| point(LAMP, 2.0 - at);
                let why = "light times k is light times k: rounding of f32";
                flicker(stage, lamp, [1e-6, 1e-5, 1e-4], why)
            },
        ),
    ]
}
