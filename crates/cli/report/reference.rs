//! What all settings are judged by: path-traced frames in two independent halves, which tell their own error.

use super::cache;
use super::task::Task;
use crate::console::Console;
use crate::failure::Failure;
use crate::frames::FrameRange;
use crate::kinds::Kind;
use crate::output;
use crate::play::{self, Pace};
use crate::signals::{self, Until};
use relight_scene::image::metrics::compare;
use relight_scene::image::{
    BEAUTY, ExrHeader, FloatImage, ImageError, Layers, Limits, read_exr, write_atomically, write_exr,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Samples a pixel of a half's first pass; each pass has as many as all before it together.
const FIRST_PASS: u32 = 16;
/// Most samples a pixel of a half.
const MOST: u32 = 4096;
/// A reference whose own root of relMSE is below this is good enough: a third of the smallest error that a report
/// speaks of, 1 %.
const GOOD_ENOUGH: f64 = 0.003;

/// Layers that are judged.
pub const LAYERS: [&str; 3] = [BEAUTY, "direct", "indirect"];

/// A frame to judge by.
pub struct Reference {
    /// Its number.
    pub frame: u32,
    /// Mean of both halves.
    pub layers: Layers,
    /// Its own relMSE by layer, in the order of [`LAYERS`], where two halves tell it.
    pub floor: Option<[f64; 3]>,
    /// The halves, where there are two.
    pub halves: Option<[Layers; 2]>,
    /// Samples a pixel of both halves together, where known.
    pub spp: Option<u32>,
}

/// What a report's JSON says of a reference.
#[derive(Serialize)]
pub struct ReferenceSummary {
    frame: u32,
    spp: Option<u32>,
    /// By layer.
    floor_relmse: Option<BTreeMap<&'static str, f64>>,
}

/// What is kept beside the halves of a reference.
#[derive(Serialize, Deserialize)]
struct KeptSamples {
    /// Samples a pixel of each.
    spp_of_each_half: u32,
    /// What the last pass took, by which the next one is judged.
    #[serde(default)]
    seconds_of_last_pass: f64,
}

impl Reference {
    /// Its own relMSE in a layer; 0 where it is not known.
    pub fn floor_of(&self, layer: &str) -> f64 {
        let at = LAYERS.iter().position(|name| *name == layer);
        self.floor.zip(at).map_or(0.0, |(floor, at)| floor[at])
    }

    /// For the report.
    pub fn summary(&self) -> ReferenceSummary {
        ReferenceSummary {
            frame: self.frame,
            spp: self.spp,
            floor_relmse: self.floor.map(|floor| LAYERS.into_iter().zip(floor).collect()),
        }
    }

    fn of_halves(frame: u32, halves: &[Layers; 2], spp: Option<u32>) -> Result<Reference, ImageError> {
        let mut floor = [0.0; 3];
        let mut layers = Layers::new(halves[0].width, halves[0].height);
        for (name, floor) in LAYERS.iter().zip(&mut floor) {
            if let [Some(a), Some(b)] = halves.each_ref().map(|half| half.rgb(name)) {
                // The mean of two independent halves has a quarter of the squared difference between them.
                *floor = compare(&a, &b)?.relmse / 4.0;
                layers.push_rgb(name, &mean(&a, &b, 0.5).pixels);
            }
        }
        Ok(Reference {
            frame,
            layers,
            floor: Some(floor),
            halves: Some(halves.clone()),
            spp,
        })
    }
}

/// a + (b − a) · `share`.
fn mean(a: &FloatImage, b: &FloatImage, share: f64) -> FloatImage {
    let mix = |a: f32, b: f32| (f64::from(a) + (f64::from(b) - f64::from(a)) * share) as f32;
    let pixels = a.pixels.iter().zip(&b.pixels);
    FloatImage {
        pixels: pixels
            .map(|(a, b)| std::array::from_fn(|k| mix(a[k], b[k])))
            .collect(),
        ..*a
    }
}

fn half_names(frame: u32) -> [String; 2] {
    ["a", "b"].map(|half| format!("frame_{frame:04}_{half}.exr"))
}

/// Takes references from a folder.
///
/// # Errors
/// A frame is missing, unreadable, of another size, or lacks the beauty.
pub fn read(task: &Task, folder: &Path) -> Result<Vec<Reference>, Failure> {
    if folder.is_file() {
        let (name, kind) = (folder.display(), Kind::of(folder).name());
        return Err(anyhow::anyhow!(
            "{name}: is {kind}, not a folder with references: give the one in which frame_0000.exr lies"
        )
        .into());
    }
    let fitting = |path: &Path| -> Result<Layers, Failure> {
        let layers = read_exr(path, &Limits::default())?;
        if (layers.width, layers.height) != task.size || layers.layer(BEAUTY).is_none() {
            return Err(anyhow::anyhow!(
                "{}: is {} x {} with {} layers; the report needs {} x {} with the beauty: give --size, or other references",
                path.display(),
                layers.width,
                layers.height,
                layers.layers.len(),
                task.size.0,
                task.size.1
            )
            .into());
        }
        Ok(layers)
    };
    (task.frames.iter())
        .map(|frame| {
            let halves = half_names(frame).map(|name| folder.join(name));
            if halves.iter().all(|half| half.exists()) {
                let halves = [fitting(&halves[0])?, fitting(&halves[1])?];
                return Ok(Reference::of_halves(frame, &halves, None)?);
            }
            Ok(Reference {
                frame,
                layers: fitting(&folder.join(format!("frame_{frame:04}.exr")))?,
                floor: None,
                halves: None,
                spp: None,
            })
        })
        .collect()
}

/// A reference in the making.
struct Growing {
    frame: u32,
    folder: PathBuf,
    halves: [Layers; 2],
    /// Samples a pixel of each half so far.
    spp: u32,
    /// How long the last pass took.
    last_pass: Duration,
}

/// Path-traces references until they are good enough or it is `until`; what was traced before goes on.
///
/// # Errors
/// The asset cannot be played, or a file not be written.
pub fn converge(task: &Task, until: Instant, console: &Console) -> Result<Vec<Reference>, Failure> {
    console.begin("Path tracing references", None);
    let mut growing: Vec<Growing> = task
        .frames
        .iter()
        .map(|frame| Growing::open(task, frame))
        .collect();
    loop {
        // The one with the fewest samples goes on.
        let next = growing.iter_mut().filter(|g| !g.is_done()).min_by_key(|g| g.spp);
        let Some(next) = next else { break };
        // A pass takes as long as all before it, and so does the next frame's: at least one pass is made of each.
        if next.spp > 0 && Instant::now() + next.last_pass * 2 > until {
            break;
        }
        let limit = (next.spp > 0).then_some(until);
        match next.pass(task, limit, console) {
            // The pass took longer than it should have: what was there before holds.
            Err(Failure::Stopped(_)) if !signals::stopped() => break,
            other => other?,
        }
        console.detail(format!(
            "frame {}: {} samples a pixel, own error {:.4}",
            next.frame,
            2 * next.spp,
            next.error()
        ));
    }
    (growing.iter())
        .map(|g| Ok(Reference::of_halves(g.frame, &g.halves, Some(2 * g.spp))?))
        .collect()
}

impl Growing {
    /// Takes up what an earlier report left.
    fn open(task: &Task, frame: u32) -> Growing {
        let folder = cache::place(task, "reference", "path", "");
        let kept = Growing::kept(&folder, frame, task.size);
        let (spp, halves, last_pass) = kept.unwrap_or_default();
        Growing {
            frame,
            folder,
            halves,
            spp,
            last_pass,
        }
    }

    fn kept(folder: &Path, frame: u32, size: (usize, usize)) -> Option<(u32, [Layers; 2], Duration)> {
        let text = std::fs::read_to_string(folder.join(format!("frame_{frame:04}.json"))).ok()?;
        let kept = serde_json::from_str::<KeptSamples>(&text).ok()?;
        let last_pass = Duration::try_from_secs_f64(kept.seconds_of_last_pass).ok()?;
        let [a, b] = half_names(frame).map(|name| read_exr(&folder.join(name), &Limits::default()).ok());
        let halves = [a?, b?];
        let fits = |half: &Layers| (half.width, half.height) == size;
        halves
            .iter()
            .all(fits)
            .then_some((kept.spp_of_each_half, halves, last_pass))
    }

    fn error(&self) -> f64 {
        let [a, b] = self
            .halves
            .each_ref()
            .map(|half| half.rgb(BEAUTY).unwrap_or_default());
        compare(&a, &b).map_or(f64::INFINITY, |c| (c.relmse / 4.0).sqrt())
    }

    fn is_done(&self) -> bool {
        self.spp >= MOST || (self.spp > 0 && self.error() < GOOD_ENOUGH)
    }

    /// Adds samples to both halves, in the time that there is.
    fn pass(&mut self, task: &Task, until: Option<Instant>, console: &Console) -> Result<(), Failure> {
        let start = Instant::now();
        let more = self.spp.max(FIRST_PASS);
        let quiet = console.silent();
        let mut halves: [Layers; 2] = Default::default();
        for half in 0..2usize {
            let only = FrameRange {
                first: self.frame,
                last: self.frame,
                step: 1,
            };
            let path = ["--integrator", "path", "--spp"].map(str::to_owned);
            let args = task.play_args(
                &task.asset,
                &self.folder.join("pass.exr"),
                only,
                &[&path[..], &[more.to_string()]].concat(),
            )?;
            // No pass of either half shares random numbers with another.
            let seed = relight_format::content_hash(
                format!("{} {} {half} {}", task.seed, self.frame, self.spp).as_bytes(),
            );
            let mut layers = Layers::default();
            play::play_watched(&args, seed, &quiet, Pace::OneByOne, &Until(until), |_, all| {
                layers = all.clone();
            })?;
            let share = f64::from(more) / f64::from(self.spp + more);
            let mut sum = Layers::new(task.size.0, task.size.1);
            for name in LAYERS {
                let new = layers.rgb(name).unwrap_or_default();
                let old = self.halves[half].rgb(name).unwrap_or_else(|| new.clone());
                sum.push_rgb(name, &mean(&old, &new, share).pixels);
            }
            halves[half] = sum;
        }
        self.halves = halves;
        self.spp += more;
        self.last_pass = start.elapsed();
        self.keep()
    }

    /// Writes it down; the count last, so that a stop between leaves an older count, which only wastes samples' weight.
    fn keep(&self) -> Result<(), Failure> {
        let _whole = signals::whole();
        for (half, name) in self.halves.iter().zip(half_names(self.frame)) {
            write_exr(&self.folder.join(name), half, &ExrHeader::new(), true)?;
        }
        let samples = KeptSamples {
            spp_of_each_half: self.spp,
            seconds_of_last_pass: self.last_pass.as_secs_f64(),
        };
        let text = output::json_text(&samples)?;
        let name = format!("frame_{:04}.json", self.frame);
        Ok(write_atomically(&self.folder.join(name), text.as_bytes())?)
    }
}
