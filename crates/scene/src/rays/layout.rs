//! The data that a traversal reads: eight-wide nodes and blocks of four triangles.
//!
//! Two coordinate frames keep the tests independent of the scene's scale and place:
//!
//! * Triangles are stored in world space times a power of two (`internal_from_world`), chosen so that the largest
//!   coordinate is near 1. The product is exact, so a scene scaled by a power of two is traced bit by bit alike,
//!   and products of three lengths neither overflow nor underflow.
//! * Boxes are stored relative to `anchor`, the point of the scene's box nearest to the world's origin. A scene
//!   that lies far from the origin then has box coordinates of its own size; every rounding is outward.

/// Number of children of a node: one AVX register of floats.
pub(super) const NODE_WIDTH: usize = 8;

/// Number of triangles in a leaf block: one SSE register of floats.
pub(super) const BLOCK_WIDTH: usize = 4;

/// Marks a child reference as a leaf; the other 31 bits are the index of its block.
pub(super) const LEAF_BIT: u32 = 1 << 31;

/// The triangle index of an unused lane of a block.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;

/// 2⁻²⁴, the largest relative error of one rounding to f32.
pub(super) const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;

/// How far, relative to the largest distance between ray origin and triangle vertex, a hit that the triangle
/// test reports may lie from the exact ray: 17 roundings (derived in `ray_setup`), plus those of the slab test.
pub(super) const HIT_ERROR: f32 = 32.0 * UNIT_ROUNDOFF;

/// Deepest level reached by the tree as the builder found it; deeper subtrees are split evenly instead, which
/// bounds the stack for any input.
pub(super) const MAX_BUILT_DEPTH: usize = 32;

/// Stack entries for the deepest tree: 7 siblings wait per level, and an evenly split subtree of 2³¹ triangles
/// adds at most 11 levels (8¹¹ > 2³¹).
pub(super) const STACK_SIZE: usize = (NODE_WIDTH - 1) * (MAX_BUILT_DEPTH + 11 + 1) + 1;

/// An inner node: the boxes of up to eight children, one array per plane.
///
/// `planes[2 * axis]` holds the lower, `planes[2 * axis + 1]` the upper bounds. The box of an unused child is
/// inverted and infinite, so that no ray meets it.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Node {
    pub planes: [[f32; NODE_WIDTH]; 6],
    pub children: [u32; NODE_WIDTH],
}

impl Node {
    pub(super) fn empty() -> Self {
        let (low, high) = ([f32::INFINITY; NODE_WIDTH], [f32::NEG_INFINITY; NODE_WIDTH]);
        Node {
            planes: [low, high, low, high, low, high],
            children: [LEAF_BIT; NODE_WIDTH],
        }
    }
}

/// Up to four triangles: `vertices[vertex][axis][lane]`, internal space. Unused lanes are all zero, a triangle
/// without area, which the test never hits.
#[derive(Clone)]
#[repr(C, align(32))]
pub(super) struct Block {
    pub vertices: [[[f32; BLOCK_WIDTH]; 3]; 3],
    pub triangles: [u32; BLOCK_WIDTH],
}

impl Block {
    pub(super) fn empty() -> Self {
        Block {
            vertices: [[[0.0; BLOCK_WIDTH]; 3]; 3],
            triangles: [NO_TRIANGLE; BLOCK_WIDTH],
        }
    }

    /// The three vertices of a lane.
    pub(super) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        let [a, b, c] = &self.vertices;
        let vertex = |[x, y, z]: &[[f32; BLOCK_WIDTH]; 3]| [x[lane], y[lane], z[lane]];
        [vertex(a), vertex(b), vertex(c)]
    }
}

/// Nodes and blocks of a tree with the frames they are stored in. An empty tree has no nodes.
pub(super) struct Tree {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    /// Power of two: internal length per metre.
    pub internal_from_world: f64,
    /// Origin of the boxes, internal space.
    pub anchor: [f32; 3],
    /// Largest absolute coordinate of a box, relative to `anchor`.
    pub extent: f32,
}
