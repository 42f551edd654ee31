//! What takes long runs without Python's lock, in a thread of its own: the caller's thread looks for signals and tells how far it is.

use crate::error::failed;
use pyo3::prelude::*;
use relight_bake::{Progress, disk};
use relight_play::render::watch::Watch;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// How often signals are looked for: a hand on Ctrl-C notices no less.
const INTERVAL: Duration = Duration::from_millis(50);

/// How far some work is, and whether it shall stop.
#[derive(Default)]
pub struct Watched {
    stop: AtomicBool,
    stage: Mutex<&'static str>,
    done: AtomicU64,
    /// 0: not known.
    total: AtomicU64,
    /// Where a bake's asset will be.
    target: OnceLock<PathBuf>,
    /// Why its disk won't do.
    refused: OnceLock<String>,
}

/// What is being done, how many of its steps are done, and of how many, where that is known.
type Status = (&'static str, u64, Option<u64>);

impl Watched {
    /// Says where a bake's asset will be: the bake is stopped before any point is spread where the disk is too full.
    pub fn writes(&self, target: &Path) {
        // Said once a bake.
        let _ = self.target.set(target.to_owned());
    }

    /// Why the bake was stopped, if its disk is too full.
    pub fn refused(&self) -> Option<PyErr> {
        self.refused.get().map(failed)
    }

    fn status(&self) -> Status {
        let stage = *self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let total = Some(self.total.load(Ordering::Relaxed)).filter(|total| *total > 0);
        (stage, self.done.load(Ordering::Relaxed), total)
    }
}

impl Watch for Watched {
    fn advance_to(&self, done: usize, of: usize) {
        self.done.store(done as u64, Ordering::Relaxed);
        self.total.store(of as u64, Ordering::Relaxed);
    }
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl Progress for Watched {
    fn expects_points(&self, points: f64) {
        if let Some(text) = self
            .target
            .get()
            .and_then(|target| disk::lacks_for(target, points))
        {
            let _ = self.refused.set(text);
        }
    }
    fn stage(&self, name: &'static str, total: Option<u64>) {
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        *stage = name;
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total.unwrap_or(0), Ordering::Relaxed);
    }
    fn advance(&self, done: u64) {
        self.done.fetch_add(done, Ordering::Relaxed);
    }
    fn expect(&self, total: u64) {
        self.total.store(total, Ordering::Relaxed);
    }
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.refused.get().is_some()
    }
}

/// Does `work`, and calls `progress`, if there is one, with its [`Status`] whenever that has changed.
///
/// # Errors
/// Those of `work`; what a signal's handler raises, such as `KeyboardInterrupt`, or `progress`, once the work has stopped.
pub fn done<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Watched) -> PyResult<T> + Send,
) -> PyResult<T> {
    let watched = Watched::default();
    py.detach(|| {
        std::thread::scope(|scope| {
            let watched = &watched;
            let (sender, receiver) = channel();
            let worker = scope.spawn(move || {
                // Nobody is gone who waits for it below.
                let _ = sender.send(work(watched));
            });
            let mut raised = None;
            let mut last = None;
            loop {
                match receiver.recv_timeout(INTERVAL) {
                    Ok(result) => return raised.map_or(result, Err),
                    // It panicked, and so does this thread.
                    Err(RecvTimeoutError::Disconnected) => match worker.join() {
                        Ok(()) => unreachable!("it sends before it ends"),
                        Err(panic) => std::panic::resume_unwind(panic),
                    },
                    Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
                    Err(RecvTimeoutError::Timeout) => {
                        let heard = Python::attach(|py| look(py, progress, watched.status(), &mut last));
                        if let Err(error) = heard {
                            watched.stop.store(true, Ordering::Relaxed);
                            raised = Some(error);
                        }
                    }
                }
            }
        })
    })
}

/// Looks for signals and tells `progress` what has changed.
fn look(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    now: Status,
    last: &mut Option<Status>,
) -> PyResult<()> {
    py.check_signals()?;
    if let Some(progress) = progress
        && *last != Some(now)
        && !now.0.is_empty()
    {
        progress.call1(py, now)?;
        *last = Some(now);
    }
    Ok(())
}
