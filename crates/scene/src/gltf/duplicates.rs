//! JSON in which no object has a key twice: serde_json keeps the last of two values without a word, other readers the first, and
//! nobody knows which one was meant.

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::cell::RefCell;
use std::fmt::{self, Write};

/// Parses a text. What `extras` hold is anybody's and may have keys twice.
///
/// # Errors
/// It is no JSON, or an object has a key twice: the message has the key's path.
pub(super) fn parse(text: &str) -> serde_json::Result<Value> {
    let path = RefCell::new(String::new());
    let mut reader = serde_json::Deserializer::from_str(text);
    let value = Unique {
        path: &path,
        in_extras: false,
    }
    .deserialize(&mut reader)?;
    reader.end()?;
    Ok(value)
}

/// A value at a path.
#[derive(Clone, Copy)]
struct Unique<'a> {
    path: &'a RefCell<String>,
    in_extras: bool,
}

impl Unique<'_> {
    /// Steps down for as long as `read` runs.
    fn at<T>(self, step: impl FnOnce(&mut String), read: impl FnOnce() -> T) -> T {
        let length = self.path.borrow().len();
        step(&mut self.path.borrow_mut());
        let done = read();
        self.path.borrow_mut().truncate(length);
        done
    }
}

fn step_to_key(path: &mut String, key: &str) {
    if !path.is_empty() {
        path.push('.');
    }
    path.push_str(key);
}

impl<'de> DeserializeSeed<'de> for Unique<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Unique<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any JSON value")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(Number::from_f64(value).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_string<E: Error>(self, value: String) -> Result<Value, E> {
        Ok(Value::String(value))
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        loop {
            let step = |path: &mut String| {
                // A string takes whatever is written.
                let _ = write!(path, "[{}]", list.len());
            };
            match self.at(step, || entries.next_element_seed(self))? {
                Some(entry) => list.push(entry),
                None => return Ok(Value::Array(list)),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut members = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            if members.contains_key(&key) && !self.in_extras {
                let mut path = self.path.borrow().clone();
                step_to_key(&mut path, &key);
                return Err(A::Error::custom(format!(
                    "{path}: is given twice, and which one is meant nobody can tell; take one away"
                )));
            }
            let below = Unique {
                in_extras: self.in_extras || key == "extras",
                ..self
            };
            let value = self.at(|path| step_to_key(path, &key), || entries.next_value_seed(below))?;
            members.insert(key, value);
        }
        Ok(Value::Object(members))
    }
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn what_has_no_key_twice_is_read_as_ever() {
        let text = r#"{"a": [1, -2, 2.5, 1e300, 18446744073709551615, "x", "\u00e9\n", true, null, {"a": {"b": 1}, "b": []}],
            "extras": {"c": 1, "d": [{"e": 1, "e": 2}], "c": 2}, "b": {"a": 0}}"#;
        let plain: serde_json::Value = serde_json::from_str(text).unwrap();
        assert_eq!(parse(text).unwrap(), plain);
        for broken in ["", "{", "[1,]", "{} x", r#"{"a":1,}"#, "NaN"] {
            assert!(parse(broken).is_err(), "{broken}");
        }
        assert!(parse(&"[".repeat(1000)).is_err());
    }

    #[test]
    fn a_key_that_is_there_twice_is_told_with_its_place() {
        for (text, path) in [
            (r#"{"scene": 0, "scene": 1}"#, "scene: "),
            (
                "{\"nodes\": [{}, {\"mesh\": 0,\n\"mesh\": 0}]}",
                "nodes[1].mesh: ",
            ),
            (r#"{"a": {"b": 1, "c": [[{"d": {}, "d": {}}]]}}"#, "a.c[0][0].d: "),
            (r#"{"extras": 1, "extras": 2}"#, "extras: "),
            (r#"{"x": {"a": 1, "\u0061": 1}}"#, "x.a: "),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.to_string().starts_with(path), "{error}");
            assert!(error.to_string().contains("twice"), "{error}");
        }
        let error = parse("{\"nodes\": [{}, {\"mesh\": 0,\n\"mesh\": 0}]}").unwrap_err();
        assert_eq!(error.line(), 2);
    }
}
