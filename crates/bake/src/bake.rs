//! A whole bake: scene in, asset out.

use crate::candidates::Candidate;
use crate::convert;
use crate::coverage::{Coverage, coverage, everywhere};
use crate::cut_sections::{World, cut_sections};
use crate::error::BakeError;
use crate::left_out::{Pruned, prune};
use crate::omissions::Omissions;
use crate::params::{BakeParams, CutParams, Part};
use crate::points::{self, PointLevels};
use crate::seen;
use crate::settings;
use crate::solution::{Solution, solution};
use crate::timed::TimedSurfaces;
use crate::transport::{Transport, levels_of, transport};
use crate::viewpoint;
use glam::Vec3;
use relight_format as format;
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
    /// So many steps of the stage are done.
    fn advance(&self, done: u64);
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
}

/// Bakes a scene. `lights`: the only sequence that the asset will play, if known; then what it cannot use is
/// left out. `source_hash` identifies the scene's file.
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
    settings::validate(params)?;
    let mut clock = Clock {
        start: Instant::now(),
        seconds: Vec::new(),
    };
    let go_on = || {
        if progress.stopped() {
            Err(BakeError::Stopped)
        } else {
            Ok(())
        }
    };
    go_on()?;

    progress.stage("load", None);
    let traced = TracedScene::new(scene.clone(), shading)?;
    let timed = TimedSurfaces::new(&traced);
    go_on()?;
    clock.lap("load");

    progress.stage("points", None);
    let Places {
        points,
        viewpoints,
        rays: search_rays,
        automatic,
    } = place_points(&timed, &scene, lights, params, progress)?;
    clock.lap("points");

    let points = if params.keeps(Part::Points) {
        everywhere(&traced, points, params.seed)
    } else {
        points
    };
    let tracks = match params.cameras_only {
        true => seen::tracks(&scene, lights),
        false => Vec::new(),
    };
    if params.cameras_only && tracks.is_empty() {
        return Err(BakeError::Parameter {
            name: "--cameras-only",
            found: "a scene without a camera".into(),
            expected: "a camera in the scene or in the sequence of --lights",
        });
    }
    let frames = lights.map_or(1, |s| s.frames).max(scene.sequence.frames);
    let cameras = seen::poses(&tracks, frames);
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
    progress.stage("refine", Some(receivers));
    let transport = transport(
        &timed,
        points,
        &viewpoints,
        &cameras,
        params,
        |v| {
            let stored = match params.short_links() {
                true => format::shortened_vector,
                false => format::quantised_vector,
            };
            Vec3::from(stored(v.to_array()))
        },
        |done| {
            // One call in 64: the watcher may take a lock.
            if done.is_multiple_of(64) {
                progress.advance(done as u64);
                go_on()?;
            }
            Ok(())
        },
    )?;
    go_on()?;
    clock.lap("refine");
    let solved = (params.solution && params.needs_bounces()).then(|| solved(&transport, params));
    if solved.is_some() {
        clock.lap("solve");
    }
    go_on()?;

    let wanted_cuts = params
        .cuts
        .as_ref()
        .filter(|cuts| cuts_are_used(cuts, params, lights));
    let cuts = match wanted_cuts {
        Some(cuts) => {
            let world = World {
                scene: &traced,
                surfaces: &timed,
                points: &transport.points,
            };
            let made = cut_sections(&world, cuts, params.seed, progress)?;
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
    } = prune(&scene, shading, lights, params);
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
    };
    Ok(Baked { asset, stats })
}

/// Whether cuts are worth making: `--cuts auto` makes none without an environment to see.
fn cuts_are_used(cuts: &CutParams, params: &BakeParams, lights: Option<&Sequence>) -> bool {
    let distant = |light: &LightTrack| {
        matches!(
            light.kind,
            LightKind::Environment { .. } | LightKind::SunSky { .. }
        )
    };
    !cuts.if_used || params.keeps(Part::Cuts) || lights.is_none_or(|s| s.lights.iter().any(distant))
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
    fn lap(&mut self, name: &'static str) {
        self.seconds.push((name, self.start.elapsed().as_secs_f64()));
        self.start = Instant::now();
    }
}

/// Levels for which an automatic coarse radius is chosen, whatever their number in a bake: fewer levels are to
/// make a bake coarser, not to spread the same points over them.
const RADIUS_LEVELS: usize = 6;

struct Places {
    points: PointLevels,
    viewpoints: Vec<Vec3>,
    rays: u64,
    automatic: bool,
}

fn place_points(
    surfaces: &dyn Surfaces,
    scene: &Scene,
    lights: Option<&Sequence>,
    params: &BakeParams,
    progress: &dyn Progress,
) -> Result<Places, BakeError> {
    let mut viewpoints = params.viewpoints.clone();
    if viewpoints.is_empty() {
        viewpoints = viewpoint::of_cameras(scene, lights);
    }
    let automatic = viewpoints.is_empty();
    let mut rays = 0;
    if automatic {
        let (place, cast) = viewpoint::in_open_space(surfaces, params.seed);
        rays += cast;
        viewpoints.extend(place);
    }
    if viewpoints.is_empty() {
        return Err(BakeError::NothingReachable { viewpoints });
    }
    if progress.stopped() {
        return Err(BakeError::Stopped);
    }
    let radius = match params.coarse_radius {
        Some(radius) => radius,
        None => {
            let (radius, cast) =
                points::coarse_radius_for(surfaces, &viewpoints, RADIUS_LEVELS, params.seed)?;
            rays += cast;
            radius
        }
    };
    if !(radius.is_finite() && radius > 0.0) {
        return Err(BakeError::NothingReachable { viewpoints });
    }
    let points = points::distribute(
        surfaces,
        &viewpoints,
        params.levels,
        radius,
        params.seed,
        |finest| {
            progress.advance(finest as u64);
            if progress.stopped() {
                Err(BakeError::Stopped)
            } else {
                Ok(())
            }
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

fn solved(transport: &Transport, params: &BakeParams) -> Solution {
    let finest = transport.points.levels.last();
    let albedo: Vec<Vec3> = finest.map_or_else(Vec::new, |l| l.points.iter().map(|p| p.albedo).collect());
    solution(
        &transport.bounce,
        transport.bounce_level,
        &transport.tree,
        &albedo,
        // T carries the last bounce.
        params.bounces.map(|n| n.saturating_sub(2)),
        params.epsilon,
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
