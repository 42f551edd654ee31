//! What is being built: the file, the file's unit, materials, and which places on the floor are taken.

use super::dice::Dice;
use super::plan::Plan;
use crate::glb::{Glb, Material, Placement, TextureRef, matt};
use crate::mesh::{Mesh, mapped, with_normals};
use crate::texture::{color, noise};
use glam::{DVec2, DVec3, dvec3};

/// A scene under construction. Lengths are metres in the place's own coordinates: floor at y = 0, middle at the origin.
pub struct Site {
    /// The file.
    pub glb: Glb,
    /// Units of the file's vertices per metre.
    pub factor: f64,
    /// Units of the world per metre, below the root node's scale.
    pub unit: f64,
    /// Half of the floor.
    half: DVec2,
    /// Circles on the floor that are taken: middle and radius.
    taken: Vec<(DVec2, f64)>,
    glossy: bool,
    texture: Option<usize>,
}

/// Faces that meet at less than this are smooth, degrees.
const CREASE: f64 = 40.0;

impl Site {
    /// An empty place.
    pub fn new(plan: &Plan) -> Site {
        let mut glb = Glb::new();
        let texture = plan
            .textured
            .then(|| glb.add_texture("Checks", &color(64, 64, checks)));
        Site {
            glb,
            factor: plan.frame.factor,
            unit: plan.frame.unit(),
            half: DVec2::new(plan.half.x, plan.half.z),
            taken: vec![],
            glossy: plan.glossy,
            texture,
        }
    }

    /// A matt material of a random colour.
    pub fn matt(&mut self, name: &'static str, dice: &mut Dice) -> usize {
        let material = matt(name, dice.albedo());
        self.glb.add_material(&material)
    }

    /// A material of a random colour, with the texture or glossy now and then where the scene has such.
    pub fn material(&mut self, name: &'static str, dice: &mut Dice) -> usize {
        let mut material = matt(name, dice.albedo());
        if self.glossy && dice.chance(0.4) {
            material.metallic = f64::from(u8::from(dice.chance(0.5)));
            material.roughness = dice.between(0.15, 0.6);
        }
        if let Some(texture) = self.texture.filter(|_| dice.chance(0.4)) {
            material.base_color_texture = Some(TextureRef::new(texture));
        }
        self.glb.add_material(&material)
    }

    /// A matt material with two sides.
    pub fn cloth(&mut self, name: &'static str, dice: &mut Dice) -> usize {
        let material = Material {
            double_sided: true,
            ..matt(name, dice.albedo())
        };
        self.glb.add_material(&material)
    }

    /// A mesh in the file's unit, without a node.
    pub fn mesh(&mut self, name: &str, mesh: &Mesh, material: usize) -> usize {
        let mesh = mapped(with_normals(mesh, CREASE), |p| p * self.factor);
        self.glb.add_mesh(name, &[(&mesh, material)])
    }

    /// Shows a mesh at a place.
    pub fn show(&mut self, name: &str, mesh: usize, mut place: Placement) {
        place.translation *= self.factor;
        self.glb.add_node(name, mesh, place);
    }

    /// Adds triangles that stand where they are.
    pub fn add(&mut self, name: &str, mesh: &Mesh, material: usize) {
        let mesh = self.mesh(name, mesh, material);
        self.show(name, mesh, Placement::HERE);
    }

    /// Takes a circle on the floor, whatever is there.
    pub fn take(&mut self, middle: DVec2, radius: f64) {
        self.taken.push((middle, radius));
    }

    /// A free circle on the floor, which is taken from now on.
    pub fn free(&mut self, dice: &mut Dice, radius: f64) -> Option<DVec3> {
        let room = self.half - DVec2::splat(radius);
        if room.min_element() <= 0.0 {
            return None;
        }
        for _ in 0..TRIES {
            let p = room * DVec2::new(dice.between(-1.0, 1.0), dice.between(-1.0, 1.0));
            if self.taken.iter().all(|(q, r)| p.distance(*q) > r + radius) {
                self.take(p, radius);
                return Some(dvec3(p.x, 0.0, p.y));
            }
        }
        None
    }

    /// As [`Site::free`], but others may come there, too.
    pub fn corner(&mut self, dice: &mut Dice, radius: f64) -> Option<DVec3> {
        let place = self.free(dice, radius);
        place.inspect(|_| self.taken.truncate(self.taken.len() - 1))
    }
}

/// Darts for a place on the floor.
const TRIES: usize = 40;

/// Checks of two tones, so that colours stay within the albedos' range when multiplied.
fn checks(u: f64, v: f64) -> DVec3 {
    let odd = ((u * 4.0).floor() + (v * 4.0).floor()) as i64 % 2 == 0;
    DVec3::splat(if odd { 1.0 } else { 0.6 } - 0.2 * noise(u, v, 16, 5))
}
