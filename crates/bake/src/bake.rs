//! A whole bake: scene in, asset out.

mod portion;
mod prepare;
mod sections;

use crate::convert;
use crate::cuts::sections::{World, cut_sections};
use crate::error::BakeError;
use crate::left_out::{Pruned, prune};
use crate::links::operators::{Transport, levels_of, transport_in_units};
use crate::links::solution::{Solution, solution};
use crate::memory;
use crate::omissions::Omissions;
use crate::params::{BakeParams, CutParams, Part};
use crate::points::coverage::{Coverage, coverage};
use crate::settings;
use crate::timed::TimedSurfaces;
use crate::units::reach::{Followed, Reach};
use crate::units::{Ledger, Units};
use glam::Vec3;
use prepare::{Places, Watch, kept_points, load, looking, place_points, quantised, stored_vector};
use relight_format as format;
use relight_scene::light::LightTrack;
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;
use relight_scene::surface::Surfaces;
use relight_scene::traced::Shading;
use sections::{bounce, links, parted, sender_tree, stored_solution};
use std::sync::Arc;
use std::time::Instant;

pub use portion::{Portion, bake_part};
pub use prepare::{coarse_radius, point_counts};

/// Who watches a bake: told what is being done, and asked whether to go on. Called from many threads.
pub trait Progress: Sync {
    /// A stage begins; `total` is the number of its steps, where it is known.
    fn stage(&self, name: &'static str, total: Option<u64>);
    /// So many more steps of the stage are done.
    fn advance(&self, done: u64);
    /// The stage turns out to have about so many steps.
    fn expect(&self, _total: u64) {}
    /// Whether the bake shall stop.
    fn stopped(&self) -> bool;
}

/// An asset and what making it took.
#[derive(Debug)]
pub struct Baked {
    /// What goes into the file; depends on scene, parameters and seed only.
    pub asset: format::Asset,
    /// What varies from run to run.
    pub stats: BakeStats,
}

/// What a bake took.
#[derive(Clone, Debug, Default)]
pub struct BakeStats {
    /// Wall-clock seconds per stage, in order.
    pub seconds: Vec<(&'static str, f64)>,
    /// Thread-seconds spent casting rays, divided by the threads ([`crate::timed`] says how it is measured).
    pub ray_tracing_seconds: f64,
    /// Worker threads.
    pub threads: usize,
    /// Memory that reconstructed rows took, bytes.
    pub row_bytes: u64,
}

/// What is baked.
#[derive(Clone)]
pub struct Request<'a> {
    /// The scene.
    pub scene: Arc<Scene>,
    /// How materials are evaluated.
    pub shading: Shading,
    /// How.
    pub params: &'a BakeParams,
    /// The only sequence that the asset will play, if known; then what it cannot use is left out.
    pub lights: Option<&'a Sequence>,
    /// Identifies the scene's file.
    pub source_hash: u64,
    /// Memory of the machine, bytes, if known: a bake that surely needs more is refused before links are made.
    pub memory: Option<u64>,
}

/// Bakes a scene in one go. The parameters are the fields of [`Request`].
///
/// # Errors
/// [`BakeError`]: the scene cannot be prepared, a parameter is out of range, nothing is reachable, or
/// `progress` said stop.
pub fn bake(
    scene: Arc<Scene>,
    shading: Shading,
    params: &BakeParams,
    lights: Option<&Sequence>,
    source_hash: u64,
    progress: &dyn Progress,
) -> Result<Baked, BakeError> {
    let request = Request {
        scene,
        shading,
        params,
        lights,
        source_hash,
        memory: None,
    };
    bake_in_units(&request, None, progress)
}

/// Bakes a scene in units of work that `ledger` keeps and takes again. The asset is that of [`bake()`], bit by bit.
///
/// # Errors
/// As [`bake()`], or a unit cannot be kept.
pub fn bake_in_units(
    request: &Request,
    ledger: Option<&Ledger>,
    progress: &dyn Progress,
) -> Result<Baked, BakeError> {
    let &Request {
        ref scene,
        shading,
        params,
        lights,
        source_hash,
        memory: _,
    } = request;
    let mut clock = Clock::new();
    let watch = Watch(progress);
    let traced = load(request, progress)?;
    let timed = TimedSurfaces::new(&traced);
    let reach = ledger.map(|_| Reach::new(scene, traced.bounds()));
    let units =
        (ledger.zip(reach.as_ref())).map_or(Units::none(), |(ledger, reach)| Units::new(ledger, reach));
    let followed = reach.as_ref().map(|reach| Followed::new(&timed, reach));
    let surfaces: &dyn Surfaces = followed.as_ref().map_or(&timed, |followed| followed);
    clock.lap("load");

    let places = place_points(surfaces, request, units, progress)?;
    let Places {
        points,
        viewpoints,
        rays: search_rays,
        automatic,
    } = places;
    clock.lap("points");
    memory::check(&points, request)?;
    let points = kept_points(&traced, points, params);
    let (tracks, cameras) = looking(request)?;

    let (levels, points) = quantised(points);
    let covered = levels_of(&points).last().map_or(Coverage::default(), |finest| {
        coverage(&traced, finest, params.seed)
    });
    let receivers: u64 = points.levels.iter().map(|l| l.points.len() as u64).sum();
    let senders: u64 = points
        .levels
        .iter()
        .take(params.sender_levels)
        .map(|l| l.points.len() as u64)
        .sum();
    progress.stage("share", None);
    let transport = transport_in_units(
        surfaces,
        points,
        (&viewpoints, &cameras),
        params,
        stored_vector(params),
        units,
        &watch,
    )?;
    watch.go_on()?;
    clock.lap("refine");
    let solved = match params.solution && params.needs_bounces() {
        true => {
            let solved = solved(&transport, params, units, &watch)?;
            clock.lap("solve");
            Some(solved)
        }
        false => None,
    };
    watch.go_on()?;

    let cuts = match wanted_cuts(request) {
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
    let Pruned {
        scene: kept,
        left_out,
        keeps_lights,
        keeps_emission,
    } = prune(scene, shading, lights, params);
    let coding = coding(&levels, &transport, params);
    let mut omitted = Omissions {
        list: left_out,
        ..Omissions::default()
    };
    omitted.unreached(covered, receivers as usize);
    omitted.of_operators(&transport, params);
    if params.cuts.is_some() && cuts.is_none() {
        omitted.unused_cuts(levels.last().map_or(0, |l| l.positions.len()));
    }
    let short = coding.short_links.then_some(transport.links.columns.len());
    omitted.precision(receivers as usize, coding.grey, short, params);
    if let Some(cuts) = &cuts {
        omitted.cut_precision(cuts.cuts.heights.len());
    }
    let rays = transport.rays + search_rays;
    let cut_rays = cuts.as_ref().map_or(0, |c| c.rays);
    let (light_tree, estimates, cuts) = cuts.map_or((None, None, None), |made| {
        (Some(made.light_tree), Some(made.estimates), Some(made.cuts))
    });
    let facts = Facts {
        rays: rays + cut_rays,
        potential_links: receivers * senders,
        covered,
        automatic,
    };
    let mut notes = scene.notes.clone();
    notes.extend(remarks(&transport, &facts, &viewpoints));
    let mut settings = settings::settings(params);
    settings.extend(setting_strings([
        (
            "own_lights",
            if keeps_lights { "kept" } else { "left out" }.into(),
        ),
        (
            "emission",
            if keeps_emission { "kept" } else { "left out" }.into(),
        ),
    ]));
    if params.cameras_only {
        settings.extend(setting_strings([(
            "cameras_only",
            convert::camera_hashes(&tracks),
        )]));
    }
    let mut counts = counts(&transport, &facts);
    counts.extend(omitted.counts());
    let provenance = format::Provenance {
        tool_version: concat!("relight ", env!("CARGO_PKG_VERSION")).into(),
        settings,
        source_hash,
        seed: params.seed,
        lambert: shading == Shading::Lambert,
        left_out: omitted.list,
        counts,
        notes,
    };
    let lit = !transport.links.is_empty();
    let mut asset = format::Asset {
        provenance,
        geometry: convert::geometry(&kept),
        materials: convert::materials(&kept),
        textures: convert::textures(&kept),
        stage: convert::stage(&kept),
        points: levels,
        separations: lit.then(|| parted(&transport.parted)).flatten(),
        // Without T no sender has anything to do.
        senders: lit.then(|| sender_tree(&transport.tree)),
        transfer: lit.then(|| links(&transport.links)),
        bounce: (lit && solved.is_none() && transport.bounce.nnz() > 0)
            .then(|| bounce(transport.bounce_level, &transport.bounce)),
        solution: solved.filter(|_| lit).map(|s| stored_solution(&s)),
        light_tree,
        estimates,
        cuts,
        coding,
    };
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

/// The cuts to make: `--cuts auto` makes none without an environment to see.
fn wanted_cuts<'a>(request: &Request<'a>) -> Option<&'a CutParams> {
    let may_shine = request
        .lights
        .is_none_or(|s| s.lights.iter().any(LightTrack::is_distant));
    let params = request.params;
    let used = |cuts: &&CutParams| !cuts.if_used || params.keeps(Part::Cuts) || may_shine;
    params.cuts.as_ref().filter(used)
}

/// What takes fewer bits in the file.
fn coding(levels: &[format::Level], made: &Transport, params: &BakeParams) -> format::Coding {
    let mut albedos = levels.iter().flat_map(|l| &l.albedo);
    format::Coding {
        grey: !params.keeps(Part::Precision) && albedos.all(|[r, g, b]| r == g && g == b),
        short_links: params.short_links() && !made.links.is_empty(),
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

/// Deterministic facts of a bake.
struct Facts {
    rays: u64,
    potential_links: u64,
    covered: Coverage,
    automatic: bool,
}

fn setting_strings<const N: usize>(pairs: [(&str, String); N]) -> Vec<(String, String)> {
    pairs
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}

fn counts(transport: &Transport, facts: &Facts) -> Vec<(String, u64)> {
    let gathered = transport.gathered.iter().sum::<usize>() as u64;
    let square_mm = |area: f64| (area * 1e6).round() as u64;
    [
        ("rays", facts.rays),
        ("potential_links", facts.potential_links),
        ("candidates", transport.points.candidates),
        ("receivers_gathered", gathered),
        ("rays_without_points", transport.lost),
        ("surface_square_mm", square_mm(facts.covered.area)),
        ("uncovered_square_mm", square_mm(facts.covered.uncovered)),
    ]
    .into_iter()
    .map(|(name, value)| (name.to_owned(), value))
    .collect()
}

fn remarks(transport: &Transport, facts: &Facts, viewpoints: &[Vec3]) -> Vec<String> {
    let mut notes = Vec::new();
    if let (true, Some(v)) = (facts.automatic, viewpoints.first()) {
        notes.push(format!(
            "The scene has no camera: points were spread from ({:.3}, {:.3}, {:.3}); --viewpoint sets another place.",
            v.x, v.y, v.z
        ));
    }
    if transport.links.is_empty() {
        notes.push(
            "No surface sees another: there is no indirect light, and the transfer operator is empty.".into(),
        );
    }
    notes
}

fn solved(
    transport: &Transport,
    params: &BakeParams,
    units: Units,
    watch: &Watch,
) -> Result<Solution, BakeError> {
    let finest = transport.points.levels.last();
    let albedo: Vec<Vec3> = finest.map_or_else(Vec::new, |l| l.points.iter().map(|p| p.albedo).collect());
    watch.0.stage("solve", None);
    solution(
        &transport.bounce,
        transport.bounce_level,
        &transport.tree,
        &albedo,
        // T carries the last bounce.
        params.bounces.map(|n| n.saturating_sub(2)),
        params.epsilon,
        units,
        &|rows| watch.step(rows as u64),
    )
}
