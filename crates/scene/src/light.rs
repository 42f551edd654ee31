//! Lights over time, as a lighting sequence or a scene describes them.

use crate::animated::Animated;
use crate::json::keyed::Keyed;
use crate::json::quantity::{
    Angle, Color, Components, Direction, Edge, Factor, HalfAngle, Hours, Length, Position, Quantity,
    Turbidity, given,
};
pub use crate::maps::{EnvironmentMap, EnvironmentMaps, MapFile};
use crate::photometry::Photometry;
use crate::weather::{Weather, hours_before};
use glam::Vec3;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::ser::Error as _;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::sync::Arc;

/// A light over time, as a sequence or a scene describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTrack {
    /// Its name: layers are called `light.<name>`. Unique within a sequence.
    pub name: String,
    /// What it is.
    pub kind: LightKind,
}

impl LightTrack {
    /// Whether its light comes from all around, from beyond the scene: an environment, or sun and sky.
    pub fn is_distant(&self) -> bool {
        matches!(
            self.kind,
            LightKind::Environment { .. } | LightKind::SunSky { .. } | LightKind::Weather { .. }
        )
    }
}

/// The kinds of lights of a sequence, with values over time. Intensities are radiometric.
//
// serde's `tag` would read them from the field `type`, but forgets paths on the way: `sequence` reads `type` first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(remote = "Self", rename_all = "snake_case", deny_unknown_fields)]
#[schemars(rename = "Light", tag = "type")]
pub enum LightKind {
    /// A point that shines the same in all directions.
    Point {
        /// World space, metres.
        #[serde(with = "Keyed::<Position>", alias = "center")]
        position: Animated<Vec3>,
        /// Radiant intensity, RGB in W/sr.
        #[serde(with = "Keyed::<Color>")]
        intensity: Animated<Vec3>,
    },
    /// As a point light, with the angular fall-off of KHR_lights_punctual.
    Spot {
        /// World space, metres.
        #[serde(with = "Keyed::<Position>", alias = "center")]
        position: Animated<Vec3>,
        /// The way the light points; need not be of unit length.
        #[serde(with = "Keyed::<Direction>")]
        direction: Animated<Vec3>,
        /// Half angle of the full-intensity cone, degrees, at most `outer_angle_deg`.
        #[serde(with = "Keyed::<HalfAngle>", default = "constant::<HalfAngle, 0>")]
        inner_angle_deg: Animated<f32>,
        /// Half angle beyond which there is no light, degrees, at most 90.
        #[serde(with = "Keyed::<HalfAngle>")]
        outer_angle_deg: Animated<f32>,
        /// Radiant intensity on the axis, RGB in W/sr.
        #[serde(with = "Keyed::<Color>")]
        intensity: Animated<Vec3>,
    },
    /// A point that shines as was measured: a photometric file (IES LM-63). A candela is taken as a W/sr.
    Ies {
        /// What the file says; not in the JSON.
        #[serde(skip)]
        profile: Arc<Photometry>,
        /// An `.ies` file, relative to the sequence's folder, or its whole text.
        file: String,
        /// World space, metres.
        #[serde(with = "Keyed::<Position>", alias = "center")]
        position: Animated<Vec3>,
        /// The way the lamp points, where both of the file's angles are 0; need not be of unit length.
        #[serde(with = "Keyed::<Direction>", default = "down")]
        direction: Animated<Vec3>,
        /// Where horizontal angles count from (type C), or the lamp's up (type A and B); its part along `direction` does not matter. Where the
        /// lamp points straight along it, +X does.
        #[serde(with = "Keyed::<Direction>", default = "up")]
        up: Animated<Vec3>,
        /// Multiplies the file's candela.
        #[serde(with = "Keyed::<Factor>", default = "constant::<Factor, 1>")]
        scale: Animated<Vec3>,
    },
    /// Parallel light from infinitely far away.
    Directional {
        /// The way the light travels; need not be of unit length.
        #[serde(with = "Keyed::<Direction>")]
        direction: Animated<Vec3>,
        /// Irradiance of a perpendicular surface, RGB in W/m².
        #[serde(with = "Keyed::<Color>")]
        irradiance: Animated<Vec3>,
    },
    /// A rectangle that emits towards `edge_u × edge_v`, not backwards. It casts no shadow.
    #[serde(alias = "rectangle")]
    Rect {
        /// Its middle, world space, metres.
        #[serde(with = "Keyed::<Position>", alias = "position")]
        center: Animated<Vec3>,
        /// One full side, metres.
        #[serde(with = "Keyed::<Edge>")]
        edge_u: Animated<Vec3>,
        /// The other full side, metres; not parallel to `edge_u`.
        #[serde(with = "Keyed::<Edge>")]
        edge_v: Animated<Vec3>,
        /// RGB in W/(m² sr).
        #[serde(with = "Keyed::<Color>")]
        radiance: Animated<Vec3>,
    },
    /// A sphere that emits outwards. It casts no shadow.
    Sphere {
        /// Its middle, world space, metres.
        #[serde(with = "Keyed::<Position>", alias = "position")]
        center: Animated<Vec3>,
        /// Metres.
        #[serde(with = "Keyed::<Length>")]
        radius: Animated<f32>,
        /// RGB in W/(m² sr).
        #[serde(with = "Keyed::<Color>")]
        radiance: Animated<Vec3>,
    },
    /// Light from all around, infinitely far away.
    Environment {
        /// The map of all frames, one for each, or those of keys; not in the JSON, which names files.
        #[serde(skip)]
        maps: EnvironmentMaps,
        /// An equirectangular map of radiance (`.hdr` or `.exr`), relative to the sequence's folder. With `####` for a number, a map for
        /// each frame; or the map's file itself, as a data URI in base64.
        file: MapFile,
        /// Multiplies the map.
        #[serde(with = "Keyed::<Factor>", default = "constant::<Factor, 1>")]
        scale: Animated<Vec3>,
        /// Turns the map counter-clockwise about +Y seen from above, degrees.
        #[serde(with = "Keyed::<Angle>", default = "constant::<Angle, 0>")]
        rotation_deg: Animated<f32>,
    },
    /// Sun and clear sky (Preetham's model).
    SunSky {
        /// 2 (very clear) to 10 (hazy).
        #[serde(with = "Keyed::<Turbidity>", default = "constant::<Turbidity, 3>")]
        turbidity: Animated<f32>,
        /// Towards the sun; need not be of unit length.
        #[serde(with = "Keyed::<Direction>")]
        sun_direction: Animated<Vec3>,
        /// Multiplies sun and sky.
        #[serde(with = "Keyed::<Factor>", default = "constant::<Factor, 1>")]
        scale: Animated<Vec3>,
    },
    /// Sun and sky as the weather was: a weather file (`.epw` or `.wea`) and Perez's sky. East is +X, north −Z.
    Weather {
        /// What the file says; not in the JSON.
        #[serde(skip)]
        weather: Arc<Weather>,
        /// An `.epw` or `.wea` file, relative to the sequence's folder, or its whole text.
        file: String,
        /// The day from whose midnight `hours` count, as `MM-DD`; the first of January where it is left out.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Day")]
        day: Option<Day>,
        /// The time, in hours, on the file's clock (without summer time).
        #[serde(with = "Keyed::<Hours>")]
        hours: Animated<f32>,
        /// Multiplies sun and sky.
        #[serde(with = "Keyed::<Factor>", default = "constant::<Factor, 1>")]
        scale: Animated<Vec3>,
        /// Turns sun and sky counter-clockwise about +Y seen from above, degrees.
        #[serde(with = "Keyed::<Angle>", default = "constant::<Angle, 0>")]
        rotation_deg: Animated<f32>,
    },
    /// Lets emissive materials of the scene shine.
    Emissive {
        /// Materials of this name; all emissive ones where it is left out.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "Option::is_none")]
        #[schemars(with = "String")]
        material: Option<String>,
        /// Multiplies the materials' emission.
        #[serde(with = "Keyed::<Factor>", default = "constant::<Factor, 1>")]
        scale: Animated<Vec3>,
    },
}

/// Where a kind of light, borrowed in either way, has its colour.
macro_rules! color_of {
    ($kind:expr) => {
        match $kind {
            LightKind::Point { intensity, .. } | LightKind::Spot { intensity, .. } => intensity,
            LightKind::Directional { irradiance, .. } => irradiance,
            LightKind::Rect { radiance, .. } | LightKind::Sphere { radiance, .. } => radiance,
            LightKind::Ies { scale, .. }
            | LightKind::Environment { scale, .. }
            | LightKind::SunSky { scale, .. }
            | LightKind::Weather { scale, .. }
            | LightKind::Emissive { scale, .. } => scale,
        }
    };
}

impl LightKind {
    /// What all of its light is in proportion to, RGB: its intensity, irradiance or radiance, or what multiplies a map or materials.
    pub fn color(&self) -> &Animated<Vec3> {
        color_of!(self)
    }

    /// The same, to be changed.
    pub fn color_mut(&mut self) -> &mut Animated<Vec3> {
        color_of!(self)
    }
}

/// A day of the year, as `MM-DD`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct Day {
    #[schemars(skip)]
    month: u32,
    #[schemars(skip)]
    day: u32,
}

impl Day {
    /// Hours of the year before its midnight.
    pub fn hours(self) -> f64 {
        hours_before(self.month, self.day).unwrap_or(0.0)
    }
}

impl TryFrom<String> for Day {
    type Error = String;

    fn try_from(text: String) -> Result<Day, String> {
        let parts = text
            .split_once('-')
            .filter(|(month, day)| month.len() <= 2 && day.len() <= 2);
        let numbers = parts.and_then(|(month, day)| Some((month.parse().ok()?, day.parse().ok()?)));
        let (month, day) = numbers
            .filter(|&(month, day)| hours_before(month, day).is_some())
            .ok_or_else(|| format!("expected a day of the year as \"MM-DD\", found {text:?}"))?;
        Ok(Day { month, day })
    }
}

impl From<Day> for String {
    fn from(Day { month, day }: Day) -> String {
        format!("{month:02}-{day:02}")
    }
}

/// The value of a field that is left out: the same number for all components, at every frame.
fn constant<Q: Quantity, const N: i8>() -> Animated<Q::Value> {
    Animated::Constant(Components::from_components([f32::from(N); 3]))
}

/// As lamps hang from ceilings.
fn down() -> Animated<Vec3> {
    Animated::Constant(Vec3::NEG_Y)
}

fn up() -> Animated<Vec3> {
    Animated::Constant(Vec3::Y)
}

/// `{"point": {…}}`, as serde writes the kind, becomes `{"name": …, "type": "point", …}`.
impl Serialize for LightTrack {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let kind =
            LightKind::serialize(&self.kind, serde_json::value::Serializer).map_err(S::Error::custom)?;
        let tagged = kind.as_object().into_iter().flatten().next();
        let (kind, fields) = tagged.ok_or_else(|| S::Error::custom("a light without a type"))?;
        let head = [("name", json!(self.name)), ("type", json!(kind))];
        let head = head.iter().map(|(key, value)| (*key, value));
        let fields = fields.as_object().into_iter().flatten();
        serializer.collect_map(head.chain(fields.map(|(key, value)| (key.as_str(), value))))
    }
}

/// The kinds' objects, each with a name.
impl JsonSchema for LightTrack {
    fn schema_name() -> Cow<'static, str> {
        "Light".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = LightKind::json_schema(generator);
        let name = json!({
            "description": "Its name, unlike those of the other lights: its layer is called `light.<name>`.",
            "type": "string",
            "minLength": 1
        });
        for kind in schema
            .get_mut("oneOf")
            .and_then(Value::as_array_mut)
            .into_iter()
            .flatten()
        {
            kind["properties"]["name"] = name.clone();
            if let Some(required) = kind["required"].as_array_mut() {
                required.insert(0, "name".into());
            }
        }
        schema
    }
}
