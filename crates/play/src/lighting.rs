//! Direct light at many places at once, light by light: points of the basis and fragments of a shot.

use crate::direct::shadow_ray;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_scene::light_set::{LightSample, LightSet};
use relight_scene::rays::Ray;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::TracedScene;
use relight_transport::random::Stream;
use relight_transport::sampling::r2;

/// Stage numbers of the random streams.
const STAGE_POINTS: u32 = 0x10;
const STAGE_PIXELS: u32 = 0x11;

/// Places per parallel task and per packet of shadow rays.
const PACKET: usize = 256;

/// The `index`-th random triple of a place: evenly spread over a place's samples, shifted from place to place.
fn random_triple(stage: u32, seed: u64, place: usize, light: usize, index: u32) -> [f32; 3] {
    let mut stream = Stream::new(seed, stage ^ ((light as u32) << 8), place as u64);
    let start = Vec2::new(stream.uniform(), stream.uniform());
    let point = r2(index, start);
    // The third number picks a triangle or the sun: the golden ratio's own sequence.
    let third = (f64::from(stream.uniform()) + f64::from(index) * 0.618_033_988_749_894_8).fract();
    [point.x, point.y, third as f32]
}

/// Adds `contribution(place, sample)` of one light, where it is not occluded, to `out[place]`, averaged over
/// `samples` samples (one for lights without extent). Places without a hit get nothing.
fn add_light(
    scene: &TracedScene,
    lights: &LightSet,
    light: usize,
    hits: &[Option<SurfaceHit>],
    samples: u32,
    (stage, seed): (u32, u64),
    contribution: impl Fn(usize, &LightSample) -> Vec3 + Sync,
    out: &mut [Vec3],
) {
    let samples = if lights.is_delta(light) { 1 } else { samples.max(1) };
    out.par_chunks_mut(PACKET).enumerate().for_each_init(
        || (Vec::new(), Vec::new(), Vec::new()),
        |(rays, targets, occluded): &mut (Vec<Ray>, Vec<(usize, Vec3)>, Vec<bool>), (chunk, out)| {
            for index in 0..samples {
                rays.clear();
                targets.clear();
                for local in 0..out.len() {
                    let place = chunk * PACKET + local;
                    let Some(hit) = &hits[place] else { continue };
                    let random = if samples == 1 && lights.is_delta(light) {
                        [0.0; 3]
                    } else {
                        random_triple(stage, seed, place, light, index)
                    };
                    let Some(sample) = lights.sample(light, hit.position, random) else {
                        continue;
                    };
                    let part = contribution(place, &sample);
                    if part.max_element() > 0.0 {
                        rays.push(shadow_ray(scene, hit, &sample));
                        targets.push((local, part / samples as f32));
                    }
                }
                occluded.clear();
                occluded.resize(rays.len(), false);
                scene.occluded_packet(rays, occluded);
                for (&(local, part), &dark) in targets.iter().zip(occluded.iter()) {
                    if !dark {
                        out[local] += part;
                    }
                }
            }
        },
    );
}

/// Irradiance of one light on the geometric side of each place, for its smooth normal. `samples` per place
/// for lights with extent.
pub fn irradiance_at(
    scene: &TracedScene,
    lights: &LightSet,
    light: usize,
    hits: &[Option<SurfaceHit>],
    samples: u32,
    seed: u64,
    out: &mut [Vec3],
) {
    let contribution = |place: usize, sample: &LightSample| {
        hits[place].as_ref().map_or(Vec3::ZERO, |hit| {
            let cosine = hit.normal.dot(sample.direction);
            let above = hit.geometric_normal.dot(sample.direction) > 0.0;
            if above {
                sample.radiance_over_pdf * cosine.max(0.0)
            } else {
                Vec3::ZERO
            }
        })
    };
    add_light(
        scene,
        lights,
        light,
        hits,
        samples,
        (STAGE_POINTS, seed),
        contribution,
        out,
    );
}

/// Radiance that each shading point sends towards its viewer after one reflection of one light. `views` are
/// unit vectors to the viewer.
pub fn reflected_at(
    scene: &TracedScene,
    lights: &LightSet,
    light: usize,
    hits: &[Option<SurfaceHit>],
    points: &[Option<ShadingPoint>],
    views: &[Vec3],
    samples: u32,
    seed: u64,
    out: &mut [Vec3],
) {
    let contribution = |place: usize, sample: &LightSample| {
        points[place].as_ref().map_or(Vec3::ZERO, |point| {
            let cosine = point.shading_normal.dot(sample.direction);
            if cosine <= 0.0 {
                return Vec3::ZERO;
            }
            bsdf::eval(point, views[place], sample.direction) * sample.radiance_over_pdf * cosine
        })
    };
    add_light(
        scene,
        lights,
        light,
        hits,
        samples,
        (STAGE_PIXELS, seed),
        contribution,
        out,
    );
}
