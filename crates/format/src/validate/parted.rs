//! Rules of points that surfaces part (SPEC 6.14).

use crate::asset::{Level, Parted};
use crate::error::Result;
use crate::layout::Kind;

use super::check;

pub(super) fn validate(parted: &Parted, levels: &[Level]) -> Result<()> {
    let kind = Kind::Parted;
    let ends: Vec<usize> = levels
        .iter()
        .scan(0, |end, level| {
            *end += level.positions.len();
            Some(*end)
        })
        .collect();
    for (i, pair) in parted.pairs.iter().enumerate() {
        let ascending = i == 0 || parted.pairs[i - 1] < *pair;
        check(
            ascending,
            kind,
            i,
            "pairs in ascending order",
            format_args!("{pair:?}"),
        )?;
        let [point, parent] = pair.map(|index| index as usize);
        let level = ends.partition_point(|&end| end <= point);
        let coarser = level.checked_sub(1).and_then(|above| ends.get(above));
        let fits = level < ends.len() && coarser.is_some_and(|&end| parent < end);
        let expected = "a point and a point of a coarser level";
        check(fits, kind, i, expected, format_args!("{pair:?}"))?;
    }
    let finest = levels.last().map_or(0, |level| level.positions.len());
    for (i, &near) in parted.near.iter().enumerate() {
        let ascending = i == 0 || parted.near[i - 1] < near;
        check(ascending, kind, i, "finest points in ascending order", near)?;
        let expected = format_args!("a finest point below {finest}");
        check((near as usize) < finest, kind, i, expected, near)?;
    }
    Ok(())
}
