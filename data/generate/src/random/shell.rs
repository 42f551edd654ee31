//! Walls: of a room with windows, of a partition, of the houses in a yard; and what is far around them.

use super::dice::Dice;
use super::plan::{Far, Plan, Sky, Walls};
use super::shapes::{Hole, Plane, sphere};
use super::site::Site;
use crate::glb::{Material, matt};
use crate::mesh::{Mesh, cuboid, flipped, join, quad};
use glam::{DVec2, DVec3, dvec2, dvec3};

/// Where the ground lies below the floor.
const STEP: f64 = 0.08;
/// Radiance of an emissive dome: about the irradiance that lamps make.
const GLOW: f64 = 1.0;

/// The room's six sides, seen from inside: floor, ceiling, four walls.
fn sides(half: DVec3) -> [Plane; 6] {
    let (w, h, d) = (half.x, half.y, half.z);
    let side = |corner: [f64; 3], u: DVec3, v: DVec3| Plane {
        corner: DVec3::from(corner),
        u,
        v,
    };
    let (x, y, z) = (DVec3::X * 2.0 * w, DVec3::Y * h, DVec3::Z * 2.0 * d);
    [
        side([-w, 0.0, -d], z, x),
        side([-w, h, -d], x, z),
        side([-w, 0.0, -d], x, y),
        side([w, 0.0, d], -x, y),
        side([-w, 0.0, d], -z, y),
        side([w, 0.0, -d], z, y),
    ]
}

/// A window somewhere in a wall.
fn window(wall: &Plane, dice: &mut Dice) -> Hole {
    let (length, height) = (wall.u.length(), wall.v.length());
    let width = dice.between(0.5, 1.6).min(0.6 * length);
    let left = dice.between(0.15, length - width - 0.15).max(0.1);
    let sill = dice.between(0.1, 1.1);
    let top = dice.between(sill + 0.7, height - 0.15).max(sill + 0.6);
    [dvec2(left, sill), dvec2(left + width, top)]
}

/// The room.
pub fn room(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "room");
    let inside = ["Floor", "Ceiling", "Wall"].map(|name| site.material(name, &mut dice));
    let accent = site.material("Accent", &mut dice);
    let outside = site.matt("Outside", &mut dice);
    let first = dice.count(1, 4);
    for (k, side) in sides(plan.half).iter().enumerate() {
        let is_window = k >= 2 && (k + first) % 4 < plan.windows;
        let holes: Vec<Hole> = is_window.then(|| window(side, &mut dice)).into_iter().collect();
        let material = match k {
            0 | 1 => inside[k],
            2 => accent,
            _ => inside[2],
        };
        wall(site, plan, side, &holes, [material, outside]);
    }
    if plan.partition {
        partition(site, plan, &mut dice, inside[2]);
    }
}

fn wall(site: &mut Site, plan: &Plan, side: &Plane, holes: &[Hole], [inner, outer]: [usize; 2]) {
    let t = plan.thickness;
    match plan.walls {
        Walls::Single => site.add("Side", &side.sheet(holes), inner),
        Walls::Outward => site.add("Side", &flipped(side.sheet(holes)), inner),
        Walls::Coincident => {
            site.add("Side", &side.sheet(holes), inner);
            site.add("Back", &flipped(side.sheet(holes)), outer);
        }
        Walls::TwoSheets => {
            site.add("Side", &side.sheet(holes), inner);
            let shifted = |p: &DVec2| *p + DVec2::splat(t);
            let outer_holes: Vec<Hole> = holes.iter().map(|[a, b]| [shifted(a), shifted(b)]).collect();
            site.add("Back", &flipped(side.behind(t).sheet(&outer_holes)), outer);
            for hole in holes {
                site.add("Jambs", &jambs(side, *hole, t), inner);
            }
        }
        Walls::Slabs => site.add("Side", &side.slabs(holes, t), inner),
    }
}

/// The four faces of a hole through a wall, seen from within the hole.
fn jambs(wall: &Plane, [a, b]: Hole, thickness: f64) -> Mesh {
    let back = -wall.normal() * thickness;
    let corners = [a, dvec2(b.x, a.y), b, dvec2(a.x, b.y)].map(|p| wall.at(p));
    let face = |k: usize| {
        let (p, q) = (corners[k], corners[(k + 1) % 4]);
        quad(p, q, q + back, p + back)
    };
    join(&[0, 1, 2, 3].map(face))
}

/// A thin wall across the room with an open door.
fn partition(site: &mut Site, plan: &Plan, dice: &mut Dice, material: usize) {
    let (h, d) = (plan.half.y, plan.half.z);
    let x = dice.between(-0.25, 0.25) * plan.half.x;
    let plane = Plane {
        corner: dvec3(x, 0.0, d),
        u: DVec3::NEG_Z * 2.0 * d,
        v: DVec3::Y * h,
    };
    let left = dice.between(0.2, 2.0 * d - 1.1);
    let door = [dvec2(left, 0.0), dvec2(left + 0.9, 2.0)];
    site.add("Partition", &plane.slabs(&[door], 0.06), material);
    let mut z = -d;
    while z < d {
        site.take(dvec2(x, z), 0.2);
        z += 0.3;
    }
}

/// A yard's houses: closed, each with a flat roof of its own that stands out a little.
pub fn houses(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "houses");
    for _ in 0..1 + plan.furniture.div_ceil(2) {
        let size = dvec3(
            dice.between(1.2, 3.0),
            dice.between(2.4, 6.0),
            dice.between(1.2, 3.0),
        );
        let Some(at) = site.free(&mut dice, dvec2(size.x, size.z).length()) else {
            continue;
        };
        let [skin, lining, roof] = ["House", "Lining", "Roof"].map(|name| site.material(name, &mut dice));
        for side in &sides(size) {
            let side = Plane {
                corner: side.corner + at,
                ..*side
            };
            match plan.walls {
                // Seen from inside, so that the yard sees its back.
                Walls::Single => site.add("House", &side.sheet(&[]), skin),
                Walls::Outward => site.add("House", &flipped(side.sheet(&[])), skin),
                _ => wall(site, plan, &side, &[], [lining, skin]),
            }
        }
        let (low, high) = (at - size * dvec3(1.1, 0.0, 1.1), at + size * dvec3(1.1, 0.0, 1.1));
        let above = DVec3::Y * (size.y + plan.thickness);
        let roof_box = cuboid(low + above, high + above + DVec3::Y * 0.2);
        site.add("Roof", &roof_box, roof);
    }
}

/// Ground, dome and stray triangles.
pub fn far(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "surroundings");
    let size = plan.half.length();
    for far in &plan.far {
        match *far {
            Far::Ground(times) => {
                let material = site.material("Ground", &mut dice);
                let half = size * times;
                let y = if plan.yard { 0.0 } else { -STEP - plan.thickness };
                let plane = Plane {
                    corner: dvec3(-half, y, -half),
                    u: DVec3::Z * 2.0 * half,
                    v: DVec3::X * 2.0 * half,
                };
                site.add("Ground", &plane.sheet(&[]), material);
            }
            Far::Dome(times) => {
                let glow = f64::from(u8::from(plan.sky == Sky::Dome)) * GLOW;
                let color = dice.albedo();
                let material = site.glb.add_material(&Material {
                    emission: [0.6 * glow, 0.8 * glow, glow],
                    ..matt("Dome", color)
                });
                site.add("Dome", &flipped(sphere(size * times, 24)), material);
            }
            Far::Stray(times) => {
                let material = site.matt("Stray", &mut dice);
                let place = dice.direction() * size * times;
                let mut triangle = quad(
                    place,
                    place + DVec3::X,
                    place + DVec3::X + DVec3::Y,
                    place + DVec3::Y,
                );
                triangle.indices.truncate(3);
                site.add("Stray", &triangle, material);
            }
        }
    }
}
