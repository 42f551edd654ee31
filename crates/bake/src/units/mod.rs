//! Units of work: ranges of a stage's items whose results are kept, so that a bake can go on after a stop, take over
//! what an edit of the scene does not reach, and be shared among machines.
//!
//! A unit's name says its stage, a hash of everything its numbers depend on but what rays meet, and its range ([`key`]);
//! over the same surfaces two units of one name are the same, whoever made them and when. Stages are functions of ranges
//! that know nothing of this; where they are driven, [`Units::taken_or_made`] stands between them and the work. Without a
//! ledger that is the work itself, in one range.
//!
//! What a hash holds is what the stage is given (points, senders, viewpoints), its settings and the seed; never a light, nor
//! what a surface reflects. What rays meet is not in it: a unit keeps where they went, and holds as long as the objects there
//! are the same ([`reach`]).
//!
//! Limit: an object that rays meet makes all units anew that cast rays. What they hold does change: a coarsest row casts
//! thousands of rays, some of which meet the object or the points around it, and finer rows are differences to coarser ones
//! (docs/notebook/reliability.md has figures).

mod columns;
pub mod folder;
pub mod key;
pub mod reach;

use crate::error::BakeError;
use key::Key;
use reach::Reach;
use relight_format::unit::{Column, UnitName};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Where units are kept.
pub trait UnitStore: Sync {
    /// A unit, if it is there and whole.
    fn load(&self, name: &UnitName) -> Option<Vec<Column>>;
    /// Keeps a unit, whole or not at all.
    ///
    /// # Errors
    /// [`BakeError::Unit`]: it cannot be kept.
    fn save(&self, name: &UnitName, columns: &[Column]) -> Result<(), BakeError>;
}

/// A result that can be kept.
pub trait Unit: Sized {
    /// As numbers.
    fn columns(&self) -> Vec<Column>;
    /// From the numbers of `count` items; `None` if they cannot be such a result.
    fn from_columns(columns: Vec<Column>, count: usize) -> Option<Self>;
}

/// A store, and what was done with it.
pub struct Ledger<'a> {
    store: &'a dyn UnitStore,
    tool: u128,
    taken: AtomicU64,
    made: AtomicU64,
    used: Mutex<BTreeSet<String>>,
}

impl<'a> Ledger<'a> {
    /// `tool`: identifies the program, since another one may compute other numbers.
    pub fn new(store: &'a dyn UnitStore, tool: u128) -> Ledger<'a> {
        Ledger {
            store,
            tool,
            taken: AtomicU64::new(0),
            made: AtomicU64::new(0),
            used: Mutex::default(),
        }
    }

    /// Units that were there, and units that had to be made.
    pub fn counts(&self) -> (u64, u64) {
        (
            self.taken.load(Ordering::Relaxed),
            self.made.load(Ordering::Relaxed),
        )
    }

    /// File names of all units that were taken or made.
    pub fn used(&self) -> BTreeSet<String> {
        self.used
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .clone()
    }

    fn note(&self, name: &UnitName, counter: &AtomicU64) {
        let mut used = self
            .used
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        // What one batch made others take: that is no reuse.
        if used.insert(name.file_name()) {
            counter.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// How a stage deals with units: not at all, or by a ledger.
#[derive(Clone, Copy, Default)]
pub struct Units<'a>(Option<(&'a Ledger<'a>, &'a Reach)>);

impl<'a> Units<'a> {
    /// Every stage in one piece, nothing kept.
    pub fn none() -> Units<'static> {
        Units::default()
    }

    /// Units of a bake whose rays are followed into `reach`.
    pub fn new(ledger: &'a Ledger<'a>, reach: &'a Reach) -> Units<'a> {
        Units(Some((ledger, reach)))
    }

    /// From now on units depend on all that can be met, wherever it is.
    pub fn see_everything(&self) {
        if let Some((_, reach)) = self.0 {
            reach.pass_everywhere();
        }
    }

    /// Whether results are kept.
    pub fn are_kept(&self) -> bool {
        self.0.is_some()
    }

    /// The inputs that all stages share: the program and the scene's bounds. `more` adds a stage's own; it is not called
    /// where nothing is kept.
    pub fn inputs(&self, more: impl FnOnce(&mut Key)) -> u128 {
        let Some((ledger, reach)) = self.0 else { return 0 };
        let mut key = Key::default();
        key.u128s(&[ledger.tool]);
        reach.inputs(&mut key);
        more(&mut key);
        key.hash()
    }

    /// `all` in ranges of `per_unit`; in one where nothing is kept.
    pub fn ranges(&self, all: Range<usize>, per_unit: usize) -> impl Iterator<Item = Range<usize>> + use<> {
        let step = if self.are_kept() {
            per_unit.max(1)
        } else {
            all.len().max(1)
        };
        all.clone()
            .step_by(step)
            .map(move |start| start..(start + step).min(all.end))
    }

    /// A unit that is there, if its rays would still go as they went.
    pub fn taken<T: Unit>(&self, stage: &str, inputs: u128, range: &Range<usize>) -> Option<T> {
        let (ledger, reach) = self.0?;
        let name = name(stage, inputs, range);
        let mut columns = ledger.store.load(&name)?;
        let passed = columns.pop()?;
        let unit = T::from_columns(columns, range.len())?;
        if !reach.take_over(passed) {
            return None;
        }
        ledger.note(&name, &ledger.taken);
        Some(unit)
    }

    /// Keeps a unit that was made.
    ///
    /// # Errors
    /// It cannot be kept.
    pub fn keep(
        &self,
        stage: &str,
        inputs: u128,
        range: &Range<usize>,
        unit: &impl Unit,
    ) -> Result<(), BakeError> {
        let Some((ledger, reach)) = self.0 else {
            return Ok(());
        };
        let name = name(stage, inputs, range);
        let mut columns = unit.columns();
        columns.push(reach.column());
        ledger.store.save(&name, &columns)?;
        ledger.note(&name, &ledger.made);
        Ok(())
    }

    /// The unit if it is there; else it is made and kept.
    ///
    /// # Errors
    /// Those of `make`, or it cannot be kept.
    pub fn taken_or_made<T: Unit>(
        &self,
        stage: &str,
        inputs: u128,
        range: &Range<usize>,
        make: impl FnOnce() -> Result<T, BakeError>,
    ) -> Result<T, BakeError> {
        if let Some(unit) = self.taken(stage, inputs, range) {
            return Ok(unit);
        }
        let unit = make()?;
        self.keep(stage, inputs, range, &unit)?;
        Ok(unit)
    }
}

fn name(stage: &str, inputs: u128, range: &Range<usize>) -> UnitName {
    UnitName {
        stage: stage.to_owned(),
        inputs,
        start: range.start as u64,
        end: range.end as u64,
    }
}
