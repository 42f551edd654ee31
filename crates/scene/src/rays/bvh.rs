//! The triangles, arranged, and what can be asked of them.

use super::avx2::Avx2;
use super::layout::{BLOCK_WIDTH, Tree};
use super::ray::{Hit, Ray};
use super::ray_setup::RaySetup;
use super::shaft::{BvhPart, ShaftEnd, ShaftSetup, ShaftStart};
use super::{packet, scalar, shaft};
use glam::Vec3;

/// The code that traverses the hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// Portable code, for any processor.
    Scalar,
    /// AVX2 with fused multiply-add.
    Avx2,
}

impl Kernel {
    /// The fastest kernel that this processor runs.
    pub fn detect() -> Kernel {
        if Avx2::detect().is_some() {
            Kernel::Avx2
        } else {
            Kernel::Scalar
        }
    }
}

/// Triangles, arranged for ray casting. Shared freely between threads.
pub struct TriangleBvh {
    pub(super) tree: Tree,
    /// The SIMD kernel, decided once at build.
    pub(super) simd: Option<Avx2>,
    pub(super) dropped: usize,
    pub(super) bounds: Option<(Vec3, Vec3)>,
    /// Per input triangle its block and lane, or `u32::MAX` if it was left out.
    pub(super) slots: Vec<u32>,
}

impl TriangleBvh {
    /// Number of triangles that were left out because a vertex is not finite or does not exist.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Lower and upper corner of the axis-aligned box around all triangles (world space); `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.bounds
    }

    /// The kernel in use.
    pub fn kernel(&self) -> Kernel {
        if self.simd.is_some() {
            Kernel::Avx2
        } else {
            Kernel::Scalar
        }
    }

    /// The same triangles, traversed by `kernel` if this processor runs it, otherwise by the portable one. For tests and
    /// comparisons: results do not depend on the kernel.
    pub fn with_kernel(mut self, kernel: Kernel) -> TriangleBvh {
        self.simd = if kernel == Kernel::Avx2 {
            Avx2::detect()
        } else {
            None
        };
        self
    }

    /// The vertices of a triangle (world space), or `None` if it was left out or does not exist.
    pub fn triangle(&self, triangle: u32) -> Option<[Vec3; 3]> {
        let slot = *self.slots.get(triangle as usize)? as usize;
        let block = self.tree.blocks.get(slot / BLOCK_WIDTH)?;
        let world_from_internal = 1.0 / self.tree.internal_from_world;
        let world = |c: f32| (f64::from(c) * world_from_internal) as f32;
        // Written out: `map` of an array of arrays is a call per vertex, 3 % of a bake.
        let [a, b, c] = block.triangle(slot % BLOCK_WIDTH);
        let vertex = |[x, y, z]: [f32; 3]| Vec3::new(world(x), world(y), world(z));
        Some([vertex(a), vertex(b), vertex(c)])
    }

    /// The closest hit. Of sheets that lie on each other it is the one whose front (vertices counter-clockwise) faces the
    /// ray, of several at the same t the one with the lowest triangle index.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_hit_where(ray, |_| true)
    }

    /// The closest hit that `accept` takes; rays pass through the others (alpha masks).
    ///
    /// `accept` is asked about any hit on the way, not only the closest, and in no particular order.
    pub fn closest_hit_where(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.traverse::<false>(ray, accept)
    }

    /// Whether the ray hits anything.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.any_hit_where(ray, |_| true)
    }

    /// Whether the ray hits anything that `accept` takes; rays pass through the rest (alpha masks).
    pub fn any_hit_where(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        self.some_hit_where(ray, accept).is_some()
    }

    /// Some hit that `accept` takes, not always the closest.
    pub fn some_hit_where(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.traverse::<true>(ray, accept)
    }

    /// Whether each of `rays` hits anything: `occluded[i]` is what [`any_hit`](Self::any_hit) returns for `rays[i]`.
    ///
    /// Right for any rays, faster than single calls for rays that share their origin or their target and lie close to
    /// each other in the slice. If the slices differ in length, the shorter one counts.
    pub fn any_hit_packet(&self, rays: &[Ray], occluded: &mut [bool]) {
        packet::any_hit_packet::<true>(&self.tree, self.simd, rays, occluded, &|_, _| true);
    }

    /// As [`any_hit_packet`](Self::any_hit_packet) of what `accept` takes, asked with the ray's number: `occluded[i]` is what
    /// [`any_hit_where`](Self::any_hit_where) returns for `rays[i]`.
    pub fn any_hit_packet_where(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        accept: impl Fn(usize, &Hit) -> bool,
    ) {
        packet::any_hit_packet::<false>(&self.tree, self.simd, rays, occluded, &accept);
    }

    /// The closest hit of each of `rays` that `accept` takes, asked with the ray's number: `hits[i]` is what
    /// [`closest_hit_where`](Self::closest_hit_where) returns for `rays[i]`.
    ///
    /// Right for any rays, faster than single calls for rays that start at one place and lie close to each other in the slice. If the
    /// slices differ in length, the shorter one counts.
    pub fn closest_hit_packet(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accept: impl Fn(usize, &Hit) -> bool,
    ) {
        packet::closest_hit_packet(&self.tree, self.simd, rays, hits, &accept);
    }

    /// Appends to `kept` what rays within the shaft may meet of `among`, with up to `steps` boxes of boxes opened: the rest
    /// stays whole. `false` if it is more than `most` parts; then only some are appended.
    pub fn narrow(
        &self,
        start: &ShaftStart,
        end: &ShaftEnd,
        among: &[BvhPart],
        steps: usize,
        most: usize,
        kept: &mut Vec<BvhPart>,
    ) -> bool {
        if let Some(simd) = self.simd {
            return simd.narrow(&self.tree, (start, end), among, steps, most, kept);
        }
        ShaftSetup::new(&self.tree, start, end)
            .is_some_and(|shaft| shaft::narrow(&self.tree, &shaft, among, steps, most, kept))
    }

    /// As [`TriangleBvh::some_hit_where`], of the triangles of some parts of this hierarchy; of those parts that are not
    /// a few triangles, nothing is met.
    pub fn some_hit_among(&self, ray: &Ray, parts: &[BvhPart], accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        if let Some(simd) = self.simd {
            return simd.cast_among(&self.tree, ray, parts, &accept);
        }
        let setup = RaySetup::new(&self.tree, ray)?;
        scalar::meet_among(&self.tree, &setup, parts, &accept)
    }

    #[inline(always)]
    fn traverse<const ANY: bool>(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        if let Some(simd) = self.simd {
            return simd.cast::<ANY>(&self.tree, ray, &accept);
        }
        let setup = RaySetup::new(&self.tree, ray)?;
        scalar::traverse::<ANY>(&self.tree, &setup, &accept)
    }
}
