//! A case of the stability suite, and what it measures.

use serde::Serialize;

/// One number that must not exceed its bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// What is measured; part of the case's name in tables and JSON.
    pub what: String,
    /// The number; not finite counts as above every bound.
    pub value: f64,
    /// What it may be at most.
    pub bound: f64,
    /// Where the bound comes from.
    pub why: &'static str,
}

impl Measure {
    /// A number under a bound.
    pub fn new(what: impl Into<String>, value: f64, bound: f64, why: &'static str) -> Measure {
        Measure {
            what: what.into(),
            value,
            bound,
            why,
        }
    }

    /// A count of what must not occur.
    pub fn none(what: impl Into<String>, count: usize, why: &'static str) -> Measure {
        Measure::new(what, count as f64, 0.0, why)
    }

    /// Whether the bound holds.
    pub fn ok(&self) -> bool {
        self.value.is_finite() && self.value <= self.bound
    }

    /// Share of the bound that is left; 1 where nothing of it was used, below 0 where it does not hold.
    pub fn margin(&self) -> f64 {
        match () {
            () if !self.value.is_finite() => f64::NEG_INFINITY,
            () if self.bound > 0.0 => 1.0 - self.value / self.bound,
            () if self.value <= self.bound => 1.0,
            () => f64::NEG_INFINITY,
        }
    }
}

/// What running a case gives; an error says what failed outright.
pub type Measured = Result<Vec<Measure>, String>;

/// A case: it makes a scene, bakes and plays it, and measures.
#[derive(Serialize)]
pub struct Case {
    /// Unique; words from coarse to fine with slashes between them.
    pub name: String,
    /// What must hold, in a sentence.
    pub says: &'static str,
    /// Belongs to the subset that takes under a minute.
    pub fast: bool,
    /// Runs it.
    #[serde(skip)]
    pub run: Box<dyn Fn(&super::stage::Stage) -> Measured>,
}

impl Case {
    /// A case.
    pub fn new(
        name: impl Into<String>,
        fast: bool,
        says: &'static str,
        run: impl Fn(&super::stage::Stage) -> Measured + 'static,
    ) -> Case {
        Case {
            name: name.into(),
            says,
            fast,
            run: Box::new(run),
        }
    }
}
