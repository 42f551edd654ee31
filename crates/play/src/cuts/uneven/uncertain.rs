//! Which uneven cells may be partly hidden from a fragment, and the rays that settle it.

use super::{BLOCK, Bits, CellPart, UnevenCells};
use crate::cuts::sites::SITES;
use glam::Vec3;
use rayon::prelude::*;
use relight_render::direct::reflected;
use relight_render::exposure::Exposure;
use relight_render::sampler::Sampler;
use relight_scene::bsdf;
use relight_scene::bsdf::bounds::ReflectionBound;
use relight_scene::environment::luminance;
use relight_scene::rays::Ray;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::TracedScene;
use std::ops::Range;

/// Visibility this near to 0 or to 1 is certain.
const SURE: f32 = 0.05;

/// A cell is asked where what is out of place in it makes up this share of what the fragment reflects.
const LEAST: f32 = 0.002;

/// Share of a fragment's light that a cell's rays may leave uncertain. That falls with the root of their number, so a cell gets
/// as many as the square of how often this goes into its own share.
const PER_RAY: f32 = 0.02;

/// Most rays of a cell: as many as it has parts.
const MOST_RAYS: f32 = 16.0;

/// Cells that are fewer than so many of their radii above the horizon are uncertain because of it, and count for little.
const HORIZON: f32 = 3.0;

/// A fragment that reflects less than so much of what the mean one does counts as if it reflected that.
const FAINT: f32 = 0.1;

/// A cell that may be partly hidden from a fragment.
#[derive(Clone, Copy, Debug)]
pub struct Uncertain {
    fragment: u32,
    cell: u32,
    /// Visibility that the cell was given.
    seen: f32,
    /// Radiance (luminance) that the fragment would reflect of what is out of place.
    at_stake: f32,
}

/// A fragment that was shaded.
pub struct ShadedFragment<'a> {
    /// Which it is.
    pub fragment: u32,
    /// What of its reflection cuts shade.
    pub point: &'a ShadingPoint,
    /// Unit direction to the viewer.
    pub view: Vec3,
    /// Weights of its sites.
    pub weights: &'a [f32; SITES],
    /// What it reflects.
    pub radiance: Vec3,
}

/// From what on a cell matters to a fragment.
pub struct Stakes {
    /// Radiance (luminance) that the fragment would reflect of what is out of place.
    least: f32,
    /// Flux (luminance) of which the fragment can reflect that much at all.
    least_out_of_place: f32,
}

impl UnevenCells {
    /// From what on a cell matters at a place; `None` where none can.
    pub fn stakes(&self, place: &ShadedFragment) -> Option<Stakes> {
        let least = LEAST * luminance(place.radiance);
        // Most of a flux that is reflected, whatever its direction.
        let most = luminance(ReflectionBound::new(place.point, place.view).bound(|_| (1.0, 0.0)));
        let least_out_of_place = least / most;
        (self.most_out_of_place > least_out_of_place).then_some(Stakes {
            least,
            least_out_of_place,
        })
    }

    /// Adds to the `radiance` of the fragments what shading left out where it was uncertain; `uncertain` in order of fragments.
    /// Returns the number of rays that it took.
    pub fn resolve(
        &self,
        scene: &TracedScene,
        seen: &Exposure,
        narrow: &[bool],
        uncertain: &[Uncertain],
        radiance: &mut [Vec3],
    ) -> u64 {
        let fragments: Vec<&[Uncertain]> = uncertain.chunk_by(|a, b| a.fragment == b.fragment).collect();
        let sum: f64 = radiance.iter().map(|r| f64::from(luminance(*r))).sum();
        let faint = FAINT * (sum / radiance.len().max(1) as f64) as f32;
        let resolver = || Resolver {
            cells: self,
            scene,
            seen,
            narrow,
            rays: Vec::new(),
            terms: Vec::new(),
            occluded: Vec::new(),
        };
        let left_out: Vec<(Vec3, usize)> = (fragments.par_iter().with_min_len(16))
            .map_init(resolver, |resolver, uncertain| {
                let whole = luminance(radiance[uncertain[0].fragment as usize]).max(faint);
                (resolver.left_out(uncertain, whole), resolver.rays.len())
            })
            .collect();
        for (uncertain, (left_out, _)) in fragments.iter().zip(&left_out) {
            let radiance = &mut radiance[uncertain[0].fragment as usize];
            *radiance = (*radiance + *left_out).max(Vec3::ZERO);
        }
        left_out.iter().map(|(_, rays)| *rays as u64).sum()
    }
}

/// Calls `visit(word, bits)` for the words of a range of places.
fn words_of(range: Range<u32>, mut visit: impl FnMut(usize, u64)) {
    let mut start = range.start;
    while start < range.end {
        let end = range.end.min((start / 64 + 1) * 64);
        let bits = (u64::MAX >> (64 - (end - start))) << (start % 64);
        visit(start as usize / 64, bits);
        start = end;
    }
}

/// A surface's matt part alone.
pub fn matt_part(point: &ShadingPoint, wo: Vec3) -> ShadingPoint {
    ShadingPoint {
        diffuse: bsdf::diffuse_reflectance(point, point.shading_normal.dot(wo)),
        lambert: true,
        ..*point
    }
}

/// Finds the cells that are uncertain.
#[derive(Default)]
pub struct UncertaintyFinder {
    /// Which of the directions that are asked for are lit for some site, and which are dark for some: a bit each.
    lit: Vec<u64>,
    dark: Vec<u64>,
    /// Cells about which the sites are uncertain, rising.
    cells: Vec<u32>,
    /// What the sites see of each of those.
    seen: Vec<[f32; SITES]>,
}

impl UncertaintyFinder {
    /// Looks the directions that are asked for up in the merged cut of `sites`, whose nodes (as slots) come from left to right with
    /// the visibility from each. Nodes may be missing, which are dark.
    pub fn look_up(
        &mut self,
        uneven: &UnevenCells,
        sites: [u32; SITES],
        nodes: impl Iterator<Item = (u32, [f32; SITES])> + Clone,
    ) {
        self.cells.clear();
        let all = uneven.asked_before[uneven.asked_before.len() - 1].div_ceil(64) as usize;
        self.lit.clear();
        self.lit.resize(all, 0);
        self.dark.clear();
        self.dark.resize(all, u64::MAX);
        let used = sites.map(|site| site != u32::MAX);
        let (lit, dark) = (&mut self.lit, &mut self.dark);
        for (slot, seen) in nodes.clone() {
            let Some((_, asked)) = uneven.asked_in(slot) else {
                continue;
            };
            // Those that are not used come last.
            let first = seen[0];
            let (mut low, mut high) = (first, first);
            for (seen, used) in seen.into_iter().zip(used) {
                let seen = if used { seen } else { first };
                (low, high) = (low.min(seen), high.max(seen));
            }
            let (may_be_lit, may_be_dark) = (high > SURE, low < 1.0 - SURE);
            words_of(asked, |word, bits| {
                lit[word] |= if may_be_lit { bits } else { 0 };
                dark[word] &= if may_be_dark { u64::MAX } else { !bits };
            });
        }
        // Whether some of these directions are lit for some site and some are dark for some.
        let may_be_either = |directions: &Bits| {
            let (mut any_lit, mut any_dark) = (0, 0);
            for &(word, bits) in directions {
                any_lit |= lit[word as usize] & bits;
                any_dark |= dark[word as usize] & bits;
            }
            any_lit != 0 && any_dark != 0
        };
        for (block, (cells, around)) in uneven.cells.chunks(BLOCK).zip(&uneven.blocks).enumerate() {
            if !may_be_either(around) {
                continue;
            }
            let cells = (0..).zip(cells).filter(|(_, cell)| may_be_either(&cell.around));
            (self.cells).extend(cells.map(|(i, _)| (block * BLOCK) as u32 + i));
        }
        self.seen.clear();
        if self.cells.is_empty() {
            return;
        }
        let nodes = nodes.filter_map(|(slot, seen)| Some((uneven.asked_in(slot)?.0, seen)));
        let mut nodes = nodes.peekable();
        for &i in &self.cells {
            let leaf = uneven.cells[i as usize].leaf;
            while nodes.next_if(|(node, _)| node.end() <= leaf).is_some() {}
            let seen = nodes.peek().filter(|(node, _)| node.first() <= leaf);
            self.seen.push(seen.map_or([0.0; SITES], |(_, seen)| *seen));
        }
    }

    /// Appends the cells that matter at a place between these sites.
    pub fn find(
        &self,
        uneven: &UnevenCells,
        place: &ShadedFragment,
        stakes: &Stakes,
        out: &mut Vec<Uncertain>,
    ) {
        let within = HORIZON * uneven.radius;
        for (&i, seen) in self.cells.iter().zip(&self.seen) {
            let cell = &uneven.cells[i as usize];
            if cell.out_of_place <= stakes.least_out_of_place
                || place.point.geometric_normal.dot(cell.direction) < within
            {
                continue;
            }
            let at_stake = luminance(reflected(place.point, place.view, cell.direction)) * cell.out_of_place;
            if at_stake > stakes.least {
                out.push(Uncertain {
                    fragment: place.fragment,
                    cell: i,
                    seen: place.weights.iter().zip(seen).map(|(w, v)| w * v).sum(),
                    at_stake,
                });
            }
        }
    }
}

/// Casts rays for one fragment after the other.
struct Resolver<'a> {
    cells: &'a UnevenCells,
    scene: &'a TracedScene,
    seen: &'a Exposure,
    /// Whether something else shades each fragment's lobe; empty: of none.
    narrow: &'a [bool],
    rays: Vec<Ray>,
    /// What each ray adds if it is not occluded, and how much of that was taken to be seen.
    terms: Vec<(Vec3, f32)>,
    occluded: Vec<bool>,
}

impl Resolver<'_> {
    /// What shading left out of the radiance of one fragment, which is `whole` (luminance).
    fn left_out(&mut self, uncertain: &[Uncertain], whole: f32) -> Vec3 {
        self.rays.clear();
        self.terms.clear();
        let f = uncertain[0].fragment as usize;
        let (Some(_), Some(point)) = (&self.seen.hits[f], &self.seen.points[f]) else {
            return Vec3::ZERO;
        };
        let wo = -self.seen.directions[f];
        let point = match self.narrow.get(f) {
            Some(true) => matt_part(point, wo),
            _ => *point,
        };
        let mut places = Vec::new();
        for cell in uncertain.iter().filter(|cell| cell.at_stake > LEAST * whole) {
            if places.is_empty() {
                places = self.seen.places_of(self.scene, f);
            }
            self.aim(cell, (&point, wo), &places, cell.at_stake / whole);
        }
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
        self.scene.occluded_packet(&self.rays, &mut self.occluded);
        (self.terms.iter().zip(&self.occluded))
            .map(|(&(adds, seen), &dark)| adds * (if dark { 0.0 } else { 1.0 } - seen))
            .sum()
    }

    /// Aims rays at the parts of a cell, as many at each as its flux is worth, evenly spread, from the fragment's places in turn.
    /// `share`: how much of the fragment's radiance is at stake.
    fn aim(
        &mut self,
        cell: &Uncertain,
        (point, wo): (&ShadingPoint, Vec3),
        places: &[SurfaceHit],
        share: f32,
    ) {
        let parts = &self.cells.cells[cell.cell as usize].parts;
        let Some(CellPart { sum: all, .. }) = parts.last() else {
            return;
        };
        let rays = (share / PER_RAY).powi(2).ceil().min(MOST_RAYS);
        let start = Sampler::new(0, cell.fragment.into(), cell.cell).next_1d();
        for k in 0..rays as u32 {
            let at = (k as f32 + start) / rays * all;
            let part = &parts[parts.partition_point(|part| part.sum < at).min(parts.len() - 1)];
            let stands_for = part.flux * (all / (rays * luminance(part.flux)));
            let adds = reflected(point, wo, part.direction) * stands_for;
            if adds != Vec3::ZERO {
                let place = &places[self.rays.len() % places.len()];
                self.rays.push(ray_from(place, part.direction));
                self.terms.push((adds, cell.seen));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cuts::illumination::Illumination;
    use crate::cuts::shade::shade;
    use crate::cuts::tests::{HalfRoof, LIGHTS, cuts, world};
    use relight_transport::cuts::merge;
    use relight_transport::light_tree::Node;

    /// A lamp, as long as the floor, that is narrower than a direction's cell, beside the roof's edge. Truth: what the roof leaves of
    /// it, weighted by cosines, is the wedge between two angles: (sin b − sin a)/2. Tolerance: 16 rays for each cell,
    /// of which the edge crosses a row.
    #[test]
    fn the_edge_of_a_roof_moves_across_a_lamp_that_is_narrower_than_a_direction() {
        const FROM: f32 = 0.2;
        const TO: f32 = 0.24;
        let worst = |resolved: bool| {
            let roof = HalfRoof::new(true);
            let directions = roof.cuts.directions().unwrap();
            let angle = |d: Vec3| d.x.atan2(d.y);
            let lamp = |d: Vec3| d.y > 0.0 && angle(d) > FROM && angle(d) < TO;
            let parts = directions
                .cells
                .parts(|d| if lamp(d) { Vec3::ONE } else { Vec3::ZERO });
            let light = Illumination::of_parts(directions, &parts, LIGHTS as usize);
            let mut shaded = shade(&roof.cuts, &light, &roof.fragments());
            if resolved {
                let rays = (light.uneven).resolve(
                    &roof.scene,
                    &roof.seen,
                    &[],
                    &shaded.uncertain,
                    &mut shaded.radiance,
                );
                assert!(rays > 0);
            }
            let whole = 0.5 * (TO.sin() - FROM.sin());
            let error = |&(x, found): &(f32, f32)| {
                let edge = (-x).atan().clamp(FROM, TO);
                let truth = 0.5 * (TO.sin() - edge.sin());
                (found - truth).abs() / whole
            };
            let lit = roof.between_the_sites(&shaded.radiance);
            lit.iter().map(error).fold(0.0, f32::max)
        };
        assert!(worst(false) > 0.4, "{}", worst(false));
        assert!(worst(true) < 0.2, "{}", worst(true));
    }

    /// Truth: the visibility of every direction, one by one.
    #[test]
    fn a_cell_is_uncertain_where_some_site_sees_some_direction_around_it_and_some_does_not() {
        let world = world();
        let cuts = cuts(&world, 0.0);
        let directions = cuts.directions().unwrap();
        let parts = directions
            .cells
            .parts(|d| Vec3::splat(if d.x > 0.1 { 1.0 } else { 0.0 }));
        let flux = directions.cells.flux(&parts);
        let uneven = UnevenCells::new(directions, &parts, &flux);
        assert!(uneven.cells.len() > 3 * BLOCK);
        let height = cuts.lights.height();
        let mut finder = UncertaintyFinder::default();
        let mut uncertain = 0;
        for sites in [[0, 1, 2], [3, 4, u32::MAX], [5, u32::MAX, u32::MAX], [6, 7, 8]] {
            let mut nodes: Vec<(u32, [f32; SITES])> = Vec::new();
            let used = sites.iter().filter(|s| **s != u32::MAX).count();
            let of = |site: u32| {
                cuts.cuts
                    .cut(if site == u32::MAX { sites[0] } else { site } as usize)
            };
            merge(sites.map(of), |node: Node, seen| {
                let seen = std::array::from_fn(|k| if k < used { seen[k] } else { 0.0 });
                // Dark nodes are left out.
                if seen.iter().any(|v| *v > 0.0) {
                    nodes.push((node.slot(height) as u32, seen));
                }
            });
            finder.look_up(&uneven, sites, nodes.into_iter());
            let sees = |leaf: u32, k: usize| world.seen[sites[k] as usize][leaf as usize];
            let expected: Vec<u32> = (0..)
                .zip(&uneven.cells)
                .filter(|(_, cell)| {
                    let around = directions.cells.around(cell.leaf);
                    let some = |value: f32| {
                        around
                            .iter()
                            .any(|&leaf| (0..used).any(|k| sees(leaf, k) == value))
                    };
                    some(0.0) && some(1.0)
                })
                .map(|(i, _)| i)
                .collect();
            assert_eq!(finder.cells, expected);
            for (&i, seen) in finder.cells.iter().zip(&finder.seen) {
                let leaf = uneven.cells[i as usize].leaf;
                assert!((0..used).all(|k| seen[k] == sees(leaf, k)));
            }
            uncertain += expected.len();
        }
        assert!(
            uncertain > 20 && uncertain < 4 * uneven.cells.len(),
            "{uncertain}"
        );
    }

    #[test]
    fn words_of_a_range_hold_its_places() {
        for range in [0..0, 3..3, 0..64, 5..70, 63..64, 64..65, 10..300] {
            let mut found = Vec::new();
            words_of(range.clone(), |word, bits| {
                found.extend(
                    (0..64)
                        .filter(|bit| bits >> bit & 1 == 1)
                        .map(|bit| word as u32 * 64 + bit),
                );
            });
            assert_eq!(found, range.collect::<Vec<u32>>());
        }
    }
}
