//! Which parts of the light go which way, and why.

use crate::play::{Integrator, PlayArgs};
use relight_play::cuts::Lights;
use relight_play::load::Loaded;
use relight_scene::light::LightTrack;
use relight_scene::light_set::{LightRig, Split};
use relight_scene::sequence::Sequence;
use std::sync::Arc;

/// What visibility cuts are used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByCuts {
    /// Nothing.
    Nothing,
    /// Direct light of environments.
    Environments,
    /// The first bounce of all light.
    FirstBounce,
}

/// What an asset's cuts are used for under a sequence.
pub fn by_cuts(integrator: Integrator, args: &PlayArgs, loaded: &Loaded, sequence: &Sequence) -> ByCuts {
    let wanted = match integrator {
        Integrator::Cuts => true,
        Integrator::Transfer => args.integrator == Integrator::Auto,
        _ => false,
    };
    match loaded
        .player
        .cuts
        .as_ref()
        .filter(|_| wanted)
        .map(|cuts| &cuts.lights)
    {
        Some(Lights::Surface(_)) => ByCuts::FirstBounce,
        Some(Lights::Directions(_)) if sequence.lights.iter().any(LightTrack::is_distant) => {
            ByCuts::Environments
        }
        _ => ByCuts::Nothing,
    }
}

/// One line about how light is made, and why. `many`: lights are so many that lightcuts take less time.
pub fn choice(integrator: Integrator, by_cuts: ByCuts, many: bool, loaded: &Loaded) -> String {
    let shadowed = if many {
        "lightcuts (so many lights take fewer rays that way)"
    } else {
        "shadow rays"
    };
    let direct = match (by_cuts, &loaded.player.cuts) {
        (ByCuts::Environments, _) => format!(
            "direct light of environments by visibility cuts (the asset has them), of other lights by {shadowed}"
        ),
        (ByCuts::Nothing, Some(cuts)) if cuts.directions().is_some() => {
            format!("direct light by {shadowed} (no environment shines)")
        }
        (ByCuts::Nothing, None) if !many => {
            format!("direct light by {shadowed} (the asset has no visibility cuts)")
        }
        _ => format!("direct light by {shadowed}"),
    };
    let indirect = match (integrator, by_cuts) {
        (Integrator::Path, _) => return "Light by path tracing.".into(),
        (Integrator::Lightcuts, _) => {
            return "Light of points by lightcuts; indirect light of virtual lights, if there are any (--vpls).".into();
        }
        (Integrator::Pixelcuts, _) => return "Light of points, sent to clusters of pixels.".into(),
        (Integrator::Brute, _) => {
            return "Direct light of every light by shadow rays; no indirect light.".into();
        }
        (Integrator::Cuts, ByCuts::FirstBounce) => "one bounce of indirect light by visibility cuts",
        (Integrator::Cuts, _) => "no indirect light",
        (_, ByCuts::FirstBounce) => {
            "indirect light by transfer, but its first bounce by visibility cuts where surfaces are not matt (the asset \
             has them)"
        }
        _ => "indirect light by transfer",
    };
    format!("Light: {direct}; {indirect}.")
}

/// The parts of each light's environment.
pub fn splits(rig: &LightRig, loaded: &Loaded, lights: usize) -> Vec<Option<Arc<Split>>> {
    let directions = loaded.player.cuts.as_ref().map_or(0, |c| c.lights.leaves()) as u32;
    (0..lights)
        .map(|light| rig.split(light, directions).map(Arc::new))
        .collect()
}
