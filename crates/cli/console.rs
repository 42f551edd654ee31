//! What people see while a command runs: bars with rate and time left on a terminal, plain lines elsewhere,
//! nothing with --quiet but what nobody may miss.

use crate::failure::Failure;
use crate::signals::{self, Until};
use crate::words;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use relight_bake::disk;
use relight_bake::error::BakeError;
use relight_render::watch::Watch;
use serde::Serialize;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Seconds between two plain progress lines of one stage.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Seconds between two lines of JSON of one stage.
const JSON_EVERY: Duration = Duration::from_secs(1);

/// How progress is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ProgressStyleName {
    /// Bars on a terminal, lines elsewhere.
    #[default]
    Auto,
    /// Lines.
    Plain,
    /// One JSON object per line, every second: stage, done, total (null where it is not known), seconds, seconds_left; what is said
    /// has note, detail, warning or error instead.
    Json,
}

/// Where notes and progress go.
pub struct Console {
    quiet: bool,
    verbose: bool,
    terminal: bool,
    json: bool,
    stage: Mutex<Option<Stage>>,
}

struct Stage {
    name: String,
    total: Option<u64>,
    bar: ProgressBar,
    start: Instant,
    said: Instant,
}

impl Console {
    /// A console on stderr.
    pub fn new(quiet: bool, verbose: bool, style: ProgressStyleName) -> Console {
        Console {
            quiet,
            verbose,
            terminal: style == ProgressStyleName::Auto && std::io::stderr().is_terminal() && !is_dumb(),
            json: style == ProgressStyleName::Json,
            stage: Mutex::new(None),
        }
    }

    /// One that says nothing, for commands that another command runs.
    pub fn silent(&self) -> Console {
        Console::new(true, false, ProgressStyleName::Plain)
    }

    /// Whether people asked for more.
    pub fn is_verbose(&self) -> bool {
        self.verbose
    }

    /// A sentence for people.
    pub fn note(&self, text: impl AsRef<str>) {
        if !self.quiet {
            self.say("note", text.as_ref());
        }
    }

    /// What nobody may miss: said with --quiet, too.
    pub fn warn(&self, text: impl AsRef<str>) {
        self.say("warning", text.as_ref());
    }

    /// A sentence for people who asked for more.
    pub fn detail(&self, text: impl AsRef<str>) {
        if self.verbose {
            self.say("detail", text.as_ref());
        }
    }

    /// How the command failed.
    pub fn fail(&self, text: &str) {
        self.say("error", text);
    }

    /// With `--progress json` an object with the one field `kind`.
    fn say(&self, kind: &str, text: &str) {
        let said = match self.json {
            true => serde_json::json!({ kind: text }).to_string(),
            false => text.to_owned(),
        };
        self.with_stage(|stage| match stage {
            Some(stage) => stage.bar.suspend(|| eprintln!("{said}")),
            None => eprintln!("{said}"),
        });
    }

    /// Begins a stage of `total` steps, if their number is known.
    pub fn begin(&self, name: &str, total: Option<u64>) {
        self.close();
        if self.quiet {
            return;
        }
        let bar = if self.terminal {
            let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr());
            // Wide parts take what the terminal leaves, and are cut where that is too little.
            let template = match total {
                Some(_) => "{wide_msg} {percent:>3}% {bar:8} {rate:>8} {eta:>4}",
                None => "{spinner} {wide_msg} {human_pos} {elapsed}",
            };
            if let Ok(style) = ProgressStyle::with_template(template) {
                let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                    // A line cannot fail to be written.
                    let _ = out.write_str(&words::rate(state.per_sec()));
                };
                bar.set_style(style.with_key("rate", rate));
            }
            bar.set_message(name.to_owned());
            bar.enable_steady_tick(Duration::from_millis(120));
            bar
        } else {
            if !self.json {
                eprintln!("{name} ...");
            }
            ProgressBar::hidden()
        };
        let now = Instant::now();
        let begun = Stage {
            name: name.to_owned(),
            total,
            bar,
            start: now,
            said: now,
        };
        if self.json {
            eprintln!("{}", json_line(&begun, 0));
        }
        self.with_stage(|stage| *stage = Some(begun));
    }

    /// So many steps of the stage are done.
    pub fn advance_to(&self, done: u64) {
        self.with_stage(|stage| {
            let Some(stage) = stage else { return };
            // Workers report out of order.
            if done > stage.bar.position() {
                stage.bar.set_position(done);
            }
            let every = if self.json { JSON_EVERY } else { LINE_EVERY };
            if !self.terminal && stage.said.elapsed() >= every {
                stage.said = Instant::now();
                let line = if self.json { json_line } else { plain_line };
                eprintln!("{}", line(stage, done));
            }
        });
    }

    /// The stage turns out to have about so many steps.
    pub fn expect(&self, total: u64) {
        self.with_stage(|stage| {
            if let Some(stage) = stage {
                stage.total = Some(total);
                stage.bar.set_length(total);
            }
        });
    }

    /// Ends the stage and takes its bar away.
    pub fn close(&self) {
        self.with_stage(|stage| {
            if let Some(stage) = stage.take() {
                stage.bar.finish_and_clear();
            }
        });
    }

    fn with_stage<T>(&self, act: impl FnOnce(&mut Option<Stage>) -> T) -> T {
        // A worker that panicked while it held the lock leaves a bar, no more.
        act(&mut self
            .stage
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner))
    }
}

/// Whether the terminal can't move its cursor.
fn is_dumb() -> bool {
    std::env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb")
}

/// A line of `--progress json`.
#[derive(Serialize)]
struct ProgressLine<'a> {
    done: u64,
    seconds: f64,
    seconds_left: Option<f64>,
    stage: &'a str,
    total: Option<u64>,
}

fn json_line(stage: &Stage, done: u64) -> String {
    let seconds = stage.start.elapsed().as_secs_f64();
    let left = (stage.total.filter(|_| done > 0))
        .map(|total| total.saturating_sub(done) as f64 * seconds / done as f64);
    let line = ProgressLine {
        done,
        seconds,
        seconds_left: left,
        stage: &stage.name,
        total: stage.total,
    };
    // Of such a struct nothing can fail to be written.
    serde_json::to_string(&line).unwrap_or_default()
}

fn plain_line(stage: &Stage, done: u64) -> String {
    let seconds = stage.start.elapsed().as_secs_f64();
    let rate = done as f64 / seconds.max(1e-9);
    match stage.total {
        Some(total) if total > 0 => format!(
            "{}: {:.0} % ({} of {}, {}), {:.0} s left",
            stage.name,
            100.0 * done as f64 / total as f64,
            words::count(done),
            words::count(total),
            words::rate(rate),
            total.saturating_sub(done) as f64 / rate.max(1e-9)
        ),
        _ => format!("{}: {} after {seconds:.0} s", stage.name, words::count(done)),
    }
}

/// The console as the bake sees it.
pub struct BakeProgress<'a> {
    console: &'a Console,
    /// Where the asset will be, if it will.
    target: Option<&'a Path>,
    /// Whether it is only said that its disk is too full.
    force: bool,
    /// When the bake is to be over.
    until: Until,
    /// Why the bake is not to go on.
    refused: OnceLock<String>,
    done: AtomicU64,
    start: Instant,
    /// Milliseconds since `start` when the console was told last.
    told: AtomicU64,
}

/// Milliseconds between two looks at the console: it has a lock, and workers report every receiver.
const TOLD_EVERY: u64 = 50;

impl<'a> BakeProgress<'a> {
    /// Reports to `console`.
    pub fn new(console: &'a Console) -> BakeProgress<'a> {
        BakeProgress {
            console,
            target: None,
            force: false,
            until: Until(None),
            refused: OnceLock::new(),
            done: AtomicU64::new(0),
            start: Instant::now(),
            told: AtomicU64::new(0),
        }
    }
}

impl<'a> BakeProgress<'a> {
    /// As it is, for a bake of which an asset, or a folder of units, comes to lie there: ends it before any point is spread where the
    /// disk is too full, unless `force`, which only says so.
    pub fn towards(self, target: &'a Path, force: bool) -> BakeProgress<'a> {
        BakeProgress {
            target: Some(target),
            force,
            ..self
        }
    }

    /// As it is, for a bake that is stopped at a moment.
    pub fn until(self, until: Option<Instant>) -> BakeProgress<'a> {
        BakeProgress {
            until: Until(until),
            ..self
        }
    }

    /// A bake's failure as the command's.
    pub fn failure(&self, error: BakeError) -> Failure {
        match (error, self.refused.get()) {
            (BakeError::Stopped, Some(why)) => {
                anyhow::anyhow!("{why}, or --force to bake all the same").into()
            }
            (BakeError::Stopped, None) => signals::failure(),
            (other, _) => other.into(),
        }
    }
}

impl relight_bake::Progress for BakeProgress<'_> {
    fn expects_points(&self, points: f64) {
        let Some(target) = self.target else { return };
        match disk::lacks_for(target, points) {
            Some(text) if self.force => self.console.warn(format!("warning: {text}")),
            Some(text) => {
                // Told once a bake.
                let _ = self.refused.set(text);
            }
            None => {}
        }
    }

    fn stage(&self, name: &'static str, total: Option<u64>) {
        let words = match name {
            "load" => "Preparing the scene",
            "reach" => "Looking around",
            "points" => "Spreading points",
            "share" => "Finding what senders see",
            "refine" => "Linking points",
            "solve" => "Solving bounces",
            "light_tree" => "Sorting lights",
            "cuts" => "Cutting visibility",
            "prune" => "Leaving out what is not needed",
            other => other,
        };
        self.done.store(0, Ordering::Relaxed);
        self.console.begin(words, total);
    }
    fn advance(&self, more: u64) {
        let done = self.done.fetch_add(more, Ordering::Relaxed) + more;
        let now = self.start.elapsed().as_millis() as u64;
        let told = self.told.load(Ordering::Relaxed);
        let due = now >= told + TOLD_EVERY;
        if due
            && self
                .told
                .compare_exchange(told, now, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok()
        {
            self.console.advance_to(done);
        }
    }
    fn expect(&self, total: u64) {
        self.console.expect(total);
    }
    fn stopped(&self) -> bool {
        self.until.stopped() || self.refused.get().is_some()
    }
}
