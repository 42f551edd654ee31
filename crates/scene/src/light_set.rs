//! The lights of one frame, ready to be sampled.
//!
//! [`LightRig`] prepares what does not change from frame to frame (tables of environment maps and of emissive
//! triangles); [`LightRig::at`] makes the [`LightSet`] of a frame.
//!
//! Rectangles and spheres of a sequence are light without matter: whoever looks at them sees their radiance
//! added to what lies behind, and they neither block nor reflect light, so that light layers add up and a
//! moving light does not change the scene that was baked.
//!
//! Each kind of light is a file with its [`shape::Shape`]; [`set`] asks them, and [`rig`] makes them. Emissive surfaces are
//! drawn through a tree ([`emissive_tree`]) by what they send to a place, textured ones by their texture ([`parts`]).
//!
//! Geometry is evaluated in f64; no threshold is absolute, so lights of 1e-20 to 1e20 work at any scene scale.

mod directional;
mod distant;
mod emission_bounds;
mod emissive;
#[cfg(test)]
mod emissive_tests;
mod emissive_tree;
mod emitters;
mod environment;
mod form;
mod map;
mod parts;
mod point;
mod profile;
mod rect;
mod rig;
mod scene_emitters;
mod set;
mod shape;
mod sphere;
mod spherical_triangle;
mod sun_sky;
#[cfg(test)]
mod tests;

pub use distant::{DistantLight, Split};
pub use emitters::{EmissiveTriangle, Emitters, NoEmitters};
pub use form::{DistantMap, LightForm};
pub use parts::EmissivePart;
pub use rig::{LightRig, LightSetError, PreparedLights};
pub use scene_emitters::SceneEmitters;
pub use set::{LightHit, LightSet};
pub use shape::{EmitterPoint, LightSample, MetEmitter, ReferencePoint};
