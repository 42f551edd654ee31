//! Emissive triangles of a scene as lights: drawn by power, sampled by area.

use super::alias::AliasTable;
use super::emitters::{EmissiveTriangle, Emitters};
use super::form::LightForm;
use super::shape::{EmitterPoint, Extent, LightSample, Shape, attenuate, extended, luminance64};
use crate::environment::luminance;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

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

    fn sample(&self, scene: &dyn Emitters, from: DVec3, random: [f32; 3]) -> Option<LightSample> {
        let drawn = self.table.sample(scene.emissive_triangles(), from, random)?;
        // A ray would meet the surface with probability `coverage`.
        let radiance = scene.emitted(drawn.primitive, drawn.barycentric)
            * scene.coverage(drawn.primitive, drawn.barycentric)
            * self.scale;
        let d = drawn.point - from;
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

    fn lights_up(&self, primitive: u32, distance: f64, cos: f64) -> Option<(Vec3, f32)> {
        let pdf = self.table.pdf(primitive, distance, cos)?;
        Some((self.scale, pdf as f32))
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
    areas: Vec<f64>,
    /// Over `triangles`; `None` if none of them emits.
    alias: Option<AliasTable>,
    /// Their primitives, rising, each with its index in `triangles`.
    by_primitive: Vec<(u32, u32)>,
    /// Area-weighted middle and the radius of a ball around it that holds all of them.
    pub center: DVec3,
    pub radius: f64,
    /// ∫∫ radiance cos dω dA, RGB, W (fronts and, where they emit, backs).
    pub power: DVec3,
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

fn cross(vertices: &[Vec3; 3]) -> DVec3 {
    let [a, b, c] = vertices.map(|v| v.as_dvec3());
    (b - a).cross(c - a)
}

impl EmissiveTable {
    /// `chosen` are indices into `all`, rising.
    pub fn new(all: &[EmissiveTriangle], chosen: Vec<u32>) -> EmissiveTable {
        let areas: Vec<f64> = chosen
            .iter()
            .map(|&i| 0.5 * cross(&all[i as usize].vertices).length())
            .collect();
        let sides = |t: &EmissiveTriangle| if t.double_sided { 2.0 } else { 1.0 };
        let mut power = DVec3::ZERO;
        let (mut weighted, mut total) = (DVec3::ZERO, 0.0);
        let mut weights = Vec::with_capacity(chosen.len());
        for (&i, &area) in chosen.iter().zip(&areas) {
            let triangle = &all[i as usize];
            power += triangle.mean_radiance.as_dvec3() * (area * PI * sides(triangle));
            weights.push(f64::from(luminance(triangle.mean_radiance)) * area * sides(triangle));
            let [a, b, c] = triangle.vertices.map(|v| v.as_dvec3());
            weighted += (a + b + c) / 3.0 * area;
            total += area;
        }
        let center = if total > 0.0 {
            weighted / total
        } else {
            DVec3::ZERO
        };
        let radius = chosen
            .iter()
            .flat_map(|&i| all[i as usize].vertices)
            .map(|v| v.as_dvec3().distance(center))
            .fold(0.0, f64::max);
        let mut by_primitive: Vec<(u32, u32)> = chosen
            .iter()
            .enumerate()
            .map(|(k, &i)| (all[i as usize].primitive, k as u32))
            .collect();
        by_primitive.sort_unstable();
        EmissiveTable {
            triangles: chosen,
            areas,
            alias: AliasTable::new(&weights),
            by_primitive,
            center,
            radius,
            power,
        }
    }

    /// A point on one of the triangles, seen from `x`; `None` where what was drawn turns its back.
    pub fn sample(&self, all: &[EmissiveTriangle], x: DVec3, random: [f32; 3]) -> Option<EmissivePoint> {
        let alias = self.alias.as_ref()?;
        let k = alias.sample(random[2]);
        let triangle = &all[self.triangles[k] as usize];
        // Uniform in area (Turk 1990).
        let root = f64::from(random[0]).sqrt();
        let (b1, b2) = (root * (1.0 - f64::from(random[1])), root * f64::from(random[1]));
        let [v0, v1, v2] = triangle.vertices.map(|v| v.as_dvec3());
        let point = v0 + b1 * (v1 - v0) + b2 * (v2 - v0);
        let normal = cross(&triangle.vertices).try_normalize()?;
        let d = point - x;
        let facing = -d.dot(normal);
        let normal = if facing > 0.0 {
            normal
        } else if triangle.double_sided {
            -normal
        } else {
            return None;
        };
        let squared = d.length_squared();
        let pdf = f64::from(alias.probability(k)) / self.areas[k] * squared * squared.sqrt() / facing.abs();
        (pdf.is_finite() && pdf > 0.0).then_some(EmissivePoint {
            primitive: triangle.primitive,
            barycentric: [b1 as f32, b2 as f32],
            point,
            normal,
            pdf,
        })
    }

    /// Density per steradian with which [`EmissiveTable::sample`] draws a point of `primitive` at a distance
    /// whose direction makes an angle of cosine `cos` with its normal; `None` if it is none of these triangles.
    pub fn pdf(&self, primitive: u32, distance: f64, cos: f64) -> Option<f64> {
        let i = self
            .by_primitive
            .binary_search_by_key(&primitive, |entry| entry.0)
            .ok()?;
        let k = self.by_primitive[i].1 as usize;
        let Some(alias) = &self.alias else {
            return Some(0.0);
        };
        let pdf = f64::from(alias.probability(k)) / self.areas[k] * distance * distance / cos.abs();
        Some(if pdf.is_finite() { pdf } else { 0.0 })
    }
}
