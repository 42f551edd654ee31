//! How much each finest point counts in its clusters: as much as viewers get to see of the light it sends.
//!
//! A cluster sends one mean for all its points. Receivers in view see the points in the open, not those behind
//! the column's foot, so a mean by area mixes in dark places and is too dark (docs/notebook/transfer.md). Weighted by
//! the importance that reaches each point from the viewpoints over one or two surfaces, the mean is right for
//! the sum over all that is in view: importance is the adjoint of light (Veach 1997, section 4.7).
//!
//! Receivers near a cluster have links to its children and don't ask for its mean. So the places that look at
//! corners and crevices from close by don't count.

use crate::error::BakeError;
use crate::points::particles::walk;
use crate::points::relevance::Relevance;
use crate::units::Units;
use rayon::prelude::*;
use relight_scene::surface::Surfaces;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::random::Stream;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// Particles per finest point of its level's radius. Each lands on two points that count, so that a cluster of 40 knows its points
/// to a fifth and their mean to a thirtieth.
const PARTICLES_PER_POINT: usize = 10;

/// Most that a wide point counts of those: it stands alone for what as many would be, of which a lamp may light a part.
const MOST_PER_WIDE: f64 = 64.0;

/// Surfaces on which a particle lands: the first is in view and receives; light that the second and the third
/// send reaches the viewer indirectly.
const LANDINGS: usize = 3;

/// Weight, relative to the mean, of a point that no particle met: it may come into view.
const UNSEEN: f32 = 0.1;

/// Largest weight relative to the mean that a byte holds, where no point is wide.
const LARGEST: f32 = 8.0;

/// Stage number of the random stream.
const STAGE: u32 = 5;

/// Particles per unit of work: a second or so.
const PARTICLES_PER_UNIT: usize = 1 << 19;

/// How often particles met the finest points.
pub struct Met {
    /// Landings that count, per point.
    pub counts: Vec<u32>,
    /// Rays cast.
    pub rays: u64,
}

/// Importance byte of each finest point (see [`relight_transport::senders::weight`]), and the number
/// of rays cast. Ways shorter than `near` don't count.
///
/// # Errors
/// A unit cannot be kept.
pub fn importance(
    surfaces: &dyn Surfaces,
    finest: &NearestPoint,
    near: f32,
    relevance: &Relevance,
    seed: u64,
    units: Units,
) -> Result<(Vec<u8>, u64), BakeError> {
    let points = finest.level.len();
    let inputs = units.inputs(|key| {
        key.level(finest.level)
            .f32s(&[near])
            .vectors(relevance.viewpoints.iter())
            .u64s(&[seed]);
    });
    let mut met = vec![0u32; points];
    let mut rays = 0;
    let areas = areas(finest.level);
    let as_many: f64 = areas.iter().map(|area| area.min(MOST_PER_WIDE)).sum();
    let particles_wanted = as_many as usize * PARTICLES_PER_POINT;
    for range in units.ranges(0..particles_wanted, PARTICLES_PER_UNIT) {
        let part: Met = units.taken_or_made("importance", inputs, &range, || {
            Ok(particles(surfaces, finest, near, relevance, seed, range.clone()))
        })?;
        // A unit's counts are as many as points, or they are none of ours.
        met.iter_mut().zip(&part.counts).for_each(|(sum, n)| *sum += n);
        rays += part.rays;
    }
    Ok((bytes(&met, &areas), rays))
}

/// Areas that points stand for, over that of a point of the level's radius.
fn areas(level: &Level) -> Vec<f64> {
    let width = |point| f64::from(level.disk_radius_of(point) / level.disk_radius);
    (0..level.len()).map(|point| width(point).powi(2)).collect()
}

/// Landings as bytes, relative to their mean.
fn bytes(met: &[u32], areas: &[f64]) -> Vec<u8> {
    let mean_area = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
    let areas: Vec<f32> = areas.iter().map(|area| (area / mean_area) as f32).collect();
    let all: u64 = met.iter().map(|&m| u64::from(m)).sum();
    let mean = (all as f32 / met.len().max(1) as f32).max(1e-3);
    let relative: Vec<f32> = (met.iter().zip(&areas))
        .map(|(&m, area)| m as f32 / mean + UNSEEN * area.min(LARGEST))
        .collect();
    // Wide points count as much as several narrow ones: no more of a byte's steps are given to that than there is.
    let wide = (relative.iter().zip(&areas)).filter(|place| *place.1 > 1.0);
    let largest = wide.fold(LARGEST, |largest, place| largest.max(*place.0));
    (relative.into_iter())
        .map(|relative| ((relative.min(largest) / largest).sqrt() * 255.0).round() as u8)
        .collect()
}

/// Sends particles of these numbers.
fn particles(
    surfaces: &dyn Surfaces,
    finest: &NearestPoint,
    near: f32,
    relevance: &Relevance,
    seed: u64,
    numbers: Range<usize>,
) -> Met {
    let met: Vec<AtomicU32> = finest.level.positions.iter().map(|_| AtomicU32::new(0)).collect();
    let rays: u64 = numbers
        .into_par_iter()
        .with_min_len(256)
        .map(|particle| {
            let mut s = Stream::new(seed, STAGE, particle as u64);
            let start = relevance.start(particle as u64, &mut s);
            let mut last = start.origin;
            walk(surfaces, start, &mut s, LANDINGS, |landing, hit, _| {
                let from_afar = hit.position.distance_squared(last) > near * near;
                last = hit.position;
                if landing > 0
                    && from_afar
                    && let Some(point) = finest.at(hit.position, hit.normal)
                {
                    met[point as usize].fetch_add(1, Ordering::Relaxed);
                }
                true
            })
        })
        .sum();
    Met {
        counts: met.into_iter().map(AtomicU32::into_inner).collect(),
        rays,
    }
}
