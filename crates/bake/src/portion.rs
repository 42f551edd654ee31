//! Parts of a bake, for many processes.

use crate::cuts::sections::{World, cut_part};
use crate::error::BakeError;
use crate::links::operators::{Viewers, with_refinement};
use crate::links::refinement::{RowWatch, Wanted, most_rays, rows};
use crate::points::placing::{load, placed};
use crate::progress::{Progress, Watch};
use crate::request::Request;
use crate::units::reach::{Followed, Reach};
use crate::units::{Ledger, Units};
use relight_scene::surface::Surfaces;

/// Part of a bake, for others to finish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Portion {
    /// What all pieces need.
    Shared,
    /// One of so many pieces, from 0.
    Piece {
        /// Which.
        index: usize,
        /// Of how many.
        of: usize,
    },
}

/// Rays of a piece, about: some seconds of work, well more than it takes to begin.
const RAYS_PER_PIECE: u64 = 1 << 23;
/// Most pieces: each of them reads the scene and the points.
const MOST_PIECES: u64 = 1000;
/// A site of cuts casts a ray at one in so many lights, about (docs/notebook/cuts.md).
const LIGHTS_PER_RAY: u64 = 6;

/// Computes part of a bake into the ledger's store. What it needs of other parts is taken from there or computed, too, so
/// that parts can run in any order and at once. Returns into how many pieces the work is best cut.
///
/// # Errors
/// As [`bake()`](crate::bake::bake()).
pub fn bake_part(
    request: &Request,
    ledger: &Ledger,
    part: Portion,
    progress: &dyn Progress,
) -> Result<usize, BakeError> {
    let params = request.params;
    let watch = Watch(progress);
    let traced = load(request, progress)?;
    let reach = Reach::new(&request.scene, traced.bounds());
    let units = Units::new(ledger, &reach);
    let surfaces = Followed::new(&traced, &reach);
    let placed = placed(&traced, &surfaces, request, units, progress)?;
    let viewers = Viewers {
        relevance: &placed.relevance,
        cameras: &placed.cameras,
    };
    let points = &placed.points;
    let counts: Vec<usize> = points.levels.iter().map(|l| l.points.len()).collect();
    let mut rays = most_rays(counts.iter().copied(), params.rays);
    let cuts = request.wanted_cuts();
    if let (Some(cuts), Some(&sites)) = (cuts, counts.last()) {
        rays += sites as u64 * u64::from(cuts.lights) / LIGHTS_PER_RAY;
    }
    progress.stage("share", None);
    with_refinement(&surfaces, points, viewers, params, units, |r, _| {
        let wanted = match part {
            // An eighth: some two levels less than the finest, a quarter of the rays.
            Portion::Shared => Wanted::coarsest(r, units, r.ranges.total() / 8),
            Portion::Piece { index, of } => Wanted::part(r, units, index, of),
        };
        watch.begin(0);
        rows(r, wanted, params.stored_link(), None, units, &watch)
    })?;
    if let Some(cuts) = cuts {
        units.see_everything();
        let world = World {
            scene: &traced,
            surfaces: &traced,
            points,
        };
        let piece = match part {
            Portion::Shared => None,
            Portion::Piece { index, of } => Some((index, of)),
        };
        cut_part(&world, cuts, params.seed, units, piece, progress)?;
    }
    watch.go_on()?;
    Ok(rays.div_ceil(RAYS_PER_PIECE).clamp(1, MOST_PIECES) as usize)
}
