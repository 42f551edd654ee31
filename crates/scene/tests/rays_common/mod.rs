//! Meshes, rays and the double-precision truth for the ray casting tests.
#![allow(dead_code)] // Each test file uses its part.

use glam::{DVec3, Vec3};
use relight_scene::rays::{Hit, Ray};

#[derive(Clone)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    pub fn scaled(mut self, scale: f32) -> Mesh {
        self.positions.iter_mut().for_each(|p| *p *= scale);
        self
    }

    pub fn moved(mut self, shift: Vec3) -> Mesh {
        self.positions.iter_mut().for_each(|p| *p += shift);
        self
    }

    pub fn add(&mut self, other: Mesh) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    pub fn bounds(&self) -> (Vec3, Vec3) {
        let low = self
            .positions
            .iter()
            .copied()
            .reduce(Vec3::min)
            .unwrap_or_default();
        let high = self
            .positions
            .iter()
            .copied()
            .reduce(Vec3::max)
            .unwrap_or_default();
        (low, high)
    }

    pub fn center(&self) -> Vec3 {
        let (low, high) = self.bounds();
        (low + high) * 0.5
    }

    /// A grid of quads whose corners `place` puts, from column and row.
    pub fn quads(&mut self, columns: u32, rows: u32, place: impl Fn(f32, f32) -> Vec3) {
        let first = self.positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                self.positions.push(place(column as f32, row as f32));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * (columns + 1) + column;
                let c = a + columns + 1;
                self.triangles.extend([[a, a + 1, c + 1], [a, c + 1, c]]);
            }
        }
    }
}

/// Unit cubes with integer corners, every other place of an n × n × n grid; outward normals.
pub fn box_grid(n: u32) -> Mesh {
    let mut mesh = Mesh {
        positions: vec![],
        triangles: vec![],
    };
    for cell in 0..n * n * n {
        let low = Vec3::new((cell % n) as f32, (cell / n % n) as f32, (cell / n / n) as f32) * 2.0;
        for (origin, u, v) in [
            (Vec3::ZERO, Vec3::Y, Vec3::X),
            (Vec3::Z, Vec3::X, Vec3::Y),
            (Vec3::ZERO, Vec3::Z, Vec3::Y),
            (Vec3::X, Vec3::Y, Vec3::Z),
            (Vec3::ZERO, Vec3::X, Vec3::Z),
            (Vec3::Y, Vec3::Z, Vec3::X),
        ] {
            mesh.quads(1, 1, |a, b| low + origin + u * a + v * b);
        }
    }
    mesh
}

/// The square [0, n]² of the plane x = 0, in unit quads.
pub fn plane_grid(n: u32) -> Mesh {
    let mut mesh = Mesh {
        positions: vec![],
        triangles: vec![],
    };
    mesh.quads(n, n, |u, v| Vec3::new(0.0, u, v));
    mesh
}

/// A closed sphere of radius 1 about the origin; outward normals, each vertex shared (indices wrap round).
pub fn sphere(rows: u32, columns: u32) -> Mesh {
    let mut positions = vec![Vec3::Y];
    for row in 1..rows {
        for column in 0..columns {
            let (polar, around) = (
                f64::from(row) / f64::from(rows) * std::f64::consts::PI,
                f64::from(column) / f64::from(columns) * std::f64::consts::TAU,
            );
            let p = DVec3::new(
                polar.sin() * around.cos(),
                polar.cos(),
                -polar.sin() * around.sin(),
            );
            positions.push(p.as_vec3());
        }
    }
    positions.push(Vec3::NEG_Y);
    let south = positions.len() as u32 - 1;
    let at = |row: u32, column: u32| 1 + (row - 1) * columns + column % columns;
    let mut triangles = vec![];
    for column in 0..columns {
        triangles.push([0, at(1, column), at(1, column + 1)]);
        for row in 1..rows - 1 {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            triangles.extend([[a, c, d], [a, d, b]]);
        }
        triangles.push([at(rows - 1, column), south, at(rows - 1, column + 1)]);
    }
    Mesh { positions, triangles }
}

/// Random triangles of very different sizes, slivers among them.
pub fn soup(count: usize) -> Mesh {
    let mut random = Random(11);
    let mut mesh = Mesh {
        positions: vec![],
        triangles: vec![],
    };
    for index in 0..count {
        let first = mesh.positions.len() as u32;
        let center = random.point_in_cube() * 4.0;
        let size = 4f32.powi(-(index as i32 % 5));
        mesh.positions
            .extend([0, 1, 2].map(|_| center + (random.point_in_cube() - 0.5) * 2.0 * size));
        if index % 7 == 0 {
            mesh.positions[first as usize + 2] = mesh.positions[first as usize] + Vec3::splat(1e-4);
        }
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

/// Rays in and around a mesh: random ones, ones along an axis with zeros of both signs, ones through vertices, short and
/// long directions, bounded and unbounded.
pub fn awkward_rays(mesh: &Mesh, count: usize) -> Vec<Ray> {
    let mut random = Random(5);
    let (low, high) = mesh.bounds();
    let size = (high - low).max_element();
    (0..count)
        .map(|index| {
            let target = if index % 5 == 0 {
                mesh.positions[random.below(mesh.positions.len())]
            } else {
                random.point_in(mesh)
            };
            let mut direction = random.point_in_cube() - 0.5;
            match index % 4 {
                0 => direction = [Vec3::X, Vec3::Y, Vec3::Z][index / 4 % 3] * 0.5,
                1 => direction = -[Vec3::X, Vec3::Y, Vec3::Z][index / 4 % 3],
                _ => {}
            }
            let length = [1.0, 1e-6, 300.0][index % 3];
            let origin = target - direction * size * [2.0, 0.2][index / 7 % 2];
            let t_max = if index % 11 == 0 {
                size * 2.0 / length
            } else {
                f32::INFINITY
            };
            Ray {
                origin,
                direction: direction * length,
                t_min: 0.0,
                t_max,
            }
        })
        .collect()
}

/// Compares a closest hit with a loop over all triangles in double precision. Returns whether it proved something: rays
/// within a small margin of an edge may go either way, and are only held to their bounds.
///
/// The margins: f32 moves a triangle by up to 17 · 2⁻²⁴ of the distance to its farthest vertex (derived in
/// `ray_setup`); 2⁻¹⁸ is four times that.
pub fn compare_with_truth(name: &str, mesh: &Mesh, ray: &Ray, hit: Option<Hit>) -> bool {
    let mut nearest_certain = f64::INFINITY;
    let mut hit_is_possible = hit.is_none();
    let mut all_certain = true;
    let origin = ray.origin.as_dvec3();
    let direction = ray.direction.as_dvec3();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3() - origin);
        let reach = a.length().max(b.length()).max(c.length());
        let margin = reach * 2f64.powi(-18);
        let unit = direction.normalize();
        // Signed distance of the ray from each edge line, positive inside (for one orientation).
        let side = |p: DVec3, q: DVec3| {
            let across = (q - p).reject_from(unit).length();
            if across == 0.0 {
                0.0
            } else {
                p.cross(q).dot(unit) / across
            }
        };
        let sides = [side(a, b), side(b, c), side(c, a)];
        let smallest = sides.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = sides.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let inside = smallest.max(-largest);
        let normal = (b - a).cross(c - a);
        let along = normal.dot(direction);
        let t = normal.dot(a) / along;
        // A slanted plane turns a sideways error into one along the ray.
        let slant = normal.length() * direction.length() / along.abs();
        let t_margin = margin * (1.0 + slant) / direction.length();
        let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
        let possible = inside > -margin && t > t_min - t_margin && t < t_max + t_margin;
        let certain = inside > margin && t > t_min + t_margin && t < t_max - t_margin;
        let possible = possible || (inside > -margin && !t_margin.is_finite());
        if let Some(hit) = hit
            && hit.triangle as usize == index
        {
            assert!(
                possible && ((f64::from(hit.t) - t).abs() <= t_margin || !t_margin.is_finite()),
                "{name}: {hit:?} for {ray:?}, but t = {t} ± {t_margin}, inside by {inside} ± {margin}"
            );
            hit_is_possible = true;
        }
        if certain {
            nearest_certain = nearest_certain.min(t + t_margin);
        } else if possible {
            all_certain = false;
        }
    }
    assert!(hit_is_possible, "{name}: {hit:?} names no triangle");
    let found = hit.map_or(f64::INFINITY, |hit| f64::from(hit.t));
    assert!(
        found <= nearest_certain,
        "{name}: lost the hit at {nearest_certain}, found {hit:?}, {ray:?}"
    );
    all_certain
}

/// SplitMix64: the same rays in every run.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    pub fn point_in_cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }

    pub fn point_in(&mut self, mesh: &Mesh) -> Vec3 {
        let (low, high) = mesh.bounds();
        low + (high - low) * self.point_in_cube()
    }

    /// Uniform over the sphere.
    pub fn direction(&mut self) -> Vec3 {
        let z = 1.0 - 2.0 * self.unit();
        let angle = self.unit() * std::f32::consts::TAU;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    }
}
