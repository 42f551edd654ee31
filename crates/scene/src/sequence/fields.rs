//! Reading typed fields out of JSON by hand, so that every complaint names the path of the field it is about.

use crate::animated::{Animated, Interpolation};
use glam::Vec3;
use serde_json::{Map, Value};
use std::path::PathBuf;
use thiserror::Error;

/// Why a lighting sequence cannot be used.
#[derive(Debug, Error)]
pub enum SequenceError {
    /// The file could not be read.
    #[error("cannot read the lighting sequence {}: {source}", file.display())]
    Read {
        /// Which file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not JSON.
    #[error("{name}: not valid JSON at line {line}, column {column}: {message}")]
    Syntax {
        /// The sequence, as the caller names it.
        name: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the parser said.
        message: String,
    },
    /// A field is missing, unknown or holds something that it cannot hold.
    #[error("{name}: {path}: {message}")]
    Field {
        /// The sequence, as the caller names it.
        name: String,
        /// Where in it, such as `lights[2].intensity`.
        path: String,
        /// What was expected and what was found.
        message: String,
    },
}

/// What is wrong at which path; the sequence's name is added at the end.
#[derive(Debug)]
pub(crate) struct FieldError {
    pub path: String,
    pub message: String,
}

/// Result of reading a field.
pub(crate) type Field<T> = Result<T, FieldError>;

/// A complaint about the field at `path`.
pub(crate) fn complain<T>(path: &str, message: impl Into<String>) -> Field<T> {
    let path = if path.is_empty() { "the sequence" } else { path };
    Err(FieldError {
        path: path.into(),
        message: message.into(),
    })
}

/// A complaint that names what was expected and shows what is there.
pub(crate) fn expected<T>(path: &str, what: &str, found: &Value) -> Field<T> {
    complain(path, format!("expected {what}, found {}", show(found)))
}

/// A value as the message shows it, at most some 60 characters of it.
pub(crate) fn show(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 60 {
        return text;
    }
    text.chars().take(57).chain("...".chars()).collect()
}

/// The path of a field of an object.
pub(crate) fn join(path: &str, field: &str) -> String {
    if path.is_empty() {
        field.into()
    } else {
        format!("{path}.{field}")
    }
}

/// An object whose fields are all among `known`.
pub(crate) fn object<'a>(value: &'a Value, path: &str, known: &[&str]) -> Field<&'a Map<String, Value>> {
    let Value::Object(map) = value else {
        return expected(path, "an object", value);
    };
    if let Some(unknown) = map.keys().find(|key| !known.contains(&key.as_str())) {
        return complain(
            &join(path, unknown),
            format!("unknown field; known here: {}", known.join(", ")),
        );
    }
    Ok(map)
}

/// A field that must be there.
pub(crate) fn required<'a>(map: &'a Map<String, Value>, path: &str, field: &str) -> Field<&'a Value> {
    match map.get(field) {
        Some(value) => Ok(value),
        None => complain(&join(path, field), "missing; it is required here"),
    }
}

/// A text.
pub(crate) fn text(value: &Value, path: &str) -> Field<String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        _ => expected(path, "a text", value),
    }
}

/// Which numbers a field accepts.
#[derive(Clone, Copy)]
pub(crate) enum Range {
    /// Every finite number.
    Any,
    /// Zero and above.
    NonNegative,
    /// Above zero.
    Positive,
    /// From the first to the second, both included.
    Within(f64, f64),
    /// Between the first and the second, both excluded.
    Between(f64, f64),
}

impl Range {
    fn describe(self) -> String {
        match self {
            Range::Any => "a finite number".into(),
            Range::NonNegative => "a number of at least 0".into(),
            Range::Positive => "a number above 0".into(),
            Range::Within(low, high) => format!("a number from {low} to {high}"),
            Range::Between(low, high) => format!("a number above {low} and below {high}"),
        }
    }

    fn contains(self, number: f64) -> bool {
        match self {
            Range::Any => true,
            Range::NonNegative => number >= 0.0,
            Range::Positive => number > 0.0,
            Range::Within(low, high) => number >= low && number <= high,
            Range::Between(low, high) => number > low && number < high,
        }
    }
}

/// A finite number in `range`. JSON has no NaN or infinity; texts such as `"NaN"` are refused by name.
pub(crate) fn number(value: &Value, path: &str, range: Range) -> Field<f64> {
    match value.as_f64() {
        Some(number) if number.is_finite() && range.contains(number) => Ok(number),
        _ => expected(path, &range.describe(), value),
    }
}

/// A number in `range` that fits 32 bits.
pub(crate) fn scalar(value: &Value, path: &str, range: Range) -> Field<f32> {
    let wide = number(value, path, range)?;
    let narrow = wide as f32;
    if !narrow.is_finite() {
        return expected(
            path,
            &format!("a number of at most {:e} in size", f32::MAX),
            value,
        );
    }
    // A positive number must not become zero on the way.
    if matches!(range, Range::Positive) && narrow <= 0.0 {
        return expected(
            path,
            &format!("a number of at least {:e}", f32::MIN_POSITIVE),
            value,
        );
    }
    Ok(narrow)
}

/// Three numbers in `range`.
pub(crate) fn vector(value: &Value, path: &str, range: Range) -> Field<Vec3> {
    match value.as_array() {
        Some(list) if list.len() == 3 && list.iter().all(Value::is_number) => {
            let mut out = [0.0; 3];
            for (i, item) in list.iter().enumerate() {
                out[i] = scalar(item, &format!("{path}[{i}]"), range)?;
            }
            Ok(Vec3::from_array(out))
        }
        _ => expected(path, "3 numbers", value),
    }
}

/// A direction: three numbers, not all zero.
pub(crate) fn direction(value: &Value, path: &str) -> Field<Vec3> {
    let direction = vector(value, path, Range::Any)?;
    if direction == Vec3::ZERO {
        return expected(path, "a direction (3 numbers, not all 0)", value);
    }
    Ok(direction)
}

/// A factor: one number for all channels, or RGB.
pub(crate) fn factor(value: &Value, path: &str) -> Field<Vec3> {
    if value.is_number() {
        return Ok(Vec3::splat(scalar(value, path, Range::NonNegative)?));
    }
    if !value.is_array() {
        return expected(path, "a number or 3 numbers (RGB)", value);
    }
    vector(value, path, Range::NonNegative)
}

/// A constant, or `{"keys": [[frame, value], …], "interpolation": "step|linear|cubic"}` (linear if left out).
pub(crate) fn animated<T>(
    value: &Value,
    path: &str,
    read: impl Fn(&Value, &str) -> Field<T>,
) -> Field<Animated<T>> {
    if !value.is_object() {
        return Ok(Animated::Constant(read(value, path)?));
    }
    let map = object(value, path, &["keys", "interpolation"])?;
    let interpolation = match map.get("interpolation") {
        None => Interpolation::Linear,
        Some(word) => match word.as_str() {
            Some("step") => Interpolation::Step,
            Some("linear") => Interpolation::Linear,
            Some("cubic") => Interpolation::Cubic,
            _ => {
                return expected(
                    &join(path, "interpolation"),
                    "\"step\", \"linear\" or \"cubic\"",
                    word,
                );
            }
        },
    };
    let keys_path = join(path, "keys");
    let list = match required(map, path, "keys")? {
        Value::Array(list) if !list.is_empty() => list,
        other => return expected(&keys_path, "a list of at least one [frame, value]", other),
    };
    let mut keys: Vec<(f64, T)> = Vec::with_capacity(list.len());
    for (i, pair) in list.iter().enumerate() {
        let pair_path = format!("{keys_path}[{i}]");
        let Some([frame, item]) = pair.as_array().map(Vec::as_slice) else {
            return expected(&pair_path, "[frame, value]", pair);
        };
        let frame_path = format!("{pair_path}[0]");
        let at = number(frame, &frame_path, Range::Any)?;
        if let Some((before, _)) = keys.last()
            && at <= *before
        {
            return complain(
                &frame_path,
                format!("frames of keys must rise, but {at} follows {before}"),
            );
        }
        keys.push((at, read(item, &format!("{pair_path}[1]"))?));
    }
    Ok(Animated::Keys { keys, interpolation })
}
