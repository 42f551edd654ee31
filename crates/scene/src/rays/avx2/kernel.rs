//! The kernel for single rays, compiled for AVX2.

use std::arch::x86_64::*;
use std::mem::MaybeUninit;

use super::super::best::Best;
use super::super::layout::{Block, LEAF_BIT, Node, STACK_SIZE, Tree};
use super::super::ray::{Hit, Ray};
use super::super::ray_setup::RaySetup;
use super::super::shaft::{self, BvhPart, ShaftEnd, ShaftSetup, ShaftStart};

#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn cast<const ANY: bool>(tree: &Tree, ray: &Ray, accept: &impl Fn(&Hit) -> bool) -> Option<Hit> {
    let setup = RaySetup::new(tree, ray)?;
    traverse::<ANY>(tree, &setup, 0, accept)
}

/// The portable code, compiled for these instructions: its loops over lanes become vectors.
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn narrow(
    tree: &Tree,
    (start, end): (&ShaftStart, &ShaftEnd),
    among: &[BvhPart],
    steps: usize,
    most: usize,
    kept: &mut Vec<BvhPart>,
) -> bool {
    ShaftSetup::new(tree, start, end)
        .is_some_and(|shaft| shaft::narrow(tree, &shaft, among, steps, most, kept))
}

#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn cast_among(
    tree: &Tree,
    ray: &Ray,
    parts: &[BvhPart],
    accept: &impl Fn(&Hit) -> bool,
) -> Option<Hit> {
    let setup = RaySetup::new(tree, ray)?;
    let lanes = Lanes::new(&setup);
    let mut best = Best::new(&setup);
    for part in parts.iter().filter(|part| part.is_triangles()) {
        let block = &tree.blocks[(part.0 & !LEAF_BIT) as usize];
        if meet_triangles(block, &setup, &lanes, &mut best, accept) {
            break;
        }
    }
    best.some_hit()
}

/// The per-ray constants in registers.
struct Lanes {
    /// Where in a node's planes the near bounds of each axis begin (index of the plane).
    near_plane: [usize; 3],
    near_inverse: [__m256; 3],
    near_offset: [__m256; 3],
    far_inverse: [__m256; 3],
    far_offset: [__m256; 3],
    t_min: __m256,
    origin: [__m128; 3],
    shear: [__m128; 3],
}

impl Lanes {
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
    fn new(ray: &RaySetup) -> Lanes {
        let wide = |v: [f32; 3]| [_mm256_set1_ps(v[0]), _mm256_set1_ps(v[1]), _mm256_set1_ps(v[2])];
        let [x, y, z] = ray.axes;
        Lanes {
            near_plane: [ray.negative[0], 2 + ray.negative[1], 4 + ray.negative[2]],
            near_inverse: wide(ray.near_inverse),
            near_offset: wide(ray.near_offset),
            far_inverse: wide(ray.far_inverse),
            far_offset: wide(ray.far_offset),
            t_min: _mm256_set1_ps(ray.t_min),
            origin: [
                _mm_set1_ps(ray.origin[x]),
                _mm_set1_ps(ray.origin[y]),
                _mm_set1_ps(ray.origin[z]),
            ],
            shear: [
                _mm_set1_ps(-ray.shear[0]),
                _mm_set1_ps(-ray.shear[1]),
                _mm_set1_ps(ray.shear[2]),
            ],
        }
    }
}

/// Traversal from `root` on.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn traverse<const ANY: bool>(
    tree: &Tree,
    ray: &RaySetup,
    root: u32,
    accept: &impl Fn(&Hit) -> bool,
) -> Option<Hit> {
    let mut best = Best::new(ray);
    improve::<ANY>(tree, ray, root, &mut best, accept);
    if ANY { best.some_hit() } else { best.hit(ray) }
}

/// Offers `best` what the ray meets from `root` on; of an any-hit query, until one is taken. Stack entries of a closest-hit query hold
/// the parameter at which the child's box begins in their upper half, whose bits order like the number, since it is not negative.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn improve<const ANY: bool>(
    tree: &Tree,
    ray: &RaySetup,
    root: u32,
    best: &mut Best,
    accept: &impl Fn(&Hit) -> bool,
) {
    let lanes = Lanes::new(ray);
    let mut stack = [MaybeUninit::<u64>::uninit(); STACK_SIZE];
    let mut top = 0usize;
    let mut current = root;
    let mut near_of = [0f32; 8];
    loop {
        if current & LEAF_BIT == 0 {
            // SAFETY: references without the leaf bit are indices of `nodes`.
            let node = unsafe { tree.nodes.get_unchecked(current as usize) };
            let (near, mut mask) = meet_boxes(node, &lanes, best.limit);
            if mask != 0 {
                // SAFETY (pushes): a node leaves at most seven children waiting, and `STACK_SIZE` has room for
                // seven per level of the deepest tree that the builder makes.
                let push = |stack: &mut [MaybeUninit<u64>; STACK_SIZE], top: &mut usize, entry: u64| unsafe {
                    stack.get_unchecked_mut(*top).write(entry);
                    *top += 1;
                };
                let first = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                if mask == 0 {
                    current = node.children[first];
                    continue;
                }
                if ANY {
                    current = node.children[first];
                    while mask != 0 {
                        let lane = mask.trailing_zeros() as usize & 7;
                        mask &= mask - 1;
                        push(&mut stack, &mut top, u64::from(node.children[lane]));
                    }
                    continue;
                }
                // SAFETY: the array holds eight floats.
                unsafe { _mm256_storeu_ps(near_of.as_mut_ptr(), near) };
                let entry =
                    |lane: usize| (u64::from(near_of[lane].to_bits()) << 32) | u64::from(node.children[lane]);
                let a = entry(first);
                let lane = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                let b = entry(lane);
                let (a, b) = (a.min(b), a.max(b));
                if mask == 0 {
                    push(&mut stack, &mut top, b);
                    current = a as u32;
                    continue;
                }
                let lane = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                let c = entry(lane);
                let (b, c) = (b.min(c), b.max(c));
                let (a, b) = (a.min(b), a.max(b));
                if mask == 0 {
                    push(&mut stack, &mut top, c);
                    push(&mut stack, &mut top, b);
                    current = a as u32;
                    continue;
                }
                // Four and more: insertion, the nearest on top.
                let base = top;
                push(&mut stack, &mut top, c);
                push(&mut stack, &mut top, b);
                push(&mut stack, &mut top, a);
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    let new = entry(lane);
                    push(&mut stack, &mut top, new);
                    let mut place = top - 1;
                    // SAFETY: all entries from `base` to `top` were written above.
                    unsafe {
                        while place > base && stack.get_unchecked(place - 1).assume_init() < new {
                            *stack.get_unchecked_mut(place) = *stack.get_unchecked(place - 1);
                            place -= 1;
                        }
                        stack.get_unchecked_mut(place).write(new);
                    }
                }
                top -= 1;
                // SAFETY: entry `top` was written above.
                current = unsafe { stack.get_unchecked(top).assume_init() } as u32;
                continue;
            }
        } else {
            // SAFETY: references with the leaf bit are indices of `blocks`.
            let block = unsafe { tree.blocks.get_unchecked((current & !LEAF_BIT) as usize) };
            if meet_triangles(block, ray, &lanes, best, accept) && ANY {
                return;
            }
        }
        loop {
            if top == 0 {
                return;
            }
            top -= 1;
            // SAFETY: all entries below `top` were written.
            let entry = unsafe { stack.get_unchecked(top).assume_init() };
            if ANY || f32::from_bits((entry >> 32) as u32) <= best.limit {
                current = entry as u32;
                break;
            }
        }
    }
}

/// Where the ray enters each child's box, and which boxes it meets before `t_max`.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn meet_boxes(node: &Node, lanes: &Lanes, t_max: f32) -> (__m256, u32) {
    let near = |axis: usize| {
        // SAFETY: the near planes are the lower or upper ones of the axis, eight aligned floats at an index below 6.
        let plane = unsafe { _mm256_load_ps(node.planes.get_unchecked(lanes.near_plane[axis]).as_ptr()) };
        _mm256_fmsub_ps(plane, lanes.near_inverse[axis], lanes.near_offset[axis])
    };
    let far = |axis: usize| {
        // SAFETY: as above; flipping the lowest bit turns lower into upper planes and back.
        let plane = unsafe { _mm256_load_ps(node.planes.get_unchecked(lanes.near_plane[axis] ^ 1).as_ptr()) };
        _mm256_fmsub_ps(plane, lanes.far_inverse[axis], lanes.far_offset[axis])
    };
    let enter = _mm256_max_ps(
        _mm256_max_ps(near(0), near(1)),
        _mm256_max_ps(near(2), lanes.t_min),
    );
    let leave = _mm256_min_ps(
        _mm256_min_ps(far(0), far(1)),
        _mm256_min_ps(far(2), _mm256_set1_ps(t_max)),
    );
    let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave));
    (enter, mask as u32)
}

/// Tests four triangles; true if one of them became the best hit. See `scalar::intersect` for the steps.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn meet_triangles(
    block: &Block,
    ray: &RaySetup,
    lanes: &Lanes,
    best: &mut Best,
    accept: &impl Fn(&Hit) -> bool,
) -> bool {
    let [x, y, z] = ray.axes;
    let vertex = |index: usize| {
        // SAFETY: axes are below 3, and each holds four aligned floats.
        let load = |axis: usize| unsafe { _mm_load_ps(block.vertices[index].get_unchecked(axis).as_ptr()) };
        let dx = _mm_sub_ps(load(x), lanes.origin[0]);
        let dy = _mm_sub_ps(load(y), lanes.origin[1]);
        let dz = _mm_sub_ps(load(z), lanes.origin[2]);
        (
            _mm_fmadd_ps(lanes.shear[0], dz, dx),
            _mm_fmadd_ps(lanes.shear[1], dz, dy),
            dz,
        )
    };
    let (a, b, c) = (vertex(0), vertex(1), vertex(2));
    let u = difference_of_products(c.0, b.1, c.1, b.0);
    let v = difference_of_products(a.0, c.1, a.1, c.0);
    let w = difference_of_products(b.0, a.1, b.1, a.0);
    let zero = _mm_setzero_ps();
    let positive = _mm_cmpge_ps(_mm_min_ps(_mm_min_ps(u, v), w), zero);
    let negative = _mm_cmple_ps(_mm_max_ps(_mm_max_ps(u, v), w), zero);
    let inside = _mm_or_ps(positive, negative);
    if _mm_movemask_ps(inside) == 0 {
        return false;
    }
    let det = _mm_add_ps(_mm_add_ps(u, v), w);
    let depth = _mm_fmadd_ps(u, a.2, _mm_fmadd_ps(v, b.2, _mm_mul_ps(w, c.2)));
    let t = _mm_div_ps(_mm_mul_ps(depth, lanes.shear[2]), det);
    let reached = _mm_and_ps(
        _mm_cmpge_ps(t, _mm_set1_ps(ray.t_min)),
        _mm_cmple_ps(t, _mm_set1_ps(best.limit)),
    );
    let mask = _mm_and_ps(_mm_and_ps(inside, reached), _mm_cmpneq_ps(det, zero));
    let mut mask = _mm_movemask_ps(mask) as u32;
    if mask == 0 {
        return false;
    }
    // Depths have the ray's sign once multiplied by S_z; the smallest tells whether a vertex is behind.
    let behind = |depth: __m128| _mm_cmple_ps(_mm_mul_ps(depth, lanes.shear[2]), zero);
    let straddles = _mm_movemask_ps(_mm_or_ps(_mm_or_ps(behind(a.2), behind(b.2)), behind(c.2))) as u32;
    let array = |v: __m128| {
        let mut out = [0f32; 4];
        // SAFETY: the array holds four floats.
        unsafe { _mm_storeu_ps(out.as_mut_ptr(), v) };
        out
    };
    let (t, u, v, w) = (array(t), array(u), array(v), array(w));
    let mut found = false;
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize & 3;
        mask &= mask - 1;
        let straddles = straddles >> lane & 1 != 0;
        found |= best.offer(
            block,
            lane,
            ray,
            t[lane],
            [u[lane], v[lane], w[lane]],
            straddles,
            accept,
        );
    }
    found
}

/// a b − c d by Kahan's method; the twin of the function of the same name in `scalar`.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn difference_of_products(a: __m128, b: __m128, c: __m128, d: __m128) -> __m128 {
    let cd = _mm_mul_ps(c, d);
    let error = _mm_fnmadd_ps(c, d, cd);
    _mm_add_ps(_mm_fmsub_ps(a, b, cd), error)
}

/// The same for eight lanes.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn difference_of_products_8(a: __m256, b: __m256, c: __m256, d: __m256) -> __m256 {
    let cd = _mm256_mul_ps(c, d);
    let error = _mm256_fnmadd_ps(c, d, cd);
    _mm256_add_ps(_mm256_fmsub_ps(a, b, cd), error)
}
