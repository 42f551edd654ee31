//! Nanoseconds of one core per pixel and merged node of shading with visibility cuts, matt and glossy.
//!
//! `cargo bench --bench cut_shading`
//!
//! The asset is baked here from `data/table.glb`, which is why the benchmark belongs to the root package: `play` may not
//! know `bake`. Its points are 5 cm apart, four times the distance of the preset `standard`, and the picture is a quarter
//! of 640 pixels wide, so that as many pixels share their sites as there. Rounds of both materials take turns; medians
//! are reported. The light is the environment of `data/window.hdr`, the illumination cut has 256 nodes; shadow rays of
//! what is too bright for cuts are not part of it.

use glam::Vec3;
use relight_bake::params::{BakeParams, CutParams, Preset};
use relight_bake::{Request, Unwatched, bake};
use relight_format as format;
use relight_play::cuts::illumination::Illumination;
use relight_play::cuts::shade::{Fragments, ShadeStats, shade};
use relight_play::shot::RelitShot;
use relight_play::{CutSites, Player, ShotSettings};
use relight_render::expose::expose;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::light_set::{LightRig, NoEmitters};
use relight_scene::sequence::read_sequence;
use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

const ROUNDS: usize = 9;
const SIZE: (usize, usize) = (160, 120);
const ILLUMINATION_CUT: usize = 256;

fn main() -> Result<(), Box<dyn Error>> {
    // `cargo test --benches` passes no --bench: then there is nothing to measure.
    if !std::env::args().any(|argument| argument == "--bench") {
        return Ok(());
    }
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let scene = Arc::new(import(&data.join("table.glb"), &ImportOptions::default())?);
    let params = BakeParams {
        levels: 4,
        sender_levels: 1,
        // No link is worth that much: direct light needs none.
        epsilon: 1e9,
        cuts: Some(CutParams::default()),
        ..BakeParams::preset(Preset::Draft)
    };
    let mut asset = bake(&Request::new(scene, &params), None, &Unwatched)?.asset;
    let folder = tempfile::tempdir()?;
    let mut loaded = |name: &str, lambert: bool| -> Result<Player, Box<dyn Error>> {
        asset.provenance.lambert = lambert;
        let file = folder.path().join(name);
        format::write_file(&file, &asset)?;
        Ok(Player::open(&file)?)
    };
    let contestants = [
        ("matt", loaded("matt.relight", true)?),
        ("glossy", loaded("glossy.relight", false)?),
    ];
    let shots: Vec<RelitShot> = contestants.iter().map(|(_, player)| shot(player)).collect();
    let sequence = read_sequence(&data.join("table_window.lights.json"))?;
    let rig = LightRig::new(&NoEmitters, &sequence.lights)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut times = [const { Vec::new() }; 2];
    let mut stats = [ShadeStats::default(); 2];
    for _ in 0..ROUNDS {
        for (i, (_, player)) in contestants.iter().enumerate() {
            let light = illumination(player, &rig);
            let (seconds, found) = pool.install(|| {
                let clock = Instant::now();
                let start = core_seconds(clock);
                let found = shaded(player, &shots[i], &light);
                (core_seconds(clock) - start, found)
            });
            times[i].push(seconds);
            stats[i] = found;
        }
    }
    println!(
        "{:<8}{:>10}{:>8}{:>8}{:>10}{:>24}",
        "surface", "fragments", "sites", "nodes", "ms", "ns/fragment and node"
    );
    for (i, (name, player)) in contestants.iter().enumerate() {
        times[i].sort_by(f64::total_cmp);
        let median = times[i][ROUNDS / 2];
        let ShadeStats {
            merged_nodes,
            fragments,
            ..
        } = stats[i];
        println!(
            "{name:<8}{fragments:>10}{:>8}{:>8.0}{:>10.1}{:>24.2}",
            player.prepared.cuts.as_ref().map_or(0, |cuts| cuts.cuts.sites()),
            merged_nodes as f64 / fragments as f64,
            1e3 * median,
            1e9 * median / merged_nodes as f64,
        );
    }
    Ok(())
}

/// What the scene's first camera sees, a ray per pixel.
fn shot(player: &Player) -> RelitShot {
    let camera = player.scene().cameras[0].at(0.0);
    let seen = expose(&player.prepared.scene, &camera, SIZE.0, SIZE.1, 1);
    let settings = ShotSettings {
        sites: Some(CutSites::Around),
        ..ShotSettings::default()
    };
    player.shot_of(seen, &settings)
}

fn illumination(player: &Player, rig: &LightRig) -> Illumination {
    let cuts = player.prepared.cuts.as_ref();
    let leaves = cuts.map_or(0, |cuts| cuts.lights.leaves());
    let distant = (rig.at(0.0)).take_distant(|light| rig.split(light, 0.0, leaves as u32).map(Arc::new));
    let radiance = |direction: Vec3| {
        distant
            .iter()
            .flatten()
            .map(|light| light.radiance(direction))
            .sum()
    };
    match cuts.and_then(|cuts| cuts.directions()) {
        Some(directions) => {
            Illumination::of_parts(directions, &directions.cells.parts(radiance), ILLUMINATION_CUT)
        }
        None => Illumination::of_samples(&[], ILLUMINATION_CUT),
    }
}

fn shaded(player: &Player, shot: &RelitShot, light: &Illumination) -> ShadeStats {
    let (Some(cuts), Some(sites)) = (&player.prepared.cuts, &shot.sites) else {
        return ShadeStats::default();
    };
    let views = shot.seen.views();
    let fragments = Fragments {
        sites,
        points: &shot.seen.points,
        views: &views,
        narrow: &[],
        matt: true,
    };
    let shaded = shade(cuts, light, &fragments);
    black_box(shaded.radiance);
    shaded.stats
}

/// Seconds that this thread has run on a core, where the system tells (Linux); else those of the clock. Other work on the
/// machine lengthens the latter only.
fn core_seconds(start: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |n| n * 1e-9)
}
