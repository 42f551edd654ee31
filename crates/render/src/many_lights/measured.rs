//! Lamps with photometric files as lights without extent: one light each, which knows its file.

use glam::DVec3;
use relight_scene::photometry::{LampAxes, Photometry};
use relight_transport::point_light::Emission;
use std::f64::consts::{PI, TAU};
use std::sync::{Arc, OnceLock};

/// Cells of equal solid angle, along the cosine to the aim and around it, by which particles leave: 4.5° wide at the side.
const CELLS: (usize, usize) = (64, 32);
/// Candela are asked for at as many places of a cell, squared.
const PER_CELL: usize = 3;
/// Share of the particles that go anywhere, so that what lies between the places asked is found, too.
const ANYWHERE: f64 = 0.05;

/// A photometric file in space.
#[derive(Clone, Debug)]
pub(super) struct MeasuredLamp {
    axes: LampAxes,
    profile: Arc<Photometry>,
    /// Rising sums over the cells, the last 1: made where the first particle leaves.
    sums: OnceLock<Vec<f64>>,
    /// Two directions at right angles to the aim.
    across: (DVec3, DVec3),
}

impl MeasuredLamp {
    pub fn new(axes: LampAxes, profile: Arc<Photometry>) -> MeasuredLamp {
        MeasuredLamp {
            axes,
            profile,
            sums: OnceLock::new(),
            across: axes.aim().any_orthonormal_pair(),
        }
    }

    fn summed(&self) -> Vec<f64> {
        let cells = CELLS.0 * CELLS.1;
        let light: Vec<f64> = (0..cells).map(|cell| self.light_of(cell)).collect();
        let total: f64 = light.iter().sum();
        let mut sum = 0.0;
        (light.iter())
            .map(|light| {
                let own = if total > 0.0 { light / total } else { 0.0 };
                let anywhere = if total > 0.0 { ANYWHERE } else { 1.0 };
                sum += (1.0 - anywhere) * own + anywhere / cells as f64;
                sum
            })
            .collect()
    }

    /// Mean candela of a cell, about.
    fn light_of(&self, cell: usize) -> f64 {
        let places = (0..PER_CELL * PER_CELL).map(|k| [k / PER_CELL, k % PER_CELL]);
        let sum: f64 = places
            .map(|place| {
                let inside = place.map(|at| (at as f64 + 0.5) / PER_CELL as f64);
                self.profile.candela(&self.axes, self.direction(cell, inside))
            })
            .sum();
        sum / (PER_CELL * PER_CELL) as f64
    }

    /// The unit direction at a place (0..1, 0..1) of a cell.
    fn direction(&self, cell: usize, inside: [f64; 2]) -> DVec3 {
        let (row, column) = (cell / CELLS.1, cell % CELLS.1);
        let cos = 1.0 - 2.0 * (row as f64 + inside[0]) / CELLS.0 as f64;
        let (sin_phi, cos_phi) = (TAU * (column as f64 + inside[1]) / CELLS.1 as f64).sin_cos();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (u, v) = self.across;
        (self.axes.aim() * cos + (u * cos_phi + v * sin_phi) * sin).normalize()
    }

    /// How the light shines, as number `profile` of the measurements.
    pub fn emission(&self, profile: u32) -> Emission {
        Emission::Measured {
            profile,
            outer: self.outer() as f32,
        }
    }

    /// A cosine to the aim below which nothing leaves.
    fn outer(&self) -> f64 {
        // Of the widest angles off the aim, a little more.
        let widest = self
            .profile
            .reach()
            .map_or(-1.0, |degrees| (degrees + 0.1).min(180.0).to_radians().cos());
        (widest - 1e-6).max(-1.0)
    }

    /// Share of the largest candela that leaves into a unit direction.
    pub fn share(&self, direction: glam::Vec3) -> f32 {
        let peak = self.profile.peak();
        if peak > 0.0 {
            (self.profile.candela(&self.axes, direction.as_dvec3()) / peak) as f32
        } else {
            0.0
        }
    }

    /// ∫ share dω, sr.
    pub fn solid_angle(&self) -> f64 {
        let peak = self.profile.peak();
        if peak > 0.0 {
            self.profile.lumens() / peak
        } else {
            0.0
        }
    }

    /// A direction by its light, and the light there over that of the density by which it was drawn: 1 on average. `random`: from 0 to 1.
    pub fn sample(&self, random: [f64; 2]) -> (DVec3, f64) {
        let sums = self.sums.get_or_init(|| self.summed());
        let cells = sums.len();
        let cell = sums.partition_point(|&sum| sum <= random[0]).min(cells - 1);
        let before = if cell == 0 { 0.0 } else { sums[cell - 1] };
        let chance = sums[cell] - before;
        let inside = [((random[0] - before) / chance).clamp(0.0, 1.0), random[1]];
        let direction = self.direction(cell, inside);
        let density = chance * cells as f64 / (4.0 * PI);
        let lumens = self.profile.lumens();
        let light = self.profile.candela(&self.axes, direction);
        (
            direction,
            if lumens > 0.0 {
                light / lumens / density
            } else {
                0.0
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::random::Stream;

    /// A lamp with a narrow beam down and some light up at one side; type C, planes all around.
    fn lamp() -> MeasuredLamp {
        let file = "IES:LM-63-2019\nTILT=NONE\n1 -1 1 6 4 1 2 0 0 0\n1 1 60\n0 5 20 90 110 180\n0 90 180 360\n\
            900 800 20 5 0 0\n900 500 20 50 0 0\n900 800 10 5 30 0\n900 800 20 5 0 0\n";
        let axes = LampAxes::new(DVec3::new(0.3, -1.0, 0.2), DVec3::X).unwrap();
        MeasuredLamp::new(axes, Arc::new(Photometry::parse(file).unwrap()))
    }

    /// Truth: the mean direction of the light by a midpoint rule over the sphere. Tolerance: four standard errors of 2^17 samples.
    #[test]
    fn directions_come_by_their_light() {
        let lamp = lamp();
        let mut truth = DVec3::ZERO;
        let (rows, columns) = (600, 300);
        for row in 0..rows {
            let cos = 1.0 - 2.0 * (f64::from(row) + 0.5) / f64::from(rows);
            for column in 0..columns {
                let phi = TAU * (f64::from(column) + 0.5) / f64::from(columns);
                let sin = (1.0 - cos * cos).sqrt();
                let direction = DVec3::new(sin * phi.cos(), cos, sin * phi.sin());
                truth += direction * lamp.profile.candela(&lamp.axes, direction);
            }
        }
        truth *= 4.0 * PI / f64::from(rows * columns) / lamp.profile.lumens();
        let count = 1 << 17;
        let (mut sum, mut squares, mut weights) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for i in 0..count {
            let mut stream = Stream::new(5, 0, i);
            let random = [stream.uniform(), stream.uniform()].map(f64::from);
            let (direction, weight) = lamp.sample(random);
            sum += direction * weight;
            squares += (direction * weight).powf(2.0);
            weights += weight;
        }
        let n = count as f64;
        let (mean, error) = (sum / n, (squares / n / n).powf(0.5));
        assert!(
            ((mean - truth).abs() - error * 4.0).max_element() < 0.0,
            "{mean} {truth}"
        );
        assert!((weights / n - 1.0).abs() < 0.01, "{}", weights / n);
        // Hardly any particle counts for much more than others.
        let most = (0..1000).map(|i| lamp.sample([(i as f64 + 0.5) / 1000.0, 0.3]).1);
        assert!(most.fold(0.0, f64::max) < 5.0);
    }

    /// Truth: the file itself.
    /// Truth: the file, whose beam ends 30° off the aim.
    #[test]
    fn no_light_leaves_beyond_what_clusters_are_told() {
        let file =
            "IES:LM-63-2019\nTILT=NONE\n1 -1 1 5 1 1 2 0 0 0\n1 1 60\n0 5 20 30 180\n0\n900 800 20 0 0\n";
        let axes = LampAxes::new(DVec3::new(0.3, -1.0, 0.2), DVec3::X).unwrap();
        let lamp = MeasuredLamp::new(axes, Arc::new(Photometry::parse(file).unwrap()));
        let Emission::Measured { outer, .. } = lamp.emission(0) else {
            panic!()
        };
        assert!(
            outer < 30f32.to_radians().cos() && outer > 31f32.to_radians().cos(),
            "{outer}"
        );
        let mut beyond = 0;
        for i in 0..10_000 {
            let mut stream = Stream::new(6, 0, i);
            let direction = DVec3::new(
                f64::from(stream.uniform()) - 0.5,
                f64::from(stream.uniform()) - 0.5,
                f64::from(stream.uniform()) - 0.5,
            );
            let direction = direction.normalize();
            let share = lamp.share(direction.as_vec3());
            assert!((0.0..=1.0).contains(&share));
            if direction.dot(lamp.axes.aim()) < f64::from(outer) {
                assert_eq!(share, 0.0);
                beyond += 1;
            }
        }
        assert!((5_000..10_000).contains(&beyond), "{beyond}");
    }
}
