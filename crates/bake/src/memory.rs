//! Memory that a bake surely needs, what grows with points and clusters, whatever the scene; and what the machine has.

use crate::error::BakeError;
use crate::links::operators::bounce_levels;
use crate::request::Request;

/// Bytes of a point with its functions, grids, receiver and share of the file (docs/notebook/reliability.md).
const PER_POINT: f64 = 750.0;

/// Bytes that so many points take, and the sums of the bounce operator between so many clusters, which are full.
pub fn of_points(points: f64, clusters: f64) -> f64 {
    PER_POINT * points + size_of::<f64>() as f64 * clusters * clusters
}

/// Memory of the machine with what it can swap, or of the control group that the program runs in where that is less, bytes;
/// `None` where the system does not say.
pub fn of_this_machine() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let kib = |field: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(field))?;
        line.trim().strip_suffix("kB")?.trim().parse().ok()
    };
    let machine = (kib("MemTotal:")? + kib("SwapTotal:").unwrap_or(0)) * 1024;
    // "max" where there is no limit.
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max");
    let group = group.ok().and_then(|text| text.trim().parse().ok());
    Some(group.map_or(machine, |group: u64| group.min(machine)))
}

/// Whether the points of all levels and the bounces fit into the machine's memory; how many points these are. `finest`: points of the finest level; each
/// coarser one has a quarter, since its disks have twice the radius.
///
/// # Errors
/// [`BakeError::TooLarge`].
pub fn check(finest: f64, request: &Request) -> Result<f64, BakeError> {
    let params = request.params;
    let of_level = |level: usize| finest * 0.25f64.powi((params.levels - 1 - level) as i32);
    let (bounce_level, _) = bounce_levels(params.levels, params.sender_levels);
    let has_bounces = params.needs_bounces() && bounce_level < params.levels;
    let clusters = if has_bounces { of_level(bounce_level) } else { 0.0 };
    let points: f64 = (0..params.levels).map(of_level).sum();
    let needed = of_points(points, clusters);
    let available = match request.memory {
        Some(available) if needed > available as f64 => available,
        _ => return Ok(points),
    };
    Err(BakeError::TooLarge {
        points,
        needed,
        available,
    })
}
