//! What lamps send over glossy surfaces: their lobes in place of the matt reflection that links are for.
//!
//! A link takes a cluster's radiosity to a receiver as if the cluster sent it evenly. Of light that comes from one side, a glossy surface sends
//! most to the other, so that a receiver gets more or less. Of each cluster some points stand for all ([`clusters`]): they know their irradiance and
//! whence the lamp shines, and their BRDF says what they send to this receiver ([`lamp`]); the difference to what is matt goes over weights that
//! are made of the links ([`links`], [`weights`]). Each point counts by the mean light around it, not by its own: a shadow's edge that passes one of four points
//! would switch a quarter of the cluster. Lobes are as much wider as the piece of surface is that a place stands for, and as the lamp. All of it is linear in the
//! lamps' light. Light of further reflections comes from all around, and is taken as ever.

mod clusters;
mod disk;
mod lamp;
mod links;
mod marks;
mod senders;
mod weights;

use crate::lit::Lit;
use crate::transfer::{OverLobes, Transfer};
use glam::Vec3;
use lamp::LampLight;
use relight_render::irradiance::Arrivals;

pub(crate) use senders::{Gloss, GlossySenders};

/// What receivers get of a lamp's light over lobes, in place of what links take as if those were matt. `direct`: its irradiance at the
/// finest points; `arrivals`: the same at [`GlossySenders::numbers`]. `None` where it is nothing.
pub(crate) fn over_lobes(
    senders: &GlossySenders,
    transfer: &Transfer,
    direct: &[Vec3],
    arrivals: &Arrivals,
) -> Option<OverLobes> {
    let lit = Lit::of(arrivals)?;
    Some(LampLight::new(senders, transfer, direct, lit).over_lobes())
}
