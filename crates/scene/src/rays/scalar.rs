//! The portable kernel, twin of `avx2`: the same triangle test, operation by operation, so that both report the same
//! hits bit by bit. Boxes only ever cull conservatively, so their rounding may differ.

use super::best::Best;
use super::layout::{BLOCK_WIDTH, Block, LEAF_BIT, NO_TRIANGLE, NODE_WIDTH, Node, STACK_SIZE, Tree};
use super::ray::Hit;
use super::ray_setup::RaySetup;
use super::shaft::BvhPart;

/// The closest accepted hit (`ANY` = false), of sheets that lie on each other the one that faces the ray (`best`), or some
/// accepted hit.
pub(super) fn traverse<const ANY: bool>(
    tree: &Tree,
    ray: &RaySetup,
    accept: &impl Fn(&Hit) -> bool,
) -> Option<Hit> {
    // A stack entry: the child and the parameter at which its box begins.
    let mut stack = [(0u32, 0f32); STACK_SIZE];
    let mut top = 1;
    stack[0] = (0, ray.t_min);
    let mut best = Best::new(ray);
    while top > 0 {
        top -= 1;
        let (child, near) = stack[top];
        if near > best.limit {
            continue;
        }
        if child & LEAF_BIT != 0 {
            let block = &tree.blocks[(child & !LEAF_BIT) as usize];
            if intersect_block(block, ray, &mut best, accept) && ANY {
                return best.some_hit();
            }
            continue;
        }
        let node = &tree.nodes[child as usize];
        let first = top;
        let near = box_entries(node, ray, best.limit);
        for (&child, &near) in node.children.iter().zip(&near) {
            if near == f32::INFINITY {
                continue;
            }
            // Nearest child on top: insertion into at most seven others.
            let mut place = top;
            while !ANY && place > first && stack[place - 1].1 < near {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = (child, near);
            top += 1;
        }
    }
    best.hit(ray)
}

/// Some accepted hit of the parts' triangles.
pub(super) fn meet_among(
    tree: &Tree,
    ray: &RaySetup,
    parts: &[BvhPart],
    accept: &impl Fn(&Hit) -> bool,
) -> Option<Hit> {
    let mut best = Best::new(ray);
    for part in parts.iter().filter(|part| part.is_triangles()) {
        let block = &tree.blocks[(part.0 & !LEAF_BIT) as usize];
        if intersect_block(block, ray, &mut best, accept) {
            break;
        }
    }
    best.some_hit()
}

/// For each child, where the ray enters its box, or infinity where it misses.
#[inline]
fn box_entries(node: &Node, ray: &RaySetup, t_max: f32) -> [f32; NODE_WIDTH] {
    let mut near = [ray.t_min; NODE_WIDTH];
    let mut far = [t_max; NODE_WIDTH];
    for axis in 0..3 {
        let near_planes = &node.planes[2 * axis + ray.negative[axis]];
        let far_planes = &node.planes[2 * axis + 1 - ray.negative[axis]];
        for lane in 0..NODE_WIDTH {
            // Plain products: without hardware support `mul_add` is a library call, and the margins allow it.
            near[lane] = near[lane].max(near_planes[lane] * ray.near_inverse[axis] - ray.near_offset[axis]);
            far[lane] = far[lane].min(far_planes[lane] * ray.far_inverse[axis] - ray.far_offset[axis]);
        }
    }
    for lane in 0..NODE_WIDTH {
        if near[lane] > far[lane] {
            near[lane] = f32::INFINITY;
        }
    }
    near
}

/// Tests the triangles of a block; true if one of them became the best hit.
fn intersect_block(block: &Block, ray: &RaySetup, best: &mut Best, accept: &impl Fn(&Hit) -> bool) -> bool {
    let mut found = false;
    for lane in 0..BLOCK_WIDTH {
        if block.triangles[lane] == NO_TRIANGLE {
            break;
        }
        if let Some((t, edges, straddles)) = intersect(&block.triangle(lane), ray)
            && t >= ray.t_min
        {
            found |= best.offer(block, lane, ray, t, edges, straddles, accept);
        }
    }
    found
}

/// The triangle test described in `ray_setup`: parameter, the three edge functions (barycentric weights times their
/// sum), and whether the triangle straddles the origin. No bound of the ray's interval is applied.
#[inline(always)]
fn intersect(triangle: &[[f32; 3]; 3], ray: &RaySetup) -> Option<(f32, [f32; 3], bool)> {
    let sheared = triangle.map(|vertex| {
        let from_origin = [0, 1, 2].map(|i| vertex[ray.axes[i]] - ray.origin[ray.axes[i]]);
        let [x, y, z] = from_origin;
        [(-ray.shear[0]).mul_add(z, x), (-ray.shear[1]).mul_add(z, y), z]
    });
    let [a, b, c] = sheared;
    let u = difference_of_products(c[0], b[1], c[1], b[0]);
    let v = difference_of_products(a[0], c[1], a[1], c[0]);
    let w = difference_of_products(b[0], a[1], b[1], a[0]);
    let inside = u.min(v).min(w) >= 0.0 || u.max(v).max(w) <= 0.0;
    let det = u + v + w;
    if !inside || det == 0.0 {
        return None;
    }
    let depth = u.mul_add(a[2], v.mul_add(b[2], w * c[2]));
    let t = depth * ray.shear[2] / det;
    let depths = [a[2], b[2], c[2]].map(|z| z * ray.shear[2]);
    let straddles = depths[0].min(depths[1]).min(depths[2]) <= 0.0;
    Some((t, [u, v, w], straddles))
}

/// a b − c d by Kahan's method: relative error of at most two roundings, hence exact sign and exact zero.
#[inline(always)]
fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let cd = c * d;
    let error = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + error
}
