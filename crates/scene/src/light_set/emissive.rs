//! Emissive surfaces of a scene as lights: drawn through a tree, then by solid angle or by area.

use super::emission_bounds::Emission;
use super::emissive_tree::EmissiveTree;
use super::emitters::{EmissiveTriangle, Emitters};
use super::form::LightForm;
use super::parts::{EmissivePart, interpolated, part_at};
use super::shape::{
    EmitterPoint, Extent, LightSample, MetEmitter, ReferencePoint, Shape, attenuate, extended, luminance64,
};
use super::spherical_triangle::SphericalTriangle;
use crate::environment::luminance;
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

/// Least solid angle, in steradians, that a part is sampled evenly over. A smaller one is far or narrow: even over its area is
/// as good, and takes a third of the time.
const LEAST_SOLID_ANGLE: f64 = 3e-4;

/// Distance from a plane, over the largest coordinate, within which rounding of places on it leaves them.
const PLANE_ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// Emissive surfaces that a light lets shine.
pub(super) struct EmissiveLight {
    pub table: Arc<EmissiveTable>,
    /// RGB factor.
    pub scale: Vec3,
}

impl Shape for EmissiveLight {
    fn extent(&self) -> Extent {
        Extent::Emissive
    }

    fn sample(&self, scene: &dyn Emitters, at: &ReferencePoint, random: [f32; 3]) -> Option<LightSample> {
        let drawn = self.table.sample(scene.emissive_triangles(), at, random)?;
        // A ray would meet the surface with probability `coverage`.
        let radiance = scene.emitted(drawn.primitive, drawn.barycentric)
            * scene.coverage(drawn.primitive, drawn.barycentric)
            * self.scale;
        let d = drawn.point - at.position.as_dvec3();
        Some(LightSample {
            emitter: Some(EmitterPoint {
                primitive: drawn.primitive,
                barycentric: drawn.barycentric,
                position: drawn.point.as_vec3(),
                normal: drawn.normal.as_vec3(),
            }),
            ..extended(d.try_normalize()?.as_vec3(), d.length(), radiance, drawn.pdf)
        })
    }

    fn lights_up(&self, primitive: u32) -> Option<Vec3> {
        self.table.leaves_of(primitive).map(|_| self.scale)
    }

    fn density_of(&self, scene: &dyn Emitters, met: &MetEmitter, from: &ReferencePoint) -> f32 {
        self.table.pdf(scene.emissive_triangles(), met, from) as f32
    }

    fn importance(&self, from: DVec3) -> f64 {
        let table = &self.table;
        let power = luminance64((table.power / PI).as_vec3() * self.scale);
        attenuate(power, from, table.center, table.radius)
    }

    fn power(&self, _: f64) -> Vec3 {
        (self.table.power * self.scale.as_dvec3()).as_vec3()
    }

    fn form<'a>(&'a self, scene: &'a dyn Emitters) -> LightForm<'a> {
        let all = scene.emissive_triangles();
        LightForm::Emissive {
            triangles: self.table.triangles.iter().map(|&i| &all[i as usize]).collect(),
            scale: self.scale,
        }
    }
}

/// The triangles of one light.
#[derive(Clone, Debug)]
pub(super) struct EmissiveTable {
    /// Indices into the scene's emissive triangles, rising.
    pub triangles: Vec<u32>,
    /// Over the leaves.
    tree: EmissiveTree,
    /// Parts of triangles that emit, triangle by triangle.
    leaves: Vec<Leaf>,
    /// Primitives of the triangles, rising, each with its leaves.
    by_primitive: Vec<(u32, Range<u32>)>,
    /// Area-weighted middle and the radius of a ball around it that holds all of them.
    pub center: DVec3,
    pub radius: f64,
    /// ∫∫ radiance cos dω dA, RGB, W (fronts and, where they emit, backs).
    pub power: DVec3,
}

#[derive(Clone, Copy, Debug)]
struct Leaf {
    /// Index into the scene's emissive triangles.
    triangle: u32,
    part: EmissivePart,
    /// m².
    area: f64,
}

/// A point drawn on an emissive triangle.
pub(super) struct EmissivePoint {
    pub primitive: u32,
    pub barycentric: [f32; 2],
    pub point: DVec3,
    /// Unit, on the side of the emission.
    pub normal: DVec3,
    /// Per steradian.
    pub pdf: f64,
}

fn vertices_of(triangle: &EmissiveTriangle) -> [DVec3; 3] {
    triangle.vertices.map(|v| v.as_dvec3())
}

fn cross([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

impl EmissiveTable {
    /// `chosen` are indices into `all`, rising.
    pub fn new(all: &[EmissiveTriangle], chosen: Vec<u32>) -> EmissiveTable {
        let (mut leaves, mut emissions, mut by_primitive) = (Vec::new(), Vec::new(), Vec::new());
        let mut power = DVec3::ZERO;
        let (mut weighted, mut total) = (DVec3::ZERO, 0.0);
        for &i in &chosen {
            let triangle = &all[i as usize];
            let vertices = vertices_of(triangle);
            let area = 0.5 * cross(vertices).length();
            let sides = if triangle.double_sided { 2.0 } else { 1.0 };
            power += triangle.mean_radiance.as_dvec3() * (area * PI * sides);
            weighted += vertices.iter().sum::<DVec3>() / 3.0 * area;
            total += area;
            let whole = [EmissivePart::whole(luminance(triangle.mean_radiance))];
            let first = leaves.len() as u32;
            for part in triangle.parts.as_deref().unwrap_or(&whole) {
                let area = area * part.share();
                let of_part = f64::from(part.luminance) * area;
                let emission = Emission::of_triangle(part.vertices(vertices), of_part, triangle.double_sided);
                if let Some(emission) = emission.filter(|_| of_part > 0.0 && of_part.is_finite()) {
                    emissions.push(emission);
                    leaves.push(Leaf {
                        triangle: i,
                        part: *part,
                        area,
                    });
                }
            }
            by_primitive.push((triangle.primitive, first..leaves.len() as u32));
        }
        by_primitive.sort_unstable_by_key(|entry| entry.0);
        let center = if total > 0.0 {
            weighted / total
        } else {
            DVec3::ZERO
        };
        let radius = (chosen.iter())
            .flat_map(|&i| vertices_of(&all[i as usize]))
            .map(|v| v.distance(center))
            .fold(0.0, f64::max);
        EmissiveTable {
            triangles: chosen,
            tree: EmissiveTree::new(&emissions),
            leaves,
            by_primitive,
            center,
            radius,
            power,
        }
    }

    /// A point on one of the triangles, seen from a place; `None` where what was drawn turns its back.
    fn sample(
        &self,
        all: &[EmissiveTriangle],
        at: &ReferencePoint,
        random: [f32; 3],
    ) -> Option<EmissivePoint> {
        let (leaf, probability) = self.tree.sample(at, random[2])?;
        let leaf = &self.leaves[leaf];
        let triangle = &all[leaf.triangle as usize];
        let vertices = vertices_of(triangle);
        let part = leaf.part.vertices(vertices);
        let normal = cross(vertices).try_normalize()?;
        let from = at.position.as_dvec3();
        let random = [f64::from(random[0]), f64::from(random[1])];
        if is_edge_on(from, vertices, normal) {
            return None;
        }
        let spherical = by_solid_angle(from, part);
        let within = match &spherical {
            Some(spherical) => met_by(part, from, spherical.direction(random)),
            None => {
                // Uniform in area (Turk 1990).
                let root = random[0].sqrt();
                DVec2::new(root * (1.0 - random[1]), root * random[1])
            }
        };
        let barycentric = leaf.part.barycentric(within);
        let point = interpolated(vertices, barycentric);
        let d = point - from;
        let facing = -d.dot(normal);
        let normal = if facing > 0.0 {
            normal
        } else if triangle.double_sided {
            -normal
        } else {
            return None;
        };
        let squared = d.length_squared();
        let density = match spherical {
            Some(spherical) => 1.0 / spherical.solid_angle,
            None => squared * squared.sqrt() / (facing.abs() * leaf.area),
        };
        let pdf = probability * density;
        (pdf.is_finite() && pdf > 0.0).then_some(EmissivePoint {
            primitive: triangle.primitive,
            barycentric: barycentric.as_vec2().to_array(),
            point,
            normal,
            pdf,
        })
    }

    /// Leaves of a primitive; `None` if it is none of these triangles.
    fn leaves_of(&self, primitive: u32) -> Option<Range<usize>> {
        let i = (self.by_primitive)
            .binary_search_by_key(&primitive, |entry| entry.0)
            .ok()?;
        let Range { start, end } = self.by_primitive[i].1;
        Some(start as usize..end as usize)
    }

    /// Density per steradian with which [`EmissiveTable::sample`] draws what a ray met, from where it was to arrive.
    fn pdf(&self, all: &[EmissiveTriangle], met: &MetEmitter, from: &ReferencePoint) -> f64 {
        let Some(leaves) = self.leaves_of(met.primitive) else {
            return 0.0;
        };
        let first = leaves.start;
        let Some(within) = part_at(&self.leaves[leaves], |leaf| &leaf.part, met.barycentric) else {
            return 0.0;
        };
        let leaf = first + within;
        let probability = self.tree.probability(leaf, from);
        let leaf = &self.leaves[leaf];
        let vertices = vertices_of(&all[leaf.triangle as usize]);
        let position = from.position.as_dvec3();
        let normal = cross(vertices).normalize_or_zero();
        if is_edge_on(position, vertices, normal) {
            return 0.0;
        }
        let part = leaf.part.vertices(vertices);
        let density = match by_solid_angle(position, part) {
            Some(spherical) => 1.0 / spherical.solid_angle,
            None => met.distance * met.distance / (met.cos.abs() * leaf.area),
        };
        let pdf = probability * density;
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}

/// Whether a place lies in a triangle's plane, as far as f32 coordinates tell: nothing arrives from there, but a place on the
/// triangle itself, whose rounding put it behind, would take it for a whole hemisphere of light.
fn is_edge_on(from: DVec3, vertices: [DVec3; 3], normal: DVec3) -> bool {
    let largest = vertices.iter().fold(from.abs(), |most, v| most.max(v.abs()));
    (from - vertices[0]).dot(normal).abs() <= PLANE_ROUNDING * largest.max_element()
}

/// The solid angle of a part, if it is sampled by that.
fn by_solid_angle(from: DVec3, part: [DVec3; 3]) -> Option<SphericalTriangle> {
    SphericalTriangle::new(from, part).filter(|part| part.solid_angle >= LEAST_SOLID_ANGLE)
}

/// Weights of vertices 1 and 2 where a ray meets a triangle that it was drawn towards.
fn met_by(triangle: [DVec3; 3], from: DVec3, direction: DVec3) -> DVec2 {
    let [a, b, c] = triangle;
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    let t = (a - from).dot(normal) / direction.dot(normal);
    let offset = from + t * direction - a;
    let squared = normal.length_squared();
    let weights = DVec2::new(offset.cross(v).dot(normal), u.cross(offset).dot(normal)) / squared;
    // Rounding may carry it over a side.
    let weights = if weights.is_finite() {
        weights.max(DVec2::ZERO)
    } else {
        DVec2::splat(1.0 / 3.0)
    };
    weights / weights.element_sum().max(1.0)
}
