//! Candidates for points: where importance from the viewpoints lands.
//!
//! Source: Lehtinen et al. 2008, section 2.3. Particles leave a viewpoint in uniform directions and bounce
//! about the scene; every surface on which they land can send light to the viewer. The first few landings
//! are disregarded to make the distribution uniform and independent of the viewpoint.
//!
//! Deviation: a particle that leaves the scene before that deposits what it hit, or surfaces in the open
//! (a ground under the sky) would get no points although they are in view.

use crate::points::particles::walk;
use crate::points::relevance::Relevance;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_transport::random::Stream;

/// Landings of one particle (section 2.3: about 30).
const BOUNCES: usize = 30;
/// Landings that are disregarded at first (section 2.3: typically 3).
const SKIPPED: usize = 3;
/// Stage number of the random stream.
const STAGE: u32 = 1;

/// A place on a surface where a point may be put.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// On the surface, world space.
    pub position: Vec3,
    /// Unit smooth normal on the side that the particle saw.
    pub normal: Vec3,
    /// Unit geometric normal on that side.
    pub geometric_normal: Vec3,
    /// Just above the surface: where rays from this place start.
    pub origin: Vec3,
    /// Total hemispherical reflectance, linear RGB.
    pub albedo: Vec3,
    /// By how much its point's radii are wider than its level's, as a power of two.
    pub widening: u8,
    /// Whether it is a point of the next coarser level, which has no finer ones around it.
    pub inherited: bool,
}

impl Candidate {
    /// The place that a ray hit, for a point so much wider than its level's.
    pub fn at(surfaces: &dyn Surfaces, hit: &SurfaceHit, widening: u8) -> Candidate {
        Candidate {
            position: hit.position,
            normal: hit.normal,
            geometric_normal: hit.geometric_normal,
            origin: ray_from(hit, hit.geometric_normal).origin,
            albedo: surfaces.albedo(hit),
            widening,
            inherited: false,
        }
    }
}

/// Traces particles number `first..first + count` and returns their landings, particle by particle, and the
/// number of rays cast. Landings nearer than `near` to where their particle came from don't count, unless all of its landings
/// are: the scene may be no wider. What the surfaces reflect is not asked: few landings become points.
pub fn trace(
    surfaces: &dyn Surfaces,
    relevance: &Relevance,
    seed: u64,
    first: u64,
    count: usize,
    near: f32,
) -> (Vec<SurfaceHit>, u64) {
    const CHUNK: usize = 256;
    let chunks: Vec<(Vec<SurfaceHit>, u64)> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut landings = Vec::new();
            let mut rays = 0;
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                let particle = first + i as u64;
                let mut s = Stream::new(seed, STAGE, particle);
                rays += trace_one(surfaces, relevance, particle, near, &mut s, &mut landings);
            }
            (landings, rays)
        })
        .collect();
    let rays = chunks.iter().map(|c| c.1).sum();
    (chunks.into_iter().flat_map(|c| c.0).collect(), rays)
}

fn trace_one(
    surfaces: &dyn Surfaces,
    relevance: &Relevance,
    particle: u64,
    near: f32,
    s: &mut Stream,
    landings: &mut Vec<SurfaceHit>,
) -> u64 {
    let deposited = landings.len();
    let start = relevance.start(particle, s);
    let mut last = start.origin;
    let mut from_near = Vec::new();
    let rays = walk(surfaces, start, s, BOUNCES, |bounce, hit, s| {
        if bounce == SKIPPED {
            landings.truncate(deposited);
            from_near.clear();
        }
        let is_near = hit.position.distance_squared(last) <= near * near;
        (if is_near { &mut from_near } else { &mut *landings }).push(*hit);
        last = hit.position;
        relevance.goes_on(hit.position, s)
    });
    if landings.len() == deposited {
        landings.append(&mut from_near);
    }
    rays
}
