//! Ctrl-C, SIGTERM and their like: the first asks every stage to stop, the second leaves at once (outputs are written
//! beside their targets and renamed, so nothing is half there in either case). No command waits for a stage that takes long, only
//! for what is written under [`whole`]: [`leave_soon`].

use crate::failure::Failure;
use relight_render::watch::Watch;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Condvar, LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);

/// How many have files half written, and who waits for none.
static HALF_WRITTEN: Mutex<usize> = Mutex::new(0);
static ALL_WHOLE: Condvar = Condvar::new();

/// How often it is looked for a signal, and how long a stage has to stop by itself.
const LOOK_EVERY: Duration = Duration::from_millis(50);
const PATIENCE: Duration = Duration::from_millis(800);

/// Starts to listen.
///
/// # Errors
/// The system refuses to install a handler.
pub fn install() -> std::io::Result<()> {
    for signal in [SIGINT, SIGTERM].into_iter().chain(system::others()) {
        // Handlers run in order: the shutdown sees the flag of an earlier signal only.
        flag::register_conditional_shutdown(signal, 128 + signal, STOP.clone())?;
        flag::register_usize(signal, SIGNAL.clone(), signal as usize)?;
        flag::register(signal, STOP.clone())?;
    }
    system::limits_are_errors()
}

/// While this is kept, files are half written, and [`leave_soon`] waits.
pub struct Whole;

/// Says that files will be half written. May be said by who has said so already.
pub fn whole() -> Whole {
    *HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner) += 1;
    Whole
}

impl Drop for Whole {
    fn drop(&mut self) {
        *HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        ALL_WHOLE.notify_all();
    }
}

/// Ends the process soon after a signal, whatever is being computed, once no file is half written; `last_words` are said before.
/// Returns when the other side of `running` is gone.
pub fn leave_soon(running: &Receiver<()>, last_words: impl FnOnce(&Failure)) {
    let wait = |time| running.recv_timeout(time) == Err(RecvTimeoutError::Timeout);
    while !stopped() {
        if !wait(LOOK_EVERY) {
            return;
        }
    }
    if !wait(PATIENCE) {
        return;
    }
    // Kept to the end: nobody begins another file.
    let half_written = HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
    let _none =
        (ALL_WHOLE.wait_while(half_written, |count| *count > 0)).unwrap_or_else(PoisonError::into_inner);
    let failure = failure();
    last_words(&failure);
    std::process::exit(128 + SIGNAL.load(Ordering::Relaxed) as i32);
}

#[cfg(unix)]
mod system {
    use signal_hook::consts::{SIGHUP, SIGXCPU, SIGXFSZ};
    use signal_hook::flag;
    use std::sync::Arc;

    /// Further signals that stop a command: the terminal is gone, or the time that it may take is over. One that whoever started the
    /// program lets it ignore, as nohup does, stays ignored.
    pub fn others() -> impl Iterator<Item = i32> {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let ignored = ignored.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok());
        // Where nobody says what is ignored, none is touched.
        let ignored = ignored.unwrap_or(u64::MAX);
        [SIGHUP, SIGXCPU]
            .into_iter()
            .filter(move |signal| ignored >> (signal - 1) & 1 == 0)
    }

    /// A file that grows beyond what the process may write is an error of that write, like a full disk.
    pub fn limits_are_errors() -> std::io::Result<()> {
        flag::register(SIGXFSZ, Arc::default()).map(drop)
    }
}

#[cfg(not(unix))]
mod system {
    pub fn others() -> impl Iterator<Item = i32> {
        std::iter::empty()
    }

    pub fn limits_are_errors() -> std::io::Result<()> {
        Ok(())
    }
}

/// Watches renderings: a signal stops them.
pub struct Signals;

impl Watch for Signals {
    fn stopped(&self) -> bool {
        stopped()
    }
}

/// As [`Signals`], and a moment stops them, too.
pub struct Until(pub Option<Instant>);

impl Watch for Until {
    fn stopped(&self) -> bool {
        stopped() || self.0.is_some_and(|until| Instant::now() >= until)
    }
}

/// Whether a signal has come.
pub fn stopped() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// Leaves the command if a signal has come.
///
/// # Errors
/// [`Failure::Stopped`].
pub fn go_on() -> Result<(), Failure> {
    if stopped() { Err(failure()) } else { Ok(()) }
}

/// The failure that a signal makes of a command.
pub fn failure() -> Failure {
    Failure::Stopped(SIGNAL.load(Ordering::Relaxed) as i32)
}
