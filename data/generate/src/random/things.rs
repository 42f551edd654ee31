//! What stands in rooms and yards: furniture, columns, curtains, plants, and clutter of many small meshes.

use super::dice::Dice;
use super::plan::Plan;
use super::shapes::{boxes, cone, cylinder, hanging, leaf, sphere};
use super::site::Site;
use crate::glb::Placement;
use crate::mesh::{Mesh, cuboid, join, moved, turned};
use glam::{DVec3, dvec3};

/// Furniture, each piece in its own free place.
pub fn furniture(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "furniture");
    for _ in 0..plan.furniture {
        let (piece, radius) = match dice.count(1, 5) {
            1 => table(&mut dice),
            2 => chair(),
            3 => shelf(&mut dice),
            4 => sofa(&mut dice),
            _ => bed(),
        };
        if let Some(at) = site.free(&mut dice, radius) {
            let material = site.material("Furniture", &mut dice);
            let turn = match dice.chance(0.7) {
                true => 90.0 * dice.count(1, 4) as f64,
                false => dice.between(0.0, 360.0).round(),
            };
            let mesh = site.mesh("Furniture", &piece, material);
            site.show("Furniture", mesh, Placement::at(at.x, 0.0, at.z).turned(turn));
        }
    }
}

/// A mesh about the origin and the circle that it needs.
type Piece = (Mesh, f64);

fn table(dice: &mut Dice) -> Piece {
    let (w, d) = (dice.between(0.3, 0.8), dice.between(0.3, 0.5));
    let leg = |x: f64, z: f64| ([x - 0.03, 0.0, z - 0.03], [x + 0.03, 0.72, z + 0.03]);
    let (x, z) = (w - 0.05, d - 0.05);
    let mesh = boxes(&[
        ([-w, 0.72, -d], [w, 0.76, d]),
        leg(-x, -z),
        leg(x, -z),
        leg(-x, z),
        leg(x, z),
    ]);
    (mesh, w.hypot(d))
}

fn chair() -> Piece {
    let leg = |x: f64, z: f64| ([x - 0.02, 0.0, z - 0.02], [x + 0.02, 0.44, z + 0.02]);
    let mesh = boxes(&[
        ([-0.22, 0.44, -0.22], [0.22, 0.48, 0.22]),
        ([-0.22, 0.48, -0.22], [0.22, 0.95, -0.18]),
        leg(-0.2, -0.2),
        leg(0.2, -0.2),
        leg(-0.2, 0.2),
        leg(0.2, 0.2),
    ]);
    (mesh, 0.32)
}

fn shelf(dice: &mut Dice) -> Piece {
    let (w, h, boards) = (0.5, dice.between(1.2, 2.1), 5);
    let mut parts = vec![
        ([-w, 0.0, -0.15], [-w + 0.02, h, 0.15]),
        ([w - 0.02, 0.0, -0.15], [w, h, 0.15]),
        ([-w, 0.0, -0.15], [w, h, -0.14]),
    ];
    for k in 0..boards {
        let y = h * f64::from(k) / f64::from(boards);
        parts.push(([-w, y, -0.15], [w, y + 0.02, 0.15]));
        let mut x = -w + 0.03;
        while x < w - 0.1 {
            let thick = dice.between(0.02, 0.06);
            if dice.chance(0.7) {
                let tall = dice.between(0.12, 0.22);
                parts.push(([x, y + 0.02, -0.12], [x + thick, y + 0.02 + tall, 0.1]));
            }
            x += thick + 0.002;
        }
    }
    (boxes(&parts), 0.55)
}

fn sofa(dice: &mut Dice) -> Piece {
    let w = dice.between(0.6, 1.1);
    let mesh = boxes(&[
        ([-w, 0.08, -0.4], [w, 0.42, 0.4]),
        ([-w, 0.42, -0.4], [w, 0.85, -0.2]),
        ([-w - 0.15, 0.08, -0.4], [-w, 0.6, 0.4]),
        ([w, 0.08, -0.4], [w + 0.15, 0.6, 0.4]),
    ]);
    (mesh, (w + 0.15).hypot(0.4))
}

fn bed() -> Piece {
    let mesh = boxes(&[
        ([-0.7, 0.15, -1.0], [0.7, 0.5, 1.0]),
        ([-0.7, 0.0, -1.05], [0.7, 1.0, -1.0]),
        ([-0.6, 0.5, -0.95], [0.6, 0.6, -0.6]),
    ]);
    (mesh, 1.25)
}

/// Columns with base and capital, up to the ceiling.
pub fn columns(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "columns");
    let radius = dice.between(0.06, 0.25);
    let h = plan.half.y - 0.02;
    let wide = 1.4 * radius;
    let column = join(&[
        cuboid(dvec3(-wide, 0.0, -wide), dvec3(wide, 0.12, wide)),
        moved(cylinder(radius, h - 0.24, 20), DVec3::Y * 0.12),
        cuboid(dvec3(-wide, h - 0.12, -wide), dvec3(wide, h, wide)),
    ]);
    if plan.columns > 0 {
        let material = site.material("Column", &mut dice);
        let mesh = site.mesh("Column", &column, material);
        for _ in 0..plan.columns {
            if let Some(at) = site.free(&mut dice, 2.0 * radius) {
                site.show("Column", mesh, Placement::at(at.x, 0.0, at.z));
            }
        }
    }
}

/// Curtains: single sheets that hang free near a wall; in a yard from nothing.
pub fn curtains(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "curtains");
    for _ in 0..plan.curtains {
        let (width, height) = (dice.between(0.6, 1.6), dice.between(1.6, plan.half.y - 0.1));
        let folds = dice.between(3.0, 7.0).round();
        let cloth = hanging(width, height, folds, dice.between(0.02, 0.06));
        let material = match dice.chance(0.7) {
            true => site.cloth("Curtain", &mut dice),
            false => site.matt("Curtain", &mut dice),
        };
        let gap = dice.between(0.08, 0.2);
        let (depth, turn) = match dice.chance(0.5) {
            true => (plan.half.z, 0.0),
            false => (plan.half.x, 90.0),
        };
        let along = dice.between(-0.5, 0.5) * (plan.half.x.min(plan.half.z) - 0.5 * width).max(0.0);
        let hung = turned(moved(cloth, dvec3(along, 0.05, gap - depth)), turn);
        site.add("Curtain", &hung, material);
    }
}

/// Plants of many leaves: in pots in rooms, on trunks in yards.
pub fn plants(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "plants");
    for _ in 0..plan.plants {
        let (stem, crown, size) = match plan.yard {
            true => (dice.between(1.5, 2.5), dice.between(0.8, 1.4), 0.2),
            false => (dice.between(0.5, 1.0), dice.between(0.25, 0.5), 0.09),
        };
        let Some(at) = site.free(&mut dice, 0.3 + 0.5 * crown) else {
            continue;
        };
        let wood = site.matt("Wood", &mut dice);
        let green = site.cloth("Leaf", &mut dice);
        let mut parts = vec![cylinder(0.08 * crown, stem, 8)];
        if !plan.yard {
            parts.push(cylinder(0.14, 0.25, 16));
        }
        site.add("Stem", &moved(join(&parts), at), wood);
        let top = at + DVec3::Y * stem;
        let leaves: Vec<Mesh> = (0..plan.leaves)
            .map(|_| {
                let reach = crown * dice.between(0.3, 1.0);
                let middle = top + dice.direction() * reach;
                leaf(middle, dice.direction(), size * dice.between(0.6, 1.4))
            })
            .collect();
        site.add("Leaves", &join(&leaves), green);
    }
}

/// Small things on the floor, a node each; all of one shape and material share a mesh.
pub fn clutter(site: &mut Site, plan: &Plan, seed: u64) {
    let mut dice = Dice::new(seed, "clutter");
    if plan.clutter == 0 {
        return;
    }
    let shapes = [
        moved(sphere(1.0, 12), DVec3::Y),
        boxes(&[([-1.0, 0.0, -1.0], [1.0, 1.5, 1.0])]),
        cone(1.0, 2.0, 12),
        cylinder(0.8, 1.6, 12),
    ];
    let meshes: Vec<usize> = (0..8)
        .map(|k| {
            let material = site.material("Thing", &mut dice);
            site.mesh("Thing", &shapes[k % shapes.len()], material)
        })
        .collect();
    for _ in 0..plan.clutter {
        let radius = dice.between(0.015, 0.08) * if plan.yard { 2.0 } else { 1.0 };
        if let Some(at) = site.corner(&mut dice, 1.5 * radius) {
            let place = Placement::at(at.x, 0.0, at.z)
                .turned(dice.between(0.0, 360.0).round())
                .scaled(radius);
            site.show("Thing", dice.one_of(&meshes), place);
        }
    }
}
