//! Paths of values within a JSON text, and where in the text they are.

use super::error::LineColumn;
use serde_json::value::RawValue;
use serde_path_to_error::Segment;
use std::collections::HashMap;
use std::fmt;

/// A step from a value to one within it.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    Key(String),
    Index(usize),
}

/// The way from the whole text to a value, such as `lights[2].intensity`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct JsonPath(Vec<Step>);

impl JsonPath {
    /// The path of a field of this object.
    pub(crate) fn key(&self, key: &str) -> JsonPath {
        self.then(Step::Key(key.into()))
    }

    /// The path of an item of this list.
    pub(crate) fn index(&self, index: usize) -> JsonPath {
        self.then(Step::Index(index))
    }

    fn then(&self, step: Step) -> JsonPath {
        let mut path = self.clone();
        path.0.push(step);
        path
    }

    /// This path, then that which serde took.
    pub(crate) fn join<'a>(&self, segments: impl Iterator<Item = &'a Segment>) -> JsonPath {
        let mut path = self.clone();
        path.0.extend(segments.filter_map(|segment| match segment {
            Segment::Seq { index } => Some(Step::Index(*index)),
            Segment::Map { key } | Segment::Enum { variant: key } => Some(Step::Key(key.clone())),
            Segment::Unknown => None,
        }));
        path
    }

    /// Where the value begins in `text`, which is JSON; if it isn't there, where the innermost value around it does.
    pub(crate) fn place(&self, text: &str) -> LineColumn {
        let mut value = text;
        for step in &self.0 {
            let inner = match step {
                Step::Key(key) => serde_json::from_str::<HashMap<String, &RawValue>>(value)
                    .ok()
                    .and_then(|fields| fields.get(key).copied()),
                Step::Index(index) => serde_json::from_str::<Vec<&RawValue>>(value)
                    .ok()
                    .and_then(|items| items.get(*index).copied()),
            };
            match inner {
                Some(inner) => value = inner.get(),
                None => break,
            }
        }
        // `value` is a part of `text`.
        let start = (value.as_ptr() as usize).saturating_sub(text.as_ptr() as usize);
        place_of(text, start + (value.len() - value.trim_start().len()))
    }
}

/// Line and column of a byte of a text.
pub(crate) fn place_of(text: &str, byte: usize) -> LineColumn {
    let before = &text.as_bytes()[..byte.min(text.len())];
    let line_start = before
        .iter()
        .rposition(|&byte| byte == b'\n')
        .map_or(0, |end| end + 1);
    LineColumn {
        line: 1 + before.iter().filter(|&&byte| byte == b'\n').count(),
        column: 1 + before.len() - line_start,
    }
}

/// Where in `text` the key begins that a parser of `part` of it read last before it stopped in this line, after so many bytes of it.
pub(crate) fn place_of_key(text: &str, part: &str, line: usize, column: usize) -> LineColumn {
    let lines = part.split_inclusive('\n').take(line.saturating_sub(1));
    let end = lines.map(str::len).sum::<usize>() + column;
    // Names of fields hold no quotes: the last one ends the key, the one before begins it.
    let quote_before = |end: usize| part.get(..end).and_then(|before| before.rfind('"'));
    let key = quote_before(end.min(part.len())).and_then(quote_before);
    let start = (part.as_ptr() as usize).saturating_sub(text.as_ptr() as usize);
    place_of(text, start + key.unwrap_or(0))
}

impl fmt::Display for JsonPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return write!(f, "the whole text");
        }
        for (i, step) in self.0.iter().enumerate() {
            match step {
                Step::Index(index) => write!(f, "[{index}]")?,
                Step::Key(key) if i == 0 => write!(f, "{key}")?,
                Step::Key(key) => write!(f, ".{key}")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: counted by eye.
    #[test]
    fn values_are_found_in_the_text() {
        let text = "{ \"a\": 1,\n  \"b\": [ 2, {\"c\":\n 3} ] }";
        let b = JsonPath::default().key("b");
        for (path, line, column, shown) in [
            (JsonPath::default(), 1, 1, "the whole text"),
            (JsonPath::default().key("a"), 1, 8, "a"),
            (b.index(0), 2, 10, "b[0]"),
            (b.index(1).key("c"), 3, 2, "b[1].c"),
            (b.index(1).key("gone"), 2, 13, "b[1].gone"),
            (b.key("gone").index(7), 2, 8, "b.gone[7]"),
        ] {
            assert_eq!(path.to_string(), shown);
            assert_eq!(path.place(text), LineColumn { line, column }, "{shown}");
        }
    }
}
