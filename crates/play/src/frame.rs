//! One relit frame: direct light at points and pixels, transfer, reconstruction.
//!
//! Source: Lehtinen et al. 2008, section 4. How indirect light on surfaces that are not matt is shaded: the matt part
//! takes the vector irradiance dotted with the shading normal; lobes that matter are followed by rays
//! ([`crate::reflections`]), others spread their light like the matt part, with the right total.
//!
//! [`light`] runs the stages: `direct` (shadow rays, or lightcuts), `environment` (visibility cuts of even
//! directions), `indirect` (where a pixel's indirect light is made), `emission`. [`resolve`] makes pixels of fragments.
//! [`traced`] makes frames by tracing; virtual lights alone take what the asset holds.

mod direct;
mod emission;
mod environment;
pub mod illuminance;
mod indirect;
pub mod light;
pub mod light_cut;
pub mod lightmap;
pub(crate) mod parts;
pub mod points;
pub mod probes;
mod received;
pub mod resolve;
pub mod settings;
pub mod stats;
mod task;
pub mod traced;
mod virtual_lights;
