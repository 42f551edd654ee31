//! The tree and its building.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// What a tree needs to know of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct TreePixel {
    /// World space, metres.
    pub position: Vec3,
    /// Unit.
    pub normal: Vec3,
    /// Whether the normal it is shaded with is `normal`.
    pub plain: bool,
    /// Whether it reflects more than like Lambert.
    pub glossy: bool,
}

/// A node: the pixels `first..end` of the tree's order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelNode {
    /// Box of the positions, in the tree's rotated space.
    pub low: Vec3,
    /// See `low`.
    pub high: Vec3,
    /// Place of the first pixel.
    pub first: u32,
    /// Place after the last one.
    pub end: u32,
    /// Nodes from this one to its right child; the left child is the next node. 0: a leaf.
    pub skip: u32,
    /// Nodes in this subtree.
    pub size: u32,
    /// Whether all normals are alike and are those that are shaded with.
    pub flat: bool,
    /// Whether any pixel reflects more than like Lambert.
    pub glossy: bool,
}

impl PixelNode {
    /// Leaves below this node, or 1.
    pub fn leaves(&self) -> u32 {
        self.size.div_ceil(2)
    }
}

/// A kd-tree in preorder.
#[derive(Clone, Debug, Default)]
pub struct PixelTree {
    /// The root first.
    pub nodes: Vec<PixelNode>,
    /// Place in the order → index of the pixel; every node is an interval of it.
    pub order: Vec<u32>,
    /// Takes world space to that of the boxes.
    pub rotation: Mat3,
}

/// Normals that differ by less along each axis are alike: a cosine is then off by less than 0.2 %.
const ALIKE: f32 = 1e-3;
/// Subtrees of fewer pixels are built by one task.
const TASK: usize = 8192;

/// A pixel while the tree is built: rotated position and scaled normal.
#[derive(Clone, Copy)]
struct Item {
    place: [f32; 6],
    index: u32,
    plain: bool,
    glossy: bool,
}

impl PixelTree {
    /// A tree over pixels with finite positions and normals, its boxes rotated by `rotation`; `normal_scale` is how
    /// many metres a normal's difference of 1 counts for. What has at most `leaf` pixels is not split.
    pub fn new(pixels: &[TreePixel], rotation: Mat3, normal_scale: f32, leaf: usize) -> PixelTree {
        let mut items: Vec<Item> = pixels
            .par_iter()
            .enumerate()
            .map(|(index, pixel)| {
                let (p, n) = (rotation * pixel.position, pixel.normal * normal_scale);
                Item {
                    place: [p.x, p.y, p.z, n.x, n.y, n.z],
                    index: index as u32,
                    plain: pixel.plain,
                    glossy: pixel.glossy,
                }
            })
            .collect();
        let mut nodes = Vec::new();
        if !items.is_empty() {
            let split = Splitting {
                alike: ALIKE * normal_scale,
                leaf: leaf.max(1),
            };
            build(&mut items, 0, &split, &mut nodes);
        }
        PixelTree {
            nodes,
            order: items.par_iter().map(|item| item.index).collect(),
            rotation,
        }
    }
}

/// What stays the same for a tree.
struct Splitting {
    /// [`ALIKE`] times the normals' scale.
    alike: f32,
    /// Most pixels of what is not split.
    leaf: usize,
}

/// Appends the subtree of `items`, which start at `first` in the order.
fn build(items: &mut [Item], first: u32, splitting: &Splitting, nodes: &mut Vec<PixelNode>) {
    let (mut low, mut high) = ([f32::INFINITY; 6], [f32::NEG_INFINITY; 6]);
    let (mut plain, mut glossy) = (true, false);
    for item in items.iter() {
        for k in 0..6 {
            low[k] = low[k].min(item.place[k]);
            high[k] = high[k].max(item.place[k]);
        }
        plain &= item.plain;
        glossy |= item.glossy;
    }
    let side = |k: usize| high[k] - low[k];
    let at = nodes.len();
    nodes.push(PixelNode {
        low: Vec3::new(low[0], low[1], low[2]),
        high: Vec3::new(high[0], high[1], high[2]),
        first,
        end: first + items.len() as u32,
        skip: 0,
        size: 1,
        flat: plain && (3..6).all(|k| side(k) <= splitting.alike),
        glossy,
    });
    let longest = (1..6).fold(0, |best, k| if side(k) > side(best) { k } else { best });
    // Few pixels, several in one place, or nothing that can be told apart.
    if items.len() <= splitting.leaf || side(longest).is_nan() || side(longest) <= 0.0 {
        return;
    }
    // Rounding may put the middle on the upper side, where everything would be below it.
    let middle = (0.5 * low[longest] + 0.5 * high[longest]).min(high[longest].next_down());
    let split = partition(items, |item| item.place[longest] <= middle);
    let (left, right) = items.split_at_mut(split);
    let split = first + split as u32;
    if left.len() + right.len() < TASK {
        build(left, first, splitting, nodes);
        nodes[at].skip = (nodes.len() - at) as u32;
        build(right, split, splitting, nodes);
    } else {
        let (a, b) = rayon::join(
            || {
                let mut nodes = Vec::with_capacity(2 * left.len() / splitting.leaf);
                build(left, first, splitting, &mut nodes);
                nodes
            },
            || {
                let mut nodes = Vec::with_capacity(2 * right.len() / splitting.leaf);
                build(right, split, splitting, &mut nodes);
                nodes
            },
        );
        nodes[at].skip = 1 + a.len() as u32;
        nodes.extend(a);
        nodes.extend(b);
    }
    nodes[at].size = (nodes.len() - at) as u32;
}

/// Moves what is `left` to the front and returns how much that is. The order depends on the items alone.
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let (mut i, mut j) = (0, items.len());
    loop {
        while i < j && left(&items[i]) {
            i += 1;
        }
        while i < j && !left(&items[j - 1]) {
            j -= 1;
        }
        if i >= j {
            return i;
        }
        items.swap(i, j - 1);
    }
}
