//! `--memory-limit`: what memory a bake will take, and in how many batches it keeps within a limit.

use crate::console::Console;
use crate::failure::Failure;
use crate::signals;
use crate::words;
use anyhow::{Context, anyhow};
use serde_json::Value;
use std::ffi::OsString;
use std::io::Read;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::ScopedJoinHandle;
use std::time::Duration;

/// What memory a bake will take, bytes.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// Most in one go.
    pub most: u64,
    /// Of that what reconstructed rows take, which batches divide.
    pub rows: u64,
}

/// Most batches: each makes anew the coarse rows that it shares with its neighbours, and rows of the coarsest levels are
/// needed by all.
const MOST_BATCHES: usize = 16;
/// Share of the rows that a batch of n needs, beyond an n-th: those along its border, and the coarsest.
const SHARED_ROWS: f64 = 0.2;

/// Predictions of memory were up to a tenth below what bakes took under a limit (docs/notebook/reliability.md), and these vary by
/// some hundredths as threads come to allocate; a limit must hold all the same.
const MARGIN: f64 = 1.15;
/// What stacks, compression and the allocator may take besides, whatever the scene: a bake of 31 MB was predicted to take
/// 22.
const SLACK: u64 = 16 << 20;

/// The memory of the scene, which is measured, comes out some tenths of a percent higher or lower from run to run: a limit that
/// one run names has to do in the next.
const BREATH: f64 = 0.01;

impl Memory {
    /// Limit under which so many batches fit.
    fn limit_of(self, batches: usize) -> u64 {
        (self.in_batches(batches) as f64 * MARGIN) as u64 + SLACK
    }

    /// Smallest limit that is surely not refused, bytes: whole MiB.
    pub fn smallest_limit(self) -> u64 {
        self.limit_of(MOST_BATCHES).next_multiple_of(1 << 20)
    }

    fn in_batches(self, batches: usize) -> u64 {
        let share = if batches > 1 {
            (1.0 / batches as f64 + SHARED_ROWS).min(1.0)
        } else {
            1.0
        };
        self.most - self.rows + (self.rows as f64 * share) as u64
    }

    /// The fewest batches that keep within a limit.
    ///
    /// # Errors
    /// None does; the message says what limit would.
    pub fn batches(self, limit: u64) -> Result<usize, Failure> {
        let enough = (limit as f64 * (1.0 + BREATH)) as u64;
        let fits = (1..=MOST_BATCHES).find(|&n| self.limit_of(n) <= enough);
        fits.ok_or_else(|| {
            anyhow!(
                "--memory-limit {limit}: the bake needs about {}; the smallest limit that would do is {}. A larger \
                 --coarse-radius or fewer --levels take less",
                words::bytes(self.most),
                self.smallest_limit()
            )
            .into()
        })
    }
}

/// What glibc calls the size from which allocations are mappings of their own, which go back when freed, and the free space
/// at the heap's end from which that goes back.
const GIVES_BACK: [&str; 2] = ["MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"];
/// The value with which glibc starts, bytes. If nobody sets it, it grows with what is freed, up to 32 MiB: peaks are an eighth
/// higher then and vary by a tenth from run to run, in the same time (docs/notebook/reliability.md).
const GIVES_BACK_FROM: &str = "131072";

/// Starts the program once more in its own place, with an allocator that gives back what is freed: it can be told so by its
/// environment alone. Comes back if it has been told, or cannot be.
pub fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if GIVES_BACK.iter().all(|name| std::env::var_os(name).is_none())
        && let Ok(program) = std::env::current_exe()
    {
        use std::os::unix::process::CommandExt;
        // Returns only if it fails; then more memory is taken, and the margin is what is left.
        let _ = Command::new(program)
            .args(std::env::args_os().skip(1))
            .envs(GIVES_BACK.map(|name| (name, GIVES_BACK_FROM)))
            .exec();
    }
}

/// Foretells the memory of this very command's bake in a process of its own (`--dry-run`): what a small bake frees stays with its
/// process, and would count against the limit.
///
/// # Errors
/// As the bake itself.
pub fn foretold(console: &Console, json: bool) -> Result<Memory, Failure> {
    console.begin("Baking small, to see what it takes", None);
    let program = std::env::current_exe().context("cannot find the program itself")?;
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    // Behind "--" nothing is an option.
    let end_of_options = arguments.iter().position(|argument| argument == "--");
    let (options, others) = arguments.split_at(end_of_options.unwrap_or(arguments.len()));
    let child = Command::new(program)
        .args(options)
        .arg("--dry-run")
        .args((!json).then_some("--json"))
        .args(others)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .context("cannot start the program once more")?;
    let (status, said, complaint) = waited_for(child)?;
    console.close();
    if !status.success() {
        let text = complaint.split("relight: error: ").nth(1).unwrap_or(&complaint);
        return Err(anyhow!("{}", text.trim_end()).into());
    }
    let said: Value = serde_json::from_str(&said).context("what the bake will take")?;
    let bytes = |key: &str| {
        said[key]
            .as_u64()
            .with_context(|| format!("what the bake will take: no {key}"))
    };
    Ok(Memory {
        most: bytes("memory_bytes")?,
        rows: bytes("row_bytes")?,
    })
}

/// How a process ended and what it said on stdout and stderr. A signal to stop ends it, too.
fn waited_for(mut child: Child) -> Result<(ExitStatus, String, String), Failure> {
    let (out, err) = (child.stdout.take(), child.stderr.take());
    std::thread::scope(|scope| {
        let (out, err) = (scope.spawn(|| all_of(out)), scope.spawn(|| all_of(err)));
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            if signals::stopped() {
                child.kill()?;
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        signals::go_on()?;
        let text = |thread: ScopedJoinHandle<String>| thread.join().unwrap_or_default();
        Ok((status, text(out), text(err)))
    })
}

fn all_of(pipe: Option<impl Read>) -> String {
    let mut text = String::new();
    // What was said before reading failed is all there is to show.
    let _ = pipe.map(|mut pipe| pipe.read_to_string(&mut text));
    text
}
