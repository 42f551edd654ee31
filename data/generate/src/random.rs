//! Scenes that nobody tuned anything to: interiors and yards with what real files have, decided by a seed.
//!
//! `plan` decides what a scene holds and where it stands in its coordinates, `words` says it; `shell`, `things` and `lamps`
//! build on a `site`, which knows what is free. Same seed, same bytes, on any machine.

mod dice;
mod lamps;
mod plan;
mod shapes;
mod shell;
mod site;
mod things;
mod words;

use crate::glb::{Glb, Placement};
use crate::sequence::sequence;
use dice::Dice;
use glam::{DQuat, DVec3, dvec2, dvec3};
use lamps::{Punctual, PunctualKind};
use plan::{Frame, Plan, Sky};
use serde_json::{Value, json};
use site::Site;

/// A scene of a seed.
pub struct RandomScene {
    /// What it holds, in one line.
    pub says: String,
    /// The scene.
    pub glb: Glb,
    /// A sequence of one frame with all its lights, and, where the file has none, a camera.
    pub sequence: Vec<u8>,
    /// Whether a sky shines, which the file alone doesn't have: only the sequence has all lights.
    pub has_sky: bool,
}

/// Vertical field of view, degrees.
const VFOV: f64 = 60.0;
/// Width over height.
const ASPECT: f64 = 4.0 / 3.0;
/// Scale of sun and sky: the sun is then as bright as the sun of a file.
const SKY_SCALE: f64 = 0.012;

/// The scene of a seed.
pub fn random(seed: u64) -> RandomScene {
    let plan = Plan::new(seed);
    let mut site = Site::new(&plan);
    if !plan.yard {
        shell::room(&mut site, &plan, seed);
    }
    shell::far(&mut site, &plan, seed);
    // Cameras come first, so that nothing stands where they look from.
    let views = views(&mut site, &plan, seed);
    if plan.yard {
        shell::houses(&mut site, &plan, seed);
    } else {
        things::furniture(&mut site, &plan, seed);
    }
    things::columns(&mut site, &plan, seed);
    things::curtains(&mut site, &plan, seed);
    things::plants(&mut site, &plan, seed);
    things::clutter(&mut site, &plan, seed);
    finished(site, &plan, &views, seed)
}

/// Eye and target, metres.
type View = (DVec3, DVec3);

/// Where cameras stand, in free places, and what they look at; the first is the one to play.
fn views(site: &mut Site, plan: &Plan, seed: u64) -> Vec<View> {
    let mut dice = Dice::new(seed, "cameras");
    let mut views = vec![];
    for _ in 0..plan.cameras.max(1) {
        let clear = if plan.yard { 1.5 } else { 0.4 };
        let at = site.free(&mut dice, clear).unwrap_or_default();
        // Across the middle, so that most of the place is seen.
        let across = dvec2(-at.x, -at.z) * dice.between(0.2, 0.9);
        let aside = 0.3 * plan.half * dvec3(dice.between(-1.0, 1.0), 0.0, dice.between(-1.0, 1.0));
        let eye = at + DVec3::Y * dice.between(1.1, 1.75);
        let mut target = dvec3(across.x, dice.between(0.5, 1.4), across.y) + aside;
        if (target - eye).length() < 0.5 {
            target = eye + DVec3::X;
        }
        views.push((eye, target));
    }
    views
}

fn finished(mut site: Site, plan: &Plan, views: &[View], seed: u64) -> RandomScene {
    let mut dice = Dice::new(seed, "sun");
    let (side, height) = (dice.direction(), dice.between(0.25, 0.9));
    let sun = dvec3(side.x, height, side.z).normalize();
    let lights = lamps::lamps(&mut site, plan, sun, seed);
    let Site { mut glb, factor, .. } = site;
    for (k, (eye, target)) in views.iter().take(plan.cameras).enumerate() {
        let name = format!("Camera {}", k + 1);
        glb.add_camera(&name, *eye * factor, *target * factor, VFOV, ASPECT);
    }
    let frame = &plan.frame;
    let root = Placement {
        translation: frame.offset * frame.unit(),
        rotation: turn(frame),
        scale: DVec3::splat(frame.root),
    };
    if frame.root != 1.0 || frame.yaw != 0.0 || frame.offset != DVec3::ZERO {
        glb.put_under("Root", root);
    }
    RandomScene {
        says: words::phrases(plan).join(", "),
        sequence: lit(plan, views, &lights, sun),
        has_sky: plan.sky == Sky::Day,
        glb,
    }
}

fn turn(frame: &Frame) -> DQuat {
    DQuat::from_rotation_y(frame.yaw.to_radians())
}

/// All lights, and a camera where the file has none, in the file's coordinates.
fn lit(plan: &Plan, views: &[View], punctual: &[Punctual], sun: DVec3) -> Vec<u8> {
    let frame = &plan.frame;
    let unit = frame.unit();
    // No finer than a hundred-thousandth of a metre, so that no machine's sine is seen.
    let place = |p: DVec3| -> Value {
        let world = (frame.offset + turn(frame) * p) * 1e5;
        json!(world.to_array().map(|x| x.round() * 1e-5 * unit))
    };
    let direction =
        |d: DVec3| -> Value { json!((turn(frame) * d).to_array().map(|x| (x * 1e6).round() * 1e-6)) };
    let grey = |x: f64| json!([x, x, x]);
    let mut lights: Vec<Value> = (punctual.iter())
        .map(|light| {
            let name = &light.name;
            match light.kind {
                PunctualKind::Point(i) => json!({ "name": name, "type": "point",
                    "position": place(light.position), "intensity": grey(i * unit * unit) }),
                PunctualKind::Spot(i, inner, outer) => json!({ "name": name, "type": "spot",
                    "position": place(light.position), "direction": direction(light.direction),
                    "inner_angle_deg": inner, "outer_angle_deg": outer, "intensity": grey(i * unit * unit) }),
                PunctualKind::Sun(e) => json!({ "name": name, "type": "directional",
                    "direction": direction(light.direction), "irradiance": grey(e) }),
            }
        })
        .collect();
    if plan.sky == Sky::Day {
        lights.push(
            json!({ "name": "day", "type": "sun_sky", "sun_direction": direction(sun),
            "turbidity": 3, "scale": SKY_SCALE }),
        );
    }
    lights.push(json!({ "name": "lamps", "type": "emissive" }));
    let (eye, target) = views[0];
    let camera = (plan.cameras == 0).then(|| {
        json!({ "position": place(eye), "look_at": place(target), "up": [0, 1, 0], "vfov_deg": VFOV,
            "aspect": ASPECT })
    });
    sequence(1, camera, &lights)
}
