//! The lists of the document (accessors, materials, nodes and the others), whose entries refer to each other by index.
//!
//! What is wrong with an entry is held back until somebody uses it: an unused broken part never refuses a scene. An
//! entry that uses a broken one while it is read takes over its faults, so that they reach whoever is shown.

use super::error::Fault;
use super::json::{At, Faults};
use super::notes::Notes;
use serde_json::Value;
use std::cell::Cell;

/// Broken entries of one list whose faults are kept word by word; a file with more has them all for one reason.
const MAX_HELD: usize = 10_000;

/// Unused broken entries of one list that get a note each.
const MAX_NOTED: usize = 5;

/// A list in which indices mean what they mean in the file.
pub(super) struct List<T> {
    entries: Vec<Entry<T>>,
    key: &'static str,
}

struct Entry<T> {
    value: Option<T>,
    broken: bool,
    faults: Vec<Fault>,
    used: Cell<bool>,
}

impl<T> List<T> {
    /// Reads the lights of an extension of the document, entry by entry: none where it is absent.
    pub fn lights_of(root: &At, extension: &str, parse: impl FnMut(&At) -> Option<T>) -> List<T> {
        let empty = Value::Null;
        let none = At::root(&empty, root.faults());
        List::parse(
            root.extension(extension).as_ref().unwrap_or(&none),
            "lights",
            parse,
        )
    }

    /// Reads the member `key` of `parent`, entry by entry.
    pub fn parse(parent: &At, key: &'static str, mut parse: impl FnMut(&At) -> Option<T>) -> List<T> {
        let mut held = 0;
        let items = parent.items(key);
        let entry = |at: &At| {
            let sink = Faults::default();
            let at = at.reporting_to(&sink);
            let value = if at.value.is_object() {
                parse(&at)
            } else {
                at.fault("must be an object");
                None
            };
            let mut faults = sink.take();
            let broken = !faults.is_empty();
            held += usize::from(broken);
            if held > MAX_HELD {
                faults = Vec::new();
            }
            Entry {
                value,
                broken,
                faults,
                used: Cell::new(false),
            }
        };
        List {
            entries: items.iter().map(entry).collect(),
            key,
        }
    }

    /// How many entries there are.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// An entry that is used: what is wrong with it is reported. `None` also for what is left out on purpose.
    pub fn get(&self, index: usize, faults: &Faults) -> Option<&T> {
        let entry = self.entries.get(index)?;
        entry.used.set(true);
        for fault in &entry.faults {
            faults.add(fault.path.clone(), fault.message.clone());
        }
        if entry.broken && entry.faults.is_empty() {
            let message = "is broken, as thousands of others are; export the scene again";
            faults.add(format!("{}[{index}]", self.key), message);
        }
        entry.value.as_ref()
    }

    /// An entry, whether it is used or not.
    pub fn peek(&self, index: usize) -> Option<&T> {
        self.entries.get(index)?.value.as_ref()
    }

    /// Notes what is wrong with entries that nobody used.
    pub fn note_unused(&self, notes: &mut Notes) {
        let unused = |entry: &&Entry<T>| entry.broken && !entry.used.get();
        for fault in (self.entries.iter().filter(unused).take(MAX_NOTED)).filter_map(|e| e.faults.first()) {
            notes.say(format!("nothing that is shown uses what is wrong here: {fault}"));
        }
        let more = self
            .entries
            .iter()
            .filter(unused)
            .count()
            .saturating_sub(MAX_NOTED);
        notes.count(
            &format!("other broken {} that nothing shown uses", self.key),
            more as u64,
        );
    }
}
