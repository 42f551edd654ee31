//! Reading a JSON text into types, with exact paths in messages.

use super::error::{JsonError, LineColumn};
use super::path::{JsonPath, place_of_key};
use crate::lfs::{LFS_ADVICE, is_lfs_pointer};
use serde::de::value::{StrDeserializer, StringDeserializer};
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error as _, IgnoredAny, IntoDeserializer, MapAccess,
    VariantAccess, Visitor,
};
use serde::{Deserialize, forward_to_deserialize_any};
use serde_json::Error;
use serde_path_to_error::{Segment, Track};
use std::path::Path;

/// The text of a file of which somebody may have to be told what is wrong.
#[derive(Clone, Copy)]
pub(crate) struct Document<'a> {
    /// The file, as messages name it.
    pub(crate) name: &'a str,
    /// All of it.
    pub(crate) text: &'a str,
}

/// What reads an object: passed to the closure of [`Document::decode_with`].
pub(crate) type ObjectReader<'t, 'de> = serde_path_to_error::Deserializer<'t, 't, Object<'de>>;

/// Reads a text file; `what` it should be stands in the message if that fails.
pub(crate) fn read_text(path: &Path, what: &'static str) -> Result<String, JsonError> {
    let fail = |source| JsonError::Read {
        what,
        file: path.to_owned(),
        source,
    };
    let bytes = std::fs::read(path).map_err(fail)?;
    if is_lfs_pointer(&bytes) {
        return Err(fail(std::io::Error::other(format!("this {LFS_ADVICE}"))));
    }
    decoded(bytes).ok_or_else(|| {
        fail(std::io::Error::other(
            "it is no text in UTF-8, nor in UTF-16 with a byte-order mark",
        ))
    })
}

/// Text of UTF-8 with or without a byte-order mark, or of UTF-16 with one.
pub(crate) fn decoded(bytes: Vec<u8>) -> Option<String> {
    let utf16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let (units, rest) = bytes.as_chunks::<2>();
        let units: Vec<u16> = units.iter().map(|pair| unit(*pair)).collect();
        String::from_utf16(&units).ok().filter(|_| rest.is_empty())
    };
    match bytes.as_slice() {
        [0xff, 0xfe, text @ ..] => utf16(text, u16::from_le_bytes),
        [0xfe, 0xff, text @ ..] => utf16(text, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, text @ ..] => String::from_utf8(text.to_vec()).ok(),
        _ => String::from_utf8(bytes).ok(),
    }
}

impl<'a> Document<'a> {
    /// Reads an object that stands at `path`: `part` of the text, or all of it.
    pub(crate) fn decode<T: Deserialize<'a>>(&self, part: &'a str, path: &JsonPath) -> Result<T, JsonError> {
        self.decode_with(Object::new(part), path, |object| T::deserialize(object))
    }

    /// Reads an object within the text by a function.
    pub(crate) fn decode_with<'b, T>(
        &self,
        object: Object<'b>,
        path: &JsonPath,
        read: impl FnOnce(ObjectReader<'_, 'b>) -> Result<T, Error>,
    ) -> Result<T, JsonError> {
        let mut track = Track::new();
        read(ObjectReader::new(object, &mut track)).map_err(|error| {
            let message = error.to_string();
            // The parser's message repeats the place at its end, counted from the start of the part.
            let message = &message[..message.rfind(" at line ").unwrap_or(message.len())];
            let taken = track.path();
            let mut segments = taken.iter().peekable();
            // The variant is named by a field, which is no step of the path.
            let path = match (object.variant, segments.peek()) {
                (Some((field, _)), None) => path.key(field),
                (Some(_), Some(Segment::Enum { .. })) => path.join(segments.skip(1)),
                _ => path.join(segments),
            };
            if object.text.len() == self.text.len() && !error.is_data() {
                return JsonError::Syntax {
                    name: self.name.into(),
                    place: LineColumn {
                        line: error.line(),
                        column: error.column(),
                    },
                    message: message.into(),
                };
            }
            if message.starts_with("duplicate field") {
                let place = place_of_key(self.text, object.text, error.line(), error.column());
                return self.error_at(&path, message, place);
            }
            self.error(&path, message)
        })
    }

    /// A complaint about the value at `path`.
    pub(crate) fn error(&self, path: &JsonPath, message: impl Into<String>) -> JsonError {
        self.error_at(path, message, path.place(self.text))
    }

    fn error_at(&self, path: &JsonPath, message: impl Into<String>, place: LineColumn) -> JsonError {
        JsonError::Field {
            name: self.name.into(),
            path: path.to_string(),
            message: message.into(),
            place,
        }
    }
}

/// An object within a JSON text as a source of serde's: of structs, and of enums whose variant one of its fields names.
#[derive(Clone, Copy)]
pub(crate) struct Object<'a> {
    text: &'a str,
    /// Fields that have been read before.
    without: &'static [&'static str],
    /// Of an enum: the field that names the variant, and the name.
    variant: Option<(&'static str, &'a str)>,
}

impl<'a> Object<'a> {
    /// The whole object.
    pub(crate) fn new(text: &'a str) -> Self {
        Object {
            text,
            without: &[],
            variant: None,
        }
    }

    /// As if it did not have these fields.
    pub(crate) fn without(self, without: &'static [&'static str]) -> Self {
        Object { without, ..self }
    }

    /// As an enum whose variant is `name`, which its field `field` says.
    pub(crate) fn variant(self, field: &'static str, name: &'a str) -> Self {
        Object {
            variant: Some((field, name)),
            ..self
        }
    }
}

impl<'de> Deserializer<'de> for Object<'de> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let mut json = serde_json::Deserializer::from_str(self.text);
        let value = json.deserialize_map(WithoutFields {
            visitor,
            without: self.without,
        })?;
        json.end()?;
        Ok(value)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        visitor.visit_enum(self)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

impl<'de> EnumAccess<'de> for Object<'de> {
    type Error = Error;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Self), Error> {
        let (_, name) = self.variant.unwrap_or_default();
        let name: StrDeserializer<'_, Error> = name.into_deserializer();
        Ok((seed.deserialize(name)?, self))
    }
}

impl<'de> VariantAccess<'de> for Object<'de> {
    type Error = Error;

    fn unit_variant(self) -> Result<(), Error> {
        IgnoredAny::deserialize(self).map(|_| ())
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Error> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _len: usize, _visitor: V) -> Result<V::Value, Error> {
        Err(Error::custom("expected an object"))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.deserialize_any(visitor)
    }
}

/// A visitor that is not shown some fields.
struct WithoutFields<V> {
    visitor: V,
    without: &'static [&'static str],
}

impl<'de, V: Visitor<'de>> Visitor<'de> for WithoutFields<V> {
    type Value = V::Value;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "an object")
    }

    fn visit_map<M: MapAccess<'de>>(self, map: M) -> Result<V::Value, M::Error> {
        let without = self.without;
        self.visitor.visit_map(FieldsWithout { map, without })
    }
}

struct FieldsWithout<M> {
    map: M,
    without: &'static [&'static str],
}

impl<'de, M: MapAccess<'de>> MapAccess<'de> for FieldsWithout<M> {
    type Error = M::Error;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, M::Error> {
        while let Some(key) = self.map.next_key::<String>()? {
            if self.without.contains(&key.as_str()) {
                self.map.next_value::<IgnoredAny>()?;
                continue;
            }
            let key: StringDeserializer<M::Error> = key.into_deserializer();
            return seed.deserialize(key).map(Some);
        }
        Ok(None)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, M::Error> {
        self.map.next_value_seed(seed)
    }
}
