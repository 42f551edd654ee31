//! The best hit so far, and which of two sheets that lie on each other a ray meets.
//!
//! Modellers that know no material for backs export a wall as two sheets at the same place that face opposite ways. Which
//! of them is nearer is then a matter of rounding; the one to meet is the one whose front faces the ray, as a rasteriser
//! that culls backs shows it. So a back counts only if no front follows within [`APART`] of its triangle's size,
//! measured across the sheet, plus what the triangle test may err (`ray_setup`).
//!
//! With L = t + tolerance for a back and L = t for a front, fronts count up to the smallest L of all accepted hits. That is a
//! minimum over a set, and whatever lies beyond it changes nothing, so the result doesn't depend on the order of traversal.

use super::layout::{Block, NO_TRIANGLE, UNIT_ROUNDOFF};
use super::ray::Hit;
use super::ray_setup::RaySetup;
use glam::Vec3;

/// How far behind a back a front may lie to be met instead, across the sheet and relative to the largest extent of
/// the back's triangle: 2⁻¹⁵, a tenth of a millimetre on a wall of four metres.
const APART: f32 = 512.0 * UNIT_ROUNDOFF;

/// Rounding of the vertices of both sheets, relative to their coordinates.
const VERTEX_ERROR: f32 = 4.0 * UNIT_ROUNDOFF;

/// What the places at which two triangles report hits may differ by across the ray, and along it (`ray_setup`: 5uM and 12uM
/// for one).
const ACROSS_ERROR: f32 = 10.0 * UNIT_ROUNDOFF;
const ALONG_ERROR: f32 = 24.0 * UNIT_ROUNDOFF;

/// Sine of the angle between ray and sheet below which the tolerance along the ray grows no further.
const LEAST_SINE: f32 = 1.0 / 1024.0;

/// The nearest hit on fronts, or on backs. Of hits at equal t the one with the lowest triangle index.
struct Nearest {
    t: f32,
    triangle: u32,
    hit: Option<Hit>,
}

impl Nearest {
    const NONE: Nearest = Nearest {
        t: f32::INFINITY,
        triangle: NO_TRIANGLE,
        hit: None,
    };

    #[inline(always)]
    fn take(&mut self, t: f32, hit: Hit) -> bool {
        let nearer = t < self.t || (t == self.t && hit.triangle < self.triangle);
        if nearer {
            *self = Nearest {
                t,
                triangle: hit.triangle,
                hit: Some(hit),
            };
        }
        nearer
    }
}

/// The best hit so far.
pub(super) struct Best {
    /// Internal parameter beyond which no hit matters.
    pub limit: f32,
    front: Nearest,
    back: Nearest,
    /// What a step of 1 along the ray rises across the nearest back (internal space).
    back_sine: f32,
}

impl Best {
    #[inline(always)]
    pub(super) fn new(ray: &RaySetup) -> Best {
        Best {
            limit: ray.t_max,
            front: Nearest::NONE,
            back: Nearest::NONE,
            back_sine: 0.0,
        }
    }

    /// Takes a candidate that passed the edge and distance tests, if it may matter and is `accept`ed.
    /// `straddles`: some of its vertices lie behind the origin along k_z.
    #[inline(always)]
    pub(super) fn offer(
        &mut self,
        block: &Block,
        lane: usize,
        ray: &RaySetup,
        t: f32,
        edges: [f32; 3],
        straddles: bool,
        accept: &impl Fn(&Hit) -> bool,
    ) -> bool {
        let triangle = block.triangles[lane];
        let det = edges[0] + edges[1] + edges[2];
        // normal · direction = −det d_z: the edge functions are those of the triangle seen along k_z.
        let is_front = det.is_sign_positive() != (ray.negative[ray.axes[2]] != 0);
        if t > self.limit || (is_front && t == self.front.t && triangle >= self.front.triangle) {
            return false;
        }
        if straddles && !ray.plane_is_ahead(&block.triangle(lane)) {
            return false;
        }
        let hit = hit_of(triangle, ray, t, edges);
        if !accept(&hit) {
            return false;
        }
        if is_front {
            self.limit = t;
            self.front.take(t, hit);
        } else {
            let (tolerance, sine) = tolerance(&block.triangle(lane), ray);
            self.limit = self.limit.min(t + tolerance);
            if self.back.take(t, hit) {
                self.back_sine = sine;
            }
        }
        true
    }

    /// The hit of `ray`, once all that may matter was offered.
    #[inline(always)]
    pub(super) fn hit(&self, ray: &RaySetup) -> Option<Hit> {
        match self.front.hit {
            Some(mut hit) if self.front.t <= self.limit => {
                let nearer = self.front.t - self.back.t;
                if nearer > 0.0 {
                    hit.sheet = nearer * self.back_sine * ray.world_from_internal;
                }
                Some(hit)
            }
            _ => self.back.hit,
        }
    }

    /// Some accepted hit.
    #[inline(always)]
    pub(super) fn some_hit(&self) -> Option<Hit> {
        self.front.hit.or(self.back.hit)
    }
}

/// A hit of a triangle at internal parameter `t`, from its edge functions.
#[inline(always)]
pub(super) fn hit_of(triangle: u32, ray: &RaySetup, t: f32, edges: [f32; 3]) -> Hit {
    let det = edges[0] + edges[1] + edges[2];
    Hit {
        t: ray.world_t(t),
        triangle,
        u: edges[1] / det,
        v: edges[2] / det,
        sheet: 0.0,
    }
}

/// How far along the ray behind this triangle's back a front may lie to be met instead (internal parameter), and what a
/// step of 1 along the ray rises across the triangle.
#[inline(never)]
fn tolerance(triangle: &[[f32; 3]; 3], ray: &RaySetup) -> (f32, f32) {
    let largest = |v: Vec3| v.abs().max_element();
    let [a, b, c] = triangle.map(Vec3::from);
    let origin = Vec3::from(ray.origin);
    let size = largest(b - a).max(largest(c - a)).max(largest(c - b));
    let coordinate = largest(a).max(largest(b)).max(largest(c));
    let distance = largest(a - origin)
        .max(largest(b - origin))
        .max(largest(c - origin));
    let across = APART * size + VERTEX_ERROR * coordinate + ACROSS_ERROR * distance;
    // A normal that underflows is that of a triangle too small to be a wall.
    let normal = (b - a).cross(c - a).try_normalize().unwrap_or(Vec3::ZERO);
    let sine = normal.dot(Vec3::from(ray.direction)).abs();
    (across / sine.max(LEAST_SINE) + ALONG_ERROR * distance, sine)
}
