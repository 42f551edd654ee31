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
mod best;
mod build;
mod bvh;
mod collapse;
mod kept;
mod layout;
mod packet;
mod ray;
mod ray_setup;
mod scalar;
mod secondary;
mod shaft;

pub use bvh::{Kernel, TriangleBvh};
pub use ray::{Hit, Ray, SurfacePoint};
pub use secondary::{
    TriangleSurface, hit_position, offset_origin, ray_from_surface, shadow_ray, shadow_ray_to_point,
    surface_point,
};
pub use shaft::{BvhPart, ShaftEnd, ShaftStart};
