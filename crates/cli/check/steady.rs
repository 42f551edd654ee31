//! Sequences in which light or camera changes little from frame to frame: what flickers, and whether lights add up.
//!
//! Each integrator has a case, with a lamp that glides, a camera that glides past a plain wall, and a light that is dimmed. Flicker is the
//! second difference of a pixel ([`Flicker`]): a camera that sees nothing but a wall without pattern, on which light varies slowly, moves no
//! edge through any pixel, so that what differs is not the picture but how its light was found.

use super::case::{Case, Measure, Measured};
use super::materials::cut_params;
use super::shapes::{LAMP, camera, faces, globe, join, matt, panel, point, room, scene, track};
use super::stage::{SIZE, Stage, coarse, difference, quick};
use glam::{Vec2, Vec3};
use relight_bake::params::BakeParams;
use relight_play::choice::{Integrator, Tracer};
use relight_play::shot::ShotSettings;
use relight_play::{CutSites, FrameSettings, Player};
use relight_render::lightcuts::LightcutSettings;
use relight_render::many_lights::PointSettings;
use relight_render::pixelcuts::PixelcutsSettings;
use relight_scene::animated::Animated;
use relight_scene::camera::Camera;
use relight_scene::image::flicker::{Flicker, greys};
use relight_scene::light::{EnvironmentMap, LightKind, LightTrack};
use relight_scene::scene::Scene;
use relight_scene::traced::Shading;
use std::sync::Arc;

/// Frames of a sequence.
const FRAMES: u32 = 16;
/// Pixels along each side where every frame is traced anew.
const SMALL: usize = 24;

/// Median, 99th and 99.9th percentile, and where they come from. "Measured" is the worst of five seeds, 26 November 2026.
type Bounds = ([f64; 3], &'static str);

const LAMP_BOUNDS: Bounds = (
    [0.0005, 0.005, 0.03],
    "a person watches it as a film: half of all pixels within 0.05 % from frame to frame, 99 of 100 within 0.5 %, 999 of 1,000 within 3 %",
);
const VIRTUAL_BOUNDS: Bounds = (
    [0.003, 0.03, 0.1],
    "half of all pixels within 0.3 % from frame to frame, 99 of 100 within 3 %, 999 of 1,000 within 10 %: what cuts choose changes",
);
const BRUTE_BOUNDS: Bounds = (
    [1e-4, 3e-4, 5e-4],
    "exact light of a lamp on a plain wall, past which the eye goes by a hundredth of its distance in a frame: measured 0.004, 0.011, 0.012 %",
);
const WALL_BOUNDS: Bounds = (
    [1e-4, 1e-3, 4e-3],
    "as direct light there, which is exact (steady/brute), and what interpolation adds: measured 0.002, 0.013, 0.039 %",
);
const MAP_BOUNDS: Bounds = (
    [0.0005, 0.005, 0.2],
    "99 of 100 pixels as lamps; where cells of the map are partly hidden single pixels ask rays of their own: measured 0.0001, 0.27, 9.8 %",
);
const CUTS_WALL_BOUNDS: Bounds = (
    [0.002, 0.03, 0.07],
    "sites of cuts that a place interpolates between change from pixel to pixel: measured 0.11, 1.6, 3.3 %, and 0.06, 0.25, 0.32 % by \
     brute force over 100,000 directions",
);
const DIMMED_BOUNDS: Bounds = (
    [1e-6, 3e-6, 1e-5],
    "light times k is light times k: rounding of f32, measured 1.4e-7, 6.9e-7, 1.1e-6",
);

/// How a sequence is made.
struct Film<'a> {
    stage: &'a Stage,
    player: &'a Player,
    integrator: Integrator,
    size: usize,
    layer: &'static str,
    /// As `play` makes shots of a camera that moves.
    moving: bool,
}

impl<'a> Film<'a> {
    /// Indirect light of the operators, where the camera stands still.
    fn by_transfer(stage: &'a Stage, player: &'a Player) -> Film<'a> {
        Film {
            stage,
            player,
            integrator: Integrator::Transfer,
            size: SIZE,
            layer: "indirect",
            moving: false,
        }
    }

    /// Grey values of its frames; `at` goes from 0 to 1.
    fn frames(&self, at: impl Fn(f32) -> (Camera, LightTrack)) -> Result<Vec<Vec<f32>>, String> {
        let settings = ShotSettings {
            integrator: self.integrator.clone(),
            width: self.size,
            height: self.size,
            samples: Some(1),
            moving: self.moving,
            sites: Some(if self.moving {
                CutSites::Around
            } else {
                CutSites::Own
            }),
        };
        let mut before = None;
        (0..FRAMES)
            .map(|frame| {
                self.stage.at("play: frame");
                let (camera, light) = at(frame as f32 / (FRAMES - 1) as f32);
                let shot = match before.take() {
                    Some((same, shot)) if same == camera => shot,
                    _ => (self.player.shot(&camera, &settings)).map_err(|e| e.to_string())?,
                };
                let lights = self.player.lights(&[light]).map_err(|e| e.to_string())?;
                let frame = (self.player)
                    .frame(&shot, &lights, 0.0, &FrameSettings::default())
                    .map_err(|e| e.to_string())?;
                before = Some((camera, shot));
                let layer = frame.layers.rgb(self.layer);
                Ok(greys(&layer.ok_or("a layer is missing")?))
            })
            .collect()
    }

    /// Its flicker as the camera glides along a wall under one light.
    fn along_the_wall(&self, light: LightTrack, bounds: Bounds) -> Measured {
        let film = Film {
            integrator: self.integrator.clone(),
            moving: true,
            ..*self
        };
        film.flicker("camera", |at| (gliding(at), light.clone()), bounds)
    }

    /// Its flicker.
    fn flicker(&self, what: &str, at: impl Fn(f32) -> (Camera, LightTrack), bounds: Bounds) -> Measured {
        percentiles(what, self.frames(at)?, bounds)
    }
}

/// How much frames flicker.
fn percentiles(what: &str, frames: Vec<Vec<f32>>, (bounds, why): Bounds) -> Measured {
    let found = Flicker::of(frames).ok_or("no light")?;
    let measure =
        |name: &str, value: f64, bound: f64| Measure::new(format!("{what}, {name}"), value, bound, why);
    Ok(vec![
        measure("median", found.median, bounds[0]),
        measure("99th percentile", found.p99, bounds[1]),
        measure("99.9th percentile", found.p999, bounds[2]),
    ])
}

/// Where the scene is seen from.
fn standing(player: &Player) -> Result<Camera, String> {
    Ok(player.scene().cameras.first().ok_or("no camera")?.at(0.0))
}

/// A camera that glides by 0.1 m along the room's right wall and towards it, and sees nothing else.
fn gliding(at: f32) -> Camera {
    let eye = Vec3::new(0.2 + 0.07 * at, 0.2, -0.3 + 0.07 * at);
    camera(eye, eye + Vec3::X, 40.0).at(0.0)
}

/// The room's lamp on its way of 0.3 m.
fn lamp(at: f32) -> LightTrack {
    point(LAMP + Vec3::X * (0.3 * at), 1.0)
}

/// A globe on the same way.
fn ball(at: f32) -> LightTrack {
    globe(LAMP + Vec3::X * (0.3 * at), 0.1, 30.0)
}

/// The room's lamp as it is dimmed to half.
fn dimmed(at: f32) -> LightTrack {
    point(LAMP, 2.0 - at)
}

/// Indirect light by the operators.
fn transfer(stage: &Stage) -> Measured {
    let player = stage.player(room(), &quick())?;
    let eye = standing(&player)?;
    let film = Film::by_transfer(stage, &player);
    let mut measures = film.flicker("lamp", |at| (eye, lamp(at)), LAMP_BOUNDS)?;
    measures.extend(film.flicker("globe", |at| (eye, ball(at)), LAMP_BOUNDS)?);
    measures.extend(film.along_the_wall(lamp(0.0), WALL_BOUNDS)?);
    measures.extend(film.flicker("dimmed lamp", |at| (eye, dimmed(at)), DIMMED_BOUNDS)?);
    Ok(measures)
}

/// Indirect light that lamps send over lobes of most of the room's walls.
fn lobes(stage: &Stage) -> Measured {
    let mut metal = room();
    let walls = &mut metal.materials[0];
    (walls.metallic, walls.roughness) = (1.0, 0.5);
    let asset = (stage.asset(metal, Shading::Full, &quick())).map_err(|e| e.to_string())?;
    let player = stage.through_file(&asset)?;
    let eye = standing(&player)?;
    let film = Film::by_transfer(stage, &player);
    let mut measures = film.flicker("lamp", |at| (eye, lamp(at)), LAMP_BOUNDS)?;
    measures.extend(film.flicker("globe", |at| (eye, ball(at)), LAMP_BOUNDS)?);
    Ok(measures)
}

/// Indirect light by virtual lights, and how much of it there is against transfer's.
fn virtual_lights(stage: &Stage, tracer: Tracer) -> Measured {
    let player = stage.player(room(), &quick())?;
    let eye = standing(&player)?;
    let film_by = |integrator: Integrator| Film {
        stage,
        player: &player,
        integrator,
        size: SMALL,
        layer: "indirect",
        moving: false,
    };
    let film = film_by(tracer.into());
    let moved = film.frames(|at| (eye, lamp(at)))?;
    let truth = film_by(Integrator::Transfer).frames(|at| (eye, lamp(at)))?;
    let mean = |frames: &[Vec<f32>]| frames.iter().flatten().map(|&v| f64::from(v)).sum::<f64>();
    let off = (mean(&moved) / mean(&truth) - 1.0).abs();
    let mut measures = percentiles("lamp", moved, VIRTUAL_BOUNDS)?;
    measures.extend(film.along_the_wall(lamp(0.0), VIRTUAL_BOUNDS)?);
    measures.extend(film.flicker("dimmed lamp", |at| (eye, dimmed(at)), DIMMED_BOUNDS)?);
    measures.push(Measure::new(
        "mean indirect light against transfer's",
        off,
        0.1,
        "rectangles lose what of them reaches through walls; cuts err by 2 % of a pixel each, on the dark side",
    ));
    Ok(measures)
}

/// Direct light by visibility cuts.
fn visibility_cuts(stage: &Stage) -> Measured {
    let params = BakeParams {
        cuts: Some(cut_params()),
        ..quick()
    };
    let player = stage.player(yard(), &params)?;
    let eye = standing(&player)?;
    let film = Film {
        stage,
        player: &player,
        integrator: Integrator::Auto,
        size: SIZE,
        layer: "direct",
        moving: false,
    };
    let map = Arc::new(evening());
    let sky = |strength: f32, degrees: f32| {
        let kind = LightKind::Environment {
            maps: map.clone().into(),
            file: String::new().into(),
            scale: Animated::Constant(Vec3::splat(strength)),
            rotation_deg: Animated::Constant(degrees),
        };
        track("sky", kind)
    };
    let mut measures = film.flicker("turned map", |at| (eye, sky(1.0, 15.0 * at)), MAP_BOUNDS)?;
    measures.extend(film.along_the_wall(sky(1.0, 0.0), CUTS_WALL_BOUNDS)?);
    measures.extend(film.flicker("dimmed map", |at| (eye, sky(2.0 - at, 0.0)), DIMMED_BOUNDS)?);
    Ok(measures)
}

/// What is traced anew in every frame: `layer`, with one seed for all frames.
fn traced(stage: &Stage, tracer: Tracer, layer: &'static str) -> Measured {
    let player = stage.player(room(), &coarse())?;
    let eye = standing(&player)?;
    let film = Film {
        stage,
        player: &player,
        integrator: tracer.clone().into(),
        size: SMALL,
        layer,
        moving: false,
    };
    let mut measures = film.flicker("dimmed lamp", |at| (eye, dimmed(at)), DIMMED_BOUNDS)?;
    // Paths that land elsewhere are other noise.
    if tracer == Tracer::Brute {
        measures.extend(film.along_the_wall(lamp(0.0), BRUTE_BOUNDS)?);
    }
    Ok(measures)
}

/// The room without its ceiling and its block.
fn yard() -> Scene {
    let [left, right, floor, _, back, front] = faces(Vec3::NEG_ONE, Vec3::ONE, true);
    let mut walls = floor;
    [&left, &right, &back, &front]
        .into_iter()
        .for_each(|face| join(&mut walls, face));
    scene(
        vec![(walls, matt(Vec3::splat(0.5)))],
        Vec3::new(0.5, 0.8, 0.9),
        Vec3::new(-0.2, -0.3, -0.4),
    )
}

/// A sky that is bright around one place, some 30° wide, and dim elsewhere.
fn evening() -> EnvironmentMap {
    let (width, height) = (128, 64);
    let sun = Vec3::new(0.6, 0.5, 0.62).normalize();
    let pixels = (0..width * height).map(|k| {
        let (azimuth, polar) = (
            std::f32::consts::TAU * ((k % width) as f32 + 0.5) / width as f32,
            std::f32::consts::PI * ((k / width) as f32 + 0.5) / height as f32,
        );
        let direction = Vec3::new(
            polar.sin() * azimuth.sin(),
            polar.cos(),
            polar.sin() * azimuth.cos(),
        );
        Vec3::splat(0.2 + 5.0 * direction.dot(sun).max(0.0).powi(32))
    });
    EnvironmentMap {
        width,
        height,
        pixels: pixels.collect(),
    }
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
    let points = PointSettings {
        vpls: 2000,
        ..PointSettings::default()
    };
    let lightcuts = Tracer::Lightcuts {
        points,
        cuts: LightcutSettings::default(),
        reconstruction: false,
    };
    let pixelcuts = Tracer::Pixelcuts {
        points,
        cuts: PixelcutsSettings::default(),
    };
    let by_virtual_lights = |name: &str, tracer: Tracer| {
        let says = "virtual lights stand still where a lamp or the camera glides";
        Case::new(name, true, says, move |stage| {
            virtual_lights(stage, tracer.clone())
        })
    };
    let by_tracing = |name: &str, tracer: Tracer, layer: &'static str| {
        let says = "what is traced anew in every frame is dimmed evenly";
        Case::new(name, true, says, move |stage| {
            traced(stage, tracer.clone(), layer)
        })
    };
    vec![
        Case::new(
            "steady/transfer",
            true,
            "indirect light goes evenly where a lamp or the camera glides",
            transfer,
        ),
        Case::new(
            "steady/lobes",
            true,
            "what lamps send over glossy surfaces goes evenly where they glide",
            lobes,
        ),
        by_virtual_lights("steady/lightcuts", lightcuts),
        by_virtual_lights("steady/pixelcuts", pixelcuts),
        Case::new(
            "steady/cuts",
            true,
            "light of visibility cuts goes evenly under a map that turns",
            visibility_cuts,
        ),
        by_tracing("steady/path", Tracer::default(), "beauty"),
        by_tracing("steady/brute", Tracer::Brute, "direct"),
        Case::new("steady/sums", true, "lights add up", sums),
    ]
}
