//! Reading values out of JSON with the path of every fault, and collecting faults so that one pass reports
//! them all.

use super::error::{Fault, ImportError, MAX_FAULTS};
use serde_json::Value;
use std::cell::{Cell, RefCell};
use std::path::Path;

/// Collects what is wrong with a file.
#[derive(Default)]
pub(super) struct Faults {
    list: RefCell<Vec<Fault>>,
    more: Cell<usize>,
}

impl Faults {
    /// Adds a fault that is not there yet, or only counts it when the list is long enough.
    pub fn add(&self, path: impl Into<String>, message: impl Into<String>) {
        let mut list = self.list.borrow_mut();
        let fault = Fault {
            path: path.into(),
            message: message.into(),
        };
        if list.contains(&fault) {
            return;
        }
        if list.len() < MAX_FAULTS {
            list.push(fault);
        } else {
            self.more.set(self.more.get() + 1);
        }
    }

    /// The faults listed so far, which are forgotten.
    pub fn take(&self) -> Vec<Fault> {
        self.list.take()
    }

    /// An error if there were any faults so far.
    pub fn finish(&self, file: &Path) -> Result<(), ImportError> {
        let faults = self.list.take();
        if faults.is_empty() {
            return Ok(());
        }
        Err(ImportError::Invalid {
            file: file.into(),
            faults,
            more: self.more.get(),
        })
    }
}

/// A JSON value and its place. The getters return `None` for what is absent (no fault) or wrong (a fault).
#[derive(Clone)]
pub(super) struct At<'a> {
    /// The value.
    pub value: &'a Value,
    /// Its place, empty for the root.
    pub path: String,
    faults: &'a Faults,
}

impl<'a> At<'a> {
    /// The whole document.
    pub fn root(value: &'a Value, faults: &'a Faults) -> Self {
        At {
            value,
            path: String::new(),
            faults,
        }
    }

    /// The same place, with faults going elsewhere.
    pub fn reporting_to<'b>(&self, faults: &'b Faults) -> At<'b>
    where
        'a: 'b,
    {
        At {
            value: self.value,
            path: self.path.clone(),
            faults,
        }
    }

    /// Where faults go.
    pub fn faults(&self) -> &'a Faults {
        self.faults
    }

    /// Reports a fault here.
    pub fn fault(&self, message: impl Into<String>) {
        self.faults.add(self.path.clone(), message);
    }

    /// Reports a fault at a member, present or not.
    pub fn fault_at(&self, key: &str, message: impl Into<String>) {
        self.faults.add(self.path_of(key), message);
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    /// A member, if there is one.
    pub fn get(&self, key: &str) -> Option<At<'a>> {
        Some(At {
            value: self.value.get(key)?,
            path: self.path_of(key),
            faults: self.faults,
        })
    }

    /// A member that must be an object where it is present.
    pub fn object(&self, key: &str) -> Option<At<'a>> {
        let member = self.get(key)?;
        if !member.value.is_object() {
            member.fault("must be an object");
            return None;
        }
        Some(member)
    }

    /// An extension of this object.
    pub fn extension(&self, name: &str) -> Option<At<'a>> {
        self.object("extensions")?.object(name)
    }

    /// The elements of an array; empty where it is absent.
    pub fn items(&self, key: &str) -> Vec<At<'a>> {
        self.get(key).map_or_else(Vec::new, |member| member.elements())
    }

    /// The elements of this array.
    pub fn elements(&self) -> Vec<At<'a>> {
        let Some(array) = self.value.as_array() else {
            self.fault("must be an array");
            return Vec::new();
        };
        let element = |(i, value)| At {
            value,
            path: format!("{}[{i}]", self.path),
            faults: self.faults,
        };
        array.iter().enumerate().map(element).collect()
    }

    /// The elements of an array of objects; anything else in it is a fault (and stays in the list, so that
    /// indices keep their meaning).
    pub fn objects(&self, key: &str) -> Vec<At<'a>> {
        let items = self.items(key);
        for item in &items {
            if !item.value.is_object() {
                item.fault("must be an object");
            }
        }
        items
    }

    /// This value as a non-negative integer, which may be written with a fraction of zero or an exponent.
    pub fn as_uint(&self) -> Option<u64> {
        // Up to 2⁵³ every integer is a number of JSON.
        let whole = |x: &f64| (0.0..=9_007_199_254_740_992.0).contains(x) && x.fract() == 0.0;
        let float = || self.value.as_f64().filter(whole).map(|x| x as u64);
        let value = self.value.as_u64().or_else(float);
        if value.is_none() {
            self.fault(format!(
                "must be a non-negative integer, found {}",
                brief(self.value)
            ));
        }
        value
    }

    /// This value as an index into a list of `len` elements called `what`.
    pub fn as_index(&self, len: usize, what: &str) -> Option<usize> {
        let index = self.as_uint()?;
        if index >= len as u64 {
            self.fault(format!("is {index}, but there are only {len} {what}"));
            return None;
        }
        Some(index as usize)
    }

    /// A non-negative integer.
    pub fn uint(&self, key: &str) -> Option<u64> {
        self.get(key)?.as_uint()
    }

    /// A non-negative integer that must be there.
    pub fn required_uint(&self, key: &str) -> Option<u64> {
        if self.get(key).is_none() {
            self.fault_at(key, "is missing");
        }
        self.uint(key)
    }

    /// An index into a list of `len` elements called `what`.
    pub fn index(&self, key: &str, len: usize, what: &str) -> Option<usize> {
        self.get(key)?.as_index(len, what)
    }

    /// An index that must be there.
    pub fn required_index(&self, key: &str, len: usize, what: &str) -> Option<usize> {
        if self.get(key).is_none() {
            self.fault_at(key, "is missing");
        }
        self.index(key, len, what)
    }

    /// A number that is finite as f32.
    pub fn float(&self, key: &str) -> Option<f32> {
        let member = self.get(key)?;
        let value = member.value.as_f64().map(|x| x as f32).filter(|x| x.is_finite());
        if value.is_none() {
            member.fault(format!("must be a finite number, found {}", brief(member.value)));
        }
        value
    }

    /// An array of exactly `N` numbers that are finite as f32.
    pub fn floats<const N: usize>(&self, key: &str) -> Option<[f32; N]> {
        self.numbers(key, |x| (x as f32).is_finite())
            .map(|numbers: [f64; N]| numbers.map(|x| x as f32))
    }

    /// An array of exactly `N` finite numbers.
    pub fn doubles<const N: usize>(&self, key: &str) -> Option<[f64; N]> {
        self.numbers(key, f64::is_finite)
    }

    fn numbers<const N: usize>(&self, key: &str, fits: impl Fn(f64) -> bool) -> Option<[f64; N]> {
        let member = self.get(key)?;
        let Some(array) = member.value.as_array().filter(|array| array.len() == N) else {
            member.fault(format!(
                "must be an array of {N} finite numbers, found {}",
                match member.value {
                    Value::Array(array) => format!("one of {} values", array.len()),
                    other => brief(other),
                }
            ));
            return None;
        };
        let mut values = [0.0; N];
        for (i, entry) in array.iter().enumerate() {
            match entry.as_f64().filter(|&x| fits(x)) {
                Some(x) => values[i] = x,
                None => {
                    let nan = if entry.is_null() {
                        " (which is how some write NaN)"
                    } else {
                        ""
                    };
                    member.fault(format!(
                        "must be an array of {N} finite numbers, found {}{nan} at [{i}]; mend it where the scene was \
                         made and export it again",
                        brief(entry)
                    ));
                    return None;
                }
            }
        }
        Some(values)
    }

    /// An array of numbers that are finite as f32, as their bits, so that equal ones can be found.
    pub fn weights(&self, key: &str) -> Vec<u32> {
        let number = |item: At| {
            let value = item.value.as_f64().map(|x| x as f32).filter(|x| x.is_finite());
            if value.is_none() {
                item.fault(format!("must be a finite number, found {}", brief(item.value)));
            }
            value.map_or(0, f32::to_bits)
        };
        self.items(key).into_iter().map(number).collect()
    }

    /// What the file calls it; nothing where that is empty.
    pub fn name(&self) -> Option<String> {
        self.text("name")
            .filter(|name| !name.is_empty())
            .map(str::to_owned)
    }

    /// A string.
    pub fn text(&self, key: &str) -> Option<&'a str> {
        let member = self.get(key)?;
        let value = member.value.as_str();
        if value.is_none() {
            member.fault(format!("must be a string, found {}", brief(member.value)));
        }
        value
    }

    /// `true` or `false`; false where absent.
    pub fn flag(&self, key: &str) -> bool {
        let Some(member) = self.get(key) else {
            return false;
        };
        member.value.as_bool().unwrap_or_else(|| {
            member.fault(format!("must be true or false, found {}", brief(member.value)));
            false
        })
    }
}

/// A value for a message: short, whatever it is.
fn brief(value: &Value) -> String {
    match value {
        Value::Array(_) => "an array".to_owned(),
        Value::Object(_) => "an object".to_owned(),
        Value::String(text) => format!("the string \"{}\"", text.chars().take(40).collect::<String>()),
        other => other.to_string(),
    }
}
