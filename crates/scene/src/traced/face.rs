//! A triangle that is hit.

use super::corner::weights;
use crate::rays::{Hit, Ray, SurfacePoint, TriangleSurface};
use crate::surface::SurfaceHit;
use glam::{Mat3A, Vec3, Vec3A};

/// A triangle, for any number of hits on it.
pub(super) struct Face {
    pub triangle: u32,
    pub surface: TriangleSurface,
    /// Normals of its vertices, mesh space, of any length; `None` where the mesh has none.
    pub normals: Option<[Vec3A; 3]>,
    /// World space, of any length, fronts to fronts.
    pub normal_from_mesh: Mat3A,
}

impl Face {
    /// Where a ray hit it.
    pub fn hit_by(&self, ray: &Ray, hit: &Hit) -> SurfaceHit {
        let mut point = self.surface.at(hit);
        if point.normal == Vec3::ZERO {
            // A triangle so thin that its normal is lost faces the ray.
            point.normal = try_unit(-ray.direction).unwrap_or(Vec3::Y);
        }
        let front = point.normal.as_dvec3().dot(ray.direction.as_dvec3()) <= 0.0;
        self.seen(hit, &point, front)
    }

    /// As if a ray had hit it from its front or back.
    pub fn hit_from(&self, front: bool, hit: &Hit) -> SurfaceHit {
        self.seen(hit, &self.surface.at(hit), front)
    }

    /// Whether its vertices' normals differ by less than an angle of such a cosine.
    pub fn is_flat(&self, cosine: f32) -> bool {
        let Some(normals) = self.normals else { return true };
        let [a, b, c] = normals.map(|normal| (self.normal_from_mesh * normal).normalize_or_zero());
        a.dot(b).min(b.dot(c)).min(c.dot(a)) > cosine
    }

    fn seen(&self, hit: &Hit, point: &SurfacePoint, front: bool) -> SurfaceHit {
        let barycentric = [hit.u, hit.v];
        let geometric = point.normal;
        let smooth = (self.normals)
            .map(|normals| -> Vec3A { (0..3).map(|k| normals[k] * weights(barycentric)[k]).sum() })
            .and_then(|normal| try_unit(Vec3::from(self.normal_from_mesh * normal)))
            // Normals that contradict the winding follow it.
            .map(|normal| {
                if normal.dot(geometric) < 0.0 {
                    -normal
                } else {
                    normal
                }
            });
        let side = if front { 1.0 } else { -1.0 };
        SurfaceHit {
            t: hit.t,
            position: point.position,
            position_error: Vec3::splat(point.clearance),
            geometric_normal: geometric * side,
            normal: smooth.unwrap_or(geometric) * side,
            front,
            primitive: hit.triangle,
            barycentric,
        }
    }
}

/// `None` where the vector is zero or not finite. In f64, so that short vectors keep their direction.
fn try_unit(vector: Vec3) -> Option<Vec3> {
    vector.as_dvec3().try_normalize().map(|unit| unit.as_vec3())
}
