//! Numbers, vectors and colours as fields of JSON: what they accept, and how a schema says so.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{DeserializeSeed, Error, IgnoredAny, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// Which numbers are accepted.
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

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Range::Any => write!(f, "a finite number"),
            Range::NonNegative => write!(f, "a number of at least 0"),
            Range::Positive => write!(f, "a number above 0"),
            Range::Within(low, high) if *high >= 1e9 => write!(f, "a number from {low} to {high:e}"),
            Range::Within(low, high) => write!(f, "a number from {low} to {high}"),
            Range::Between(low, high) => write!(f, "a number above {low} and below {high}"),
        }
    }
}

impl Range {
    fn contains(self, number: f64) -> bool {
        match self {
            Range::Any => true,
            Range::NonNegative => number >= 0.0,
            Range::Positive => number > 0.0,
            Range::Within(low, high) => number >= low && number <= high,
            Range::Between(low, high) => number > low && number < high,
        }
    }

    /// A finite number of this range, as it is.
    pub(crate) fn check<E: Error>(self, number: f64) -> Result<f64, E> {
        if number.is_finite() && self.contains(number) {
            return Ok(number);
        }
        if number.abs() >= 1e9 {
            return Err(E::custom(format_args!("expected {self}, found {number:e}")));
        }
        Err(E::custom(format_args!("expected {self}, found {number}")))
    }

    /// A number of this range that fits 32 bits.
    fn narrow<E: Error>(self, number: f64) -> Result<f32, E> {
        let narrow = self.check(number)? as f32;
        if !narrow.is_finite() {
            let most = f32::MAX;
            return Err(E::custom(format_args!(
                "expected a number of at most {most:e} in size, found {number}"
            )));
        }
        // A positive number must not become zero on the way.
        if matches!(self, Range::Positive) && narrow <= 0.0 {
            let least = f32::MIN_POSITIVE;
            return Err(E::custom(format_args!(
                "expected a number of at least {least:e}, found {number}"
            )));
        }
        Ok(narrow)
    }

    fn schema(self) -> Schema {
        match self {
            Range::Any => json_schema!({ "type": "number" }),
            Range::NonNegative => json_schema!({ "type": "number", "minimum": 0 }),
            Range::Positive => json_schema!({ "type": "number", "exclusiveMinimum": 0 }),
            Range::Within(low, high) => json_schema!({ "type": "number", "minimum": low, "maximum": high }),
            Range::Between(low, high) => {
                json_schema!({ "type": "number", "exclusiveMinimum": low, "exclusiveMaximum": high })
            }
        }
    }
}

/// How a quantity is written.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// One number.
    Number,
    /// A list of three numbers.
    Triple,
    /// A list of three numbers that are not all 0.
    Direction,
    /// One number for all channels, or RGB.
    NumberOrRgb,
}

/// What a quantity is in memory.
pub(crate) trait Components: Copy {
    /// From three numbers; three times the same where one was written.
    fn from_components(components: [f32; 3]) -> Self;
    /// Writes it.
    fn write<S: Serializer>(self, serializer: S) -> Result<S::Ok, S::Error>;
}

impl Components for f32 {
    fn from_components([x, _, _]: [f32; 3]) -> f32 {
        x
    }

    fn write<S: Serializer>(self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(shortest(self))
    }
}

impl Components for glam::Vec3 {
    fn from_components(components: [f32; 3]) -> Self {
        components.into()
    }

    fn write<S: Serializer>(self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.to_array().map(shortest))
    }
}

/// The number with the fewest decimals that reads back as the same f32 (0.1, not 0.10000000149011612).
pub(crate) fn shortest(value: f32) -> f64 {
    let short = value.to_string().parse::<f64>().ok();
    short
        .filter(|&short| short as f32 == value)
        .unwrap_or(f64::from(value))
}

/// Kinds of numbers, vectors and colours that fields hold.
pub(crate) trait Quantity {
    /// In memory.
    type Value: Components;
    /// Its name in schemas.
    const NAME: &'static str;
    /// In a sentence of the schema.
    const DESCRIPTION: &'static str;
    /// How it is written.
    const FORM: Form;
    /// Of each number.
    const RANGE: Range;
}

/// Most intensity, irradiance or radiance of a light, in its unit: the product with 4π, an area and the inverse of a squared distance is
/// within 32-bit numbers.
pub(crate) const MAX_LIGHT: f64 = 1e30;
/// Most emission of a material, and most by which a light's or material's own is multiplied: both together are [`MAX_LIGHT`].
pub(crate) const MAX_FACTOR: f64 = 1e15;

macro_rules! quantities {
    ($($(#[doc = $doc:literal])+ $name:ident: $value:ty, $form:ident, $range:expr;)+) => {$(
        $(#[doc = $doc])+
        pub(crate) struct $name;

        impl Quantity for $name {
            type Value = $value;
            const NAME: &'static str = stringify!($name);
            const DESCRIPTION: &'static str = concat!($($doc),+);
            const FORM: Form = Form::$form;
            const RANGE: Range = $range;
        }
    )+};
}

quantities! {
    #[doc = "Any number."]
    Plain: f32, Number, Range::Any;
    #[doc = "A share, from 0 to 1."]
    Share: f32, Number, Range::Within(0.0, 1.0);
    #[doc = "A length in metres, above 0."]
    Length: f32, Number, Range::Positive;
    #[doc = "An angle in degrees."]
    Angle: f32, Number, Range::Any;
    #[doc = "Half the angle of a cone in degrees, from 0 to 90."]
    HalfAngle: f32, Number, Range::Within(0.0, 90.0);
    #[doc = "A field of view in degrees, above 0 and below 180."]
    FieldOfView: f32, Number, Range::Between(0.0, 180.0);
    #[doc = "Width over height, above 0."]
    Aspect: f32, Number, Range::Positive;
    #[doc = "Haze of the sky, from 2 (very clear) to 10 (hazy)."]
    Turbidity: f32, Number, Range::Within(2.0, 10.0);
    #[doc = "Hours since a day began, from 0 to 8784."]
    Hours: f32, Number, Range::Within(0.0, 8784.0);
    #[doc = "An exponent of Phong's model, from 0 to 1000000."]
    Exponent: f32, Number, Range::Within(0.0, crate::bsdf::MAX_EXPONENT as f64);
    #[doc = "A point: x, y and z in metres."]
    Position: glam::Vec3, Triple, Range::Any;
    #[doc = "A direction: x, y and z, not all 0; its length does not matter."]
    Direction: glam::Vec3, Direction, Range::Any;
    #[doc = "A way from one point to another: x, y and z in metres, not all 0."]
    Edge: glam::Vec3, Direction, Range::Any;
    #[doc = "Linear RGB, each from 0 to 1e30."]
    Color: glam::Vec3, Triple, Range::Within(0.0, MAX_LIGHT);
    #[doc = "A factor, from 0 to 1e15: one number for all channels, or linear RGB."]
    Factor: glam::Vec3, NumberOrRgb, Range::Within(0.0, MAX_FACTOR);
    #[doc = "How much is reflected, from 0 to 1: one number for all channels, or linear RGB."]
    Reflectance: glam::Vec3, NumberOrRgb, Range::Within(0.0, 1.0);
    #[doc = "How much is reflected: linear RGB, each from 0 to 1."]
    Albedo: glam::Vec3, Triple, Range::Within(0.0, 1.0);
    #[doc = "Emitted radiance in W/(m² sr), from 0 to 1e15: one number for all channels, or linear RGB."]
    Radiance: glam::Vec3, NumberOrRgb, Range::Within(0.0, MAX_FACTOR);
}

/// Reads one value of a quantity.
pub(crate) struct QuantityVisitor<Q>(PhantomData<Q>);

impl<Q> QuantityVisitor<Q> {
    pub(crate) fn new() -> Self {
        QuantityVisitor(PhantomData)
    }
}

impl<'de, Q: Quantity> Visitor<'de> for QuantityVisitor<Q> {
    type Value = Q::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match Q::FORM {
            Form::Number => write!(f, "{}", Q::RANGE),
            Form::Triple => write!(f, "3 numbers"),
            Form::Direction => write!(f, "a direction (3 numbers, not all 0)"),
            Form::NumberOrRgb => write!(f, "a number or 3 numbers (RGB)"),
        }
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Q::Value, E> {
        if matches!(Q::FORM, Form::Triple | Form::Direction) {
            return Err(E::custom(format_args!(
                "expected {}, found {number}",
                self.as_expected()
            )));
        }
        Ok(Q::Value::from_components([Q::RANGE.narrow(number)?; 3]))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Q::Value, E> {
        self.visit_f64(number as f64)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Q::Value, E> {
        self.visit_f64(number as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Q::Value, A::Error> {
        if Q::FORM == Form::Number {
            return Err(A::Error::invalid_type(Unexpected::Seq, &self));
        }
        let mut components = [0.0; 3];
        for (i, component) in components.iter_mut().enumerate() {
            *component = (list.next_element_seed(Narrow(Q::RANGE))?)
                .ok_or_else(|| A::Error::invalid_length(i, &self))?;
        }
        let mut count = components.len();
        while list.next_element::<IgnoredAny>()?.is_some() {
            count += 1;
        }
        if count > components.len() {
            return Err(A::Error::invalid_length(count, &self));
        }
        if Q::FORM == Form::Direction && components == [0.0; 3] {
            return Err(A::Error::custom(format_args!(
                "expected {}, found [0, 0, 0]",
                self.as_expected()
            )));
        }
        Ok(Q::Value::from_components(components))
    }
}

impl<Q: Quantity> QuantityVisitor<Q> {
    fn as_expected(&self) -> &dyn serde::de::Expected {
        self
    }
}

/// One number of a range, as f32.
struct Narrow(Range);

impl<'de> DeserializeSeed<'de> for Narrow {
    type Value = f32;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<f32, D::Error> {
        let number = deserializer.deserialize_f64(Number(self.0))?;
        self.0.narrow(number)
    }
}

/// One number of a range.
pub(crate) struct Number(pub(crate) Range);

impl Visitor<'_> for Number {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<f64, E> {
        self.0.check(number)
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<f64, E> {
        self.0.check(number as f64)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<f64, E> {
        self.0.check(number as f64)
    }
}

/// A number above 0, in f64.
pub(crate) struct Above0(f64);

impl JsonSchema for Above0 {
    fn schema_name() -> Cow<'static, str> {
        "Above0".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        Range::Positive.schema()
    }
}

impl<'de> Deserialize<'de> for Above0 {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_f64(Number(Range::Positive)).map(Above0)
    }
}

/// A number above 0, in f64.
pub(crate) fn positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Above0::deserialize(deserializer).map(|number| number.0)
}

/// A number of at least 0, in f64.
pub(crate) fn non_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    deserializer.deserialize_f64(Number(Range::NonNegative))
}

/// A point, in f64.
pub(crate) fn point<'de, D: Deserializer<'de>>(deserializer: D) -> Result<glam::DVec3, D::Error> {
    <[f64; 3]>::deserialize(deserializer).map(glam::DVec3::from)
}

/// Three numbers above 0, in f64.
pub(crate) fn positive_triple<'de, D: Deserializer<'de>>(deserializer: D) -> Result<glam::DVec3, D::Error> {
    let numbers = <[Above0; 3]>::deserialize(deserializer)?;
    Ok(numbers.map(|number| number.0).into())
}

/// The number 1, the version of all of these forms.
#[derive(Clone, Copy)]
pub(crate) struct Version1;

impl<'de> Deserialize<'de> for Version1 {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match u64::deserialize(deserializer)? {
            1 => Ok(Version1),
            other => Err(D::Error::custom(format_args!(
                "expected 1, the version that this program reads, found {other}"
            ))),
        }
    }
}

impl Serialize for Version1 {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(1)
    }
}

impl JsonSchema for Version1 {
    fn schema_name() -> Cow<'static, str> {
        "Version".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "const": 1 })
    }
}

/// A field that may be left out, but not be null.
pub(crate) fn given<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

/// A value of a quantity that has no keys.
pub(crate) struct Fixed<Q: Quantity>(pub(crate) Q::Value);

impl<'de, Q: Quantity> Deserialize<'de> for Fixed<Q> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer
            .deserialize_any(QuantityVisitor::<Q>::new())
            .map(Fixed)
    }
}

/// Of a field that may be left out: `#[serde(default, with = "Fixed::<Q>", skip_serializing_if = "Option::is_none")]`.
impl<Q: Quantity> Fixed<Q> {
    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Q::Value>, D::Error> {
        let value: Self = Deserialize::deserialize(deserializer)?;
        Ok(Some(value.0))
    }

    pub(crate) fn serialize<S: Serializer>(
        value: &Option<Q::Value>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => value.write(serializer),
            None => serializer.serialize_none(),
        }
    }
}

impl<Q: Quantity> JsonSchema for Fixed<Q> {
    fn schema_name() -> Cow<'static, str> {
        Q::NAME.into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let number = Q::RANGE.schema();
        let triple = json_schema!({ "type": "array", "items": number, "minItems": 3, "maxItems": 3 });
        let mut schema = match Q::FORM {
            Form::Number => number,
            Form::Triple => triple,
            Form::Direction => {
                let mut schema = triple;
                schema.insert("not".into(), serde_json::json!({ "const": [0, 0, 0] }));
                schema
            }
            Form::NumberOrRgb => json_schema!({ "anyOf": [number, triple] }),
        };
        schema.insert("description".into(), Q::DESCRIPTION.trim().into());
        schema
    }
}
