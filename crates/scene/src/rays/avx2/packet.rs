//! Shadow rays in packets of sixteen: one box, or one triangle, meets eight rays at once.
//!
//! Rays are first sorted by the signs of their direction, and by their dominant axis, within windows of the input. A packet
//! then descends together; a box is tested against the bounds of all its rays (interval arithmetic on origins and
//! inverse directions, as in Boulos et al., "Geometric and Arithmetic Culling Methods for Entire Ray Packets", 2006)
//! before the rays themselves are asked. Once few rays are left in a subtree they go on singly.
//!
//! Whether a ray hits something depends on the triangle test alone, which repeats the single one operation by
//! operation; so packets return what single rays return. `closest_packet` looks for the closest hits by the same parts.

use std::arch::x86_64::*;

use super::super::best::hit_of;
use super::super::layout::{Block, LEAF_BIT, NO_TRIANGLE, Node, STACK_SIZE, Tree, UNIT_ROUNDOFF};
use super::super::ray::{Hit, Ray};
use super::super::ray_setup::RaySetup;
use super::kernel::{difference_of_products_8, traverse};

/// Rays that are sorted together: their setups (25 KB) stay in the first-level cache.
pub(super) const WINDOW: usize = 128;

/// Vectors of eight rays per packet: sixteen rays, as in the packets that measured best for Embree.
pub(super) const GROUPS: usize = 2;
pub(super) const LANES: usize = 8;
pub(super) const PACKET: usize = GROUPS * LANES;

/// With at most this many rays left in a subtree, single traversal is faster (docs/notebook/rays.md).
pub(super) const FEW: u32 = 5;

/// See [`super::super::TriangleBvh::any_hit_packet_where`]. `ALL`: `accept` takes all.
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn any_hit_packet<const ALL: bool>(
    tree: &Tree,
    rays: &[Ray],
    occluded: &mut [bool],
    accept: &impl Fn(usize, &Hit) -> bool,
) {
    let count = rays.len().min(occluded.len());
    occluded[..count].fill(false);
    let mut sorted = Sorted::new();
    let windows = rays[..count].chunks(WINDOW).zip(occluded.chunks_mut(WINDOW));
    for (window, (rays, occluded)) in windows.enumerate() {
        sorted.sort(tree, rays);
        for members in sorted.packets() {
            let setups = sorted.of_packet(members);
            let hits = cast_packet::<ALL>(tree, &setups, members.len(), &|lane, hit| {
                accept(window * WINDOW + place(members[lane]), hit)
            });
            for (lane, member) in members.iter().enumerate() {
                occluded[place(*member)] = hits >> lane & 1 != 0;
            }
        }
    }
}

/// Rays of a window, alike ones together.
pub(super) struct Sorted {
    setups: Vec<RaySetup>,
    /// Signs (3 bits), dominant axis (2), place in the window (8), place in `setups` (8).
    order: Vec<u32>,
}

/// Place of a member of [`Sorted`] in its window.
pub(super) fn place(member: u32) -> usize {
    (member >> 8 & 0xff) as usize
}

impl Sorted {
    pub(super) fn new() -> Sorted {
        Sorted {
            setups: Vec::with_capacity(WINDOW),
            order: Vec::with_capacity(WINDOW),
        }
    }

    /// Takes the rays of a window that can hit something.
    #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
    pub(super) fn sort(&mut self, tree: &Tree, rays: &[Ray]) {
        self.setups.clear();
        self.order.clear();
        for (index, ray) in rays.iter().enumerate().take(WINDOW) {
            if let Some(setup) = RaySetup::new(tree, ray) {
                let [x, y, z] = setup.negative;
                let class = (x + 2 * y + 4 * z) * 4 + setup.axes[2];
                self.order
                    .push((class << 16 | index << 8 | self.setups.len()) as u32);
                self.setups.push(setup);
            }
        }
        self.order.sort_unstable();
    }

    /// Up to sixteen members each, whose directions have the same signs.
    pub(super) fn packets(&self) -> impl Iterator<Item = &[u32]> {
        let same_signs = self.order.chunk_by(|a, b| a >> 18 == b >> 18);
        same_signs.flat_map(|members| members.chunks(PACKET))
    }

    /// The rays of a packet; unused slots repeat one of them.
    pub(super) fn of_packet(&self, members: &[u32]) -> [&RaySetup; PACKET] {
        let setup = |member: u32| &self.setups[(member & 0xff) as usize];
        let mut rays = [setup(members[0]); PACKET];
        for (slot, member) in rays.iter_mut().zip(members) {
            *slot = setup(*member);
        }
        rays
    }
}

/// Eight rays, one per lane.
pub(super) struct Group {
    near_inverse: [__m256; 3],
    near_offset: [__m256; 3],
    far_inverse: [__m256; 3],
    far_offset: [__m256; 3],
    t_min: __m256,
    pub(super) t_max: __m256,
    origin: [__m256; 3],
    shear: [__m256; 3],
}

/// What holds for all rays of a packet, in all lanes.
pub(super) struct Common {
    /// Index of the near plane of each axis.
    near_plane: [usize; 3],
    /// Per axis the origin that makes the near plane nearest, and the one that makes the far plane farthest.
    near_origin: [__m256; 3],
    far_origin: [__m256; 3],
    /// Per axis the bounds of the inverse directions.
    near_inverse: [[__m256; 2]; 3],
    far_inverse: [[__m256; 2]; 3],
    t_min: __m256,
    pub(super) t_max: __m256,
}

/// Casts up to sixteen rays whose directions have the same signs; unused slots repeat one of them. Returns a bit per ray. `accept` is asked
/// with the ray's lane.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn cast_packet<const ALL: bool>(
    tree: &Tree,
    rays: &[&RaySetup; PACKET],
    count: usize,
    accept: &impl Fn(usize, &Hit) -> bool,
) -> u32 {
    let mut active = (1u32 << count) - 1;
    if active.count_ones() <= FEW {
        return cast_singly(tree, rays, active, 0, accept);
    }
    let groups = [group(&rays[..LANES]), group(&rays[LANES..])];
    let common = common(rays, &groups);
    let same_axes = rays.iter().all(|ray| ray.axes == rays[0].axes);
    let mut hits = 0u32;
    // Child in the lower, rays in the upper half.
    let mut stack = [0u64; STACK_SIZE];
    stack[0] = u64::from(active) << 32;
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let (child, mask) = (stack[top] as u32, (stack[top] >> 32) as u32 & active);
        if mask == 0 {
            continue;
        }
        let mut found = 0;
        if mask.count_ones() <= FEW {
            found = cast_singly(tree, rays, mask, child, accept);
        } else if child & LEAF_BIT != 0 {
            // SAFETY: references with the leaf bit are indices of `blocks`.
            let block = unsafe { tree.blocks.get_unchecked((child & !LEAF_BIT) as usize) };
            found = if same_axes {
                meet_block::<ALL>(block, &groups, rays, mask, accept)
            } else {
                cast_singly(tree, rays, mask, child, accept)
            };
        } else {
            // SAFETY: references without the leaf bit are indices of `nodes`.
            let node = unsafe { tree.nodes.get_unchecked(child as usize) };
            let mut children = meet_any(node, &common);
            while children != 0 {
                let lane = children.trailing_zeros() as usize & 7;
                children &= children - 1;
                let inside = meet_box(node, lane, &common, &groups, mask);
                // A node leaves at most seven children waiting beside the one visited next; see `STACK_SIZE`.
                if inside != 0 {
                    stack[top] = u64::from(inside) << 32 | u64::from(node.children[lane]);
                    top += 1;
                }
            }
        }
        hits |= found;
        active &= !found;
        if active == 0 {
            break;
        }
    }
    hits
}

/// Casts the rays of `mask` one by one from `root` on.
#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn cast_singly(
    tree: &Tree,
    rays: &[&RaySetup; PACKET],
    mask: u32,
    root: u32,
    accept: &impl Fn(usize, &Hit) -> bool,
) -> u32 {
    let mut hits = 0;
    let mut rest = mask;
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize & (PACKET - 1);
        rest &= rest - 1;
        if traverse::<true>(tree, rays[lane], root, &|hit| accept(lane, hit)).is_some() {
            hits |= 1 << lane;
        }
    }
    hits
}

/// Per-ray values of a group, lane by lane.
#[repr(C, align(32))]
struct Columns {
    per_axis: [[[f32; LANES]; 3]; 6],
    t_min: [f32; LANES],
    t_max: [f32; LANES],
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn group(rays: &[&RaySetup]) -> Group {
    let mut columns = Columns {
        per_axis: [[[0.0; LANES]; 3]; 6],
        t_min: [0.0; LANES],
        t_max: [0.0; LANES],
    };
    for lane in 0..LANES {
        let ray = rays[lane];
        for axis in 0..3 {
            columns.per_axis[0][axis][lane] = ray.near_inverse[axis];
            columns.per_axis[1][axis][lane] = ray.near_offset[axis];
            columns.per_axis[2][axis][lane] = ray.far_inverse[axis];
            columns.per_axis[3][axis][lane] = ray.far_offset[axis];
            columns.per_axis[4][axis][lane] = ray.origin[ray.axes[axis]];
            columns.per_axis[5][axis][lane] = ray.shear[axis];
        }
        columns.t_min[lane] = ray.t_min;
        columns.t_max[lane] = ray.t_max;
    }
    // SAFETY: every column holds eight floats.
    let load = |column: &[f32; LANES]| unsafe { _mm256_loadu_ps(column.as_ptr()) };
    let three = |columns: &[[f32; LANES]; 3]| [load(&columns[0]), load(&columns[1]), load(&columns[2])];
    let [near_inverse, near_offset, far_inverse, far_offset, origin, shear] = &columns.per_axis;
    let minus = _mm256_set1_ps(-0.0);
    let shear = three(shear);
    Group {
        near_inverse: three(near_inverse),
        near_offset: three(near_offset),
        far_inverse: three(far_inverse),
        far_offset: three(far_offset),
        t_min: load(&columns.t_min),
        t_max: load(&columns.t_max),
        origin: three(origin),
        shear: [
            _mm256_xor_ps(shear[0], minus),
            _mm256_xor_ps(shear[1], minus),
            shear[2],
        ],
    }
}

/// The smallest lane, in all lanes.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn lowest(v: __m256) -> __m256 {
    let v = _mm256_min_ps(v, _mm256_permute2f128_ps::<1>(v, v));
    let v = _mm256_min_ps(v, _mm256_permute_ps::<0b01_00_11_10>(v));
    _mm256_min_ps(v, _mm256_permute_ps::<0b10_11_00_01>(v))
}

/// The largest lane, in all lanes.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn highest(v: __m256) -> __m256 {
    let v = _mm256_max_ps(v, _mm256_permute2f128_ps::<1>(v, v));
    let v = _mm256_max_ps(v, _mm256_permute_ps::<0b01_00_11_10>(v));
    _mm256_max_ps(v, _mm256_permute_ps::<0b10_11_00_01>(v))
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn common(rays: &[&RaySetup; PACKET], groups: &[Group; GROUPS]) -> Common {
    let [a, b] = groups;
    let zero = _mm256_setzero_ps();
    let mut common = Common {
        near_plane: [
            rays[0].negative[0],
            2 + rays[0].negative[1],
            4 + rays[0].negative[2],
        ],
        near_origin: [zero; 3],
        far_origin: [zero; 3],
        near_inverse: [[zero; 2]; 3],
        far_inverse: [[zero; 2]; 3],
        t_min: lowest(_mm256_min_ps(a.t_min, b.t_min)),
        t_max: highest(_mm256_max_ps(a.t_max, b.t_max)),
    };
    let minus = _mm256_set1_ps(-0.0);
    let slack = _mm256_set1_ps(4.0 * UNIT_ROUNDOFF);
    for axis in 0..3 {
        let (near_a, near_b) = (a.near_inverse[axis], b.near_inverse[axis]);
        let (far_a, far_b) = (a.far_inverse[axis], b.far_inverse[axis]);
        common.near_inverse[axis] = [
            lowest(_mm256_min_ps(near_a, near_b)),
            highest(_mm256_max_ps(near_a, near_b)),
        ];
        common.far_inverse[axis] = [
            lowest(_mm256_min_ps(far_a, far_b)),
            highest(_mm256_max_ps(far_a, far_b)),
        ];
        // The padded origins, back from the offsets, widened by the two roundings of that way and two to spare.
        let near_a = _mm256_div_ps(a.near_offset[axis], near_a);
        let near_b = _mm256_div_ps(b.near_offset[axis], near_b);
        let far_a = _mm256_div_ps(a.far_offset[axis], far_a);
        let far_b = _mm256_div_ps(b.far_offset[axis], far_b);
        let (near, far, sign) = if rays[0].negative[axis] == 0 {
            (
                highest(_mm256_max_ps(near_a, near_b)),
                lowest(_mm256_min_ps(far_a, far_b)),
                slack,
            )
        } else {
            let slack = _mm256_xor_ps(slack, minus);
            (
                lowest(_mm256_min_ps(near_a, near_b)),
                highest(_mm256_max_ps(far_a, far_b)),
                slack,
            )
        };
        common.near_origin[axis] = _mm256_fmadd_ps(_mm256_andnot_ps(minus, near), sign, near);
        common.far_origin[axis] = _mm256_fnmadd_ps(_mm256_andnot_ps(minus, far), sign, far);
    }
    common
}

/// Children whose box any ray of the packet may meet: bounds of all slab distances at once. The error, three relative
/// roundings of t, is within the cone's slope, which leaves ten.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn meet_any(node: &Node, common: &Common) -> u32 {
    let near = |axis: usize| {
        // SAFETY: plane indices are below 6, and each plane holds eight aligned floats.
        let plane = unsafe { _mm256_load_ps(node.planes.get_unchecked(common.near_plane[axis]).as_ptr()) };
        let distance = _mm256_sub_ps(plane, common.near_origin[axis]);
        let [low, high] = common.near_inverse[axis];
        _mm256_min_ps(_mm256_mul_ps(distance, low), _mm256_mul_ps(distance, high))
    };
    let far = |axis: usize| {
        // SAFETY: as above.
        let plane =
            unsafe { _mm256_load_ps(node.planes.get_unchecked(common.near_plane[axis] ^ 1).as_ptr()) };
        let distance = _mm256_sub_ps(plane, common.far_origin[axis]);
        let [low, high] = common.far_inverse[axis];
        _mm256_max_ps(_mm256_mul_ps(distance, low), _mm256_mul_ps(distance, high))
    };
    let enter = _mm256_max_ps(
        _mm256_max_ps(near(0), near(1)),
        _mm256_max_ps(near(2), common.t_min),
    );
    let leave = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), _mm256_min_ps(far(2), common.t_max));
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave)) as u32
}

/// The rays of `mask` that meet the box of one child.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn meet_box(node: &Node, lane: usize, common: &Common, groups: &[Group; GROUPS], mask: u32) -> u32 {
    let planes = Planes::new(node, lane, common);
    let mut inside = 0;
    for (index, group) in groups.iter().enumerate() {
        if mask >> (LANES * index) & 0xff != 0 {
            let (_, meets) = planes.meet(group);
            inside |= (_mm256_movemask_ps(meets) as u32) << (LANES * index);
        }
    }
    inside & mask
}

/// Near and far planes of a child's box, in all lanes.
pub(super) struct Planes {
    near: [__m256; 3],
    far: [__m256; 3],
}

impl Planes {
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
    pub(super) fn new(node: &Node, lane: usize, common: &Common) -> Planes {
        // SAFETY: plane indices are below 6.
        let plane = |index: usize| _mm256_set1_ps(unsafe { node.planes.get_unchecked(index) }[lane]);
        let [x, y, z] = common.near_plane;
        Planes {
            near: [plane(x), plane(y), plane(z)],
            far: [plane(x ^ 1), plane(y ^ 1), plane(z ^ 1)],
        }
    }

    /// Where each ray of a group enters the box, and which of them do.
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
    pub(super) fn meet(&self, group: &Group) -> (__m256, __m256) {
        let near =
            |axis: usize| _mm256_fmsub_ps(self.near[axis], group.near_inverse[axis], group.near_offset[axis]);
        let far =
            |axis: usize| _mm256_fmsub_ps(self.far[axis], group.far_inverse[axis], group.far_offset[axis]);
        let enter = _mm256_max_ps(
            _mm256_max_ps(near(0), near(1)),
            _mm256_max_ps(near(2), group.t_min),
        );
        let leave = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), _mm256_min_ps(far(2), group.t_max));
        (enter, _mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave))
    }
}

/// The rays of `mask` that hit a triangle of the block. All rays share their axes.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn meet_block<const ALL: bool>(
    block: &Block,
    groups: &[Group; GROUPS],
    rays: &[&RaySetup; PACKET],
    mask: u32,
    accept: &impl Fn(usize, &Hit) -> bool,
) -> u32 {
    let axes = rays[0].axes;
    let mut hits = 0;
    for lane in 0..block.triangles.len() {
        if block.triangles[lane] == NO_TRIANGLE {
            break;
        }
        for (index, group) in groups.iter().enumerate() {
            let wanted = (mask & !hits) >> (LANES * index) & 0xff;
            if wanted == 0 {
                continue;
            }
            let met = meet_triangle(block, lane, axes, group);
            let mut unsure = met.hit & met.straddles & wanted;
            let mut hit = met.hit & wanted;
            while unsure != 0 {
                let ray = unsure.trailing_zeros() as usize;
                unsure &= unsure - 1;
                if !rays[LANES * index + ray].plane_is_ahead(&block.triangle(lane)) {
                    hit &= !(1 << ray);
                }
            }
            if !ALL && hit != 0 {
                let rays = &rays[LANES * index..];
                hit = accepted(block.triangles[lane], &met, hit, rays, &|ray, hit| {
                    accept(LANES * index + ray, hit)
                });
            }
            hits |= hit << (LANES * index);
        }
    }
    hits
}

/// Those of a group's rays of `hit` whose hit of a triangle `accept` takes.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn accepted(
    triangle: u32,
    met: &Met,
    hit: u32,
    rays: &[&RaySetup],
    accept: &impl Fn(usize, &Hit) -> bool,
) -> u32 {
    let (t, edges) = (array(met.t), met.edges.map(|edges| array(edges)));
    let mut accepted = 0;
    let mut rest = hit;
    while rest != 0 {
        let ray = rest.trailing_zeros() as usize & (LANES - 1);
        rest &= rest - 1;
        let hit = hit_of(triangle, rays[ray], t[ray], edges.map(|edges| edges[ray]));
        accepted |= u32::from(accept(ray, &hit)) << ray;
    }
    accepted
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn array(v: __m256) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    // SAFETY: the array holds eight floats.
    unsafe { _mm256_storeu_ps(out.as_mut_ptr(), v) };
    out
}

/// How eight rays meet a triangle.
pub(super) struct Met {
    /// Those that hit it, and those for which it straddles the origin.
    pub(super) hit: u32,
    pub(super) straddles: u32,
    /// Where, and by which edge functions, of those that hit it.
    pub(super) t: __m256,
    pub(super) edges: [__m256; 3],
}

/// See `scalar::intersect` for the steps.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn meet_triangle(block: &Block, lane: usize, axes: [usize; 3], group: &Group) -> Met {
    let vertex = |index: usize| {
        let load = |axis: usize| _mm256_set1_ps(block.vertices[index][axis][lane]);
        let dx = _mm256_sub_ps(load(axes[0]), group.origin[0]);
        let dy = _mm256_sub_ps(load(axes[1]), group.origin[1]);
        let dz = _mm256_sub_ps(load(axes[2]), group.origin[2]);
        (
            _mm256_fmadd_ps(group.shear[0], dz, dx),
            _mm256_fmadd_ps(group.shear[1], dz, dy),
            dz,
        )
    };
    let (a, b, c) = (vertex(0), vertex(1), vertex(2));
    let u = difference_of_products_8(c.0, b.1, c.1, b.0);
    let v = difference_of_products_8(a.0, c.1, a.1, c.0);
    let w = difference_of_products_8(b.0, a.1, b.1, a.0);
    let zero = _mm256_setzero_ps();
    let positive = _mm256_cmp_ps::<_CMP_GE_OQ>(_mm256_min_ps(_mm256_min_ps(u, v), w), zero);
    let negative = _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_max_ps(_mm256_max_ps(u, v), w), zero);
    let inside = _mm256_or_ps(positive, negative);
    if _mm256_movemask_ps(inside) == 0 {
        return Met {
            hit: 0,
            straddles: 0,
            t: zero,
            edges: [zero; 3],
        };
    }
    let det = _mm256_add_ps(_mm256_add_ps(u, v), w);
    let depth = _mm256_fmadd_ps(u, a.2, _mm256_fmadd_ps(v, b.2, _mm256_mul_ps(w, c.2)));
    let t = _mm256_div_ps(_mm256_mul_ps(depth, group.shear[2]), det);
    let reached = _mm256_and_ps(
        _mm256_cmp_ps::<_CMP_GE_OQ>(t, group.t_min),
        _mm256_cmp_ps::<_CMP_LE_OQ>(t, group.t_max),
    );
    let hit = _mm256_and_ps(
        _mm256_and_ps(inside, reached),
        _mm256_cmp_ps::<_CMP_NEQ_OQ>(det, zero),
    );
    let behind = |depth: __m256| _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_mul_ps(depth, group.shear[2]), zero);
    let straddles = _mm256_or_ps(_mm256_or_ps(behind(a.2), behind(b.2)), behind(c.2));
    Met {
        hit: _mm256_movemask_ps(hit) as u32,
        straddles: _mm256_movemask_ps(straddles) as u32,
        t,
        edges: [u, v, w],
    }
}
