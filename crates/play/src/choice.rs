//! Ways to make light, and which of them a frame takes and why.

use crate::cuts;
use crate::lights::Lights;
use crate::prepared::PreparedScene;
use relight_render::lightcuts::LightcutSettings;
use relight_render::many_lights::PointSettings;
use relight_render::pixelcuts::PixelcutsSettings;
use std::fmt;
use std::path::PathBuf;

/// A way to make light.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Integrator {
    /// [`Integrator::Transfer`] with all visibility cuts that the asset has; without points [`Tracer::Path`].
    #[default]
    Auto,
    /// The asset's operators; direct light by shadow rays or, of many lights, lightcuts.
    Transfer,
    /// The asset's visibility cuts: direct light of environments, or the first bounce of any light; other direct light as
    /// [`Integrator::Transfer`] makes it.
    Cuts,
    /// Nothing of the asset but its scene, and, for virtual lights, its points.
    Traced(Tracer),
}

/// A way to make light of a scene alone.
#[derive(Clone, Debug, PartialEq)]
pub enum Tracer {
    /// The path tracer.
    Path {
        /// Most reflections of a path; `None`: no limit.
        max_bounces: Option<u32>,
    },
    /// Every light with shadow rays of its own; direct light only.
    Brute,
    /// Every one of points that stand for all lights, virtual lights included, with a shadow ray of its own.
    BrutePoints(PointSettings),
    /// The same points with a bounded error, by clusters of lights.
    Lightcuts {
        /// The points.
        points: PointSettings,
        /// Which clusters will do.
        cuts: LightcutSettings,
        /// Lightcuts at some places only, and reconstruction cuts between them.
        reconstruction: bool,
    },
    /// The same points, each sent to clusters of pixels.
    Pixelcuts {
        /// The points.
        points: PointSettings,
        /// How many clusters, and how finely.
        cuts: PixelcutsSettings,
    },
}

impl Tracer {
    /// Virtual lights that are wanted.
    pub fn virtual_lights(&self) -> u32 {
        match self {
            Tracer::BrutePoints(points)
            | Tracer::Lightcuts { points, .. }
            | Tracer::Pixelcuts { points, .. } => points.vpls,
            Tracer::Path { .. } | Tracer::Brute => 0,
        }
    }
}

impl Default for Tracer {
    /// Path tracing without a limit.
    fn default() -> Tracer {
        Tracer::Path { max_bounces: None }
    }
}

impl From<Tracer> for Integrator {
    fn from(tracer: Tracer) -> Integrator {
        Integrator::Traced(tracer)
    }
}

impl Integrator {
    /// Its name on the command line.
    pub fn name(&self) -> &'static str {
        match self {
            Integrator::Auto => "auto",
            Integrator::Transfer => "transfer",
            Integrator::Cuts => "cuts",
            Integrator::Traced(Tracer::Path { .. }) => "path",
            Integrator::Traced(Tracer::Brute | Tracer::BrutePoints(_)) => "brute",
            Integrator::Traced(Tracer::Lightcuts { .. }) => "lightcuts",
            Integrator::Traced(Tracer::Pixelcuts { .. }) => "pixelcuts",
        }
    }

    /// Whether it takes what a bake made, not the scene alone.
    pub fn needs_operators(&self) -> bool {
        match self {
            Integrator::Traced(tracer) => tracer.virtual_lights() > 0,
            _ => true,
        }
    }

    /// [`Integrator::Auto`] decided for a scene.
    ///
    /// # Errors
    /// The scene lacks what it takes.
    pub fn decided(&self, prepared: &PreparedScene) -> Result<Integrator, MissingError> {
        match (self, &prepared.transfer, &prepared.cuts) {
            (Integrator::Auto, Some(_), _) => Ok(Integrator::Transfer),
            (Integrator::Auto, None, _) => Ok(Tracer::default().into()),
            (Integrator::Transfer, None, _) => Err(MissingError::Points),
            (Integrator::Cuts, _, None) => Err(MissingError::Cuts),
            _ => Ok(self.clone()),
        }
    }
}

/// What an asset lacks of what an integrator takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MissingError {
    /// Points.
    #[error("holds no points, so there is nothing to transfer; use --integrator path")]
    Points,
    /// Visibility cuts.
    #[error(
        "was baked without visibility cuts; bake with --cuts environment or --cuts indirect (with --cuts auto also \
         --keep cuts), or use --integrator transfer"
    )]
    Cuts,
}

/// An asset can't be played as was asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {missing}", file.display())]
pub struct ChoiceError {
    /// The asset.
    pub file: PathBuf,
    /// What it lacks.
    pub missing: MissingError,
}

/// What visibility cuts are used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutUse {
    /// Nothing.
    Nothing,
    /// Direct light of environments.
    Environments,
    /// The first bounce of all light.
    FirstBounce,
}

/// Which visibility cuts an asset has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutKind {
    /// None.
    None,
    /// Of even directions.
    Directions,
    /// Of surface samples.
    Surfaces,
}

impl CutKind {
    /// Those of a scene.
    pub fn of(prepared: &PreparedScene) -> CutKind {
        match prepared.cuts.as_ref().map(|cuts| &cuts.lights) {
            None => CutKind::None,
            Some(cuts::CutLights::Directions(_)) => CutKind::Directions,
            Some(cuts::CutLights::Surface(_)) => CutKind::Surfaces,
        }
    }

    /// What they are used for under some lights.
    pub fn used_for(self, lights: &Lights) -> CutUse {
        match self {
            CutKind::Surfaces => CutUse::FirstBounce,
            CutKind::Directions if lights.any_distant() => CutUse::Environments,
            _ => CutUse::Nothing,
        }
    }
}

/// Which parts of the light go which way, and why. Shown, it is a sentence.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// How light is made; never [`Integrator::Auto`].
    pub integrator: Integrator,
    /// What visibility cuts are used for.
    pub cuts: CutUse,
    /// Which the asset has.
    pub of: CutKind,
    /// Whether pixels take direct light by lightcuts, because there are so many lights that these take less time.
    pub by_lightcuts: bool,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shadowed = if self.by_lightcuts {
            "lightcuts (so many lights take fewer rays that way)"
        } else {
            "shadow rays"
        };
        let direct = match (self.cuts, self.of) {
            (CutUse::Environments, _) => format!(
                "direct light of environments by visibility cuts (the asset has them), of other lights by {shadowed}"
            ),
            (CutUse::Nothing, CutKind::Directions) => {
                format!("direct light by {shadowed} (no environment shines)")
            }
            (CutUse::Nothing, CutKind::None) if !self.by_lightcuts => {
                format!("direct light by {shadowed} (the asset has no visibility cuts)")
            }
            _ => format!("direct light by {shadowed}"),
        };
        let indirect = match (&self.integrator, self.cuts) {
            (Integrator::Traced(Tracer::Path { .. }), _) => return f.write_str("Light by path tracing."),
            (Integrator::Traced(Tracer::Lightcuts { points, .. }), _) => {
                return write!(
                    f,
                    "Light of points by lightcuts; {}.",
                    of_virtual_lights(points.vpls)
                );
            }
            (Integrator::Traced(Tracer::Pixelcuts { points, .. }), _) => {
                return write!(
                    f,
                    "Light of points, sent to clusters of pixels; {}.",
                    of_virtual_lights(points.vpls)
                );
            }
            (Integrator::Traced(Tracer::BrutePoints(points)), _) => {
                return write!(
                    f,
                    "Light of points, each by a shadow ray; {}.",
                    of_virtual_lights(points.vpls)
                );
            }
            (Integrator::Traced(Tracer::Brute), _) => {
                return f.write_str("Direct light of every light by shadow rays; no indirect light.");
            }
            (Integrator::Cuts, CutUse::FirstBounce) => "one bounce of indirect light by visibility cuts",
            (Integrator::Cuts, _) => "no indirect light",
            (_, CutUse::FirstBounce) => {
                "indirect light by transfer, but its first bounce by visibility cuts where surfaces are not matt (the asset \
                 has them)"
            }
            _ => "indirect light by transfer",
        };
        write!(f, "Light: {direct}; {indirect}.")
    }
}

fn of_virtual_lights(vpls: u32) -> &'static str {
    match vpls {
        0 => "no indirect light (--vpls N makes some)",
        _ => "indirect light of virtual lights",
    }
}
