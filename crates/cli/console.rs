//! What people see while a command runs: bars with rate and time left on a terminal, plain lines elsewhere,
//! nothing with --quiet.

use crate::signals;
use crate::words;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Seconds between two plain progress lines of one stage.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Where notes and progress go.
pub struct Console {
    quiet: bool,
    verbose: bool,
    terminal: bool,
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
    pub fn new(quiet: bool, verbose: bool) -> Console {
        Console {
            quiet,
            verbose,
            terminal: std::io::stderr().is_terminal(),
            stage: Mutex::new(None),
        }
    }

    /// One that says nothing, for commands that another command runs.
    pub fn silent(&self) -> Console {
        Console::new(true, false)
    }

    /// Whether people asked for more.
    pub fn is_verbose(&self) -> bool {
        self.verbose
    }

    /// A sentence for people.
    pub fn note(&self, text: impl AsRef<str>) {
        if !self.quiet {
            self.say(text.as_ref());
        }
    }

    /// A sentence for people who asked for more.
    pub fn detail(&self, text: impl AsRef<str>) {
        if self.verbose {
            self.say(text.as_ref());
        }
    }

    fn say(&self, text: &str) {
        self.with_stage(|stage| match stage {
            Some(stage) => stage.bar.suspend(|| eprintln!("{text}")),
            None => eprintln!("{text}"),
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
            let template = match total {
                Some(_) => "{msg} [{bar:32}] {percent:>3} %  {per_sec}  {eta} left",
                None => "{spinner} {msg} {elapsed}  {human_pos}",
            };
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style);
            }
            bar.set_message(name.to_owned());
            bar.enable_steady_tick(Duration::from_millis(120));
            bar
        } else {
            eprintln!("{name} ...");
            ProgressBar::hidden()
        };
        let now = Instant::now();
        self.with_stage(|stage| {
            *stage = Some(Stage {
                name: name.to_owned(),
                total,
                bar,
                start: now,
                said: now,
            });
        });
    }

    /// So many steps of the stage are done.
    pub fn advance_to(&self, done: u64) {
        self.with_stage(|stage| {
            let Some(stage) = stage else { return };
            // Workers report out of order.
            if done > stage.bar.position() {
                stage.bar.set_position(done);
            }
            if !self.terminal && stage.said.elapsed() >= LINE_EVERY {
                stage.said = Instant::now();
                eprintln!("{}", plain_line(stage, done));
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

fn plain_line(stage: &Stage, done: u64) -> String {
    let seconds = stage.start.elapsed().as_secs_f64();
    let rate = done as f64 / seconds.max(1e-9);
    match stage.total {
        Some(total) if total > 0 => format!(
            "{}: {:.0} % ({} of {}, {:.0} a second), {:.0} s left",
            stage.name,
            100.0 * done as f64 / total as f64,
            words::count(done),
            words::count(total),
            rate,
            total.saturating_sub(done) as f64 / rate.max(1e-9)
        ),
        _ => format!("{}: {} after {seconds:.0} s", stage.name, words::count(done)),
    }
}

/// The console as the bake sees it.
pub struct BakeProgress<'a>(pub &'a Console);

impl relight_bake::Progress for BakeProgress<'_> {
    fn stage(&self, name: &'static str, total: Option<u64>) {
        let words = match name {
            "load" => "Preparing the scene",
            "points" => "Spreading points",
            "refine" => "Linking points",
            "prune" => "Leaving out what is not needed",
            other => other,
        };
        self.0.begin(words, total);
    }
    fn advance(&self, done: u64) {
        self.0.advance_to(done);
    }
    fn stopped(&self) -> bool {
        signals::stopped()
    }
}
