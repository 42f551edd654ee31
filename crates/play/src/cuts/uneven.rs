//! Edges of lamps finer than the directions: cells across which light is uneven, which are asked part by part.
//!
//! A direction's visibility counts for its whole cell. Where a cell holds both the edge of a lamp and the edge of what stands
//! before it, the product of the means is not the mean of the product. So cells across which light is uneven, and
//! whose visibility is uncertain, get rays of their own: Σ f_p (V_p − V) is what their visibility V left out, for the
//! flux f_p of each part. Where no light is uneven nothing is asked.
//!
//! Shading finds the [`uncertain`] cells on its way; [`UnevenCells::resolve`] casts the rays.

pub mod uncertain;

use super::cells::Cells;
use super::lights::Directions;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::environment::luminance;
use relight_transport::light_tree::Node;
use std::ops::Range;

/// Share of all light that is out of place in a cell which counts as uneven, at least.
const UNEVEN: f32 = 3e-5;

/// Most cells, those with the most light out of place.
const MOST_CELLS: usize = 2048;

/// The cells across which a frame's light is uneven. By default there are none.
#[derive(Default)]
pub struct UnevenCells {
    /// In order of their leaves.
    cells: Vec<Uneven>,
    /// The directions around each [`BLOCK`] of cells.
    blocks: Vec<Bits>,
    /// Per leaf, and for one more, how many leaves before it are asked for: those of the cells and around them.
    asked_before: Vec<u32>,
    /// By [`Node::slot`] whether the node holds any of those: a bit each. Most nodes do not, which this tells sooner (without it
    /// and with [`super::shade`]'s search for uncertain cells inlined, shading under a sky took 4 % longer).
    holds_asked: Vec<u64>,
    /// Radius of a cell, radians.
    radius: f32,
    /// Largest flux (luminance) of any cell that is out of place.
    most_out_of_place: f32,
}

/// Some of the directions that are asked for: words of 64 and the bits in them.
type Bits = Vec<(u32, u64)>;

/// Cells that are looked at together first.
const BLOCK: usize = 16;

/// A cell across which light is uneven.
struct Uneven {
    /// Unit direction to its middle.
    direction: Vec3,
    /// Flux (luminance) that is not where it would be in an even cell.
    out_of_place: f32,
    /// Its direction's leaf.
    leaf: u32,
    /// Its direction and those around.
    around: Bits,
    /// Its parts that hold light.
    parts: Vec<CellPart>,
}

struct CellPart {
    /// Unit direction to its middle.
    direction: Vec3,
    /// Flux on a perpendicular surface, RGB, W/m².
    flux: Vec3,
    /// Sum of the luminances of the cell's parts up to it.
    sum: f32,
}

impl UnevenCells {
    /// Finds the cells in the flux of all `parts` ([`Cells::parts`]) and that of all directions.
    pub fn new(directions: &Directions, parts: &[Vec3], flux: &[Vec3]) -> UnevenCells {
        let cells = &directions.cells;
        let leaves = flux.len();
        let all: f64 = flux.iter().map(|&flux| f64::from(luminance(flux))).sum();
        let least = UNEVEN * all as f32;
        let mut found: Vec<(f32, u32)> = (0..leaves as u32)
            .into_par_iter()
            .with_min_len(1024)
            // No more can be out of place than there is.
            .filter(|&leaf| luminance(flux[leaf as usize]) > least)
            .map(|leaf| (out_of_place(cells, leaf, parts), leaf))
            .filter(|found| found.0 > least)
            .collect();
        found.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        found.truncate(MOST_CELLS);
        if found.is_empty() {
            return UnevenCells::default();
        }
        found.sort_unstable_by_key(|found| found.1);
        let around: Vec<Vec<u32>> = found.iter().map(|&(_, leaf)| cells.around(leaf)).collect();
        let mut asked_before = vec![0; leaves + 1];
        around
            .iter()
            .flatten()
            .for_each(|&leaf| asked_before[leaf as usize + 1] = 1);
        for leaf in 0..leaves {
            asked_before[leaf + 1] += asked_before[leaf];
        }
        let height = leaves.trailing_zeros() as u8;
        let mut holds_asked = vec![0; (2 * leaves).div_ceil(64)];
        for slot in 1..2 * leaves {
            let node = Node::in_slot(slot, height);
            if asked_before[node.first() as usize] < asked_before[node.end() as usize] {
                holds_asked[slot / 64] |= 1 << (slot % 64);
            }
        }
        let bits =
            |around: &[Vec<u32>]| bits(around.iter().flatten().map(|&leaf| asked_before[leaf as usize]));
        UnevenCells {
            cells: (found.iter().zip(around.chunks(1)))
                .map(|(&(out_of_place, leaf), around)| Uneven {
                    direction: directions.tree.views[leaves + leaf as usize].direction,
                    out_of_place,
                    leaf,
                    around: bits(around),
                    parts: lit_parts(cells, leaf, parts),
                })
                .collect(),
            blocks: around.chunks(BLOCK).map(bits).collect(),
            asked_before,
            holds_asked,
            radius: directions.tree.views[leaves].radius,
            most_out_of_place: found.iter().map(|found| found.0).fold(0.0, f32::max),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The node in a slot, if it holds directions that are asked for, and which of them.
    #[inline]
    fn asked_in(&self, slot: u32) -> Option<(Node, Range<u32>)> {
        if self.holds_asked[slot as usize / 64] >> (slot % 64) & 1 == 0 {
            return None;
        }
        let height = (self.asked_before.len() - 1).trailing_zeros() as u8;
        let node = Node::in_slot(slot as usize, height);
        let before = |leaf: u32| self.asked_before[leaf as usize];
        Some((node, before(node.first())..before(node.end())))
    }
}

/// The bits of these places.
fn bits(places: impl Iterator<Item = u32>) -> Bits {
    let mut places: Vec<u32> = places.collect();
    places.sort_unstable();
    (places.chunk_by(|a, b| a / 64 == b / 64))
        .map(|word| {
            (
                word[0] / 64,
                word.iter().fold(0, |bits, place| bits | 1 << (place % 64)),
            )
        })
        .collect()
}

/// Flux (luminance) that is not where it would be if a direction's cell were even.
fn out_of_place(cells: &Cells, leaf: u32, parts: &[Vec3]) -> f32 {
    let own = cells.parts_of(leaf);
    let (mut angle, mut flux) = (0.0, 0.0);
    for &part in own {
        angle += cells.angle(part);
        flux += luminance(parts[part as usize]);
    }
    let off = |&part: &u32| (luminance(parts[part as usize]) - flux * cells.angle(part) / angle).abs();
    // What is missing in one part is too much in another.
    0.5 * own.iter().map(off).sum::<f32>()
}

fn lit_parts(cells: &Cells, leaf: u32, parts: &[Vec3]) -> Vec<CellPart> {
    let mut sum = 0.0;
    let lit = |&part: &u32| {
        let flux = parts[part as usize];
        sum += luminance(flux);
        (luminance(flux) > 0.0).then(|| CellPart {
            direction: cells.direction(part),
            flux,
            sum,
        })
    };
    cells.parts_of(leaf).iter().filter_map(lit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cuts::VisibilityCuts;
    use crate::cuts::tests::world;
    use relight_transport::cuts::SiteCuts;

    fn uneven(radiance: impl Fn(Vec3) -> Vec3 + Sync) -> (VisibilityCuts, UnevenCells) {
        let cuts = VisibilityCuts::of_directions(SiteCuts::default(), &world().lights);
        let directions = cuts.directions().unwrap();
        let parts = directions.cells.parts(radiance);
        let cells = UnevenCells::new(directions, &parts, &directions.cells.flux(&parts));
        (cuts, cells)
    }

    #[test]
    fn an_even_or_a_smooth_sky_has_no_uneven_cells() {
        assert!(uneven(|_| Vec3::ZERO).1.cells.is_empty());
        assert!(uneven(|_| Vec3::new(3.0, 2.0, 1.0)).1.cells.is_empty());
        // Cells of 1024 are 0.11 wide: a hundredth as steep as in the lamp below is smooth.
        assert!(uneven(|d| Vec3::splat(2.0 + 0.2 * d.y)).1.cells.is_empty());
    }

    #[test]
    fn a_lamps_uneven_cells_are_those_that_its_edge_crosses() {
        let lit = |d: Vec3| d.y > 0.8;
        let radiance = |d: Vec3| if lit(d) { Vec3::ONE } else { Vec3::ZERO };
        let (cuts, uneven) = uneven(radiance);
        let cells = &cuts.directions().unwrap().cells;
        let crossed = |leaf: u32| {
            let lit = cells
                .parts_of(leaf)
                .iter()
                .filter(|&&p| lit(cells.direction(p)))
                .count();
            // A part in a corner is out of place, but less than counts.
            (lit > 0 && lit < cells.parts_of(leaf).len()).then_some(lit)
        };
        let found: Vec<u32> = uneven.cells.iter().map(|cell| cell.leaf).collect();
        assert!(found.is_sorted() && found.iter().all(|&leaf| crossed(leaf).is_some()));
        let missed = |leaf: &u32| crossed(*leaf).is_some() && !found.contains(leaf);
        assert_eq!((0..1024).filter(missed).count(), 0);
        for cell in &uneven.cells {
            let parts: f32 = cell.parts.iter().map(|part| luminance(part.flux)).sum();
            assert!(cell.out_of_place > 0.0 && cell.out_of_place < parts);
            assert_eq!(cell.parts.len(), crossed(cell.leaf).unwrap());
        }
    }

    #[test]
    fn bits_are_those_of_the_places() {
        let places = [5, 64, 0, 63, 200, 5];
        let expected = vec![(0, 1 << 5 | 1 | 1 << 63), (1, 1), (3, 1 << 8)];
        assert_eq!(bits(places.into_iter()), expected);
    }
}
