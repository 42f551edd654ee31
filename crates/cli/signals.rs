//! Ctrl-C and SIGTERM: the first asks every stage to stop, the second leaves at once (outputs are written
//! beside their targets and renamed, so nothing is half there in either case).

use crate::failure::Failure;
use relight_render::watch::Watch;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);

/// Starts to listen.
///
/// # Errors
/// The system refuses to install a handler.
pub fn install() -> std::io::Result<()> {
    for signal in [SIGINT, SIGTERM] {
        // Handlers run in order: the shutdown sees the flag of an earlier signal only.
        flag::register_conditional_shutdown(signal, 128 + signal, STOP.clone())?;
        flag::register_usize(signal, SIGNAL.clone(), signal as usize)?;
        flag::register(signal, STOP.clone())?;
    }
    Ok(())
}

/// Watches renderings: a signal stops them.
pub struct Signals;

impl Watch for Signals {
    fn stopped(&self) -> bool {
        stopped()
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
