//! Parts of emissive triangles that emit about alike: what is drawn of a textured emission.
//!
//! A triangle is halved at the middles of its sides, into four, again and again where its texture differs most, until
//! what is unknown of all of them together is little, or there are many. Parts that are dark for sure are left out, so a texture
//! with one bright texel has a few small parts around it.

use glam::{DVec2, DVec3, Vec2};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Most times that a triangle is halved: a part is as wide as a texel of a texture of 4096.
const MOST_LEVELS: u8 = 12;

/// A part of an emissive triangle, drawn evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissivePart {
    /// Barycentric weights of the triangle's vertices 1 and 2 at its corners.
    pub corners: [Vec2; 3],
    /// Luminance by which it is drawn, W/(m² sr); above 0.
    pub luminance: f32,
    /// Which of four it lies in, level by level, two bits each, the first level highest.
    code: u32,
    level: u8,
}

impl EmissivePart {
    /// All of a triangle.
    pub fn whole(luminance: f32) -> EmissivePart {
        EmissivePart {
            corners: [Vec2::ZERO, Vec2::X, Vec2::Y],
            luminance,
            code: 0,
            level: 0,
        }
    }

    /// Share of the triangle's area.
    pub fn share(&self) -> f64 {
        0.25f64.powi(i32::from(self.level))
    }

    /// Its corners in space, of a triangle of these vertices.
    pub fn vertices(&self, of: [DVec3; 3]) -> [DVec3; 3] {
        self.corners.map(|corner| interpolated(of, corner.as_dvec2()))
    }

    /// The triangle's weights at weights of the part.
    pub fn barycentric(&self, within: DVec2) -> DVec2 {
        let [a, b, c] = self.corners.map(|corner| corner.as_dvec2());
        a + (b - a) * within.x + (c - a) * within.y
    }

    /// The four parts of a part: at each corner, and between them.
    fn quarters(&self) -> [EmissivePart; 4] {
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
        let of = |k: u32, corners| EmissivePart {
            corners,
            luminance: self.luminance,
            code: self.code | k << (2 * (MOST_LEVELS - 1 - self.level)),
            level: self.level + 1,
        };
        [
            of(0, [a, ab, ca]),
            of(1, [ab, b, bc]),
            of(2, [ca, bc, c]),
            of(3, [bc, ca, ab]),
        ]
    }
}

/// Linear between the vertices of a triangle; `weights` are those of vertices 1 and 2.
pub fn interpolated(vertices: [DVec3; 3], weights: DVec2) -> DVec3 {
    let [a, b, c] = vertices;
    a + (b - a) * weights.x + (c - a) * weights.y
}

/// Which of a triangle's parts, in the order in which [`subdivide`] makes them, a place of these barycentric weights lies in;
/// `None` in a dark one.
pub fn part_at<T>(
    parts: &[T],
    part_of: impl Fn(&T) -> &EmissivePart,
    barycentric: [f32; 2],
) -> Option<usize> {
    let [v, w] = barycentric.map(f64::from);
    let mut weights = [1.0 - v - w, v, w];
    let mut code = 0;
    for _ in 0..MOST_LEVELS {
        let corner = weights.iter().position(|&weight| weight >= 0.5);
        weights = match corner {
            Some(k) => {
                let mut of_corner = weights.map(|weight| 2.0 * weight);
                of_corner[k] -= 1.0;
                of_corner
            }
            None => weights.map(|weight| 1.0 - 2.0 * weight),
        };
        code = code << 2 | corner.unwrap_or(3) as u32;
    }
    let i = parts
        .partition_point(|part| part_of(part).code <= code)
        .checked_sub(1)?;
    let part = part_of(&parts[i]);
    let below = 2 * (MOST_LEVELS - part.level);
    (part.code >> below == code >> below).then_some(i)
}

/// A part that may be halved further.
struct Open {
    triangle: usize,
    part: EmissivePart,
    area: f64,
    /// Least and most luminance.
    range: [f32; 2],
}

impl Open {
    /// What isn't known of its power.
    fn unknown(&self) -> f64 {
        self.area * f64::from(self.range[1] - self.range[0])
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Open) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Open {}
impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Open) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Open {
    fn cmp(&self, other: &Open) -> Ordering {
        (self.unknown().total_cmp(&other.unknown()))
            .then(other.triangle.cmp(&self.triangle))
            .then(other.part.code.cmp(&self.part.code))
    }
}

/// Parts of triangles of these `areas`, as many lists, each in order; at most about `most` in all, but one of each triangle.
/// `range(triangle, corners)` is the least and the most luminance within a part, safe bounds. `accuracy`: the share of the power
/// that may stay unknown. The parts' luminance is the most within each.
pub fn subdivide(
    areas: &[f64],
    most: usize,
    accuracy: f64,
    range: impl Fn(usize, &[Vec2; 3]) -> [f32; 2],
) -> Vec<Vec<EmissivePart>> {
    let mut open = BinaryHeap::new();
    let (mut unknown, mut known) = (0.0, 0.0);
    let open_of = |triangle: usize, part: EmissivePart| {
        let range = range(triangle, &part.corners);
        let part = EmissivePart {
            luminance: range[1],
            ..part
        };
        let area = areas[triangle] * part.share();
        (range[1] > 0.0).then_some(Open {
            triangle,
            part,
            area,
            range,
        })
    };
    let middle = |open: &Open| 0.5 * open.area * f64::from(open.range[0] + open.range[1]);
    for part in (0..areas.len()).filter_map(|i| open_of(i, EmissivePart::whole(0.0))) {
        unknown += part.unknown();
        known += middle(&part);
        open.push(part);
    }
    let mut parts = vec![Vec::new(); areas.len()];
    let mut count = open.len();
    while unknown > accuracy * known && count < most {
        let Some(widest) = open.pop() else { break };
        unknown -= widest.unknown();
        if widest.part.level == MOST_LEVELS {
            parts[widest.triangle].push(widest.part);
            continue;
        }
        known -= middle(&widest);
        count -= 1;
        for quarter in widest.part.quarters() {
            if let Some(quarter) = open_of(widest.triangle, quarter) {
                unknown += quarter.unknown();
                known += middle(&quarter);
                count += 1;
                open.push(quarter);
            }
        }
    }
    for Open { triangle, part, .. } in open {
        parts[triangle].push(part);
    }
    for parts in &mut parts {
        parts.sort_unstable_by_key(|part| part.code);
    }
    parts
}
