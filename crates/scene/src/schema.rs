//! JSON Schemas of the files that people write, for editors to complete from and to check against. They say types, ranges,
//! units and defaults; what only a reader can know (that a material exists, that keys rise) they leave to it.

use crate::light::LightTrack;
use crate::material_edits::{EditForm, EditsFile};
use crate::sequence::{SequenceCamera, SequenceFile};
use crate::surface_scene::Description;
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::Value;

/// Of a lighting sequence ([`crate::sequence::read_sequence`]).
pub fn sequence() -> Value {
    schema::<SequenceFile<SequenceCamera, LightTrack>>("Lighting sequence of relight")
}

/// Of material edits ([`crate::material_edits::read_material_edits`]).
pub fn materials() -> Value {
    schema::<EditsFile<EditForm>>("Material edits of relight")
}

/// Of a scene description ([`crate::surface_scene::read_surface_scene`]).
pub fn scene() -> Value {
    schema::<Description>("Scene description of relight")
}

fn schema<T: JsonSchema>(title: &str) -> Value {
    let mut schema = SchemaGenerator::default().into_root_schema_for::<T>();
    schema.insert("title".into(), title.into());
    schema.to_value()
}
