//! Closest hits in packets of sixteen rays that start near each other and go the same way, as those through a pixel do.
//!
//! The packet descends as that of shadow rays does (`packet`), nearest boxes first; each ray keeps its own best hit, and boxes
//! that begin behind all of these are left out. The best hit doesn't depend on the order in which triangles are offered
//! (`best`), so packets return what single rays return.

use std::arch::x86_64::*;

use super::super::best::Best;
use super::super::layout::{Block, LEAF_BIT, NO_TRIANGLE, Node, STACK_SIZE, Tree};
use super::super::ray::{Hit, Ray};
use super::super::ray_setup::RaySetup;
use super::kernel::improve;
use super::packet::{
    Common, FEW, GROUPS, Group, LANES, PACKET, Planes, Sorted, WINDOW, array, common, group, highest, lowest,
    meet_any, meet_triangle, place,
};

/// See [`super::super::TriangleBvh::closest_hit_packet`].
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
pub(super) fn closest_hit_packet(
    tree: &Tree,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
    accept: &impl Fn(usize, &Hit) -> bool,
) {
    let count = rays.len().min(hits.len());
    hits[..count].fill(None);
    let mut sorted = Sorted::new();
    let windows = rays[..count].chunks(WINDOW).zip(hits.chunks_mut(WINDOW));
    for (window, (rays, hits)) in windows.enumerate() {
        sorted.sort(tree, rays);
        for members in sorted.packets() {
            let setups = sorted.of_packet(members);
            let mut packet = Packet {
                rays: &setups,
                best: setups.map(Best::new),
            };
            packet.cast(tree, members.len(), &|lane, hit| {
                accept(window * WINDOW + place(members[lane]), hit)
            });
            for (lane, member) in members.iter().enumerate() {
                hits[place(*member)] = packet.best[lane].hit(setups[lane]);
            }
        }
    }
}

/// A subtree that is yet to be visited.
#[derive(Clone, Copy)]
struct Waiting {
    /// Where the first ray enters its box.
    near: f32,
    child: u32,
    /// Rays that enter it.
    mask: u32,
}

const NOTHING: Waiting = Waiting {
    near: 0.0,
    child: 0,
    mask: 0,
};

/// Rays, and the best that each has met.
struct Packet<'a> {
    rays: &'a [&'a RaySetup; PACKET],
    best: [Best; PACKET],
}

impl Packet<'_> {
    /// Finds the closest hits of the first `count` rays; `accept` is asked with the ray's lane.
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
    fn cast(&mut self, tree: &Tree, count: usize, accept: &impl Fn(usize, &Hit) -> bool) {
        let all = (1u32 << count) - 1;
        if all.count_ones() <= FEW {
            self.cast_singly(tree, all, 0, accept);
            return;
        }
        let mut groups = [group(&self.rays[..LANES]), group(&self.rays[LANES..])];
        let mut common = common(self.rays, &groups);
        let axes = self.rays[0].axes;
        let same_axes = self.rays.iter().all(|ray| ray.axes == axes);
        let mut stack = [NOTHING; STACK_SIZE];
        stack[0].mask = all;
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let Waiting { near, child, mask } = stack[top];
            let mask = mask & reach(&groups, near);
            if mask == 0 {
                continue;
            }
            if mask.count_ones() <= FEW {
                self.cast_singly(tree, mask, child, accept);
            } else if child & LEAF_BIT == 0 {
                // SAFETY: references without the leaf bit are indices of `nodes`.
                let node = unsafe { tree.nodes.get_unchecked(child as usize) };
                top = push_children(node, mask, &common, &groups, &mut stack, top);
                continue;
            } else if same_axes {
                // SAFETY: references with the leaf bit are indices of `blocks`.
                let block = unsafe { tree.blocks.get_unchecked((child & !LEAF_BIT) as usize) };
                self.meet_block(block, axes, &groups, mask, accept);
            } else {
                self.cast_singly(tree, mask, child, accept);
            }
            // Rays end at what they have met.
            let limits = |first: usize| {
                let limits: [f32; LANES] = std::array::from_fn(|lane| self.best[first + lane].limit);
                // SAFETY: the array holds eight floats.
                unsafe { _mm256_loadu_ps(limits.as_ptr()) }
            };
            groups[0].t_max = limits(0);
            groups[1].t_max = limits(LANES);
            common.t_max = highest(_mm256_max_ps(groups[0].t_max, groups[1].t_max));
        }
    }

    /// Casts the rays of `mask` one by one from `root` on.
    #[inline(never)]
    #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
    fn cast_singly(&mut self, tree: &Tree, mask: u32, root: u32, accept: &impl Fn(usize, &Hit) -> bool) {
        let mut rest = mask;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize & (PACKET - 1);
            rest &= rest - 1;
            improve::<false>(tree, self.rays[lane], root, &mut self.best[lane], &|hit| {
                accept(lane, hit)
            });
        }
    }

    /// Offers the triangles of a block to the rays of `mask`. All rays share their axes.
    #[inline]
    #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
    fn meet_block(
        &mut self,
        block: &Block,
        axes: [usize; 3],
        groups: &[Group; GROUPS],
        mask: u32,
        accept: &impl Fn(usize, &Hit) -> bool,
    ) {
        for lane in 0..block.triangles.len() {
            if block.triangles[lane] == NO_TRIANGLE {
                break;
            }
            for (index, group) in groups.iter().enumerate() {
                let wanted = mask >> (LANES * index) & 0xff;
                if wanted == 0 {
                    continue;
                }
                let met = meet_triangle(block, lane, axes, group);
                let mut hit = met.hit & wanted;
                if hit == 0 {
                    continue;
                }
                let t = array(met.t);
                let edges = met.edges.map(|v| array(v));
                while hit != 0 {
                    let ray = hit.trailing_zeros() as usize & (LANES - 1);
                    hit &= hit - 1;
                    let slot = LANES * index + ray;
                    self.best[slot].offer(
                        block,
                        lane,
                        self.rays[slot],
                        t[ray],
                        [edges[0][ray], edges[1][ray], edges[2][ray]],
                        met.straddles >> ray & 1 != 0,
                        &|hit: &Hit| accept(slot, hit),
                    );
                }
            }
        }
    }
}

/// Rays for which something at `near` may matter.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn reach(groups: &[Group; GROUPS], near: f32) -> u32 {
    let near = _mm256_set1_ps(near);
    let of = |group: &Group| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, group.t_max)) as u32;
    of(&groups[0]) | of(&groups[1]) << LANES
}

/// Puts the children that rays of `mask` enter on the stack, the nearest on top; returns its new height.
#[inline]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
fn push_children(
    node: &Node,
    mask: u32,
    common: &Common,
    groups: &[Group; GROUPS],
    stack: &mut [Waiting; STACK_SIZE],
    base: usize,
) -> usize {
    let nowhere = _mm256_set1_ps(f32::INFINITY);
    let mut top = base;
    let mut children = meet_any(node, common);
    while children != 0 {
        let lane = children.trailing_zeros() as usize & 7;
        children &= children - 1;
        let planes = Planes::new(node, lane, common);
        let (mut inside, mut near) = (0, nowhere);
        for (index, group) in groups.iter().enumerate() {
            if mask >> (LANES * index) & 0xff == 0 {
                continue;
            }
            let (enter, meets) = planes.meet(group);
            inside |= (_mm256_movemask_ps(meets) as u32) << (LANES * index);
            near = _mm256_min_ps(near, _mm256_blendv_ps(nowhere, enter, meets));
        }
        inside &= mask;
        if inside == 0 {
            continue;
        }
        let new = Waiting {
            near: _mm256_cvtss_f32(lowest(near)),
            child: node.children[lane],
            mask: inside,
        };
        // A node leaves at most seven children waiting beside the one visited next; see `STACK_SIZE`.
        let mut at = top;
        while at > base && stack[at - 1].near < new.near {
            stack[at] = stack[at - 1];
            at -= 1;
        }
        stack[at] = new;
        top += 1;
    }
    top
}
