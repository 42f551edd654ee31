//! From triangles to a [`TriangleBvh`]: what is kept, the frames it is stored in, and the binary hierarchy.

use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

use super::avx2::Avx2;
use super::bvh::TriangleBvh;
use super::collapse::collapse;
use super::kept::{Bounds, Kept};
use super::layout::{BLOCK_WIDTH, HIT_ERROR, NO_TRIANGLE, Tree, UNIT_ROUNDOFF};

impl TriangleBvh {
    /// Builds the hierarchy over `triangles`, triples of indices into `positions` (world space, metres).
    ///
    /// Triangles with a non-finite vertex, or with an index beyond `positions`, are left out and counted. About
    /// 1 µs per triangle.
    pub fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> TriangleBvh {
        build(positions, triangles)
    }
}

/// See [`TriangleBvh::build`].
fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> TriangleBvh {
    let corners = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|i| positions.get(i as usize).copied().filter(|p| p.is_finite()));
        Some([a?, b?, c?])
    };
    let finite: Vec<(u32, [Vec3; 3])> = (0u32..)
        .zip(triangles)
        .filter_map(|(i, triangle)| Some((i, corners(triangle)?)))
        .collect();
    let (mut low, mut high) = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
    for vertex in finite.iter().flat_map(|(_, vertices)| vertices) {
        low = low.min(*vertex);
        high = high.max(*vertex);
    }
    let mut bvh = TriangleBvh {
        tree: Tree {
            nodes: vec![],
            blocks: vec![],
            internal_from_world: 1.0,
            anchor: [0.0; 3],
            extent: 0.0,
        },
        simd: Avx2::detect(),
        dropped: triangles.len() - finite.len(),
        bounds: None,
        slots: vec![NO_TRIANGLE; triangles.len()],
    };
    if finite.is_empty() {
        return bvh;
    }
    bvh.bounds = Some((low, high));

    let internal_from_world = power_of_two_below_inverse(low.abs().max(high.abs()).max_element());
    let internal = |v: Vec3| (v.as_dvec3() * internal_from_world).as_vec3();
    // The point of the scene's box nearest to the origin: coordinates relative to it are never larger than absolute ones.
    let anchor = Vec3::ZERO.clamp(internal(low), internal(high));
    let kept: Vec<Kept> = finite
        .iter()
        .map(|&(triangle, vertices)| {
            let vertices = vertices.map(internal);
            Kept {
                triangle,
                vertices,
                bounds: padded_bounds(vertices, anchor),
            }
        })
        .collect();
    let bounds = kept
        .iter()
        .fold(Bounds::EMPTY, |all, triangle| all.union(triangle.bounds));
    let (nodes, blocks) = collapse(&binary_tree(&kept, bounds), &kept);
    for (slot, triangle) in blocks.iter().flat_map(|block| block.triangles).enumerate() {
        if triangle != NO_TRIANGLE {
            bvh.slots[triangle as usize] = slot as u32;
        }
    }
    debug_assert_eq!(
        blocks.first().map_or(0, |block| block.triangles.len()),
        BLOCK_WIDTH
    );
    bvh.tree = Tree {
        nodes,
        blocks,
        internal_from_world,
        anchor: anchor.to_array(),
        extent: bounds.low.abs().max(bounds.high.abs()).max_element(),
    };
    bvh
}

/// The power of two that brings `largest` into [1, 2); 1 for zero.
fn power_of_two_below_inverse(largest: f32) -> f64 {
    if largest == 0.0 {
        return 1.0;
    }
    let exponent = (f64::from(largest).to_bits() >> 52) & 0x7ff;
    f64::from_bits((2046 - exponent) << 52)
}

/// The box of a triangle relative to `anchor`, widened by what the triangle test and the slab test may be off
/// (`ray_setup`), rounded outward.
fn padded_bounds(vertices: [Vec3; 3], anchor: Vec3) -> Bounds {
    let [a, b, c] = vertices.map(|v| v.as_dvec3() - anchor.as_dvec3());
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let size = (high - low).max_element() * f64::from(HIT_ERROR);
    let plane = low.abs().max(high.abs()) * f64::from(4.0 * UNIT_ROUNDOFF);
    let padding = DVec3::splat(size) + plane;
    let down = |x: f64| (x as f32).next_down();
    let up = |x: f64| (x as f32).next_up();
    let (low, high) = (low - padding, high + padding);
    Bounds {
        low: Vec3::new(down(low.x), down(low.y), down(low.z)),
        high: Vec3::new(up(high.x), up(high.y), up(high.z)),
    }
}

/// A binary hierarchy with one triangle per leaf. Boxes are first brought into the unit cube, where the builder's
/// areas neither overflow nor vanish; only its topology is used.
fn binary_tree(kept: &[Kept], bounds: Bounds) -> Bvh2 {
    let size = (bounds.high - bounds.low).max_element();
    // All vertices at one point leave a denormal size, from the outward rounding, with no finite inverse.
    let scale = if size.is_normal() { 1.0 / size } else { 1.0 };
    let unit = |v: Vec3| Vec3A::from((v - bounds.low) * scale);
    let boxes: Vec<Aabb> = kept
        .iter()
        .map(|k| Aabb::new(unit(k.bounds.low), unit(k.bounds.high)))
        .collect();
    let params = BvhBuildParams {
        max_prims_per_leaf: 1,
        ..BvhBuildParams::medium_build()
    };
    obvhs::bvh2::builder::build_bvh2(&boxes, params, &mut Default::default())
}
