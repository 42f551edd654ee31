//! The AVX2 kernel: a ray meets the eight boxes of a node, or the four triangles of a block, at once.
//!
//! Twin of `scalar`; the triangle test is the same operation by operation. All of the module's `unsafe` is of two
//! kinds: calling code compiled for AVX2, which [`Avx2`] proves to be possible, and reading nodes, blocks and stack
//! entries without bounds checks, which the shape of [`Tree`] allows.
#![allow(unsafe_code)] // SIMD intrinsics; every block states why it is sound, and tests compare with `scalar`.

mod closest_packet;
mod kernel;
mod packet;

use super::layout::Tree;
use super::ray::{Hit, Ray};
use super::shaft::{BvhPart, ShaftEnd, ShaftStart};

/// Proof that the processor has the instructions that this module is compiled for.
#[derive(Clone, Copy)]
pub(super) struct Avx2(());

impl Avx2 {
    pub(super) fn detect() -> Option<Avx2> {
        let found = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("popcnt");
        found.then_some(Avx2(()))
    }

    /// The closest accepted hit (`ANY` = false) or some accepted hit.
    #[inline(always)]
    pub(super) fn cast<const ANY: bool>(
        self,
        tree: &Tree,
        ray: &Ray,
        accept: &impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        // SAFETY: a value of this type exists only where `detect` found the instructions.
        unsafe { kernel::cast::<ANY>(tree, ray, accept) }
    }

    /// See [`super::TriangleBvh::narrow`].
    pub(super) fn narrow(
        self,
        tree: &Tree,
        shaft: (&ShaftStart, &ShaftEnd),
        among: &[BvhPart],
        steps: usize,
        most: usize,
        kept: &mut Vec<BvhPart>,
    ) -> bool {
        // SAFETY: a value of this type exists only where `detect` found the instructions.
        unsafe { kernel::narrow(tree, shaft, among, steps, most, kept) }
    }

    /// Some accepted hit of the parts' triangles.
    #[inline(always)]
    pub(super) fn cast_among(
        self,
        tree: &Tree,
        ray: &Ray,
        parts: &[BvhPart],
        accept: &impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        // SAFETY: a value of this type exists only where `detect` found the instructions.
        unsafe { kernel::cast_among(tree, ray, parts, accept) }
    }

    /// See [`super::TriangleBvh::any_hit_packet_where`]. `ALL`: `accept` takes all.
    #[inline(always)]
    pub(super) fn any_hit_packet<const ALL: bool>(
        self,
        tree: &Tree,
        rays: &[Ray],
        occluded: &mut [bool],
        accept: &impl Fn(usize, &Hit) -> bool,
    ) {
        // SAFETY: a value of this type exists only where `detect` found the instructions.
        unsafe { packet::any_hit_packet::<ALL>(tree, rays, occluded, accept) }
    }

    /// See [`super::TriangleBvh::closest_hit_packet`].
    #[inline(always)]
    pub(super) fn closest_hit_packet(
        self,
        tree: &Tree,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        accept: &impl Fn(usize, &Hit) -> bool,
    ) {
        // SAFETY: a value of this type exists only where `detect` found the instructions.
        unsafe { closest_packet::closest_hit_packet(tree, rays, hits, accept) }
    }
}
