//! One light sample at one surface point: shared by the reference integrators.

use glam::Vec3;
use relight_scene::bsdf;
use relight_scene::light_set::{LightSample, LightSet, MetEmitter, ReferencePoint};
use relight_scene::rays::{self, Ray, SurfacePoint};
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_end, ray_from_end};
use relight_scene::traced::TracedScene;

/// BRDF × cosine for light from `wi`.
pub fn reflected(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Vec3 {
    bsdf::eval(point, wo, wi) * point.shading_normal.dot(wi).max(0.0)
}

/// The shadow ray from a surface point to what was drawn on a light.
pub(crate) fn shadow_ray(scene: &TracedScene, from: &SurfacePoint, sample: &LightSample) -> Ray {
    match &sample.emitter {
        Some(emitter) => {
            let vertices = scene.triangle_positions(emitter.primitive);
            let front = (vertices[1] - vertices[0])
                .cross(vertices[2] - vertices[0])
                .dot(emitter.normal)
                > 0.0;
            let target = scene.surface_at(emitter.primitive, emitter.barycentric, front);
            rays::shadow_ray(from, &ray_end(&target))
        }
        None if sample.distance == f32::INFINITY => ray_from_end(from, sample.direction),
        None => rays::shadow_ray_to_point(from, from.position + sample.direction * sample.distance),
    }
}

/// Radiance towards `wo` from one sample of `light`, unweighted, with the sample's density (0: no extent).
/// `None` where it is zero.
pub(crate) fn direct_sample(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    light: usize,
    hit: &SurfaceHit,
    point: &ShadingPoint,
    wo: Vec3,
    random: [f32; 3],
) -> Option<(Vec3, LightSample)> {
    let sample = lights.sample(light, hit, random)?;
    let reflected = reflected(point, wo, sample.direction);
    if reflected == Vec3::ZERO {
        return None;
    }
    let ray = shadow_ray(scene, &ray_end(hit), &sample);
    let mut reflected = reflected;
    if scene.bends_from(hit, point) && scene.crosses_solid(&ray) {
        // What the lobe shows behind solid glass is found by rays that bend.
        let cos = point.shading_normal.dot(sample.direction).max(0.0);
        reflected = bsdf::eval_diffuse(point, wo, sample.direction) * cos;
        if reflected == Vec3::ZERO {
            return None;
        }
    }
    let passed = scene.passed(&ray);
    (passed != Vec3::ZERO).then(|| (reflected * sample.radiance_over_pdf * passed, sample))
}

/// Calls `visit(light, radiance, density)` for all light that leaves a surface, or an area light before it, or
/// the environment behind everything, against a ray that started at `origin` with unit `direction` and met
/// `hit`. Density: per steradian, of drawing this direction `from` where it started as a sample of that light; of emissive
/// surfaces 0 where nobody says from where.
pub(crate) fn light_met(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    origin: Vec3,
    direction: Vec3,
    hit: Option<&SurfaceHit>,
    from: Option<&ReferencePoint>,
    mut visit: impl FnMut(usize, Vec3, f32),
) {
    let t_max = hit.map_or(f32::INFINITY, |hit| hit.t);
    let tint = scene.tint(&Ray::endless(origin, direction), t_max);
    let mut visit = |light, radiance: Vec3, pdf| visit(light, radiance * tint, pdf);
    lights.along(origin, direction, t_max, |met| {
        visit(met.light, met.radiance, met.pdf)
    });
    if let Some(hit) = hit
        && lights.has_emissive()
        && (hit.front || scene.material(hit.primitive).double_sided)
    {
        let met = MetEmitter {
            primitive: hit.primitive,
            barycentric: hit.barycentric,
            distance: f64::from(hit.t),
            cos: f64::from(hit.geometric_normal.dot(direction)),
        };
        lights.emitted(&met, from, |met| visit(met.light, met.radiance, met.pdf));
    }
}
