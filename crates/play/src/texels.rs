//! Which places of the surface the texels of a lightmap show.
//!
//! Every texel has a few places spread over its square, of which those on the surface are kept, as pixels have rays. A texel whose square a
//! triangle touches, but none of these places, takes the point of the triangle that is nearest to its middle: bilinear lookups of
//! the triangle reach it, too. What nothing touches is filled from the nearest texels that have light ([`fill`]), so that neither
//! lookups nor mip levels mix in what is no surface.

use glam::{DVec2, Vec2};
use rayon::prelude::*;
use relight_render::texels::OnTriangle;
use relight_transport::sampling::r2;
use std::collections::HashSet;

/// Places over a texel's square.
const PLACES: u32 = 8;
/// The same of maps with so many texels that they would take too much memory.
const PLACES_OF_MANY: u32 = 4;
const MANY: usize = 2048 * 2048;

/// Rows that are found together.
const STRIP: usize = 16;

/// How far inside of a triangle, in texels, a place lies that another triangle may not have, too: what rounding of coordinates moves is
/// much less.
const INSIDE: f64 = 0.02;

/// Where the triangles of a scene lie in a square map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Atlas {
    /// Texels along each side.
    pub size: u32,
    /// Of each triangle of the scene, by its world index, its corners in the order of its front; coordinates from 0 to 1, the
    /// first from left to right, the second downwards. Triangles without area in the map are not in it.
    pub corners: Vec<[Vec2; 3]>,
}

/// The places of all texels, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Texels {
    /// Texels along each side.
    pub size: u32,
    /// Start of each texel's places, and the end of the last.
    pub offsets: Vec<u32>,
    /// Places; a texel's first one is the nearest to its middle.
    pub places: Vec<OnTriangle>,
    /// Triangles, rising, that lie over others in the map, and how much of the map, in texels, is covered more than once.
    pub overlapping: Vec<u32>,
    /// See `overlapping`.
    pub covered_twice: f64,
    /// How much of the map is covered, in texels.
    pub covered: f64,
}

/// A triangle in texels.
struct Flat {
    corners: [DVec2; 3],
    /// Twice the area, signed.
    doubled: f64,
}

impl Flat {
    fn new(corners: [Vec2; 3], size: u32) -> Option<Flat> {
        let corners = corners.map(|corner| corner.as_dvec2() * f64::from(size));
        let [a, b, c] = corners;
        let doubled = (b - a).perp_dot(c - a);
        (doubled != 0.0 && corners.iter().all(|corner| corner.is_finite()))
            .then_some(Flat { corners, doubled })
    }

    /// Weights of the three corners at a place; all from 0 to 1 within.
    fn weights(&self, place: DVec2) -> [f64; 3] {
        let [a, b, c] = self.corners;
        let v = (place - a).perp_dot(c - a) / self.doubled;
        let w = (b - a).perp_dot(place - a) / self.doubled;
        [1.0 - v - w, v, w]
    }

    /// The least distance of a place within from the sides, texels; below 0 outside.
    fn depth(&self, weights: [f64; 3]) -> f64 {
        let [a, b, c] = self.corners;
        let sides = [b.distance(c), c.distance(a), a.distance(b)];
        let heights = [0, 1, 2].map(|k| weights[k] * self.doubled.abs() / sides[k]);
        heights.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Of what the triangle has of a texel's square, around a middle outside of the triangle, the point nearest to the middle.
    fn nearest(&self, middle: DVec2) -> Option<DVec2> {
        let [a, b, c] = self.corners;
        // The way there lies within the square, so that it ends at a side.
        let ends = [(a, b), (b, c), (c, a)].map(|(from, to)| {
            let along = to - from;
            let (mut first, mut last) = (0.0f64, 1.0f64);
            for (start, step) in [(from.x - middle.x, along.x), (from.y - middle.y, along.y)] {
                if step == 0.0 {
                    if start.abs() > 0.5 {
                        return None;
                    }
                    continue;
                }
                let (s, t) = ((-0.5 - start) / step, (0.5 - start) / step);
                (first, last) = (first.max(s.min(t)), last.min(s.max(t)));
            }
            let nearest = (middle - from).dot(along) / along.length_squared();
            (first <= last).then(|| from + along * nearest.clamp(first, last))
        });
        let nearer = |p: DVec2, q: DVec2| match q.distance_squared(middle) < p.distance_squared(middle) {
            true => q,
            false => p,
        };
        ends.into_iter().flatten().reduce(nearer)
    }

    /// From where to where the triangle reaches along x between two y.
    fn span(&self, low: f64, high: f64) -> (f64, f64) {
        let [a, b, c] = self.corners;
        let mut span = (f64::INFINITY, f64::NEG_INFINITY);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (from, to) = if from.y <= to.y { (from, to) } else { (to, from) };
            if to.y < low || from.y > high {
                continue;
            }
            let at = |y: f64| match to.y > from.y {
                true => from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y)).clamp(0.0, 1.0),
                false => from.x,
            };
            for x in [at(low), at(high), if to.y <= high { to.x } else { at(high) }] {
                span = (span.0.min(x), span.1.max(x));
            }
        }
        span
    }

    fn bounds(&self) -> (DVec2, DVec2) {
        let [a, b, c] = self.corners;
        (a.min(b).min(c), a.max(b).max(c))
    }
}

/// Places within a texel, from its upper left corner: the middle, then others the farther from it the later.
fn pattern(size: u32) -> Vec<DVec2> {
    let count = match (size as usize).pow(2) > MANY {
        true => PLACES_OF_MANY,
        false => PLACES,
    };
    let middle = DVec2::splat(0.5);
    let mut places: Vec<DVec2> = (1..count).map(|i| r2(i, Vec2::ZERO).as_dvec2()).collect();
    places.push(middle);
    places.sort_by(|a, b| a.distance_squared(middle).total_cmp(&b.distance_squared(middle)));
    places
}

/// What is known of a texel while triangles come.
#[derive(Clone)]
struct Slots {
    /// Per place of the pattern the triangle that it lies on.
    places: Vec<Option<(OnTriangle, f64)>>,
    /// The nearest point of a triangle that touches the square, and its squared distance from the middle.
    touched: Option<(OnTriangle, f64)>,
}

/// A strip of rows.
struct Strip {
    counts: Vec<u32>,
    places: Vec<OnTriangle>,
    overlapping: HashSet<u32>,
    covered: usize,
    twice: usize,
}

impl Texels {
    /// Finds the places of all texels.
    pub fn of(atlas: &Atlas) -> Texels {
        let size = atlas.size as usize;
        let mut strips: Vec<Vec<u32>> = vec![Vec::new(); size.div_ceil(STRIP)];
        for (triangle, &corners) in (0..).zip(&atlas.corners) {
            let Some(flat) = Flat::new(corners, atlas.size) else {
                continue;
            };
            let (low, high) = flat.bounds();
            let strip = |y: f64| (y.clamp(0.0, (size - 1) as f64) as usize) / STRIP;
            for strip in strip(low.y)..=strip(high.y) {
                strips[strip].push(triangle);
            }
        }
        let pattern = pattern(atlas.size);
        let strips: Vec<Strip> = (strips.par_iter().enumerate())
            .map(|(strip, triangles)| strip_of(atlas, strip * STRIP, triangles, &pattern))
            .collect();
        let mut texels = Texels {
            size: atlas.size,
            offsets: vec![0],
            ..Texels::default()
        };
        let mut end = 0;
        let share = 1.0 / pattern.len() as f64;
        for strip in strips {
            for count in strip.counts {
                end += count;
                texels.offsets.push(end);
            }
            texels.places.extend(strip.places);
            texels.overlapping.extend(strip.overlapping);
            texels.covered += strip.covered as f64 * share;
            texels.covered_twice += strip.twice as f64 * share;
        }
        texels.overlapping.sort_unstable();
        texels.overlapping.dedup();
        texels
    }

    /// Number of texels.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Places of a texel.
    pub fn places_of(&self, texel: usize) -> &[OnTriangle] {
        &self.places[self.offsets[texel] as usize..self.offsets[texel + 1] as usize]
    }

    /// Those places alone that `keep` says, texel by texel: which of its places each keeps.
    pub fn keep(&mut self, keep: impl Fn(usize, &[OnTriangle]) -> Vec<OnTriangle> + Sync) {
        let kept: Vec<Vec<OnTriangle>> = (0..self.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|texel| match self.places_of(texel) {
                [] => Vec::new(),
                places => keep(texel, places),
            })
            .collect();
        let mut end = 0;
        for (offset, kept) in self.offsets.iter_mut().skip(1).zip(&kept) {
            end += kept.len() as u32;
            *offset = end;
        }
        self.places = kept.concat();
    }
}

/// The texels of some rows from `first` on.
fn strip_of(atlas: &Atlas, first: usize, triangles: &[u32], pattern: &[DVec2]) -> Strip {
    let size = atlas.size as usize;
    let rows = STRIP.min(size - first);
    let nothing = Slots {
        places: vec![None; pattern.len()],
        touched: None,
    };
    let mut slots = vec![nothing; if triangles.is_empty() { 0 } else { rows * size }];
    let mut strip = Strip {
        counts: Vec::with_capacity(rows * size),
        places: Vec::new(),
        overlapping: HashSet::new(),
        covered: 0,
        twice: 0,
    };
    for &triangle in triangles {
        let Some(flat) = Flat::new(atlas.corners[triangle as usize], atlas.size) else {
            continue;
        };
        let (low, high) = flat.bounds();
        let texel = |at: f64, least: usize, most: usize| (at.max(least as f64) as usize).min(most);
        for y in texel(low.y, first, first + rows - 1)..=texel(high.y, first, first + rows - 1) {
            let (left, right) = flat.span(y as f64, y as f64 + 1.0);
            for x in texel(left, 0, size - 1)..=texel(right, 0, size - 1) {
                let corner = DVec2::new(x as f64, y as f64);
                let slots = &mut slots[(y - first) * size + x];
                strip.add(slots, triangle, &flat, corner, pattern);
            }
        }
    }
    for slots in &slots {
        let before = strip.places.len();
        strip
            .places
            .extend(slots.places.iter().flatten().map(|place| place.0));
        strip.covered += strip.places.len() - before;
        if strip.places.len() == before {
            strip.places.extend(slots.touched.map(|touched| touched.0));
        }
        strip.counts.push((strip.places.len() - before) as u32);
    }
    strip.counts.resize(rows * size, 0);
    strip
}

impl Strip {
    /// Takes what a triangle has of a texel.
    fn add(&mut self, slots: &mut Slots, triangle: u32, flat: &Flat, corner: DVec2, pattern: &[DVec2]) {
        let on = |[_, v, w]: [f64; 3]| OnTriangle {
            triangle,
            barycentric: [v as f32, w as f32],
        };
        let mut inside = false;
        for (slot, place) in slots.places.iter_mut().zip(pattern) {
            let weights = flat.weights(corner + *place);
            if weights.iter().any(|weight| *weight < 0.0) {
                continue;
            }
            inside = true;
            let depth = flat.depth(weights);
            match slot {
                Some((other, deep)) => {
                    if depth > INSIDE && *deep > INSIDE {
                        self.twice += 1;
                        self.overlapping.extend([other.triangle, triangle]);
                    }
                }
                None => *slot = Some((on(weights), depth)),
            }
        }
        if inside {
            return;
        }
        // The middle is one of the places.
        let middle = corner + 0.5;
        let Some(nearest) = flat.nearest(middle) else {
            return;
        };
        let off = nearest.distance_squared(middle);
        if slots.touched.is_none_or(|(_, least)| off < least) {
            let weights = flat.weights(nearest).map(|weight| weight.clamp(0.0, 1.0));
            slots.touched = Some((on(weights), off));
        }
    }
}

/// Gives every texel that is not `lit` the value of the nearest one that is (by steps to the eight texels around); maps without any stay as
/// they are.
pub fn fill<T: Copy>(size: u32, lit: &[bool], values: &mut [T]) {
    let size = size as usize;
    let mut done = lit.to_vec();
    let mut border: Vec<u32> = (0..lit.len() as u32).filter(|&i| lit[i as usize]).collect();
    while !border.is_empty() {
        let mut next = Vec::new();
        // Sides before corners: those are nearer.
        for steps in [
            [(0i64, -1i64), (-1, 0), (1, 0), (0, 1)],
            [(-1, -1), (1, -1), (-1, 1), (1, 1)],
        ] {
            for &from in &border {
                let (x, y) = ((from as usize % size) as i64, (from as usize / size) as i64);
                for (dx, dy) in steps {
                    let (x, y) = (x + dx, y + dy);
                    if x < 0 || y < 0 || x >= size as i64 || y >= size as i64 {
                        continue;
                    }
                    let to = y as usize * size + x as usize;
                    if !done[to] {
                        done[to] = true;
                        values[to] = values[from as usize];
                        next.push(to as u32);
                    }
                }
            }
        }
        border = next;
    }
}

#[cfg(test)]
mod tests;
