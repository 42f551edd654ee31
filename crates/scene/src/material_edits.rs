//! Changes of materials at play time, without a new bake: which model, which parameters, at which frame.
//!
//! ```json
//! { "relight_materials": 1, "edits": [
//!   { "material": "Teapot", "model": "ward", "base_color": [0.1, 0.1, 0.4], "specular": 0.3,
//!     "roughness_u": {"keys": [[0, 0.1], [47, 0.4]], "interpolation": "linear"}, "rotation_deg": 30 } ] }
//! ```
//!
//! `material` is a name (all materials so named are edited) or a number. Edits are applied in their order; what
//! they do not mention stays as the source has it. Numbers and colours may have keys. Roughness is perceptual in
//! every model (α is its square) and multiplied by the metallic-roughness texture's green channel. Textures are
//! those of the asset, by number or name, `null` for none; a new one is looked up where the material's texture of
//! that kind was, else where its first texture is.
//!
//! `"variant": "beach"`, with or without `edits`, names a variant of the scene's materials that edits go on from.
//!
//! `docs/materials.md` has every field. What rays meet is fixed by the bake, so alpha and visibility cannot be edited. Links were chosen for the
//! albedos of the bake: where an edit makes a dark surface bright, faint links are missing.

mod edit;
mod form;
mod parameters;
mod read;
#[cfg(test)]
mod tests;

pub use edit::MaterialEdits;
pub(crate) use form::{EditForm, EditsFile};
pub use read::{parse_material_edits, read_material_edits};
