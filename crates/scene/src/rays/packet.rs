//! Rays in packets.

use super::avx2::Avx2;
use super::layout::Tree;
use super::ray::{Hit, Ray};
use super::ray_setup::RaySetup;
use super::scalar;

/// See [`super::TriangleBvh::any_hit_packet_where`]. `ALL`: `accept` takes all.
#[inline(always)]
pub(super) fn any_hit_packet<const ALL: bool>(
    tree: &Tree,
    simd: Option<Avx2>,
    rays: &[Ray],
    occluded: &mut [bool],
    accept: &impl Fn(usize, &Hit) -> bool,
) {
    if let Some(simd) = simd {
        simd.any_hit_packet::<ALL>(tree, rays, occluded, accept);
        return;
    }
    for (i, (ray, occluded)) in rays.iter().zip(occluded).enumerate() {
        let hit = RaySetup::new(tree, ray)
            .and_then(|setup| scalar::traverse::<true>(tree, &setup, &|hit: &Hit| accept(i, hit)));
        *occluded = hit.is_some();
    }
}

/// See [`super::TriangleBvh::closest_hit_packet`].
#[inline(always)]
pub(super) fn closest_hit_packet(
    tree: &Tree,
    simd: Option<Avx2>,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
    accept: &impl Fn(usize, &Hit) -> bool,
) {
    if let Some(simd) = simd {
        simd.closest_hit_packet(tree, rays, hits, accept);
        return;
    }
    for (i, (ray, hit)) in rays.iter().zip(hits).enumerate() {
        *hit = RaySetup::new(tree, ray)
            .and_then(|setup| scalar::traverse::<false>(tree, &setup, &|hit: &Hit| accept(i, hit)));
    }
}
