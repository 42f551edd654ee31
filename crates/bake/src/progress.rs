//! Who watches a bake, and may stop it.

use crate::error::BakeError;
use crate::links::refinement::RowWatch;

/// Who watches a bake: told what is being done, and asked whether to go on. Called from many threads.
pub trait Progress: Sync {
    /// A stage begins; `total` is the number of its steps, where it is known.
    fn stage(&self, name: &'static str, total: Option<u64>);
    /// So many more steps of the stage are done.
    fn advance(&self, done: u64);
    /// The stage turns out to have about so many steps.
    fn expect(&self, _total: u64) {}
    /// So many points there will be at most, about; told before there are any.
    fn expects_points(&self, _points: f64) {}
    /// Whether the bake shall stop.
    fn stopped(&self) -> bool;
}

/// Nobody watches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Progress for Unwatched {
    fn stage(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, _: u64) {}
    fn stopped(&self) -> bool {
        false
    }
}

/// A watcher as stages see it.
pub(crate) struct Watch<'a>(pub &'a dyn Progress);

impl Watch<'_> {
    pub fn step(&self, done: u64) -> Result<(), BakeError> {
        self.0.advance(done);
        self.go_on()
    }

    pub fn go_on(&self) -> Result<(), BakeError> {
        if self.0.stopped() {
            Err(BakeError::Stopped)
        } else {
            Ok(())
        }
    }
}

impl RowWatch for Watch<'_> {
    fn begin(&self, most_rays: u64) {
        self.0.stage("refine", Some(most_rays));
    }
    fn cast(&self, rays: usize) -> Result<(), BakeError> {
        self.step(rays as u64)
    }
    fn expect(&self, rays: u64) {
        self.0.expect(rays);
    }
}
