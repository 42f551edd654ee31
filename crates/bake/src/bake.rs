//! A whole bake: scene in, asset out.

use crate::candidates::Candidate;
use crate::convert;
use crate::coverage::{Coverage, coverage, everywhere};
use crate::cut_sections::{World, cut_part, cut_sections};
use crate::error::BakeError;
use crate::left_out::{Pruned, prune};
use crate::omissions::Omissions;
use crate::params::{BakeParams, CutParams, Part};
use crate::points::{self, PointLevels};
use crate::refine::{RowWatch, Wanted, most_rays, rows};
use crate::seen;
use crate::settings;
use crate::solution::{Solution, solution};
use crate::timed::TimedSurfaces;
use crate::transport::{Transport, levels_of, transport_in_units, with_refinement};
use crate::units::{Ledger, Units, key};
use crate::viewpoint;
use glam::Vec3;
use relight_format as format;
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::links::Links;
use relight_transport::senders::SenderTree;
use relight_transport::sparse::Rows;
use std::sync::Arc;
use std::time::Instant;

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
    /// Memory that reconstructed rows took, bytes: what batches save.
    pub row_bytes: u64,
}

/// Candidates until all levels are full, for each point that is expected: 15 to 31 on the scenes of docs/reliability.md.
/// For progress only.
const CANDIDATES_PER_POINT: u64 = 22;

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
    /// In how many parts links are made one after the other, to take less memory; more than 1 takes a ledger.
    pub batches: usize,
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
        batches: 1,
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
        batches,
    } = request;
    let mut clock = Clock::new();
    let watch = Watch(progress);
    let traced = load(request, progress)?;
    let timed = TimedSurfaces::new(&traced);
    let units = units_of(ledger, scene);
    clock.lap("load");

    let places = place_points(&timed, request, units, progress)?;
    let Places {
        points,
        viewpoints,
        rays: search_rays,
        automatic,
    } = places;
    clock.lap("points");
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
    let counts_of_levels = points.levels.iter().map(|l| l.points.len());
    progress.stage("refine", Some(most_rays(counts_of_levels, params.rays)));
    let transport = transport_in_units(
        &timed,
        points,
        (&viewpoints, &cameras),
        params,
        stored_vector(params),
        (units, batches),
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
        // Without T no sender has anything to do.
        senders: lit.then(|| sender_tree(&transport.tree)),
        transfer: lit.then(|| links(&transport.links)),
        bounce: (lit && solved.is_none() && !transport.bounce.entries.is_empty())
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
        ray_tracing_seconds: (timed.thread_seconds(rays) + timed.packet_thread_seconds()) / threads as f64,
        threads,
        row_bytes: transport.row_bytes,
    };
    Ok(Baked { asset, stats })
}

/// The points, and those that are kept though no light path leads there.
fn kept_points(traced: &TracedScene, points: PointLevels, params: &BakeParams) -> PointLevels {
    if params.keeps(Part::Points) {
        everywhere(traced, points, params.seed)
    } else {
        points
    }
}

/// The cameras that alone will look, and where they stand over all frames; none: anybody may look from anywhere.
fn looking<'a>(request: &'a Request) -> Result<(Vec<&'a CameraTrack>, Vec<Camera>), BakeError> {
    let (scene, lights) = (&request.scene, request.lights);
    if !request.params.cameras_only {
        return Ok((Vec::new(), Vec::new()));
    }
    let tracks = seen::tracks(scene, lights);
    if tracks.is_empty() {
        return Err(BakeError::Parameter {
            name: "--cameras-only",
            found: "a scene without a camera".into(),
            expected: "a camera in the scene or in the sequence of --lights",
        });
    }
    let frames = lights.map_or(1, |s| s.frames).max(scene.sequence.frames);
    let cameras = seen::poses(&tracks, frames);
    Ok((tracks, cameras))
}

/// The cuts to make: `--cuts auto` makes none without an environment to see.
fn wanted_cuts<'a>(request: &Request<'a>) -> Option<&'a CutParams> {
    let distant = |light: &LightTrack| {
        matches!(
            light.kind,
            LightKind::Environment { .. } | LightKind::SunSky { .. }
        )
    };
    let may_shine = request.lights.is_none_or(|s| s.lights.iter().any(distant));
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
/// A site of cuts casts a ray at one in so many lights, about (docs/cuts.md).
const LIGHTS_PER_RAY: u64 = 6;

/// Computes part of a bake into the ledger's store. What it needs of other parts is taken from there or computed, too, so
/// that parts can run in any order and at once. Returns into how many pieces the work is best cut.
///
/// # Errors
/// As [`bake_in_units`].
pub fn bake_part(
    request: &Request,
    ledger: &Ledger,
    part: Portion,
    progress: &dyn Progress,
) -> Result<usize, BakeError> {
    let params = request.params;
    let watch = Watch(progress);
    let traced = load(request, progress)?;
    let units = units_of(Some(ledger), &request.scene);
    let Places {
        points, viewpoints, ..
    } = place_points(&traced, request, units, progress)?;
    let points = kept_points(&traced, points, params);
    let (_, cameras) = looking(request)?;
    let (_, points) = quantised(points);
    let counts: Vec<usize> = points.levels.iter().map(|l| l.points.len()).collect();
    let mut rays = most_rays(counts.iter().copied(), params.rays);
    let cuts = wanted_cuts(request);
    if let (Some(cuts), Some(&sites)) = (cuts, counts.last()) {
        rays += sites as u64 * u64::from(cuts.lights) / LIGHTS_PER_RAY;
    }
    progress.stage("share", None);
    let viewers = (&viewpoints[..], &cameras[..]);
    with_refinement(&traced, &points, viewers, params, units, |r, _| {
        let wanted = match part {
            // An eighth: some two levels less than the finest, a quarter of the rays.
            Portion::Shared => Wanted::coarsest(r, units, r.ranges.total() / 8),
            Portion::Piece { index, of } => Wanted::part(r, units, index, of),
        };
        progress.stage("refine", Some(0));
        rows(r, wanted, stored_vector(params), units, &watch)
    })?;
    if let Some(cuts) = cuts {
        let world = World {
            scene: &traced,
            surfaces: &traced,
            points: &points,
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

/// A watcher as stages see it.
struct Watch<'a>(&'a dyn Progress);

impl Watch<'_> {
    fn step(&self, done: u64) -> Result<(), BakeError> {
        self.0.advance(done);
        self.go_on()
    }

    fn go_on(&self) -> Result<(), BakeError> {
        if self.0.stopped() {
            Err(BakeError::Stopped)
        } else {
            Ok(())
        }
    }
}

impl RowWatch for Watch<'_> {
    fn cast(&self, rays: usize) -> Result<(), BakeError> {
        self.step(rays as u64)
    }
    fn expect(&self, rays: u64) {
        self.0.expect(rays);
    }
}

/// What a reader of the file will see of a link.
fn stored_vector(params: &BakeParams) -> impl Fn(Vec3) -> Vec3 + Copy + Sync {
    let stored = match params.short_links() {
        true => format::shortened_vector,
        false => format::quantised_vector,
    };
    move |v| Vec3::from(stored(v.to_array()))
}

fn load(request: &Request, progress: &dyn Progress) -> Result<TracedScene, BakeError> {
    settings::validate(request.params)?;
    let watch = Watch(progress);
    watch.go_on()?;
    progress.stage("load", None);
    let traced = TracedScene::new(request.scene.clone(), request.shading)?;
    watch.go_on()?;
    Ok(traced)
}

fn units_of<'a>(ledger: Option<&'a Ledger<'a>>, scene: &Scene) -> Units<'a> {
    Units::new(ledger, ledger.map_or(0, |_| key::surfaces(scene)))
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

/// Levels for which an automatic coarse radius is chosen, whatever their number in a bake: fewer levels are to
/// make a bake coarser, not to spread the same points over them.
const RADIUS_LEVELS: usize = 6;

/// The scene prepared, and R of the coarsest level: what is asked for, or what suits the scene.
///
/// # Errors
/// As [`bake()`].
pub fn coarse_radius(request: &Request, progress: &dyn Progress) -> Result<(TracedScene, f32), BakeError> {
    let traced = load(request, progress)?;
    let (viewpoints, _, _) = viewpoints(&traced, request)?;
    let radius = radius(&traced, request, &viewpoints, Units::none())?.0;
    Ok((traced, radius))
}

struct Places {
    points: PointLevels,
    viewpoints: Vec<Vec3>,
    rays: u64,
    automatic: bool,
}

/// Viewpoints, rays cast to find them, and whether the scene had none of its own.
fn viewpoints(surfaces: &dyn Surfaces, request: &Request) -> Result<(Vec<Vec3>, u64, bool), BakeError> {
    let mut viewpoints = request.params.viewpoints.clone();
    if viewpoints.is_empty() {
        viewpoints = viewpoint::of_cameras(&request.scene, request.lights);
    }
    let automatic = viewpoints.is_empty();
    let mut rays = 0;
    if automatic {
        let (place, cast) = viewpoint::in_open_space(surfaces, request.params.seed);
        rays += cast;
        viewpoints.extend(place);
    }
    if viewpoints.is_empty() {
        return Err(BakeError::NothingReachable { viewpoints });
    }
    Ok((viewpoints, rays, automatic))
}

/// R of the coarsest level, and rays cast to find it.
fn radius(
    surfaces: &dyn Surfaces,
    request: &Request,
    viewpoints: &[Vec3],
    units: Units,
) -> Result<(f32, u64), BakeError> {
    let (radius, rays) = match request.params.coarse_radius {
        Some(radius) => (radius, 0),
        None => {
            points::coarse_radius_in_units(surfaces, viewpoints, RADIUS_LEVELS, request.params.seed, units)?
        }
    };
    if radius.is_finite() && radius > 0.0 {
        Ok((radius, rays))
    } else {
        Err(BakeError::NothingReachable {
            viewpoints: viewpoints.to_vec(),
        })
    }
}

fn place_points(
    surfaces: &dyn Surfaces,
    request: &Request,
    units: Units,
    progress: &dyn Progress,
) -> Result<Places, BakeError> {
    progress.stage("reach", None);
    let (params, watch) = (request.params, Watch(progress));
    let (viewpoints, mut rays, automatic) = viewpoints(surfaces, request)?;
    watch.go_on()?;
    let (radius, cast) = radius(surfaces, request, &viewpoints, units)?;
    rays += cast;
    // Radii of our own make give about as many points as were wanted.
    let finest = points::expected(RADIUS_LEVELS, params.levels) as u64;
    let wanted = params
        .coarse_radius
        .is_none()
        .then_some(finest * CANDIDATES_PER_POINT);
    progress.stage("points", wanted);
    let mut told = 0;
    let points = points::distribute_in_units(
        surfaces,
        &viewpoints,
        params.levels,
        radius,
        params.seed,
        units,
        |spread| {
            let new = spread.candidates() - told;
            told = spread.candidates();
            if let Some(wanted) = wanted {
                // It is not done yet, whatever was expected.
                progress.expect(wanted.max(told + told / 8));
            }
            watch.step(new)
        },
    )?;
    Ok(Places {
        points,
        viewpoints,
        rays,
        automatic,
    })
}

/// The points as a reader of the file will see them: the operators are built over those. Places keep where
/// their rays start, and their exact geometric normals.
fn quantised(mut points: PointLevels) -> (Vec<format::Level>, PointLevels) {
    let mut levels = Vec::with_capacity(points.levels.len());
    for level in &mut points.levels {
        let exact = format::Level {
            disk_radius: level.disk_radius,
            support_radius: level.support_radius,
            positions: level.points.iter().map(|p| p.position.to_array()).collect(),
            normals: level.points.iter().map(|p| p.normal.to_array()).collect(),
            albedo: level
                .points
                .iter()
                .map(|p| p.albedo.clamp(Vec3::ZERO, Vec3::ONE).to_array())
                .collect(),
        };
        let stored = format::quantised_level(&exact);
        for (i, place) in level.points.iter_mut().enumerate() {
            *place = Candidate {
                position: stored.positions[i].into(),
                normal: stored.normals[i].into(),
                albedo: stored.albedo[i].into(),
                ..*place
            };
        }
        levels.push(exact);
    }
    (levels, points)
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

fn links(links: &Links) -> format::Links {
    format::Links {
        receivers: links.receivers,
        senders: links.senders,
        row_offsets: links.row_offsets.clone(),
        columns: links.columns.clone(),
        vectors: links.vectors.iter().map(Vec3::to_array).collect(),
    }
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

fn sender_tree(tree: &SenderTree) -> format::Senders {
    format::Senders {
        counts: (0..tree.levels())
            .map(|l| tree.ranges.range(l).len() as u32)
            .collect(),
        leaf_of_point: tree.leaf_of_point.clone(),
        importance: tree.importance.clone(),
        parents: tree.parents.clone(),
    }
}

fn bounce(level: usize, rows: &Rows) -> format::BounceLinks {
    format::BounceLinks {
        level: level as u32,
        matrix: matrix(rows, 1.0),
    }
}

fn stored_solution(solution: &Solution) -> format::Solution {
    format::Solution {
        level: solution.level as u32,
        channels: solution
            .channels
            .iter()
            .map(|rows| matrix(rows, f64::MAX))
            .collect(),
    }
}

/// `most`: what no row may exceed, whatever rounding made of it.
fn matrix(rows: &Rows, most: f64) -> format::WeightRows {
    format::WeightRows {
        rows: rows.rows() as u32,
        row_offsets: rows.offsets.clone(),
        columns: rows.entries.iter().map(|e| e.0).collect(),
        weights: rows.entries.iter().map(|e| e.1).collect(),
        row_sums: (0..rows.rows())
            .map(|i| rows.row(i).iter().map(|e| f64::from(e.1)).sum::<f64>().min(most) as f32)
            .collect(),
    }
}
