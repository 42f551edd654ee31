//! Cells of even directions: the part of the sphere for which each of them stands.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relight_scene::environment::direction_from_uv;
use relight_transport::grid::PointGrid;

/// Which direction each small part of the sphere is nearest to: columns of longitude, rows of latitude.
pub struct Cells {
    width: usize,
    height: usize,
    leaf: Vec<u32>,
    /// Parts in order of their directions, and where each direction's start; one more than there are directions.
    parts: Vec<u32>,
    starts: Vec<u32>,
    /// Solid angle of a part in each row.
    angles: Vec<f32>,
}

/// Parts of the table for each direction, at least: light that changes within a direction's cell is averaged over them.
const PARTS: usize = 16;

impl Cells {
    /// Finds the nearest of `directions` (unit) for every part.
    pub fn new(directions: &[Vec3]) -> Cells {
        let height = ((PARTS * directions.len()) as f64 / 2.0).sqrt().ceil() as usize;
        let width = 2 * height;
        // Cells of even directions reach at most some 1.3 times the radius of a disc of their size.
        let reach = 3.0 / (directions.len() as f32).sqrt();
        let grid = PointGrid::new(directions, directions, reach);
        let leaf: Vec<u32> = (0..width * height)
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let d = part_direction(i, width, height);
                let mut best = (f32::NEG_INFINITY, u32::MAX);
                grid.near(d, |entry| {
                    let near = entry.position.dot(d);
                    if near > best.0 || (near == best.0 && entry.index < best.1) {
                        best = (near, entry.index);
                    }
                });
                best.1
            })
            .collect();
        let mut starts = vec![0u32; directions.len() + 1];
        for &leaf in &leaf {
            starts[leaf as usize + 1] += 1;
        }
        for i in 0..directions.len() {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut parts = vec![0u32; leaf.len()];
        for (part, &leaf) in (0..).zip(&leaf) {
            parts[next[leaf as usize] as usize] = part;
            next[leaf as usize] += 1;
        }
        Cells {
            width,
            height,
            leaf,
            parts,
            starts,
            angles: (0..height).map(|y| part_angle(y, width, height)).collect(),
        }
    }

    /// Flux on a perpendicular surface (W/m²) of each part, when `radiance(direction)` comes from everywhere.
    pub fn parts(&self, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Vec<Vec3> {
        let mut parts = vec![Vec3::ZERO; self.width * self.height];
        (parts.par_chunks_mut(self.width).enumerate()).for_each(|(y, row)| {
            let first = y * self.width;
            let angle = self.angles[y];
            for (part, flux) in (first..).zip(row) {
                *flux = radiance(part_direction(part, self.width, self.height)) * angle;
            }
        });
        parts
    }

    /// Flux that comes from the cell of each direction, from that of its parts.
    pub fn flux(&self, parts: &[Vec3]) -> Vec<Vec3> {
        (0..self.starts.len() - 1)
            .into_par_iter()
            .with_min_len(1024)
            .map(|leaf| {
                let sum: DVec3 = self
                    .parts_of(leaf as u32)
                    .iter()
                    .map(|&p| parts[p as usize].as_dvec3())
                    .sum();
                sum.as_vec3()
            })
            .collect()
    }

    /// The parts of a direction's cell, rising.
    pub fn parts_of(&self, leaf: u32) -> &[u32] {
        &self.parts[self.starts[leaf as usize] as usize..self.starts[leaf as usize + 1] as usize]
    }

    /// Unit direction to the middle of a part.
    pub fn direction(&self, part: u32) -> Vec3 {
        part_direction(part as usize, self.width, self.height)
    }

    /// Solid angle of a part.
    pub fn angle(&self, part: u32) -> f32 {
        self.angles[part as usize / self.width]
    }

    /// The directions next to one, and itself; rising.
    pub fn around(&self, leaf: u32) -> Vec<u32> {
        let mut near = vec![leaf];
        for &part in self.parts_of(leaf) {
            let (x, y) = (part as usize % self.width, part as usize / self.width);
            for dy in [-1i32, 0, 1] {
                for dx in [self.width - 1, 0, 1] {
                    let y = (y as i32 + dy).clamp(0, self.height as i32 - 1) as usize;
                    near.push(self.leaf[y * self.width + (x + dx) % self.width]);
                }
            }
        }
        near.sort_unstable();
        near.dedup();
        near
    }
}

fn part_direction(i: usize, width: usize, height: usize) -> Vec3 {
    let (x, y) = (i % width, i / width);
    direction_from_uv([(x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32])
}

/// Solid angle of a part in row `y`.
fn part_angle(y: usize, width: usize, height: usize) -> f32 {
    let polar = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).cos();
    (2.0 * std::f64::consts::PI / width as f64 * (polar(y) - polar(y + 1))) as f32
}
