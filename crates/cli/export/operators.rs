//! Operators as matrices: what one bounce does, its factors, and the bounces between clusters.

use super::files::{Folder, check_size};
use super::report::Facts;
use anyhow::{anyhow, bail};
use relight_format::Asset;
use relight_play::open::{load_operators, matrix};
use std::path::Path;

/// Irradiance of a surface over radiosity of others.
const UNIT: &str = "W/m² per W/m²";

/// Bytes of an entry while points_from_points is computed: an f64 and its column, then also an f32 and its column.
const ENTRY_BYTES: u64 = 20;

/// The factors of one bounce; with a `limit` of bytes also their product, and what Radiance reads.
pub fn transfer(file: &Path, folder: &mut Folder, limit: Option<u64>) -> anyhow::Result<Facts> {
    let Some(operators) = load_operators(file)? else {
        bail!("holds no points, so no transfer operator");
    };
    let factors = operators.factors();
    if factors.transfer.nnz() == 0 {
        bail!("holds no transfer operator: no surface sends light to another");
    }
    let (points, senders) = (factors.pull.cols(), factors.transfer.cols());
    let receivers = factors.transfer.rows() / 3;
    if let Some(limit) = limit {
        let size = [points, points];
        check_size("points_from_points", &size, ENTRY_BYTES, limit, "factors")?;
        check_size("transfer.rmx", &[receivers, senders, 3], 4, limit, "factors")?;
    }
    folder.market("pull", "1", &factors.pull)?;
    folder.market("transfer", UNIT, &factors.transfer)?;
    folder.market("push", "1", &factors.push)?;
    folder.market("normals", "1", &factors.normals)?;
    if limit.is_some() {
        let flattened = factors.flattened();
        let what = "irradiance of the finest points per unit radiosity of the finest points, one bounce";
        folder.market("points_from_points", UNIT, &flattened)?;
        folder.radiance("points_from_points", what, 1, &flattened)?;
        let what = "differences of vector irradiance (x, y, z) of receivers per unit coefficient of senders";
        folder.radiance("transfer", what, 3, &factors.transfer)?;
    }
    Ok(Facts::Transfer {
        finest_points: points,
        receivers,
        senders,
    })
}

/// The bounce operator, or the solution that an asset has in its place.
pub fn bounce(asset: &Asset, folder: &mut Folder, limit: u64) -> anyhow::Result<Facts> {
    if asset.bounce.is_none() && asset.solution.is_none() {
        bail!("holds no bounces: no surface sends light to another, or one bounce was asked for");
    }
    if let Some(bounce) = &asset.bounce {
        let size = bounce.matrix.rows as usize;
        check_size("bounce.rmx", &[size, size], 4, limit, "links")?;
        let k = matrix(bounce.matrix.clone()).map_err(|error| anyhow!(error))?;
        folder.market("bounce", UNIT, &k)?;
        let what = "mean irradiance of clusters per unit radiosity of clusters";
        folder.radiance("bounce", what, 1, &k)?;
    }
    for (channel, stored) in asset.solution.iter().flat_map(|s| s.channels.iter().enumerate()) {
        let s = matrix(stored.clone()).map_err(|error| anyhow!(error))?;
        folder.market(&format!("solution_{channel}"), UNIT, &s)?;
    }
    Ok(Facts::Bounce {
        bounce_level: asset.bounce.as_ref().map(|b| b.level),
        solution_level: asset.solution.as_ref().map(|s| s.level),
    })
}
