//! A whole bake: scene in, asset out.

use crate::convert;
use crate::cuts::sections::{World, cut_sections};
use crate::error::BakeError;
use crate::left_out::{Pruned, prune};
use crate::links::operators::{Transport, Viewers, transport};
use crate::operator_sections;
use crate::points::coverage::{Coverage, coverage};
use crate::points::placing::{load, placed, reflect_as_cells};
use crate::points::poisson::levels_of;
use crate::progress::{Progress, Watch};
use crate::report::Made;
use crate::request::{BakeStats, Baked, Request};
use crate::timed::TimedSurfaces;
use crate::units::reach::{Followed, Reach};
use crate::units::{Ledger, Units};
use relight_format as format;
use relight_scene::surface::Surfaces;
use std::time::Instant;

/// Bakes a scene: in one go, or in units of work that `ledger` keeps and takes again. The asset is the same, bit by bit.
///
/// # Errors
/// The scene cannot be prepared, a parameter is out of range, nothing is reachable, the points do not fit into the
/// machine's memory, `progress` said stop, or a unit cannot be kept.
pub fn bake(request: &Request, ledger: Option<&Ledger>, progress: &dyn Progress) -> Result<Baked, BakeError> {
    let params = request.params;
    let mut clock = Clock::new();
    let watch = Watch(progress);
    let traced = load(request, progress)?;
    let timed = TimedSurfaces::new(&traced);
    let reach = ledger.map(|_| Reach::new(&request.scene, traced.bounds()));
    let units =
        (ledger.zip(reach.as_ref())).map_or(Units::none(), |(ledger, reach)| Units::new(ledger, reach));
    let followed = reach.as_ref().map(|reach| Followed::new(&timed, reach));
    let surfaces: &dyn Surfaces = followed.as_ref().map_or(&timed, |followed| followed);
    clock.lap("load");

    let mut placed = placed(&traced, surfaces, request, units, progress)?;
    clock.lap("points");
    let points = std::mem::take(&mut placed.points);
    let covered = (levels_of(&points).last()).map_or(Coverage::default(), |finest| {
        coverage(&traced, finest, params.seed)
    });

    progress.stage("share", None);
    let viewers = Viewers {
        relevance: &placed.relevance,
        cameras: &placed.cameras,
    };
    let mut transport = transport(
        surfaces,
        points,
        viewers,
        params,
        params.stored_link(),
        units,
        &watch,
    )?;
    let near = &transport.separations.near;
    transport.rays += reflect_as_cells(
        &timed,
        &mut placed,
        &mut transport.points,
        near,
        params.seed,
        progress,
    )?;
    watch.go_on()?;
    clock.lap("refine");
    let solution = match params.solution && params.needs_bounces() {
        true => {
            progress.stage("solve", None);
            let solved = transport.solved(params, units, |rows| watch.step(rows as u64))?;
            clock.lap("solve");
            Some(solved)
        }
        false => None,
    };
    watch.go_on()?;

    let cuts = match request.wanted_cuts() {
        Some(cuts) => {
            units.see_everything();
            let world = World {
                scene: &traced,
                surfaces: &timed,
                points: &transport.points,
            };
            let made = cut_sections(&world, cuts, params.seed, units, progress)?;
            clock.lap("cuts");
            Some(made)
        }
        None => None,
    };

    progress.stage("prune", None);
    let pruned = prune(&request.scene, request.shading, request.lights, params);
    let made = Made {
        coding: params.coding(&placed.levels, !transport.links.is_empty()),
        placed: &placed,
        covered,
        transport: &transport,
        cuts: cuts.as_ref(),
        pruned: &pruned,
    };
    let (provenance, coding, rays) = (made.provenance(request), made.coding, made.rays());
    let mut asset = with_operators(&transport, with_scene(&pruned));
    asset.provenance = provenance;
    asset.points = placed.levels;
    asset.coding = coding;
    if let Some(solution) = solution.filter(|_| asset.transfer.is_some()) {
        asset.bounce = None;
        asset.solution = Some(operator_sections::solution(&solution));
    }
    if let Some(made) = cuts {
        asset.light_tree = Some(made.light_tree);
        asset.estimates = Some(made.estimates);
        asset.cuts = Some(made.cuts);
    }
    let content = format::Content::of(&asset).to_counts();
    asset.provenance.counts.extend(content);
    clock.lap("prune");
    let threads = rayon::current_num_threads();
    let stats = BakeStats {
        seconds: clock.seconds,
        ray_tracing_seconds: timed.thread_seconds(rays) / threads as f64,
        threads,
        row_bytes: transport.row_bytes,
    };
    Ok(Baked { asset, stats })
}

/// The sections of the scene itself.
fn with_scene(pruned: &Pruned) -> format::Asset {
    format::Asset {
        geometry: convert::geometry(&pruned.scene),
        materials: convert::materials(&pruned.scene),
        material_extensions: convert::material_extensions(&pruned.scene),
        material_glass: convert::material_glass(&pruned.scene),
        textures: convert::textures(&pruned.scene),
        stage: convert::stage(&pruned.scene),
        ..format::Asset::default()
    }
}

/// The operators, if there is any indirect light: without T no sender has anything to do.
fn with_operators(transport: &Transport, asset: format::Asset) -> format::Asset {
    if transport.links.is_empty() {
        return asset;
    }
    format::Asset {
        separations: operator_sections::separations(&transport.separations),
        senders: Some(operator_sections::sender_tree(&transport.tree)),
        transfer: Some(operator_sections::transfer(&transport.links)),
        bounce: (transport.bounce.nnz() > 0)
            .then(|| operator_sections::bounce(transport.bounce_level, &transport.bounce)),
        ..asset
    }
}

struct Clock {
    start: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    fn new() -> Clock {
        Clock {
            start: Instant::now(),
            seconds: Vec::new(),
        }
    }

    fn lap(&mut self, name: &'static str) {
        self.seconds.push((name, self.start.elapsed().as_secs_f64()));
        self.start = Instant::now();
    }
}
