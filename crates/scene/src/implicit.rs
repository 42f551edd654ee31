//! Implicit surfaces: signed distances, combined, and traced by spheres.
//!
//! Source: Hart, "Sphere Tracing" (1996). A step along the ray is a share of the value, which no surface can be
//! nearer than, as long as values grow at most by a tenth faster than distance (exact distances and their
//! unions, intersections and differences grow as fast as distance; the ellipsoid's usual estimate slightly faster
//! in places). Deviations: a hit is a change of sign, found by bisection in f64, not a value below a
//! threshold, so that rays that graze a surface or start on it neither stop short nor leak; steps have a least
//! length, relative to the bounds, which ends marching along a surface; what a ray may miss is
//! a chord shorter than that. Everything is relative to the bounds: scaling by a power of two changes no decision.

use crate::json::quantity::{Above0, non_negative, point, positive, positive_triple};
use crate::rays::Ray;
use crate::scene::Mesh;
use crate::surface::{ClippedRay, SurfaceHit, Surfaces};
use crate::surface_nets::Field;
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// Steps are this share of the value.
const STEP_SHARE: f64 = 0.9;
/// Least step, relative to the bounds' diagonal.
const LEAST_STEP: f64 = 1.0 / (1 << 17) as f64;
/// Half width of the central differences for normals, relative to the bounds' diagonal: f64 leaves some ten
/// digits of the difference.
const GRADIENT_STEP: f64 = 1.0 / (1 << 20) as f64;

/// A shape by its signed distance: negative inside. Lengths in metres, world space, Y up.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Sdf {
    /// Exact.
    Sphere {
        /// Its middle.
        #[serde(deserialize_with = "point")]
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// Above zero.
        #[serde(deserialize_with = "positive")]
        #[schemars(with = "Above0")]
        radius: f64,
    },
    /// An estimate of the distance with slope 1 on the surface (Quilez).
    Ellipsoid {
        /// Its middle.
        #[serde(deserialize_with = "point")]
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// Semi-axes along x, y and z, above zero.
        #[serde(deserialize_with = "positive_triple")]
        #[schemars(with = "[Above0; 3]")]
        radii: DVec3,
    },
    /// A ring around the y axis; exact.
    Torus {
        /// Its middle.
        #[serde(deserialize_with = "point")]
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// From the middle to the middle of the tube, above zero.
        #[serde(deserialize_with = "positive")]
        #[schemars(with = "Above0")]
        major: f64,
        /// Radius of the tube, above zero.
        #[serde(deserialize_with = "positive")]
        #[schemars(with = "Above0")]
        minor: f64,
    },
    /// An upright cylinder with rounded edges; exact outside.
    RoundedCylinder {
        /// Its middle.
        #[serde(deserialize_with = "point")]
        #[schemars(with = "[f64; 3]")]
        center: DVec3,
        /// Outer radius, above zero.
        #[serde(deserialize_with = "positive")]
        #[schemars(with = "Above0")]
        radius: f64,
        /// Half of its whole height, above zero.
        #[serde(deserialize_with = "positive")]
        #[schemars(with = "Above0")]
        half_height: f64,
        /// Radius of the edges, from zero to the radius and the half height.
        #[serde(deserialize_with = "non_negative")]
        #[schemars(range(min = 0.0))]
        rounding: f64,
    },
    /// Where any is; empty: nowhere.
    Union(
        #[serde(deserialize_with = "Children::read")]
        #[schemars(with = "Children")]
        Vec<Sdf>,
    ),
    /// Where all are; empty: nowhere.
    Intersection(
        #[serde(deserialize_with = "Children::read")]
        #[schemars(with = "Children")]
        Vec<Sdf>,
    ),
    /// The first without the others; empty: nowhere.
    Difference(
        #[serde(deserialize_with = "Children::read")]
        #[schemars(with = "Children")]
        Vec<Sdf>,
    ),
    /// As a union, with creases rounded over a width (polynomial smooth minimum, folded from first to last).
    SmoothUnion {
        /// Width of the blend in metres, above zero.
        #[serde(rename = "k", deserialize_with = "positive")]
        #[schemars(with = "Above0")]
        width: f64,
        /// The shapes, at least one.
        #[serde(deserialize_with = "at_least_one")]
        #[schemars(length(min = 1))]
        of: Vec<Sdf>,
    },
}

/// Shapes as JSON has them within others.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Shapes")]
struct Children {
    /// The shapes, at least one.
    #[serde(deserialize_with = "at_least_one")]
    #[schemars(length(min = 1))]
    of: Vec<Sdf>,
}

impl Children {
    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Sdf>, D::Error> {
        Children::deserialize(deserializer).map(|children| children.of)
    }
}

fn at_least_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Sdf>, D::Error> {
    let shapes = Vec::deserialize(deserializer)?;
    if shapes.is_empty() {
        return Err(D::Error::custom("empty: give at least one shape"));
    }
    Ok(shapes)
}

/// Cells of a mesh along the longest side of the bounds: triangles of a hundredth of the shape.
const MESH_CELLS: f64 = 96.0;

/// Signed distance, or an estimate of it, in metres: negative inside.
pub fn distance(sdf: &Sdf, p: DVec3) -> f64 {
    let fold = |of: &[Sdf], blend: &dyn Fn(f64, f64) -> f64| {
        let values = of.iter().map(|child| distance(child, p));
        values.reduce(blend).unwrap_or(f64::INFINITY)
    };
    match sdf {
        Sdf::Sphere { center, radius } => p.distance(*center) - radius,
        Sdf::Ellipsoid { center, radii } => {
            let q = p - center;
            let (k, l) = ((q / radii).length(), (q / (radii * radii)).length());
            // At the middle the estimate is 0/0; its least limit is the smallest radius.
            if l > 0.0 {
                k * (k - 1.0) / l
            } else {
                -radii.min_element()
            }
        }
        Sdf::Torus { center, major, minor } => {
            let q = p - center;
            (q.x.hypot(q.z) - major).hypot(q.y) - minor
        }
        Sdf::RoundedCylinder {
            center,
            radius,
            half_height,
            rounding,
        } => {
            let q = p - center;
            let a = q.x.hypot(q.z) - (radius - rounding);
            let b = q.y.abs() - (half_height - rounding);
            a.max(b).min(0.0) + a.max(0.0).hypot(b.max(0.0)) - rounding
        }
        Sdf::Union(of) => fold(of, &f64::min),
        Sdf::Intersection(of) => fold(of, &f64::max),
        Sdf::Difference(of) => fold(of, &|a, b| a.max(-b)),
        Sdf::SmoothUnion { width, of } => fold(of, &|a, b| {
            let h = (0.5 + 0.5 * (b - a) / width).clamp(0.0, 1.0);
            b + (a - b) * h - width * h * (1.0 - h)
        }),
    }
}

/// The zero set of an [`Sdf`] with one albedo. Its front is the outside.
#[derive(Clone, Debug)]
pub struct ImplicitSurface {
    sdf: Sdf,
    low: DVec3,
    high: DVec3,
    diagonal: f64,
    albedo: Vec3,
}

impl ImplicitSurface {
    /// `bounds` must hold the whole surface; what lies outside them is cut off. `albedo` is Lambert's, linear RGB.
    pub fn new(sdf: Sdf, bounds: (Vec3, Vec3), albedo: Vec3) -> ImplicitSurface {
        let (low, high) = (bounds.0.as_dvec3(), bounds.1.as_dvec3());
        let diagonal = low.distance(high);
        // A surface that touches its bounds stays inside.
        let margin = DVec3::splat(diagonal * LEAST_STEP);
        ImplicitSurface {
            sdf,
            low: low - margin,
            high: high + margin,
            diagonal,
            albedo,
        }
    }

    /// Triangles of it, in cells of a share of the longest side of its bounds; `material` is theirs.
    pub fn mesh(&self, material: u32) -> Mesh {
        let extent = self.high - self.low;
        let cells = (extent / extent.max_element() * MESH_CELLS).ceil().as_uvec3();
        Field {
            low: self.low,
            high: self.high,
            nodes: cells + 1,
            value: &|p| distance(&self.sdf, p),
            gradient: &|p| self.gradient(p),
        }
        .mesh(material)
    }

    /// What it reflects: Lambert's albedo, linear RGB.
    pub fn color(&self) -> Vec3 {
        self.albedo
    }

    /// Distance in metres at which the ray changes sides.
    fn crossing(&self, ray: &ClippedRay) -> Option<f64> {
        let least = self.diagonal * LEAST_STEP;
        let value = |t: f64| distance(&self.sdf, ray.at(t));
        let mut t = ray.near;
        let mut here = value(t);
        // A NaN (from parameters that make no sense) counts as outside.
        let starts_inside = !ray.starts_outside && here < 0.0;
        if (here < 0.0) != starts_inside {
            return Some(t); // cut by its bounds
        }
        while t < ray.far {
            let step = (here.abs() * STEP_SHARE).max(least);
            // Without room for a step the least one may round away far from the origin.
            let next = (t + step).max(t.next_up()).min(ray.far);
            let there = value(next);
            if (there < 0.0) != starts_inside {
                return Some(bisect(t, next, |t| (value(t) < 0.0) == starts_inside));
            }
            (t, here) = (next, there);
        }
        None
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let h = self.diagonal * GRADIENT_STEP;
        let along = |axis: DVec3| distance(&self.sdf, p + axis * h) - distance(&self.sdf, p - axis * h);
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)) / (2.0 * h)
    }
}

/// Largest number found between `a`, where `before` holds, and `b`, where it does not, such that it still
/// holds there; to f64 precision relative to `b − a`.
pub(crate) fn bisect(mut a: f64, mut b: f64, before: impl Fn(f64) -> bool) -> f64 {
    // 40 halvings: far below the rounding of the f32 result.
    for _ in 0..40 {
        let middle = 0.5 * (a + b);
        if before(middle) {
            a = middle;
        } else {
            b = middle;
        }
    }
    a
}

impl Surfaces for ImplicitSurface {
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        Some((self.low.as_vec3(), self.high.as_vec3()))
    }

    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        let ray = ClippedRay::new(ray, self.low, self.high)?;
        let t = self.crossing(&ray)?;
        let gradient = self.gradient(ray.at(t));
        Some(ray.hit(t, gradient, gradient, self.diagonal))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        ClippedRay::new(ray, self.low, self.high).is_some_and(|ray| self.crossing(&ray).is_some())
    }

    fn albedo(&self, _: &SurfaceHit) -> Vec3 {
        self.albedo
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{ray_between, ray_between_hits, ray_from};

    fn ray(origin: Vec3, direction: Vec3) -> Ray {
        Ray {
            origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }

    /// Directions spread evenly over the sphere.
    fn direction(k: u32) -> Vec3 {
        let z = 1.0 - 2.0 * ((k as f32 * 0.618_034).fract());
        let (sin, cos) = (std::f32::consts::TAU * (k as f32 * 0.754_878).fract()).sin_cos();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(radius * cos, radius * sin, z)
    }

    fn sphere(scale: f32) -> ImplicitSurface {
        let sdf = Sdf::Sphere {
            center: DVec3::splat(scale.into()),
            radius: scale.into(),
        };
        ImplicitSurface::new(sdf, (Vec3::ZERO, Vec3::splat(2.0 * scale)), Vec3::splat(0.5))
    }

    /// Truth: the quadratic formula in f64. Grazing rays included: the impact parameter goes up to 0.999999.
    #[test]
    fn rays_meet_a_sphere_where_the_quadratic_formula_says() {
        for scale in [1e-4f32, 1.0, 1e5] {
            let surface = sphere(scale);
            for k in 0..5000 {
                let along = direction(k);
                let side = along.any_orthonormal_vector();
                let impact = [0.1, 0.7, 0.99, 0.999_999, 1.000_1][k as usize % 5];
                let origin = Vec3::splat(scale) + (side * impact - along * 3.0) * scale;
                let (o, d) = (origin.as_dvec3() - f64::from(scale), along.as_dvec3().normalize());
                let (b, c) = (o.dot(d), o.length_squared() - f64::from(scale).powi(2));
                let discriminant = b * b - c;
                let hit = surface.closest_hit(&ray(origin, along * 2.0));
                assert_eq!(
                    hit.is_some(),
                    discriminant > 0.0,
                    "scale {scale}, impact {impact}"
                );
                assert_eq!(hit.is_some(), surface.occluded(&ray(origin, along * 2.0)));
                let Some(hit) = hit else { continue };
                // The position is rounded to f32 once; the direction has twice unit length.
                let truth = o + d * (-b - discriminant.sqrt()) + f64::from(scale);
                let slack = f64::from(scale) * 4e-7;
                assert!(
                    (hit.position.as_dvec3() - truth).length() < slack,
                    "scale {scale}: {hit:?}"
                );
                let normal = (hit.position.as_dvec3() - f64::from(scale)).normalize().as_vec3();
                assert!((hit.geometric_normal - normal).length() < 1e-5 && hit.front);
                assert!((hit.t * 2.0 - (hit.position - origin).length()).abs() < 1e-5 * scale);
            }
        }
    }

    /// Truth: the torus's quartic, by counting on a ray that crosses the ring's plane; four crossings, found
    /// one after the other by rays that start where the last one ended. Tolerance: each start is offset by some
    /// 3e-5 along an oblique normal, which shifts the ray.
    #[test]
    fn a_ray_through_a_torus_meets_it_four_times() {
        let sdf = Sdf::Torus {
            center: DVec3::ZERO,
            major: 1.0,
            minor: 0.25,
        };
        let surface = ImplicitSurface::new(sdf, (Vec3::splat(-1.25), Vec3::splat(1.25)), Vec3::ONE);
        for height in [0.0f32, 0.1, 0.2] {
            let half_width = (0.25f32.powi(2) - height * height).sqrt();
            let truth = [
                -1.0 - half_width,
                half_width - 1.0,
                1.0 - half_width,
                1.0 + half_width,
            ];
            let mut from = ray(Vec3::new(-3.0, height, 0.0), Vec3::X);
            for (k, x) in truth.into_iter().enumerate() {
                let hit = surface.closest_hit(&from).unwrap();
                assert!(
                    (hit.position.x - x).abs() < 1e-4,
                    "crossing {k} at {} instead of {x}",
                    hit.position
                );
                assert_eq!(hit.front, k % 2 == 0);
                assert!(hit.geometric_normal.x < 0.0, "faces the ray");
                from = ray_from(&hit, Vec3::X);
            }
            assert!(surface.closest_hit(&from).is_none());
        }
    }

    /// From a point of a convex shape every direction above its surface is free, and every one below is not.
    #[test]
    fn shadow_rays_start_and_end_on_a_surface() {
        for scale in [1e-4f32, 1.0, 1e5] {
            let surface = sphere(scale);
            let center = Vec3::splat(scale);
            for k in 0..3000 {
                let hit = surface
                    .closest_hit(&ray(center + direction(k) * (3.0 * scale), -direction(k)))
                    .unwrap();
                let mut away = direction(7 * k + 1);
                if away.dot(hit.geometric_normal) < 0.0 {
                    away = -away;
                }
                assert!(
                    !surface.occluded(&ray_from(&hit, away)),
                    "scale {scale}: {hit:?} {away}"
                );
                assert!(!surface.occluded(&ray_between(&hit, hit.position + away * (2.0 * scale))));
                // Not a chord below the least step.
                if away.dot(hit.geometric_normal) > 1e-2 {
                    let inward = surface.closest_hit(&ray_from(&hit, -away)).expect("the far side");
                    assert!(!inward.front && !surface.occluded(&ray_between_hits(&hit, &inward)));
                }
            }
        }
    }

    /// No ray from inside a closed shape gets out: unions with creases, intersections, differences and blends.
    #[test]
    fn closed_shapes_are_watertight() {
        let ball = |x: f64, radius: f64| Sdf::Sphere {
            center: DVec3::X * x,
            radius,
        };
        let egg = Sdf::Ellipsoid {
            center: DVec3::Y * 0.3,
            radii: DVec3::new(0.5, 0.9, 0.3),
        };
        let drum = Sdf::RoundedCylinder {
            center: DVec3::ZERO,
            radius: 0.8,
            half_height: 0.5,
            rounding: 0.1,
        };
        let shapes = [
            Sdf::Union(vec![ball(-0.3, 0.5), ball(0.3, 0.5)]),
            Sdf::Intersection(vec![ball(-0.3, 0.8), ball(0.3, 0.8)]),
            Sdf::Difference(vec![drum.clone(), ball(0.6, 0.3)]),
            Sdf::SmoothUnion {
                width: 0.1,
                of: vec![egg.clone(), drum.clone(), ball(0.9, 0.2)],
            },
            egg,
            drum,
        ];
        for sdf in shapes {
            let surface = ImplicitSurface::new(sdf.clone(), (Vec3::splat(-1.3), Vec3::splat(1.3)), Vec3::ONE);
            for k in 0..5000 {
                let inside = direction(3 * k) * 0.05;
                assert!(distance(&sdf, inside.as_dvec3()) < 0.0);
                let out = surface.closest_hit(&ray(inside, direction(k))).expect("a wall");
                assert!(!out.front && out.geometric_normal.dot(direction(k)) <= 0.0);
                let value = distance(&sdf, out.position.as_dvec3());
                assert!(value.abs() < 1e-6, "{sdf:?}: {value} at {}", out.position);
            }
        }
    }
}
