//! What shines: emissive spheres, tubes, screens and panels; point lights and spots of the file; the sun.
//!
//! Each kind of lamp has about as much power a square metre of floor, so that none drowns the others.

use super::dice::{Dice, rounded};
use super::plan::{Lamp, Plan, Sky};
use super::shapes::{boxes, cylinder, lying, sphere};
use super::site::Site;
use crate::glb::{Material, Placement, TextureRef, matt};
use crate::mesh::{Mesh, moved, quad};
use crate::texture::{color, hash01};
use glam::{DVec3, dvec3};
use serde_json::json;
use std::f64::consts::PI;

/// A light without extent, in the place's own metres.
pub struct Punctual {
    /// Unique in its scene.
    pub name: String,
    /// Metres; nothing to a sun.
    pub position: DVec3,
    /// Unit vector along which it shines.
    pub direction: DVec3,
    /// Kind and strength.
    pub kind: PunctualKind,
}

/// Kind and strength: cd of a scene in metres, or lx; taken as W/sr and W/m².
pub enum PunctualKind {
    /// Radiant intensity.
    Point(f64),
    /// Radiant intensity on the axis; inner and outer angle, degrees.
    Spot(f64, f64, f64),
    /// Irradiance.
    Sun(f64),
}

/// Power of one kind of lamps for each square metre of floor, W.
const POWER: [f64; 2] = [2.0, 6.0];
/// Irradiance of the sun: some times what lamps make.
const SUN: f64 = 12.0;

/// Adds the lamps; what has no extent is returned, too, for the sequence.
pub fn lamps(site: &mut Site, plan: &Plan, sun: DVec3, seed: u64) -> Vec<Punctual> {
    let mut dice = Dice::new(seed, "lamp places");
    let floor = 4.0 * plan.half.x * plan.half.z;
    let mut without_extent = vec![];
    for lamp in &plan.lamps {
        let power = dice.between(POWER[0], POWER[1]) * if plan.yard { 60.0 } else { floor };
        match *lamp {
            Lamp::Bulbs(n) => bulbs(site, plan, &mut dice, n, power),
            Lamp::Tubes(n) => tubes(site, plan, &mut dice, n, power),
            Lamp::Screens(n) => screens(site, plan, &mut dice, n, power),
            Lamp::Panels(n) => panels(site, plan, &mut dice, n, power),
            Lamp::Points(n) => {
                for k in 0..n {
                    without_extent.push(Punctual {
                        name: format!("Point {k}"),
                        position: hung(plan, &mut dice, 0.3),
                        direction: DVec3::NEG_Y,
                        kind: PunctualKind::Point(rounded(power / n as f64 / (4.0 * PI))),
                    });
                }
            }
            Lamp::Spots(n) => {
                for k in 0..n {
                    let outer = dice.between(20.0, 60.0).round();
                    let aside = dice.direction() * 0.4;
                    without_extent.push(Punctual {
                        name: format!("Spot {k}"),
                        position: hung(plan, &mut dice, 0.1),
                        direction: (DVec3::NEG_Y + aside).normalize(),
                        kind: PunctualKind::Spot(
                            rounded(power / n as f64 / PI),
                            (0.6 * outer).round(),
                            outer,
                        ),
                    });
                }
            }
        }
    }
    if plan.sky == Sky::Sun {
        without_extent.push(Punctual {
            name: "Sun".into(),
            position: DVec3::ZERO,
            direction: -sun,
            kind: PunctualKind::Sun(SUN),
        });
    }
    for light in &without_extent {
        add(site, light);
    }
    without_extent
}

fn add(site: &mut Site, light: &Punctual) {
    // Candelas of a world whose unit is no metre.
    let candela = |intensity: f64| intensity * site.unit * site.unit;
    let mut value = match light.kind {
        PunctualKind::Point(intensity) => json!({ "type": "point", "intensity": candela(intensity) }),
        PunctualKind::Spot(intensity, inner, outer) => {
            let spot = json!({
                "innerConeAngle": inner.to_radians(),
                "outerConeAngle": outer.to_radians()
            });
            json!({ "type": "spot", "intensity": candela(intensity), "spot": spot })
        }
        PunctualKind::Sun(irradiance) => json!({ "type": "directional", "intensity": irradiance }),
    };
    value["name"] = json!(light.name);
    let position = light.position * site.factor;
    site.glb.add_light(&light.name, value, position, light.direction);
}

/// A place under the ceiling; in a yard between a lamp post's height and the eaves.
fn hung(plan: &Plan, dice: &mut Dice, below: f64) -> DVec3 {
    let spread = if plan.yard { 0.7 } else { 0.85 };
    let top = if plan.yard { 3.0 } else { plan.half.y };
    dvec3(
        dice.between(-spread, spread) * plan.half.x,
        top - below - dice.between(0.0, 0.3),
        dice.between(-spread, spread) * plan.half.z,
    )
}

/// A material that emits so much power from so much surface, W and m².
fn shining(site: &mut Site, name: &'static str, power: f64, area: f64) -> usize {
    let radiance = power / (PI * area);
    site.glb.add_material(&Material {
        emission: [1.0, 0.9, 0.75].map(|tint| rounded(tint * radiance)),
        ..matt(name, [0.5; 3])
    })
}

fn bulbs(site: &mut Site, plan: &Plan, dice: &mut Dice, n: usize, power: f64) {
    let radius = dice.between(0.02, 0.08);
    let area = n as f64 * 4.0 * PI * radius * radius;
    let material = shining(site, "Bulb", power, area);
    let mesh = site.mesh("Bulb", &sphere(radius, 12), material);
    let below = 0.12;
    for _ in 0..n {
        let at = hung(plan, dice, below);
        site.show("Bulb", mesh, Placement::at(at.x, at.y, at.z));
    }
}

fn tubes(site: &mut Site, plan: &Plan, dice: &mut Dice, n: usize, power: f64) {
    let (radius, length) = (dice.between(0.008, 0.02), dice.between(0.6, 1.5));
    let area = n as f64 * 2.0 * PI * radius * length;
    let material = shining(site, "Tube", power, area);
    let tube = moved(lying(cylinder(radius, length, 10)), DVec3::NEG_X * 0.5 * length);
    let mesh = site.mesh("Tube", &tube, material);
    for _ in 0..n {
        let at = hung(plan, dice, 0.05);
        let at = at.clamp(
            dvec3(0.8 - plan.half.x, 0.0, 0.8 - plan.half.z),
            dvec3(plan.half.x - 0.8, at.y, plan.half.z - 0.8),
        );
        let place = Placement::at(at.x, at.y, at.z);
        site.show("Tube", mesh, place.turned(90.0 * dice.count(1, 2) as f64));
    }
}

fn screens(site: &mut Site, plan: &Plan, dice: &mut Dice, n: usize, power: f64) {
    let (w, h) = (0.8, 0.45);
    let texture = site.glb.add_texture("Picture", &color(64, 36, picture));
    // The mean of the picture: its bright patches alone count.
    let lit: f64 = (0..64 * 36)
        .map(|k| picture((f64::from(k % 64) + 0.5) / 64.0, (f64::from(k / 64) + 0.5) / 36.0).x)
        .map(|tone| tone.powf(2.2))
        .sum::<f64>()
        / (64.0 * 36.0);
    let radiance = rounded(power / n as f64 / (PI * w * h * lit));
    let material = site.glb.add_material(&Material {
        emission: [radiance; 3],
        emissive_texture: Some(TextureRef::new(texture)),
        ..matt("Screen", [0.04; 3])
    });
    let case = site.matt("Case", dice);
    let picture = with_picture(quad(
        dvec3(-0.5 * w, 0.0, 0.0),
        dvec3(0.5 * w, 0.0, 0.0),
        dvec3(0.5 * w, h, 0.0),
        dvec3(-0.5 * w, h, 0.0),
    ));
    let back = boxes(&[([-0.5 * w, 0.0, -0.06], [0.5 * w, h, -0.01])]);
    let (picture, back) = (
        site.mesh("Screen", &picture, material),
        site.mesh("Case", &back, case),
    );
    for k in 0..n {
        // On walls that face each other, at eye height; in a yard on stands of nothing.
        let side = if k % 2 == 0 { -1.0 } else { 1.0 };
        let x = dice.between(-0.6, 0.6) * plan.half.x;
        let z = side * (plan.half.z * if plan.yard { 0.6 } else { 1.0 } - 0.08);
        let place = Placement::at(x, dice.between(0.7, 1.5), z);
        let place = place.turned(if side < 0.0 { 0.0 } else { 180.0 });
        site.show("Screen", picture, place);
        site.show("Case", back, place);
    }
}

/// Texture coordinates over the whole picture.
fn with_picture(mut mesh: Mesh) -> Mesh {
    let corners = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    mesh.uvs = corners.map(glam::DVec2::from).to_vec();
    mesh
}

/// Mostly dark, with few bright patches.
fn picture(u: f64, v: f64) -> DVec3 {
    let (x, y) = ((u * 8.0).floor() as i64, (v * 4.0).floor() as i64);
    DVec3::splat(if hash01(x, y, 3) > 0.85 { 1.0 } else { 0.04 })
}

fn panels(site: &mut Site, plan: &Plan, dice: &mut Dice, n: usize, power: f64) {
    let edge = dice.between(0.2, 0.9);
    let material = shining(site, "Panel", power, n as f64 * edge * edge);
    let half = 0.5 * edge;
    let panel = quad(
        dvec3(-half, 0.0, -half),
        dvec3(half, 0.0, -half),
        dvec3(half, 0.0, half),
        dvec3(-half, 0.0, half),
    );
    let mesh = site.mesh("Panel", &panel, material);
    for _ in 0..n {
        let mut at = hung(plan, dice, 0.0);
        if !plan.yard {
            at.y = plan.half.y - 0.015;
        }
        site.show("Panel", mesh, Placement::at(at.x, at.y, at.z));
    }
}
