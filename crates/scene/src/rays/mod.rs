//! Ray casting: closest hit, any hit, and packets of shadow rays over a static set of triangles.
//!
//! A binary hierarchy from `obvhs` (PLOC with reinsertion) is collapsed to eight-wide nodes by the optimal merging of
//! Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs" (HPG 2017,
//! section 3.1), uncompressed here. Traversal is our own (`avx2`, `scalar`), because obvhs's loses hits on axis-aligned,
//! tiny and huge scenes. The triangle test is watertight and the box test conservative at every scale; `ray_setup` derives
//! both.
//!
//! What a query returns depends on the ray and the triangles alone: not on the kernel, the thread, nor on the order of
//! traversal. Single rays and packets, AVX2 and scalar code agree bit by bit.

#[cfg_attr(not(target_arch = "x86_64"), path = "avx2_absent.rs")]
mod avx2;
mod build;
mod collapse;
mod layout;
mod packet;
mod ray_setup;
mod scalar;
mod secondary;
mod shaft;

use glam::Vec3;

pub use secondary::{
    SurfacePoint, hit_position, offset_origin, ray_from_surface, shadow_ray, shadow_ray_to_point,
    surface_point,
};

pub use shaft::{BvhPart, ShaftEnd, ShaftStart};

use avx2::Avx2;
use layout::{BLOCK_WIDTH, Tree};
use ray_setup::RaySetup;
use shaft::ShaftSetup;

/// A part of a straight line: `origin + t * direction` for `t_min <= t <= t_max`, in world space.
///
/// `direction` need not be of unit length; t counts in units of its length. A negative `t_min` counts as 0. A ray with
/// a NaN, an infinite origin or direction, or no direction, hits nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start of the ray (metres).
    pub origin: Vec3,
    /// Direction, of any length.
    pub direction: Vec3,
    /// Smallest parameter of a hit, inclusive.
    pub t_min: f32,
    /// Largest parameter of a hit, inclusive; may be infinite.
    pub t_max: f32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Parameter along the ray, in units of its direction's length.
    pub t: f32,
    /// Index of the triangle in the input of [`TriangleBvh::build`].
    pub triangle: u32,
    /// Barycentric weight of the triangle's vertex 1, in [0, 1].
    pub u: f32,
    /// Barycentric weight of the triangle's vertex 2, in [0, 1]; vertex 0 has 1 − u − v.
    pub v: f32,
}

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
    tree: Tree,
    /// The SIMD kernel, decided once at build.
    simd: Option<Avx2>,
    dropped: usize,
    bounds: Option<(Vec3, Vec3)>,
    /// Per input triangle its block and lane, or `u32::MAX` if it was left out.
    slots: Vec<u32>,
}

impl TriangleBvh {
    /// Builds the hierarchy over `triangles`, triples of indices into `positions` (world space, metres).
    ///
    /// Triangles with a non-finite vertex, or with an index beyond `positions`, are left out and counted. About
    /// 1 µs per triangle.
    pub fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> TriangleBvh {
        build::build(positions, triangles)
    }

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

    /// The closest hit; of several at the same t the one with the lowest triangle index.
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
        packet::any_hit_packet(&self.tree, self.simd, rays, occluded);
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
