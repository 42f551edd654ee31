//! What may lie between places and lights: shafts.
//!
//! Source: Haines and Wallace, "Shaft Culling for Efficient Ray-Cast Radiosity" (1991). A shaft holds all straight ways from
//! a box to a box. Its sides here are those of the box around both and, in each pair of axes, the two tangents from the
//! first box's middle to the second box, moved out by the first one's size. What lies beyond a side meets no ray within.
//! Triangles are asked one by one, too: whether the shaft lies on one side of theirs, and whether they lie below the plane
//! on which all rays begin.
//!
//! All tests may keep what no ray meets, and never drop what one would: they are widened by more than rays may err
//! (`ray_setup`), and by more than they keep from surfaces at their ends (`secondary`).

use super::layout::{
    BLOCK_WIDTH, Block, LEAF_BIT, NO_TRIANGLE, NODE_WIDTH, Node, STACK_SIZE, Tree, UNIT_ROUNDOFF,
};
use super::ray::SurfacePoint;
use glam::{Vec3, Vec4};

/// Where the rays of a shaft begin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShaftStart {
    /// Middle of all beginnings (world space, metres).
    pub centre: Vec3,
    /// Half extents of the box around them.
    pub half: Vec3,
    /// Unit normal of the plane that they lie on; zero if they don't lie on one.
    pub normal: Vec3,
    /// How far above `centre` along the normal all rays into the upper side begin, at least (metres; may be negative).
    pub floor: f32,
    /// How far beside the box rays may begin (metres).
    pub slack: f32,
}

impl ShaftStart {
    /// For rays of [`super::ray_from_surface`] and its kin from any of `points`.
    pub fn around(points: impl Iterator<Item = SurfacePoint> + Clone) -> ShaftStart {
        let (mut low, mut high, mut clearance) = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0.0f32);
        let mut normal = None;
        for point in points.clone() {
            low = low.min(point.position);
            high = high.max(point.position);
            clearance = clearance.max(point.clearance);
            let common = normal.get_or_insert(point.normal);
            if *common != point.normal {
                *common = Vec3::ZERO;
            }
        }
        let centre = (low + high) * 0.5;
        let normal = normal.unwrap_or(Vec3::ZERO);
        // Rays start a clearance above their surface at least; half of it is left for rounding.
        let floor = points
            .map(|point| normal.dot(point.position - centre) + 0.5 * point.clearance)
            .fold(f32::INFINITY, f32::min);
        ShaftStart {
            centre,
            half: (high - low) * 0.5,
            normal,
            floor,
            // A clearance along each axis above, as much along the ray, and as much for rounding.
            slack: 4.0 * clearance,
        }
    }
}

/// Where the rays of a shaft end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShaftEnd {
    /// Lower corner of the box around all ends, relative to the start's centre (world space, metres).
    pub low: Vec3,
    /// Upper corner.
    pub high: Vec3,
    /// The box holds directions instead, and rays have no end.
    pub endless: bool,
    /// The largest clearance of surfaces at which rays end ([`super::shadow_ray`], metres).
    pub clearance: f32,
    /// All rays end above surfaces: those that the box touches are never met.
    pub on_surfaces: bool,
}

/// A part of a [`super::TriangleBvh`]: some triangles, or boxes of boxes of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BvhPart(pub(super) u32);

impl BvhPart {
    /// All of it.
    pub const ALL: BvhPart = BvhPart(0);

    /// Whether it is a few triangles.
    pub fn is_triangles(self) -> bool {
        self.0 & LEAF_BIT != 0
    }
}

/// Roundings, relative to the size of all that is compared: of positions and sides (some), of hits (32), and what
/// shadow rays keep from their ends by their length (64); twice that.
const ROUNDING: f32 = 192.0 * UNIT_ROUNDOFF;
/// How far, relative to distances, a surface's ends may seem to lie behind it: roundings, a quarter of what
/// rays keep from it.
const BEHIND: f32 = 16.0 * UNIT_ROUNDOFF;

/// Pairs of axes; each has two sides that hold the third axis.
const PAIRS: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// A side: `normal · p > limit` is beyond, in the two components of its pair.
#[derive(Clone, Copy)]
struct Side {
    normal: [f32; 2],
    /// For boxes, whose coordinates are relative to the anchor.
    box_limit: f32,
    /// For vertices, relative to the start.
    limit: f32,
}

/// A shaft in the tree's internal space.
pub(super) struct ShaftSetup {
    start: [f32; 3],
    /// Box around all of it, relative to the anchor.
    box_low: [f32; 3],
    box_high: [f32; 3],
    /// The same relative to the start.
    low: [f32; 3],
    high: [f32; 3],
    start_half: [f32; 3],
    /// Of the end, relative to the start.
    centre: [f32; 3],
    centre_size: [f32; 3],
    half: [f32; 3],
    /// Two per pair; limits are infinite where the end is around the start in both axes.
    sides: [[Side; 2]; 3],
    /// Zero if rays may lead below it.
    normal: [f32; 3],
    floor: f32,
    endless: bool,
    /// As [`BEHIND`], negative where surfaces at the ends count.
    behind: f32,
}

impl ShaftSetup {
    /// `None` where the tree is empty or numbers are out of range.
    #[inline(always)]
    pub(super) fn new(tree: &Tree, start: &ShaftStart, end: &ShaftEnd) -> Option<ShaftSetup> {
        // A power of two: products are exact unless they leave f32's range.
        let scale = tree.internal_from_world as f32;
        let internal = |v: Vec3| [v.x * scale, v.y * scale, v.z * scale];
        let largest = |v: [f32; 3]| max(max(v[0].abs(), v[1].abs()), v[2].abs());
        let apex = internal(start.centre);
        let start_half = internal(start.half);
        let (low, high) = if end.endless {
            (end.low.to_array(), end.high.to_array())
        } else {
            (internal(end.low), internal(end.high))
        };
        let from_anchor = [0, 1, 2].map(|k| apex[k] - tree.anchor[k]);
        let far = if end.endless {
            0.0
        } else {
            max(largest(low), largest(high))
        };
        let size = tree.extent + largest(from_anchor) + largest(apex) + largest(start_half) + far;
        let slack = (start.slack + 4.0 * end.clearance) * scale + ROUNDING * size;
        let sum = slack + low[0] + low[1] + low[2] + high[0] + high[1] + high[2];
        if tree.nodes.is_empty() || !sum.is_finite() || scale < f32::MIN_POSITIVE {
            return None;
        }
        let reach = |c: f32| {
            if end.endless && c != 0.0 {
                c * f32::INFINITY
            } else {
                c
            }
        };
        let hull_low = [0, 1, 2].map(|k| min(reach(min(low[k], 0.0)), -start_half[k]) - slack);
        let hull_high = [0, 1, 2].map(|k| max(reach(max(high[k], 0.0)), start_half[k]) + slack);
        let around = [0, 1, 2].map(|k| low[k] <= 0.0 && high[k] >= 0.0);
        let side = |[i, j]: [usize; 2], turn: f32| {
            let corner = tangent_corner([low[i], high[i]], [low[j], high[j]], turn);
            let normal = [-turn * corner[1], turn * corner[0]];
            let limit = if around[i] && around[j] {
                f32::INFINITY
            } else {
                (slack + start_half[i]) * normal[0].abs() + (slack + start_half[j]) * normal[1].abs()
            };
            Side {
                normal,
                box_limit: limit + normal[0] * from_anchor[i] + normal[1] * from_anchor[j],
                limit,
            }
        };
        let sides = PAIRS.map(|pair| [side(pair, 1.0), side(pair, -1.0)]);
        let centre = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
        let half = [0, 1, 2].map(|k| 0.5 * (high[k] - low[k]));
        let normal = start.normal.to_array();
        let lowest = [0, 1, 2].map(|k| {
            let beside = if end.endless {
                half[k]
            } else {
                half[k] + start_half[k]
            };
            normal[k] * centre[k] - normal[k].abs() * beside
        });
        let rises = lowest[0] + lowest[1] + lowest[2] > ROUNDING * (largest(centre) + largest(half));
        Some(ShaftSetup {
            start: apex,
            box_low: [0, 1, 2].map(|k| from_anchor[k] + hull_low[k]),
            box_high: [0, 1, 2].map(|k| from_anchor[k] + hull_high[k]),
            low: hull_low,
            high: hull_high,
            start_half,
            centre,
            centre_size: centre.map(f32::abs),
            half,
            sides,
            normal: if rises { normal } else { [0.0; 3] },
            floor: start.floor * scale,
            endless: end.endless,
            behind: if end.on_surfaces { BEHIND } else { -2.0 * BEHIND },
        })
    }
}

/// The corner of a rectangle that all others lie clockwise of (`turn` 1, seen from the origin outside of it), or counter-
/// clockwise (−1).
#[inline(always)]
fn tangent_corner(x: [f32; 2], y: [f32; 2], turn: f32) -> [f32; 2] {
    let mut extreme = [x[0], y[0]];
    for corner in [[x[1], y[0]], [x[1], y[1]], [x[0], y[1]]] {
        if turn * (extreme[0] * corner[1] - extreme[1] * corner[0]) > 0.0 {
            extreme = corner;
        }
    }
    extreme
}

/// See [`super::TriangleBvh::narrow`].
#[inline(always)]
pub(super) fn narrow(
    tree: &Tree,
    shaft: &ShaftSetup,
    among: &[BvhPart],
    steps: usize,
    most: usize,
    kept: &mut Vec<BvhPart>,
) -> bool {
    let end = kept.len() + most;
    let mut stack = [0u32; STACK_SIZE];
    let mut steps = steps;
    for part in among {
        stack[0] = part.0;
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let part = stack[top];
            let is_triangles = part & LEAF_BIT != 0;
            if is_triangles || steps == 0 {
                if is_triangles && !meets(&tree.blocks[(part & !LEAF_BIT) as usize], shaft) {
                    continue;
                }
                if kept.len() == end {
                    return false;
                }
                kept.push(BvhPart(part));
                continue;
            }
            steps -= 1;
            let node = &tree.nodes[part as usize];
            let mut inside = not_beyond(node, shaft);
            while inside != 0 {
                let lane = inside.trailing_zeros() as usize % NODE_WIDTH;
                inside &= inside - 1;
                stack[top] = node.children[lane];
                top += 1;
            }
        }
    }
    true
}

/// A bit for each child that is not beyond a side. Unused children are beyond all.
#[inline(always)]
fn not_beyond(node: &Node, shaft: &ShaftSetup) -> u32 {
    let mut most = [f32::NEG_INFINITY; NODE_WIDTH];
    for axis in 0..3 {
        let (low, high) = (&node.planes[2 * axis], &node.planes[2 * axis + 1]);
        for lane in 0..NODE_WIDTH {
            let out = max(low[lane] - shaft.box_high[axis], shaft.box_low[axis] - high[lane]);
            most[lane] = max(out, most[lane]);
        }
    }
    for ([i, j], sides) in PAIRS.into_iter().zip(&shaft.sides) {
        for side in sides {
            // The corner of the box that is least far out.
            let a = &node.planes[2 * i + usize::from(side.normal[0] < 0.0)];
            let b = &node.planes[2 * j + usize::from(side.normal[1] < 0.0)];
            for lane in 0..NODE_WIDTH {
                let out = a[lane] * side.normal[0] + b[lane] * side.normal[1] - side.box_limit;
                most[lane] = max(out, most[lane]);
            }
        }
    }
    (0..NODE_WIDTH).fold(0, |bits, lane| bits | u32::from(most[lane] <= 0.0) << lane)
}

/// Whether any triangle of the block may meet the shaft. A lane per triangle.
#[inline(always)]
fn meets(block: &Block, shaft: &ShaftSetup) -> bool {
    let vertex = |k: usize| {
        let along = |axis: usize| Vec4::from_array(block.vertices[k][axis]) - Vec4::splat(shaft.start[axis]);
        [along(0), along(1), along(2)]
    };
    let (a, b, c) = (vertex(0), vertex(1), vertex(2));
    // More than zero: outside.
    let mut out = Vec4::NEG_INFINITY;
    for axis in 0..3 {
        let (a, b, c) = (a[axis], b[axis], c[axis]);
        out = out.max(a.min(b).min(c) - Vec4::splat(shaft.high[axis]));
        out = out.max(Vec4::splat(shaft.low[axis]) - a.max(b).max(c));
    }
    for ([i, j], sides) in PAIRS.into_iter().zip(&shaft.sides) {
        for side in sides {
            let (m, n) = (Vec4::splat(side.normal[0]), Vec4::splat(side.normal[1]));
            let along = |v: &[Vec4; 3]| v[i] * m + v[j] * n;
            out = out.max(along(&a).min(along(&b)).min(along(&c)) - Vec4::splat(side.limit));
        }
    }
    let used = used_lanes(block);
    if out.cmple(Vec4::ZERO).bitmask() & used == 0 {
        return false;
    }
    if shaft.normal != [0.0; 3] {
        let height = |v: &[Vec4; 3]| dot_with(v, &shaft.normal);
        out = out.max(Vec4::splat(shaft.floor) - height(&a).max(height(&b)).max(height(&c)));
    }
    // The triangle's plane n · p = n · a: both the start and the end above it, or both below.
    let (d, e) = (
        [b[0] - a[0], b[1] - a[1], b[2] - a[2]],
        [c[0] - a[0], c[1] - a[1], c[2] - a[2]],
    );
    let n = [
        d[1] * e[2] - d[2] * e[1],
        d[2] * e[0] - d[0] * e[2],
        d[0] * e[1] - d[1] * e[0],
    ];
    let sizes = [n[0].abs(), n[1].abs(), n[2].abs()];
    let plane = n[0] * a[0] + n[1] * a[1] + n[2] * a[2];
    let plane_size = sizes[0] * a[0].abs() + sizes[1] * a[1].abs() + sizes[2] * a[2].abs();
    let start_margin = plane_size * (2.0 * BEHIND) + dot_with(&sizes, &shaft.start_half);
    let (end_plane, end_size) = if shaft.endless {
        (Vec4::ZERO, Vec4::ZERO)
    } else {
        (plane, plane_size)
    };
    let half = dot_with(&sizes, &shaft.half);
    let far = dot_with(&sizes, &shaft.centre_size);
    let end_margin = half - (end_size + far + half) * shaft.behind;
    let end = dot_with(&n, &shaft.centre) - end_plane;
    let above = (-plane - start_margin).min(end - end_margin);
    let below = (plane - start_margin).min(-end - end_margin);
    out = out.max(above).max(below);
    out.cmple(Vec4::ZERO).bitmask() & used != 0
}

#[inline(always)]
fn dot_with(v: &[Vec4; 3], w: &[f32; 3]) -> Vec4 {
    v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
}

/// A bit per lane with a triangle.
#[inline(always)]
fn used_lanes(block: &Block) -> u32 {
    (0..BLOCK_WIDTH).fold(0, |bits, lane| {
        bits | u32::from(block.triangles[lane] != NO_TRIANGLE) << lane
    })
}

/// One instruction, without `f32::max`'s care for NaN, which takes four.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
