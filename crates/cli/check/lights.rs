//! Lights that are many, one, none, in contact with surfaces, or a thousand million times as strong as each other.

use super::case::{Case, Measure, Measured};
use super::sanity::sane;
use super::shapes::{LAMP, cuboid, faces, globe, join, matt, panel, point, room, scene, sky, sun, track};
use super::stage::{AtPoints, SIZE, Stage, at_points, coarse, difference, mean_by};
use glam::{DVec3, Vec2, Vec3};
use relight_bake::params::BakeParams;
use relight_play::{FrameSettings, Player};
use relight_scene::animated::Animated;
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::scene::Scene;

/// Light that walls absorb over light that falls on them at first, less 1: nothing goes and nothing comes.
pub fn balance(player: &Player, light: &AtPoints) -> f64 {
    let Some(transfer) = &player.prepared.transfer else {
        return f64::NAN;
    };
    let (mut absorbed, mut sent) = (DVec3::ZERO, DVec3::ZERO);
    let places = light.direct.iter().zip(&light.indirect).zip(&light.areas);
    for (((direct, indirect), area), albedo) in places.zip(&transfer.albedo) {
        let [direct, indirect, albedo] = [direct, indirect, albedo].map(|v| v.as_dvec3());
        absorbed += (1.0 - albedo) * (direct + indirect) * *area;
        sent += direct * *area;
    }
    (absorbed / sent - 1.0).abs().max_element()
}

/// Light on the walls of the room, over what lamps of 4π W/sr in all send into it.
fn received(light: &AtPoints, flux: f64, area: f64) -> f64 {
    light.mean_direct().x * area / flux
}

const BALANCE: &str =
    "what closed walls absorb is what falls on them: 2 % of light that does not come evenly";

fn energy(stage: &Stage) -> Measured {
    let player = stage.player(room(), &super::stage::quick())?;
    let light = at_points(stage, &player, &[point(LAMP, 1.0)])?;
    Ok(vec![Measure::new(
        "energy balance",
        balance(&player, &light),
        0.02,
        BALANCE,
    )])
}

/// Each light where it touches something, in a room of walls 24 m² and block.
fn contact(stage: &Stage) -> Measured {
    let player = stage.player(room(), &coarse())?;
    let shot = stage.shot(&player, SIZE)?;
    let transfer = player.prepared.transfer.as_ref().ok_or("no points")?;
    let middle = transfer.finest.len() / 2;
    let (at, normal) = (transfer.finest.positions[middle], transfer.finest.normals[middle]);
    let spacing = transfer.finest.disk_radius;
    let flux = 4.0 * std::f64::consts::PI;
    // Faces of the room, and the block's five.
    let area = 24.0 + 2.0 * (1.1 * 0.7 + 1.1 * 0.7);
    let lights: Vec<(&str, LightTrack)> = vec![
        ("point light in the floor", point(Vec3::new(0.4, -1.0, 0.4), 1.0)),
        (
            "point light a millionth above the floor",
            point(Vec3::new(0.4, -1.0 + 1e-6, 0.4), 1.0),
        ),
        ("point light in an edge", point(Vec3::new(1.0, -1.0, 0.3), 1.0)),
        ("point light in a corner", point(Vec3::ONE, 1.0)),
        ("point light at a point of the basis", point(at, 1.0)),
        (
            "point light a hundredth above a point of the basis",
            point(at + normal * (0.01 * spacing), 1.0),
        ),
        (
            "point light a tenth above a point of the basis",
            point(at + normal * (0.1 * spacing), 1.0),
        ),
        (
            "point light within the block",
            point(Vec3::new(-0.2, -0.5, -0.1), 1.0),
        ),
        ("panel in the ceiling", panel(Vec3::Y, Vec2::splat(0.5), 1.0)),
        ("panel in the floor", panel(Vec3::NEG_Y, Vec2::splat(0.5), 1.0)),
        ("panel of no area", panel(Vec3::ZERO, Vec2::ZERO, 1.0)),
        ("panel as wide as the room", panel(Vec3::Y, Vec2::splat(2.0), 1.0)),
        (
            "sphere half in the floor",
            globe(Vec3::new(0.4, -1.0, 0.4), 0.1, 1.0),
        ),
        ("sphere of no radius", globe(Vec3::ZERO, 0.0, 1.0)),
        ("sphere around the room", globe(Vec3::ZERO, 10.0, 1.0)),
    ];
    let mut measures = Vec::new();
    for (name, light) in lights {
        let is_point = matches!(light.kind, LightKind::Point { .. });
        let tracks = [light];
        let lit = stage.lit(&player, &shot, &tracks)?;
        let named = |m: Measure| Measure {
            what: format!("{name}: {}", m.what),
            ..m
        };
        measures.extend(sane(&lit).into_iter().map(named));
        if is_point {
            let light = at_points(stage, &player, &tracks)?;
            measures.push(Measure::new(
                format!("{name}: light on the walls over light sent"),
                received(&light, flux, area),
                1.5,
                "no lamp gives more than it has; half as much again for the noise of points near it",
            ));
        }
    }
    Ok(measures)
}

/// Two rooms with a wall of 2 cm between them, closed or with a door; half of it is lit.
fn two_rooms() -> Scene {
    let wall = 0.01;
    let mut rooms = cuboid(Vec3::new(-2.0, -1.0, -1.0), Vec3::new(-wall, 1.0, 1.0), true);
    join(
        &mut rooms,
        &cuboid(Vec3::new(wall, -1.0, -1.0), Vec3::new(2.0, 1.0, 1.0), true),
    );
    let mut scene = scene(
        vec![(rooms, matt(Vec3::splat(0.6)))],
        Vec3::new(1.7, 0.5, 0.8),
        Vec3::new(0.2, -0.5, -0.5),
    );
    scene.cameras.push(super::shapes::camera(
        Vec3::new(-1.7, 0.5, 0.8),
        Vec3::new(-0.2, -0.5, -0.5),
        70.0,
    ));
    scene
}

/// A lamp of a thousand million beside a closed room with a lamp of one.
fn contrast(stage: &Stage) -> Measured {
    let player = stage.player(two_rooms(), &super::stage::quick())?;
    let bright = LightTrack {
        name: "bright".into(),
        ..point(Vec3::new(-1.0, 0.3, 0.0), 1e9)
    };
    let faint = LightTrack {
        name: "faint".into(),
        ..point(Vec3::new(1.0, 0.3, 0.0), 1.0)
    };
    let transfer = player.prepared.transfer.as_ref().ok_or("no points")?;
    let near: Vec<bool> = transfer.finest.positions.iter().map(|p| p.x > 0.0).collect();
    let there =
        |light: &[Vec3]| -> Vec<Vec3> { light.iter().zip(&near).filter(|e| *e.1).map(|e| *e.0).collect() };
    let alone = at_points(stage, &player, std::slice::from_ref(&faint))?;
    let beside = at_points(stage, &player, &[bright.clone(), faint.clone()])?;
    let dark = at_points(stage, &player, std::slice::from_ref(&bright))?;
    let of_side = |side: bool| {
        let places = dark.indirect.iter().zip(&dark.areas).zip(&near);
        mean_by(places.filter(|place| *place.1 == side).map(|place| place.0))
    };
    let shot = stage.shot(&player, SIZE)?;
    let mut measures = sane(&stage.lit(&player, &shot, &[bright, faint])?);
    measures.extend([
        Measure::new(
            "direct light of the faint lamp beside the bright one",
            difference(&there(&beside.direct), &there(&alone.direct)),
            0.0,
            "walls are opaque",
        ),
        Measure::new(
            "indirect light of the bright lamp behind the wall",
            of_side(true).abs().max_element() / of_side(false).x,
            1e-4,
            "share of the lit room's; nothing is interpolated through a wall",
        ),
    ]);
    Ok(measures)
}

/// Sun, a thousand million times the night sky, on an open box.
fn sun_and_night(stage: &Stage) -> Measured {
    let [left, right, floor, _, back, front] = faces(Vec3::NEG_ONE, Vec3::ONE, true);
    let mut walls = floor;
    [&left, &right, &back, &front]
        .into_iter()
        .for_each(|face| join(&mut walls, face));
    let scene = scene(
        vec![(walls, matt(Vec3::splat(0.5)))],
        Vec3::new(0.5, 0.8, 0.9),
        Vec3::new(-0.2, -0.3, -0.4),
    );
    let player = stage.player(scene, &coarse())?;
    let shot = stage.shot(&player, SIZE)?;
    let (day, night) = (sun(Vec3::new(-0.3, -1.0, 0.1), 1e9), sky(1.0));
    let mut measures = Vec::new();
    let apart = [&day, &night].map(|light| stage.lit(&player, &shot, std::slice::from_ref(light)));
    let [by_sun, by_night] = apart;
    let (by_sun, by_night) = (by_sun?, by_night?);
    let settings = FrameSettings {
        light_layers: true,
        ..FrameSettings::default()
    };
    let both = stage.lit_with(&player, &shot, &[night, day], &settings)?;
    measures.extend(sane(&both));
    measures.extend(sane(&by_night).into_iter().map(|m| Measure {
        what: format!("night alone: {}", m.what),
        ..m
    }));
    let sum: Vec<Vec3> = by_sun
        .indirect
        .iter()
        .zip(&by_night.indirect)
        .map(|(a, b)| *a + *b)
        .collect();
    measures.push(Measure::new(
        "both lights against their sum",
        difference(&both.indirect, &sum),
        1e-4,
        "linear up to where the bounces stop: 10⁻⁵ of the sum, and rounding",
    ));
    let night: Vec<Vec3> = (by_night.emission.iter().zip(&by_night.direct))
        .zip(&by_night.indirect)
        .map(|((e, d), i)| *e + *d + *i)
        .collect();
    let layer = both.lights.first().map(|l| l.1.as_slice()).unwrap_or_default();
    measures.push(Measure::new(
        "the night's layer beside the sun against the night alone",
        difference(layer, &night),
        0.0,
        "layers are made light by light: the same sums",
    ));
    Ok(measures)
}

/// So many point lights of the same strength in all.
fn many(stage: &Stage, count: usize, params: &BakeParams, size: usize) -> Measured {
    let player = stage.player(room(), params)?;
    let shot = stage.shot(&player, size)?;
    // At the middles of the points for both: so many lights go through lightcuts, which know of nothing else.
    let settings = FrameSettings {
        coarse: true,
        ..FrameSettings::default()
    };
    let one = stage.lit_with(&player, &shot, &[point(LAMP, 1.0)], &settings)?;
    let tracks: Vec<LightTrack> = (0..count)
        .map(|i| LightTrack {
            name: format!("light {i}"),
            ..point(LAMP, 1.0 / count as f32)
        })
        .collect();
    let all = stage.lit_with(&player, &shot, &tracks, &settings)?;
    let mut measures = sane(&all);
    measures.push(Measure::new(
        "direct light against one light",
        difference(&all.direct, &one.direct),
        1e-6,
        "sums of f32 shares in f64: a few roundings of f32, however many lights",
    ));
    measures.push(Measure::new(
        "indirect light against one light",
        difference(&all.indirect, &one.indirect),
        1e-5,
        "the same sums, then the same chain of operators",
    ));
    Ok(measures)
}

/// One light that shines through a thousand that do not, and no light at all.
fn few(stage: &Stage) -> Measured {
    let player = stage.player(room(), &coarse())?;
    let shot = stage.shot(&player, SIZE)?;
    let lamp = point(LAMP, 1.0);
    let one = stage.lit(&player, &shot, std::slice::from_ref(&lamp))?;
    let mut tracks: Vec<LightTrack> = (0..1000)
        .map(|i| LightTrack {
            name: format!("dark {i}"),
            ..point(Vec3::new(i as f32 * 1e-3, 0.0, 0.0), 0.0)
        })
        .collect();
    tracks.push(lamp);
    let among_dark = stage.lit(&player, &shot, &tracks)?;
    let none = stage.lit(&player, &shot, &[])?;
    let outside = stage.lit(&player, &shot, &[point(Vec3::splat(9.0), 1e6)])?;
    let lit = |lit: &relight_play::frame::light::Lit| {
        (lit.direct.iter().chain(&lit.indirect).chain(&lit.emission))
            .filter(|v| **v != Vec3::ZERO)
            .count()
    };
    let black = spot_that_faces_away();
    let away = stage.lit(&player, &shot, &[black])?;
    Ok(vec![
        Measure::new(
            "one light among a thousand dark ones",
            difference(&among_dark.direct, &one.direct) + difference(&among_dark.indirect, &one.indirect),
            0.0,
            "zero adds nothing",
        ),
        Measure::none("lit pixels without a light", lit(&none), "no light, no light"),
        Measure::none(
            "lit pixels under a lamp outside",
            lit(&outside),
            "the room is closed",
        ),
        Measure::none(
            "lit pixels under a lamp without a cone",
            lit(&away),
            "nothing leaves it",
        ),
    ])
}

/// A spot whose cone has no width.
fn spot_that_faces_away() -> LightTrack {
    let kind = LightKind::Spot {
        position: Animated::Constant(LAMP),
        direction: Animated::Constant(Vec3::Y),
        inner_angle_deg: Animated::Constant(0.0),
        outer_angle_deg: Animated::Constant(0.0),
        intensity: Animated::Constant(Vec3::ONE),
    };
    track("spot", kind)
}

/// All of them.
pub fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "lights/energy",
            true,
            "a closed room absorbs the light that falls on it",
            energy,
        ),
        Case::new(
            "lights/contact",
            true,
            "lights in, on and around surfaces",
            contact,
        ),
        Case::new(
            "lights/contrast",
            false,
            "two closed rooms, one 10⁹ times as bright as the other",
            contrast,
        ),
        Case::new(
            "lights/sun-and-night",
            true,
            "sun against a night sky of 10⁻⁹",
            sun_and_night,
        ),
        Case::new("lights/few", true, "one light and none", few),
        Case::new(
            "lights/thousand",
            true,
            "a thousand lights at one place are one light",
            |stage| many(stage, 1000, &coarse(), 24),
        ),
        Case::new(
            "lights/million",
            false,
            "a million lights at one place are one light",
            |stage| {
                let params = BakeParams {
                    levels: 2,
                    sender_levels: 2,
                    coarse_radius: Some(0.6),
                    ..coarse()
                };
                many(stage, 1_000_000, &params, 8)
            },
        ),
    ]
}
