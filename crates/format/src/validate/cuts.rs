//! Rules of light trees and cuts.

use super::check::{check, check_above_zero, check_finite, check_length, check_unit};
use crate::asset::{Asset, Cuts, LightSamples, LightTree};
use crate::codec::cut::{MAX_CODE, steps};
use crate::error::Result;
use crate::layout::Kind;
use crate::section::light_tree::is_tree_size;

impl LightTree {
    /// Checks the number of lights; that directions are a permutation; area, lengths, finiteness and unit normals of
    /// surface lights.
    ///
    /// # Errors
    /// `Invalid` with the leaf.
    pub fn validate(&self) -> Result<()> {
        let kind = Kind::LightTree;
        let lights = self.lights.len();
        let expected = "a power of two of 256 to 1048576 lights";
        check(is_tree_size(lights), kind, 0, expected, lights)?;
        match &self.lights {
            LightSamples::Environment { order } => check_permutation(order),
            LightSamples::Surface {
                area,
                positions,
                normals,
            } => {
                check_above_zero(kind, 0, "area", *area)?;
                check_length(kind, "normals, one per light", normals.len(), lights)?;
                check_finite(kind, "positions", positions)?;
                check_unit(kind, "normals", normals)
            }
        }
    }
}

fn check_permutation(order: &[u32]) -> Result<()> {
    let mut seen = vec![false; order.len()];
    let mut new = |index: u32| {
        let place = seen.get_mut(index as usize);
        place.is_some_and(|place| !std::mem::replace(place, true))
    };
    match order.iter().position(|&index| !new(index)) {
        None => Ok(()),
        Some(i) => {
            let expected = format_args!("each lattice index below {} once", order.len());
            check(false, Kind::LightTree, i, expected, order[i])
        }
    }
}

impl Cuts {
    /// Checks thresholds, rows and values, and that each site's nodes tile the `lights` leaves of a tree.
    ///
    /// # Errors
    /// `Invalid` with the site or the element.
    pub fn validate(&self, lights: usize) -> Result<()> {
        let kind = Kind::Cuts;
        check_above_zero(kind, 0, "sigma", self.sigma)?;
        check_above_zero(kind, 0, "unit", self.unit)?;
        let elements = self.heights.len();
        check_length(kind, "values, one per element", self.values.len(), elements)?;
        let first = self.row_offsets.first().copied();
        let expected = "row offsets from 0 on, of at least one site";
        let found = format_args!("{} of them", self.row_offsets.len());
        check(
            first == Some(0) && self.row_offsets.len() > 1,
            kind,
            0,
            expected,
            found,
        )?;
        let last = self.row_offsets[self.row_offsets.len() - 1] as usize;
        check(
            last == elements,
            kind,
            0,
            format_args!("rows of {elements} elements"),
            last,
        )?;
        for (site, row) in self.row_offsets.windows(2).enumerate() {
            let expected = format_args!("a row offset of {} to {elements}", row[0]);
            let in_range = row[0] <= row[1] && row[1] as usize <= elements;
            check(in_range, kind, site, expected, row[1])?;
            self.check_tiling(row[0] as usize..row[1] as usize, site, lights as u64)?;
        }
        self.check_values()
    }

    /// Whether the nodes of one site tile the leaves, each at a multiple of its own size.
    fn check_tiling(&self, row: std::ops::Range<usize>, site: usize, lights: u64) -> Result<()> {
        let mut start = 0u64;
        for i in row {
            // A node of more than 2³¹ leaves fits no tree.
            let leaves = 1u64 << self.heights[i].min(32);
            let fits = start & (leaves - 1) == 0 && start + leaves <= lights;
            let expected = format_args!("a node of {lights} leaves that can start at leaf {start}");
            check(
                fits,
                Kind::Cuts,
                i,
                expected,
                format_args!("height {}", self.heights[i]),
            )?;
            start += leaves;
        }
        let expected = format_args!("nodes of {lights} leaves in all at the site");
        check(start == lights, Kind::Cuts, site, expected, start)
    }

    fn check_values(&self) -> Result<()> {
        let steps: Vec<f64> = (0..=u8::MAX).map(|h| f64::from(steps(h, self.sigma))).collect();
        let fits = |(&height, &value): (&u8, &f32)| {
            value >= 0.0 && f64::from(value) * steps[usize::from(height)] <= f64::from(MAX_CODE)
        };
        match self
            .heights
            .iter()
            .zip(&self.values)
            .position(|element| !fits(element))
        {
            None => Ok(()),
            Some(i) => {
                let most = f64::from(MAX_CODE) / steps[usize::from(self.heights[i])];
                let expected = format_args!("a value of 0 to {most}");
                check(false, Kind::Cuts, i, expected, self.values[i])
            }
        }
    }
}

/// Checks the light tree, and the cuts against it and against the points.
pub(super) fn validate(asset: &Asset) -> Result<()> {
    if let Some(tree) = &asset.light_tree {
        tree.validate()?;
    }
    let Some(cuts) = &asset.cuts else {
        return Ok(());
    };
    let Some(tree) = &asset.light_tree else {
        return check(false, Kind::Cuts, 0, "a light tree for cuts", "none");
    };
    cuts.validate(tree.lights.len())?;
    let sites = asset.points.last().map_or(0, |level| level.positions.len());
    check_length(
        Kind::Cuts,
        "sites, one per finest point",
        cuts.row_offsets.len() - 1,
        sites,
    )
}
