//! The few shapes that all else is put together from.

use crate::mesh::{Mesh, cuboid, grid, join, lathe, mapped, quad};
use glam::{DVec2, DVec3, dvec2, dvec3};

/// A rectangle in space: a corner and its two whole sides, at right angles. Its front is the side of u × v.
#[derive(Clone, Copy)]
pub struct Plane {
    /// A corner.
    pub corner: DVec3,
    /// One side.
    pub u: DVec3,
    /// The other.
    pub v: DVec3,
}

/// A hole in a plane: from and to, metres along u and v.
pub type Hole = [DVec2; 2];

impl Plane {
    /// Unit normal of the front.
    pub fn normal(&self) -> DVec3 {
        self.u.cross(self.v).normalize()
    }

    /// The point at these metres along u and v.
    pub fn at(&self, p: DVec2) -> DVec3 {
        self.corner + self.u.normalize() * p.x + self.v.normalize() * p.y
    }

    /// Pieces between the holes: from and to.
    pub fn pieces(&self, holes: &[Hole]) -> Vec<Hole> {
        let cuts = |k: usize, length: f64| {
            let mut cuts: Vec<f64> = holes.iter().flatten().map(|p| p[k]).collect();
            cuts.extend([0.0, length]);
            cuts.sort_by(f64::total_cmp);
            cuts.dedup();
            cuts
        };
        let (us, vs) = (cuts(0, self.u.length()), cuts(1, self.v.length()));
        let mut pieces = vec![];
        for u in us.windows(2) {
            for v in vs.windows(2) {
                let middle = dvec2(0.5 * (u[0] + u[1]), 0.5 * (v[0] + v[1]));
                if !(holes.iter()).any(|[a, b]| middle.cmpgt(*a).all() && middle.cmplt(*b).all()) {
                    pieces.push([dvec2(u[0], v[0]), dvec2(u[1], v[1])]);
                }
            }
        }
        pieces
    }

    /// The plane as a sheet with holes.
    pub fn sheet(&self, holes: &[Hole]) -> Mesh {
        let piece = |[a, b]: Hole| {
            quad(
                self.at(a),
                self.at(dvec2(b.x, a.y)),
                self.at(b),
                self.at(dvec2(a.x, b.y)),
            )
        };
        let pieces: Vec<Mesh> = self.pieces(holes).into_iter().map(piece).collect();
        join(&pieces)
    }

    /// Boxes behind the plane, one a piece. The plane is along the axes.
    pub fn slabs(&self, holes: &[Hole], thickness: f64) -> Mesh {
        let back = -self.normal() * thickness;
        let slab = |[a, b]: Hole| {
            let (p, q) = (self.at(a), self.at(b) + back);
            cuboid(p.min(q), p.max(q))
        };
        let slabs: Vec<Mesh> = self.pieces(holes).into_iter().map(slab).collect();
        join(&slabs)
    }

    /// The plane further back, and wider by the same on all sides.
    pub fn behind(&self, by: f64) -> Plane {
        let (u, v) = (self.u.normalize() * by, self.v.normalize() * by);
        Plane {
            corner: self.corner - self.normal() * by - u - v,
            u: self.u + 2.0 * u,
            v: self.v + 2.0 * v,
        }
    }
}

/// A sphere about the origin, seen from outside.
pub fn sphere(radius: f64, around: usize) -> Mesh {
    let rings = around / 2;
    let profile: Vec<(f64, f64)> = (0..=rings)
        .map(|k| {
            let angle = std::f64::consts::PI * k as f64 / rings as f64;
            (radius * angle.sin(), -radius * angle.cos())
        })
        .collect();
    lathe(&profile, around, 1.0)
}

/// A cylinder on the origin, its ends closed.
pub fn cylinder(radius: f64, height: f64, around: usize) -> Mesh {
    lathe(
        &[(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)],
        around,
        1.0,
    )
}

/// A cone on the origin.
pub fn cone(radius: f64, height: f64, around: usize) -> Mesh {
    lathe(&[(0.0, 0.0), (radius, 0.0), (0.0, height)], around, 1.0)
}

/// A mesh that stood along +Y, lying along +X.
pub fn lying(mesh: Mesh) -> Mesh {
    mapped(mesh, |p| dvec3(p.y, -p.x, p.z))
}

/// Hanging cloth of one sheet about the origin: folds along x, hanging in y from 0 to `height`.
pub fn hanging(width: f64, height: f64, folds: f64, depth: f64) -> Mesh {
    grid(32, 6, |u, v| {
        let fold = depth * (u * folds * std::f64::consts::TAU).sin() * (1.0 - 0.5 * v);
        (
            dvec3((u - 0.5) * width, v * height, fold),
            dvec2(u * width, -v * height),
        )
    })
}

/// A small square with this middle and normal: a leaf.
pub fn leaf(middle: DVec3, normal: DVec3, size: f64) -> Mesh {
    let u = normal.any_orthonormal_vector() * 0.5 * size;
    let v = normal.cross(u);
    quad(middle - u - v, middle + u - v, middle + u + v, middle - u + v)
}

/// Boxes by their low and high corners.
pub fn boxes(of: &[([f64; 3], [f64; 3])]) -> Mesh {
    let all: Vec<Mesh> = of
        .iter()
        .map(|(low, high)| cuboid(DVec3::from(*low), DVec3::from(*high)))
        .collect();
    join(&all)
}
