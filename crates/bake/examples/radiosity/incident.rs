//! Indirect light as radiance that arrives from every direction, for surfaces that reflect some directions more.

use crate::solver::Radiosity;
use crate::tensor;
use glam::Vec3;
use relight_bake::points::poisson::{PointLevels, levels_of};
use relight_transport::basis::Level;
use relight_transport::pyramid::{LevelRanges, fine_from_coarse};
use relight_transport::sampling::Frame;
use relight_transport::sh::{COUNT, Coefficients, MAX_DEGREE, count, evaluate};
use std::f32::consts::PI;

/// Radiance per channel.
pub type Rgb<T> = [T; 3];

/// Incident radiance (W·m⁻²·sr⁻¹) off surfaces at the finest points, from the rays that `solution` gathered with:
/// where a point took its parents' word for its irradiance, it takes it for radiance too.
///
/// `direct`: irradiance straight from the sources at the finest points, which `solution` is for.
pub fn incident_radiance(
    points: &PointLevels,
    solution: &Radiosity,
    direct: &[Vec3],
) -> Rgb<Vec<Coefficients>> {
    let levels = levels_of(points);
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let parents = fine_from_coarse(&levels, |_, _| false);
    let places: Vec<_> = points.levels.iter().flat_map(|l| &l.points).collect();
    let finest = ranges.total() - direct.len();
    // What a matt surface sends into every direction.
    let sent: Vec<Vec3> = (finest..ranges.total())
        .map(|i| places[i].albedo / PI * (direct[i - finest] + solution.irradiance[i]))
        .collect();
    let gathered = |i: usize| !solution.hits[i].is_empty();
    [0, 1, 2].map(|channel| {
        let mut values = vec![[0.0; COUNT]; ranges.total()];
        for i in (0..ranges.total()).filter(|&i| gathered(i)) {
            let frame = Frame::around(places[i].geometric_normal);
            let rays = solution.directions.iter().zip(&solution.hits[i]);
            // Cosine-distributed rays stand for a solid angle of π/cos each, in the mean.
            let samples = rays.filter_map(|(&local, &hit)| {
                let solid_angle = PI / (solution.directions.len() as f32 * local.z);
                let sent = sent.get(hit as usize)?[channel];
                Some((frame.world_from_local(local), sent, solid_angle))
            });
            values[i] = project(samples);
        }
        tensor::fill(&mut values, gathered, &ranges, &parents);
        values.split_off(finest)
    })
}

/// Coefficients of a function known at samples (unit direction, value, solid angle that the sample stands for): ∫ f Y dω.
fn project(samples: impl Iterator<Item = (Vec3, f32, f32)>) -> Coefficients {
    let mut sums = [0.0f64; COUNT];
    for (direction, value, solid_angle) in samples {
        let weight = f64::from(value) * f64::from(solid_angle);
        for (sum, y) in sums.iter_mut().zip(evaluate(direction)) {
            *sum += weight * f64::from(y);
        }
    }
    sums.map(|s| s as f32)
}

/// Radiance reflected towards the mirror direction `mirror` by a lobe cosᵉ that sums to 1 (Phong 1975), from incident
/// radiance.
///
/// A lobe about an axis multiplies harmonics of degree l by its Legendre moment, a₀ = 1, a₁ = (e + 1)/(e + 2),
/// a_l = a_(l−2) (e − l + 2)/(e + l + 1).
pub fn lobe(radiance: &Coefficients, mirror: Vec3, exponent: f32) -> f32 {
    let mut moments = [1.0, (exponent + 1.0) / (exponent + 2.0), 0.0, 0.0];
    for l in 2..=MAX_DEGREE {
        moments[l] = moments[l - 2] * (exponent - l as f32 + 2.0) / (exponent + l as f32 + 1.0);
    }
    let y = evaluate(mirror);
    let degree = |l: usize| (l * l..count(l)).map(|k| radiance[k] * y[k]).sum::<f32>() * moments[l];
    (0..=MAX_DEGREE).map(degree).sum()
}
