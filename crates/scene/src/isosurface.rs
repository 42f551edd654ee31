//! Isosurfaces of volumes: where a trilinearly interpolated density passes a level.
//!
//! Rays visit the cells between sample centres in order (Amanatides and Woo 1987). Inside a cell the density along
//! the ray is a cubic (Parker et al. 1998); its extremes split the cell's stretch into monotone parts, and
//! bisection finds the crossing. A side (inside or outside) is carried from cell to cell, so that no rounding at a
//! face between cells loses a crossing. The geometric normal is the gradient of the cell's interpolation, which jumps
//! between cells; the smooth normal interpolates central differences at the samples.

use crate::implicit::bisect;
use crate::rays::Ray;
use crate::scene::Mesh;
use crate::surface::{ClippedRay, SurfaceHit, Surfaces};
use crate::surface_nets::Field;
use glam::{DVec3, UVec3, Vec3};

/// Most samples that a volume may have: 2²⁸ bytes are a cube of 645 samples a side.
const MAX_SAMPLES: u64 = 1 << 28;

/// Why a volume cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// Fewer than two samples along an axis, or far too many.
    #[error("a volume of {size} samples; give it at least 2 along each axis and at most 2^28 in all")]
    Size {
        /// Samples along x, y and z.
        size: UVec3,
    },
    /// The data do not fill the volume.
    #[error("{found} bytes for a volume of {size} samples; one byte a sample is needed, {expected} in all")]
    Length {
        /// Samples along x, y and z.
        size: UVec3,
        /// Their product.
        expected: u64,
        /// Bytes given.
        found: usize,
    },
    /// The surface is cut open at the volume's border.
    #[error(
        "sample {at} on the border is {value}, above the level {level}; surround the data with empty samples"
    )]
    OpenBorder {
        /// Which sample.
        at: UVec3,
        /// Its density.
        value: u8,
        /// The level.
        level: f64,
    },
    /// Bounds that hold no volume.
    #[error(
        "bounds from {low} to {high} hold no volume; the second corner must be above the first along each axis"
    )]
    Bounds {
        /// First corner.
        low: Vec3,
        /// Second corner.
        high: Vec3,
    },
}

/// The surface on which a volume's density is at a level; denser is inside, its front is the outside.
#[derive(Clone, Debug)]
pub struct Isosurface {
    size: UVec3,
    samples: Vec<u8>,
    level: f64,
    low: DVec3,
    high: DVec3,
    albedo: Vec3,
}

/// A cell's density as a polynomial in its local coordinates, minus the level, negated: positive outside.
struct Cell {
    /// Coefficients of 1, x, y, z, xy, yz, zx, xyz.
    c: [f64; 8],
}

impl Isosurface {
    /// A volume of `size` samples, x fastest, then y, then z. `bounds` are its outer faces, so that sample
    /// (0, 0, 0) lies half a step inside the lower corner. `level` is in units of the samples, `albedo`
    /// Lambert's, linear RGB.
    ///
    /// # Errors
    /// See [`VolumeError`].
    pub fn new(
        size: UVec3,
        samples: Vec<u8>,
        level: f64,
        bounds: (Vec3, Vec3),
        albedo: Vec3,
    ) -> Result<Isosurface, VolumeError> {
        let expected = size
            .to_array()
            .iter()
            .try_fold(1u64, |product, &n| product.checked_mul(n.into()))
            .filter(|&product| product <= MAX_SAMPLES && size.min_element() >= 2)
            .ok_or(VolumeError::Size { size })?;
        if samples.len() as u64 != expected {
            let found = samples.len();
            return Err(VolumeError::Length {
                size,
                expected,
                found,
            });
        }
        let (low, high) = bounds;
        if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return Err(VolumeError::Bounds { low, high });
        }
        let surface = Isosurface {
            size,
            samples,
            level,
            low: low.as_dvec3(),
            high: high.as_dvec3(),
            albedo,
        };
        surface.check_border()?;
        Ok(surface)
    }

    /// Triangles of it, in the cells between its samples; `material` is theirs.
    pub fn mesh(&self, material: u32) -> Mesh {
        let (low, high) = self.domain();
        let last = (self.size - 2).as_dvec3();
        // The cell that holds a place, and where in it.
        let within = |p: DVec3| {
            let at = self.sample_from_world(p);
            let cell = at.floor().clamp(DVec3::ZERO, last);
            (cell.as_uvec3(), at - cell)
        };
        Field {
            low,
            high,
            nodes: self.size,
            value: &|p| {
                let (cell, local) = within(p);
                self.cell(cell).value(local)
            },
            gradient: &|p| {
                let (cell, local) = within(p);
                self.smooth_gradient(cell, local)
            },
        }
        .mesh(material)
    }

    /// What it reflects: Lambert's albedo, linear RGB.
    pub fn color(&self) -> Vec3 {
        self.albedo
    }

    fn check_border(&self) -> Result<(), VolumeError> {
        let last = self.size - 1;
        for z in 0..self.size.z {
            for y in 0..self.size.y {
                // Rows inside the volume have two border samples, those on its faces are all border.
                let is_face = y == 0 || y == last.y || z == 0 || z == last.z;
                let step = if is_face { 1 } else { last.x };
                for x in (0..self.size.x).step_by(step as usize) {
                    let at = UVec3::new(x, y, z);
                    let value = self.samples[self.index(at)];
                    if f64::from(value) > self.level {
                        let level = self.level;
                        return Err(VolumeError::OpenBorder { at, value, level });
                    }
                }
            }
        }
        Ok(())
    }

    fn index(&self, at: UVec3) -> usize {
        let row = at.z as usize * self.size.y as usize + at.y as usize;
        row * self.size.x as usize + at.x as usize
    }

    fn step(&self) -> DVec3 {
        (self.high - self.low) / self.size.as_dvec3()
    }

    /// Sample coordinates of a world position: sample (i, j, k) is at (i, j, k).
    fn sample_from_world(&self, p: DVec3) -> DVec3 {
        (p - self.low) / self.step() - 0.5
    }

    /// How far a sample is outside, in units of the samples.
    fn outside(&self, at: UVec3) -> f64 {
        self.level - f64::from(self.samples[self.index(at)])
    }

    /// Values at the corners of a cell: bit 0 of the position is x, bit 1 y, bit 2 z.
    fn corners(&self, cell: UVec3) -> [f64; 8] {
        std::array::from_fn(|k| {
            let k = k as u32;
            self.outside(cell + UVec3::new(k & 1, k >> 1 & 1, k >> 2))
        })
    }

    fn cell(&self, cell: UVec3) -> Cell {
        let v = self.corners(cell);
        Cell {
            c: [
                v[0],
                v[1] - v[0],
                v[2] - v[0],
                v[4] - v[0],
                v[3] - v[1] - v[2] + v[0],
                v[6] - v[2] - v[4] + v[0],
                v[5] - v[1] - v[4] + v[0],
                v[7] - v[3] - v[5] - v[6] + v[1] + v[2] + v[4] - v[0],
            ],
        }
    }

    /// Gradient of the density, outward, at a sample by central differences (one-sided at the border), world units.
    fn sample_gradient(&self, at: UVec3) -> DVec3 {
        let last = self.size - 1;
        let step = self.step();
        let along = |axis: usize| {
            let (mut below, mut above) = (at, at);
            below[axis] = at[axis].saturating_sub(1);
            above[axis] = (at[axis] + 1).min(last[axis]);
            let distance = f64::from(above[axis] - below[axis]) * step[axis];
            (self.outside(above) - self.outside(below)) / distance
        };
        DVec3::new(along(0), along(1), along(2))
    }

    fn smooth_gradient(&self, cell: UVec3, local: DVec3) -> DVec3 {
        (0..8u32)
            .map(|k| {
                let corner = UVec3::new(k & 1, k >> 1 & 1, k >> 2);
                let near = corner.as_dvec3();
                // Weight x at the upper corner, 1 − x at the lower one.
                let weight = near * local + (1.0 - near) * (1.0 - local);
                self.sample_gradient(cell + corner) * weight.element_product()
            })
            .sum()
    }

    /// The box of the sample centres, world space: there is no surface outside.
    fn domain(&self) -> (DVec3, DVec3) {
        let half = self.step() * 0.5;
        (self.low + half, self.high - half)
    }

    /// Distance in metres at which the ray changes sides, and the cell where it does.
    fn crossing(&self, ray: &ClippedRay) -> Option<(f64, UVec3)> {
        let cells = self.size - 1;
        let last = (cells - 1).as_dvec3();
        let step = self.step();
        let origin = self.sample_from_world(ray.origin);
        let direction = ray.direction / step;
        let at = |t: f64| origin + direction * t;
        let cell_of = |p: DVec3| p.floor().clamp(DVec3::ZERO, last).as_uvec3();

        let mut t = ray.near;
        let mut cell = cell_of(at(t));
        let mut inside = None;
        if ray.starts_outside {
            inside = Some(false);
        }
        loop {
            // Where the ray leaves the cell, and through which face.
            let (mut exit, mut axis) = (ray.far, 3);
            for k in 0..3 {
                if direction[k] == 0.0 {
                    continue;
                }
                let face = f64::from(cell[k]) + f64::from(u8::from(direction[k] > 0.0));
                let distance = (face - origin[k]) / direction[k];
                if distance < exit {
                    (exit, axis) = (distance, k);
                }
            }
            let exit = exit.max(t);
            let corners = self.corners(cell);
            let (any_inside, any_outside) = corners
                .iter()
                .fold((false, false), |(i, o), &v| (i | (v < 0.0), o | (v >= 0.0)));
            if any_inside && any_outside {
                let polynomial = self.cell(cell).along(at(t) - cell.as_dvec3(), direction);
                let value = |t_from: f64| polynomial.value(t_from);
                let side = *inside.get_or_insert_with(|| value(0.0) < 0.0);
                let is_before = |s: f64| (value(s) < 0.0) == side;
                let length = exit - t;
                let mut from = 0.0;
                for to in [0.0]
                    .into_iter()
                    .chain(polynomial.extremes(length))
                    .chain([length])
                {
                    if !is_before(to) {
                        return Some((t + bisect(from, to, is_before), cell));
                    }
                    from = to;
                }
            } else if *inside.get_or_insert(any_inside) != any_inside {
                return Some((t, cell)); // the face itself is the surface
            }
            if axis == 3 {
                return None;
            }
            // Out of the volume?
            if direction[axis] > 0.0 {
                cell[axis] += 1;
                if cell[axis] == cells[axis] {
                    return None;
                }
            } else {
                cell[axis] = cell[axis].checked_sub(1)?;
            }
            t = exit;
        }
    }
}

impl Cell {
    /// At local coordinates.
    fn value(&self, p: DVec3) -> f64 {
        let [one, x, y, z, xy, yz, zx, xyz] = self.c;
        one + x * p.x
            + y * p.y
            + z * p.z
            + xy * p.x * p.y
            + yz * p.y * p.z
            + zx * p.z * p.x
            + xyz * p.element_product()
    }

    /// The polynomial along `start + direction · s`, in s.
    fn along(&self, start: DVec3, direction: DVec3) -> Cubic {
        let [one, x, y, z, xy, yz, zx, xyz] = self.c;
        let (a, d) = (start, direction);
        // Products of two of the three linear coordinates: constant, linear, quadratic term.
        let pair = |i: usize, j: usize| [a[i] * a[j], a[i] * d[j] + a[j] * d[i], d[i] * d[j]];
        let (pxy, pyz, pzx) = (pair(0, 1), pair(1, 2), pair(2, 0));
        let quadratic = |k: usize| xy * pxy[k] + yz * pyz[k] + zx * pzx[k];
        Cubic([
            one + x * a.x + y * a.y + z * a.z + quadratic(0) + xyz * pxy[0] * a.z,
            x * d.x + y * d.y + z * d.z + quadratic(1) + xyz * (pxy[1] * a.z + pxy[0] * d.z),
            quadratic(2) + xyz * (pxy[2] * a.z + pxy[1] * d.z),
            xyz * pxy[2] * d.z,
        ])
    }

    /// Gradient at local coordinates, per cell.
    fn gradient(&self, p: DVec3) -> DVec3 {
        let [_, x, y, z, xy, yz, zx, xyz] = self.c;
        DVec3::new(
            x + xy * p.y + zx * p.z + xyz * p.y * p.z,
            y + xy * p.x + yz * p.z + xyz * p.x * p.z,
            z + yz * p.y + zx * p.x + xyz * p.x * p.y,
        )
    }
}

/// Coefficients of 1, s, s², s³.
struct Cubic([f64; 4]);

impl Cubic {
    fn value(&self, s: f64) -> f64 {
        let [a, b, c, d] = self.0;
        a + s * (b + s * (c + s * d))
    }

    /// Extremes within (0, length), in order.
    fn extremes(&self, length: f64) -> impl Iterator<Item = f64> {
        let [_, c, b, a] = self.0;
        // 3a s² + 2b s + c = 0, by the form that loses no digits (q and c/q).
        let discriminant = b * b - 3.0 * a * c;
        let q = -(b + b.signum() * discriminant.max(0.0).sqrt());
        let (r1, r2) = (q / (3.0 * a), c / q);
        let keep = move |s: f64| (discriminant >= 0.0 && s > 0.0 && s < length).then_some(s);
        let (first, second) = if r1 < r2 { (r1, r2) } else { (r2, r1) };
        [keep(first), keep(second)].into_iter().flatten()
    }
}

impl Surfaces for Isosurface {
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        Some((self.low.as_vec3(), self.high.as_vec3()))
    }

    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        let (low, high) = self.domain();
        let ray = ClippedRay::new(ray, low, high)?;
        let (t, cell) = self.crossing(&ray)?;
        let local = (self.sample_from_world(ray.at(t)) - cell.as_dvec3()).clamp(DVec3::ZERO, DVec3::ONE);
        let gradient = self.cell(cell).gradient(local) / self.step();
        let smooth = self.smooth_gradient(cell, local);
        Some(ray.hit(t, gradient, smooth, low.distance(high)))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let (low, high) = self.domain();
        ClippedRay::new(ray, low, high).is_some_and(|ray| self.crossing(&ray).is_some())
    }

    fn albedo(&self, _: &SurfaceHit) -> Vec3 {
        self.albedo
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{ray_between_hits, ray_from};

    const N: u32 = 32;

    fn direction(k: u32) -> Vec3 {
        let z = 1.0 - 2.0 * ((k as f32 * 0.618_034).fract());
        let (sin, cos) = (std::f32::consts::TAU * (k as f32 * 0.754_878).fract()).sin_cos();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(radius * cos, radius * sin, z)
    }

    fn ray(origin: Vec3, direction: Vec3) -> Ray {
        Ray {
            origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }

    fn volume(density: impl Fn(Vec3) -> f32, scale: f32) -> Isosurface {
        let samples = (0..N * N * N)
            .map(|k| {
                let at = UVec3::new(k % N, k / N % N, k / N / N);
                let p = (at.as_vec3() + 0.5) / N as f32 * 2.0 - 1.0;
                let border = at.min_element() == 0 || at.max_element() == N - 1;
                if border {
                    0
                } else {
                    density(p).round().clamp(0.0, 255.0) as u8
                }
            })
            .collect();
        let bounds = (Vec3::splat(-scale), Vec3::splat(scale));
        Isosurface::new(UVec3::splat(N), samples, 128.0, bounds, Vec3::splat(0.7)).unwrap()
    }

    /// A ball of radius 0.6 in bounds from −1 to 1; 20 densities a step.
    fn ball(scale: f32) -> Isosurface {
        volume(|p| 128.0 - 20.0 * N as f32 / 2.0 * (p.length() - 0.6), scale)
    }

    /// Truth: the sphere that was sampled. Samples are rounded to half a density, 1/40 of a step; trilinear
    /// interpolation of a radius-0.6 sphere with steps of 1/16 errs by up to 3 h²/8r = 2.4e-3.
    #[test]
    fn a_sampled_sphere_is_where_the_sphere_is() {
        for scale in [1e-4f32, 1.0, 1e5] {
            let surface = ball(scale);
            for k in 0..3000 {
                let hit = surface
                    .closest_hit(&ray(direction(k) * 3.0 * scale, -direction(k)))
                    .unwrap();
                let error = hit.position.length() / scale - 0.6;
                assert!(error.abs() < 5e-3, "scale {scale}: {error}");
                assert!(hit.front && hit.geometric_normal.dot(direction(k)) > 0.9);
                assert!(
                    hit.normal.dot(direction(k)) > 0.99,
                    "{} {}",
                    hit.normal,
                    direction(k)
                );
            }
        }
    }

    /// Truth: brute force, the same interpolation evaluated at 20,000 steps along each ray of a rough volume.
    #[test]
    fn hits_are_where_dense_sampling_finds_them() {
        let hash = |p: Vec3| {
            (p.dot(Vec3::new(127.1, 311.7, 74.7)).sin() * 43_758.547)
                .fract()
                .abs()
        };
        let surface = volume(|p| 255.0 * hash(p).powi(2), 1.0);
        let value = |p: DVec3| {
            let s = surface.sample_from_world(p);
            let cell = s.floor().clamp(DVec3::ZERO, DVec3::splat(f64::from(N) - 2.0));
            let x = s - cell;
            let v = surface.corners(cell.as_uvec3());
            let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
            let plane = |k: usize| mix(mix(v[k], v[k + 1], x.x), mix(v[k + 2], v[k + 3], x.x), x.y);
            mix(plane(0), plane(4), x.z)
        };
        for k in 0..200 {
            let (origin, along) = (
                direction(5 * k) * 2.0,
                -(direction(5 * k) + direction(k) * 0.3).normalize(),
            );
            let (low, high) = surface.domain();
            let Some(clipped) = ClippedRay::new(&ray(origin, along), low, high) else {
                continue;
            };
            let step = (clipped.far - clipped.near) / 20_000.0;
            let truth = (1..20_000)
                .map(|i| clipped.near + step * f64::from(i))
                .find(|&t| value(clipped.at(t)) < 0.0);
            let found = surface
                .closest_hit(&ray(origin, along))
                .map(|hit| f64::from(hit.t));
            match (truth, found) {
                (None, None) => {}
                // Dense sampling may jump over a chord shorter than its step, never the other way round.
                (None, Some(_)) => panic!("ray {k}: a chord shorter than 1e-4, unlikely in 200 rays"),
                (Some(truth), Some(found)) => {
                    assert!(
                        found < truth + 1e-5 && found > truth - 2.0 * step - 1e-5,
                        "{k}: {found} {truth}"
                    );
                }
                (Some(truth), None) => panic!("ray {k} lost its hit at {truth}"),
            }
        }
    }

    /// No ray from inside gets out, along axes and diagonals and through samples and edges, too.
    #[test]
    fn an_isosurface_is_watertight() {
        let surface = ball(1.0);
        let mut directions: Vec<Vec3> = (0..20_000).map(direction).collect();
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    directions.push(Vec3::new(x as f32, y as f32, z as f32));
                }
            }
        }
        let half_step = 1.0 / N as f32;
        for origin in [
            Vec3::ZERO,
            Vec3::splat(half_step),
            Vec3::new(half_step, 0.0, -half_step),
        ] {
            for &along in directions.iter().filter(|along| **along != Vec3::ZERO) {
                let hit = surface.closest_hit(&ray(origin, along)).expect("a wall");
                assert!(!hit.front && hit.geometric_normal.dot(along) <= 0.0);
                assert!(
                    (hit.position.length() - 0.6).abs() < 5e-3,
                    "{along}: {}",
                    hit.position
                );
            }
        }
    }

    #[test]
    fn shadow_rays_start_and_end_on_an_isosurface() {
        for scale in [1e-4f32, 1.0, 1e5] {
            let surface = ball(scale);
            for k in 0..3000 {
                let hit = surface
                    .closest_hit(&ray(direction(k) * 3.0 * scale, -direction(k)))
                    .unwrap();
                // The interpolated sphere is not quite convex: 0.1 rad above its facets all is free.
                let away = direction(11 * k + 3);
                if away.dot(hit.geometric_normal) > 0.1 {
                    assert!(
                        !surface.occluded(&ray_from(&hit, away)),
                        "scale {scale}: {hit:?} {away}"
                    );
                    let far = surface.closest_hit(&ray_from(&hit, -away)).expect("the far side");
                    assert!(!surface.occluded(&ray_between_hits(&hit, &far)));
                }
            }
        }
    }

    #[test]
    fn volumes_that_make_no_sense_are_refused() {
        let bounds = (Vec3::ZERO, Vec3::ONE);
        let new = |size, samples: Vec<u8>, bounds| Isosurface::new(size, samples, 128.0, bounds, Vec3::ONE);
        assert!(matches!(
            new(UVec3::new(1, 2, 2), vec![0; 4], bounds),
            Err(VolumeError::Size { .. })
        ));
        assert!(matches!(
            new(UVec3::splat(u32::MAX), vec![], bounds),
            Err(VolumeError::Size { .. })
        ));
        assert!(matches!(
            new(UVec3::splat(2), vec![0; 7], bounds),
            Err(VolumeError::Length { .. })
        ));
        let full = new(UVec3::splat(2), vec![200; 8], bounds).unwrap_err();
        assert!(full.to_string().contains("border"), "{full}");
        let flat = (Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0));
        assert!(matches!(
            new(UVec3::splat(2), vec![0; 8], flat),
            Err(VolumeError::Bounds { .. })
        ));
    }
}
