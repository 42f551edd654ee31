//! Kinds of light that pixelcuts keep apart.

use glam::Vec3;

/// Light of one kind, of one light or of all: a layer of its own.
pub(super) struct LitKind {
    pub virtual_lights: bool,
    /// Where light layers are wanted.
    pub source: Option<u32>,
    /// Reflected radiance by point of the view.
    pub radiance: Vec<Vec3>,
}
