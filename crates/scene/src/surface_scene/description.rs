//! What a `*.scene.json` holds. Lengths in metres, world space, +Y up.

use crate::camera::CameraTrack;
use crate::implicit::Sdf;
use crate::json::quantity::{Albedo, Fixed, Position, Version1};
use schemars::JsonSchema;
use serde::Deserialize;

/// A scene of boxes, implicit surfaces and isosurfaces, all Lambertian.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "SceneDescription")]
pub(crate) struct Description {
    /// The version of this form.
    #[allow(dead_code, reason = "there is one")]
    relight_scene: Version1,
    /// Who looks.
    pub(super) camera: CameraTrack,
    /// Solid boxes along the axes.
    #[serde(default)]
    pub(super) boxes: Vec<BoxForm>,
    /// Implicit solids.
    #[serde(default)]
    pub(super) implicits: Vec<ImplicitForm>,
    /// Isosurfaces of volumes.
    #[serde(default)]
    pub(super) volumes: Vec<VolumeForm>,
}

/// A solid box along the axes.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Box")]
pub(super) struct BoxForm {
    /// Its name, for messages.
    pub(super) name: String,
    /// Its lowest corner.
    pub(super) min: Fixed<Position>,
    /// Its highest corner, above `min` along each axis.
    pub(super) max: Fixed<Position>,
    /// Its reflectance.
    pub(super) albedo: Fixed<Albedo>,
}

/// The surface of an implicit solid.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Implicit")]
pub(super) struct ImplicitForm {
    /// Its name, for messages.
    pub(super) name: String,
    /// Its reflectance.
    pub(super) albedo: Fixed<Albedo>,
    /// Lowest and highest corner of a box that contains it with a margin.
    pub(super) bounds: [Fixed<Position>; 2],
    /// Its signed distance: negative inside.
    pub(super) sdf: Sdf,
}

/// Where the density of a volume has one value.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Volume")]
pub(super) struct VolumeForm {
    /// Its name, for messages.
    pub(super) name: String,
    /// Its reflectance.
    pub(super) albedo: Fixed<Albedo>,
    /// Its samples, bytes without a header, x fastest, then y, then z: a file in the description's folder or below it.
    pub(super) file: String,
    /// Samples along x, y and z.
    pub(super) size: [u32; 3],
    /// Lowest and highest corner of the volume.
    pub(super) bounds: [Fixed<Position>; 2],
    /// The density at the surface, above 0 and below 255; more is inside.
    pub(super) level: f64,
}
