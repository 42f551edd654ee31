//! Memory that a bake surely needs: what grows with points and clusters, whatever the scene.

use crate::error::BakeError;
use crate::links::operators::bounce_levels;
use crate::points::poisson::PointLevels;
use crate::request::Request;

/// Bytes of a point with its functions, grids, receiver and share of the file (docs/notebook/reliability.md).
const PER_POINT: f64 = 750.0;

/// Bytes that so many points take, and the sums of the bounce operator between so many clusters, which are full.
pub fn of_points(points: f64, clusters: f64) -> f64 {
    PER_POINT * points + size_of::<f64>() as f64 * clusters * clusters
}

/// Whether points and bounces fit into the machine's memory, before the long part of the bake.
///
/// # Errors
/// [`BakeError::TooLarge`].
pub fn check(points: &PointLevels, request: &Request) -> Result<(), BakeError> {
    let Some(available) = request.memory else {
        return Ok(());
    };
    let params = request.params;
    let counts: Vec<usize> = points.levels.iter().map(|level| level.points.len()).collect();
    let (bounce_level, _) = bounce_levels(counts.len(), params.sender_levels);
    let clusters = counts.get(bounce_level).filter(|_| params.needs_bounces());
    let all = points.count();
    let needed = of_points(all as f64, clusters.map_or(0.0, |&n| n as f64)) as u64;
    match needed <= available {
        true => Ok(()),
        false => Err(BakeError::TooLarge {
            points: all,
            needed,
            available,
        }),
    }
}
