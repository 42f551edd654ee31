//! Rectangles, spheres and emissive triangles as points.

use super::points::{End, POINTS_PER_AREA_LIGHT, POINTS_PER_EMITTER, PointLights, Sphere, stage};
use glam::{DVec3, Vec2, Vec3};
use relight_scene::environment::luminance;
use relight_scene::light_set::{EmissivePart, EmissiveTriangle, Emitters, LightForm, LightSet};
use relight_scene::surface::ray_end;
use relight_scene::traced::TracedScene;
use relight_transport::point_light::{Emission, PointLight};
use relight_transport::random::Stream;
use relight_transport::sampling::r2;
use std::f64::consts::{PI, TAU};

/// For each light how many points stand for it; 0 for those without area.
pub(super) fn counts(lights: &LightSet<'_>, total: Option<u32>) -> Vec<usize> {
    let mut automatic = 0;
    // The radius matters to distant lights only.
    let powers: Vec<Option<f64>> = (0..lights.len())
        .map(|light| {
            automatic += match lights.form(light) {
                LightForm::Rect { .. } | LightForm::Sphere { .. } => POINTS_PER_AREA_LIGHT,
                LightForm::Emissive { triangles, .. } if !triangles.is_empty() => {
                    let parts = |t: &&EmissiveTriangle| t.parts.as_ref().map_or(1, Vec::len);
                    let all = triangles.iter().map(parts).sum::<usize>();
                    all.clamp(POINTS_PER_AREA_LIGHT, POINTS_PER_EMITTER)
                }
                _ => return None,
            };
            let power = f64::from(luminance(lights.power(light, 0.0)));
            Some(if power.is_finite() {
                power
            } else {
                f64::from(f32::MAX)
            })
        })
        .collect();
    shared_out(&powers, total.map_or(automatic, |total| total as usize))
}

/// `total` among all that have a weight, at least 1 for each: half of it by weight, half evenly; largest remainders
/// take what rounding leaves.
pub(super) fn shared_out(weights: &[Option<f64>], total: usize) -> Vec<usize> {
    let members = weights.iter().flatten().count();
    let sum: f64 = weights.iter().flatten().sum();
    let rest = total.saturating_sub(members);
    let share = |weight: f64| {
        let even = 1.0 / members as f64;
        let by_weight = if sum > 0.0 { weight / sum } else { even };
        0.5 * (by_weight + even) * rest as f64
    };
    let mut counts: Vec<usize> = weights
        .iter()
        .map(|w| w.map_or(0, |w| 1 + share(w) as usize))
        .collect();
    let mut left: Vec<(f64, usize)> = weights
        .iter()
        .enumerate()
        .filter_map(|(i, w)| w.map(|w| (share(w).fract(), i)))
        .collect();
    left.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let given: usize = counts.iter().sum();
    let missing = (members + rest).saturating_sub(given);
    for &(_, i) in left.iter().take(missing) {
        counts[i] += 1;
    }
    counts
}

/// Adds `count` points for one light.
pub(super) fn push(
    points: &mut PointLights,
    scene: &TracedScene,
    emitters: &dyn Emitters,
    source: u32,
    form: &LightForm<'_>,
    count: usize,
    seed: u64,
) {
    let mut stream = Stream::new(seed, stage::AREA, u64::from(source));
    match form {
        LightForm::Rect {
            corner,
            edge_u,
            edge_v,
            radiance,
        } => {
            let (u, v) = (edge_u.as_dvec3(), edge_v.as_dvec3());
            let cross = u.cross(v);
            let intensity = radiance.as_dvec3() * (cross.length() / count as f64);
            let start = Vec2::new(stream.uniform(), stream.uniform());
            for k in 0..count {
                let place = r2(k as u32, start).as_dvec2();
                let light = PointLight {
                    emission: Emission::Oriented,
                    position: (corner.as_dvec3() + u * place.x + v * place.y).as_vec3(),
                    axis: cross.normalize().as_vec3(),
                    intensity: intensity.as_vec3(),
                };
                points.push(light, source, End::Free);
            }
        }
        LightForm::Sphere {
            center,
            radius,
            radiance,
        } => {
            let sphere = Sphere {
                center: *center,
                radius: *radius,
            };
            points.spheres.push(sphere);
            let end = End::Sphere(points.spheres.len() as u32 - 1);
            let r = f64::from(*radius);
            // From afar a sphere is a disc of its radiance.
            let intensity = (radiance.as_dvec3() * (PI * r * r / count as f64)).as_vec3();
            let start = DVec3::new(
                stream.uniform().into(),
                stream.uniform().into(),
                stream.uniform().into(),
            );
            for k in 0..count {
                let light = PointLight {
                    emission: Emission::Omni,
                    position: (center.as_dvec3() + r * in_sphere(r3(k, start))).as_vec3(),
                    axis: Vec3::ZERO,
                    intensity,
                };
                points.push(light, source, end);
            }
        }
        LightForm::Emissive { triangles, scale } => {
            Cells::new(scene, triangles).push(points, scene, emitters, source, *scale, count, seed);
        }
        _ => {}
    }
}

/// The k-th point of the R3 sequence (Roberts 2018: the recurrence by powers of the root of g⁴ = g + 1), started at
/// `start`.
fn r3(k: usize, start: DVec3) -> DVec3 {
    const STEP: DVec3 = DVec3::new(
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_970_3,
    );
    (start + STEP * (k % (1 << 32)) as f64).fract()
}

/// A point of the unit ball that is distributed by equation 7 of appendix A: seen from outside, evenly over the
/// sphere's solid angle. Equation 8.
fn in_sphere(random: DVec3) -> DVec3 {
    let (sin, cos) = (TAU * random.y).sin_cos();
    let (x, y) = (random.x.sqrt() * cos, random.x.sqrt() * sin);
    let z = (1.0 - x * x - y * y).max(0.0).sqrt() * (PI * (random.z - 0.5)).sin();
    DVec3::new(x, y, z)
}

/// A part of an emissive triangle: a triangle of barycentric weights of vertices 1 and 2.
struct Cell {
    corners: [Vec2; 3],
    /// Index into the light's triangles.
    triangle: u32,
    front: bool,
    /// m².
    area: f64,
}

/// Parts of all triangles of a light with rising sums of their power, the last 1.
struct Cells<'a> {
    triangles: &'a [&'a EmissiveTriangle],
    cells: Vec<Cell>,
    sums: Vec<f64>,
}

impl<'a> Cells<'a> {
    fn new(scene: &TracedScene, triangles: &'a [&'a EmissiveTriangle]) -> Cells<'a> {
        let (mut cells, mut sums, mut sum) = (Vec::new(), Vec::new(), 0.0);
        for (i, triangle) in triangles.iter().enumerate() {
            let area = f64::from(scene.triangle_area(triangle.primitive));
            let whole = [EmissivePart::whole(luminance(triangle.mean_radiance))];
            let sides = [true, false]
                .into_iter()
                .take(1 + usize::from(triangle.double_sided));
            for front in sides {
                for part in triangle.parts.as_deref().unwrap_or(&whole) {
                    let area = area * part.share();
                    cells.push(Cell {
                        corners: part.corners,
                        triangle: i as u32,
                        front,
                        area,
                    });
                    sum += f64::from(part.luminance) * area;
                    sums.push(sum);
                }
            }
        }
        sums.iter_mut().for_each(|s| *s /= sum);
        Cells {
            triangles,
            cells,
            sums,
        }
    }

    /// Adds `count` points, evenly over the power: the k-th lies in the k-th part of it.
    fn push(
        &self,
        points: &mut PointLights,
        scene: &TracedScene,
        emitters: &dyn Emitters,
        source: u32,
        scale: Vec3,
        count: usize,
        seed: u64,
    ) {
        // All weights zero: nothing emits.
        if !self.sums.last().is_some_and(|sum| sum.is_finite()) {
            return;
        }
        let mut stream = Stream::new(seed, stage::CELLS, u64::from(source));
        let start = Vec2::new(stream.uniform(), stream.uniform());
        for k in 0..count {
            let random = (k as f64 + f64::from(stream.uniform())) / count as f64;
            let i = self
                .sums
                .partition_point(|&sum| sum <= random)
                .min(self.cells.len() - 1);
            let cell = &self.cells[i];
            let chance = self.sums[i] - if i == 0 { 0.0 } else { self.sums[i - 1] };
            if chance <= 0.0 {
                continue;
            }
            // Consecutive points of the sequence are even within whatever cell they share.
            let place = r2(k as u32, start);
            let (a, b) = if place.x + place.y > 1.0 {
                (1.0 - place.x, 1.0 - place.y)
            } else {
                (place.x, place.y)
            };
            let [c0, c1, c2] = cell.corners;
            let barycentric = (c0 + a * (c1 - c0) + b * (c2 - c0)).to_array();
            let primitive = self.triangles[cell.triangle as usize].primitive;
            let hit = scene.surface_at(primitive, barycentric, cell.front);
            let radiance = (emitted(emitters, primitive, barycentric) * scale).as_dvec3();
            let light = PointLight {
                emission: Emission::Oriented,
                position: hit.position,
                axis: hit.geometric_normal,
                intensity: (radiance * (cell.area / (chance * count as f64))).as_vec3(),
            };
            let clearance = ray_end(&hit).clearance;
            points.push(light, source, End::Surface { clearance });
        }
    }
}

/// What a ray would meet on average: a surface is there with probability `coverage`.
fn emitted(emitters: &dyn Emitters, primitive: u32, barycentric: [f32; 2]) -> Vec3 {
    emitters.emitted(primitive, barycentric) * emitters.coverage(primitive, barycentric)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_shared_out_by_power_and_none_is_left_without() {
        let counts = shared_out(&[Some(1.0), None, Some(3.0), Some(0.0)], 100);
        // Half of 97 evenly, 16.2 each, half by power, 12.1 and 36.4, and 1 each.
        assert_eq!(counts, [29, 0, 54, 17]);
        assert_eq!(shared_out(&[Some(1e20), Some(1e-20)], 1), [1, 1]);
        assert_eq!(shared_out(&[Some(0.0), Some(0.0)], 7).iter().sum::<usize>(), 7);
        assert!(shared_out(&[], 7).is_empty());
    }
}
