//! Cameras: pinhole, perspective. An image of another shape keeps the vertical field of view.

use crate::animated::Animated;
use crate::json::keyed::Keyed;
use crate::json::quantity::{Aspect, Direction, FieldOfView, Fixed, Position};
use glam::{Vec2, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A perspective camera of the scene or of a sequence, over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Camera")]
pub struct CameraTrack {
    /// Name of its node; empty for a sequence's own camera. Not in the JSON.
    #[serde(skip)]
    pub name: String,
    /// Eye, world space, metres.
    #[serde(with = "Keyed::<Position>")]
    pub position: Animated<Vec3>,
    /// A point that appears in the middle of the image, world space, metres.
    #[serde(with = "Keyed::<Position>")]
    pub look_at: Animated<Vec3>,
    /// Up direction; need not be perpendicular to the view or of unit length.
    #[serde(with = "Keyed::<Direction>", default = "y_up")]
    pub up: Animated<Vec3>,
    /// Vertical field of view in degrees, above 0 and below 180.
    #[serde(with = "Keyed::<FieldOfView>")]
    pub vfov_deg: Animated<f32>,
    /// Width over height that the author meant, if any: sets the default image size only.
    #[serde(default, with = "Fixed::<Aspect>", skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Fixed<Aspect>")]
    pub aspect: Option<f32>,
}

fn y_up() -> Animated<Vec3> {
    Animated::Constant(Vec3::Y)
}

/// A camera at one frame, ready to make rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Eye, world space.
    pub position: Vec3,
    /// Unit vector to the right of the image.
    pub right: Vec3,
    /// Unit vector to the top of the image.
    pub up: Vec3,
    /// Unit view direction.
    pub forward: Vec3,
    /// Tangent of half the vertical field of view.
    pub tan_half_vfov: f32,
}

impl Camera {
    /// A camera at `position` with unit view direction `forward`. `up` need not be perpendicular to it or of unit length;
    /// along it, another axis takes its place.
    pub fn looking(position: Vec3, forward: Vec3, up: Vec3, tan_half_vfov: f32) -> Camera {
        let right = forward
            .cross(up)
            .try_normalize()
            .unwrap_or_else(|| forward.any_orthonormal_vector());
        Camera {
            position,
            right,
            up: right.cross(forward),
            forward,
            tan_half_vfov,
        }
    }
}

impl CameraTrack {
    /// The camera at `frame`. Degenerate directions (eye on the target, up along the view) fall back to
    /// another axis, so that the frame is always orthonormal.
    pub fn at(&self, frame: f64) -> Camera {
        let position = self.position.at(frame);
        let forward = (self.look_at.at(frame) - position)
            .try_normalize()
            .unwrap_or(Vec3::NEG_Z);
        let tan_half_vfov = (self.vfov_deg.at(frame).to_radians() * 0.5).tan();
        Camera::looking(position, forward, self.up.at(frame), tan_half_vfov)
    }

    /// Whether the camera stays where it is.
    pub fn is_fixed(&self) -> bool {
        self.position.is_constant()
            && self.look_at.is_constant()
            && self.up.is_constant()
            && self.vfov_deg.is_constant()
    }
}

impl Camera {
    /// Unit direction through a point of the image: `pixel` in pixels from the top left corner (centres at
    /// +0.5), `size` = (width, height) in pixels.
    pub fn direction(&self, pixel: Vec2, size: Vec2) -> Vec3 {
        let x = (2.0 * pixel.x - size.x) / size.y * self.tan_half_vfov;
        let y = (size.y - 2.0 * pixel.y) / size.y * self.tan_half_vfov;
        (self.forward + self.right * x + self.up * y).normalize()
    }
}
