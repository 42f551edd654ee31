//! Values over time as JSON: a constant, or `{"keys": [[frame, value], …], "interpolation": "step|linear|cubic"}`.

use super::quantity::{Fixed, Number, Quantity, QuantityVisitor, Range};
use crate::animated::{Animated, Interpolation};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeSeed, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// How fields of type [`Animated`] are read, written and described: `#[serde(with = "Keyed::<Q>")]`.
pub(crate) struct Keyed<Q>(PhantomData<Q>);

impl<Q: Quantity> Keyed<Q> {
    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Animated<Q::Value>, D::Error> {
        deserializer.deserialize_any(KeyedVisitor::<Q>(PhantomData))
    }

    /// Of a field that may be left out.
    pub(crate) fn given<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Animated<Q::Value>>, D::Error> {
        Self::deserialize(deserializer).map(Some)
    }

    pub(crate) fn serialize<S: Serializer>(
        value: &Animated<Q::Value>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            Animated::Constant(value) => Written(*value).serialize(serializer),
            Animated::Keys { keys, interpolation } => {
                let keys: Vec<_> = keys
                    .iter()
                    .map(|&(frame, value)| (frame, Written(value)))
                    .collect();
                let mut fields = serializer.serialize_struct("Keys", 2)?;
                fields.serialize_field("keys", &keys)?;
                fields.serialize_field("interpolation", interpolation)?;
                fields.end()
            }
        }
    }
}

struct Written<T>(T);

impl<T: super::quantity::Components> Serialize for Written<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.write(serializer)
    }
}

impl<Q: Quantity> JsonSchema for Keyed<Q> {
    fn schema_name() -> Cow<'static, str> {
        format!("Animated{}", Q::NAME).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let value = generator.subschema_for::<Fixed<Q>>();
        let interpolation = generator.subschema_for::<Interpolation>();
        json_schema!({
            "anyOf": [
                value,
                {
                    "description": "Values at frames, and how to go from one to the next. Before the first and after \
                        the last key the nearest one's value holds.",
                    "type": "object",
                    "properties": {
                        "keys": {
                            "description": "Pairs of frame and value; frames rise and may be fractions.",
                            "type": "array",
                            "minItems": 1,
                            "items": {
                                "type": "array",
                                "prefixItems": [{ "type": "number" }, value],
                                "minItems": 2,
                                "maxItems": 2
                            }
                        },
                        "interpolation": {
                            "description": "How the value goes from key to key.",
                            "default": "linear",
                            "allOf": [interpolation]
                        }
                    },
                    "required": ["keys"],
                    "additionalProperties": false
                }
            ]
        })
    }
}

struct KeyedVisitor<Q>(PhantomData<Q>);

impl<'de, Q: Quantity> Visitor<'de> for KeyedVisitor<Q> {
    type Value = Animated<Q::Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        QuantityVisitor::<Q>::new().expecting(f)?;
        write!(f, ", or an object with keys")
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        QuantityVisitor::<Q>::new()
            .visit_f64(number)
            .map(Animated::Constant)
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
        QuantityVisitor::<Q>::new()
            .visit_seq(list)
            .map(Animated::Constant)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let track = Track::<Q>::deserialize(MapAccessDeserializer::new(map))?;
        Ok(Animated::Keys {
            keys: track.keys.0,
            interpolation: track.interpolation,
        })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
struct Track<Q: Quantity> {
    keys: Keys<Q>,
    #[serde(default)]
    interpolation: Interpolation,
}

struct Keys<Q: Quantity>(Vec<(f64, Q::Value)>);

impl<'de, Q: Quantity> Deserialize<'de> for Keys<Q> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer
            .deserialize_seq(KeysVisitor::<Q>(PhantomData))
            .map(Keys)
    }
}

struct KeysVisitor<Q>(PhantomData<Q>);

impl<'de, Q: Quantity> Visitor<'de> for KeysVisitor<Q> {
    type Value = Vec<(f64, Q::Value)>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of at least one [frame, value]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut keys: Vec<(f64, Q::Value)> = Vec::new();
        while let Some(key) = list.next_element_seed(Key::<Q> {
            after: keys.last().map(|key| key.0),
            quantity: PhantomData,
        })? {
            keys.push(key);
        }
        if keys.is_empty() {
            return Err(A::Error::invalid_length(0, &self));
        }
        Ok(keys)
    }
}

/// One `[frame, value]`.
struct Key<Q> {
    /// The frame of the key before.
    after: Option<f64>,
    quantity: PhantomData<Q>,
}

impl<'de, Q: Quantity> DeserializeSeed<'de> for Key<Q> {
    type Value = (f64, Q::Value);

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, Q: Quantity> Visitor<'de> for Key<Q> {
    type Value = (f64, Q::Value);

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[frame, value]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let frame = (list.next_element_seed(RisingFrame(self.after))?)
            .ok_or_else(|| A::Error::invalid_length(0, &self))?;
        let value = (list.next_element::<Fixed<Q>>()?).ok_or_else(|| A::Error::invalid_length(1, &self))?;
        match list.next_element::<IgnoredAny>()? {
            None => Ok((frame, value.0)),
            Some(_) => Err(A::Error::custom("expected [frame, value], found more")),
        }
    }
}

/// A frame after another one.
struct RisingFrame(Option<f64>);

impl<'de> DeserializeSeed<'de> for RisingFrame {
    type Value = f64;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<f64, D::Error> {
        let frame = deserializer.deserialize_f64(Number(Range::Any))?;
        match self.0 {
            Some(before) if frame <= before => Err(D::Error::custom(format_args!(
                "frames of keys must rise, but {frame} follows {before}"
            ))),
            _ => Ok(frame),
        }
    }
}
