//! What glTF does not say: the units of lights, the rate of animations, and a name.

use super::nodes::PunctualKind;

/// Frames per second at which animations are resampled, the default of sequences.
pub const FPS: f64 = 24.0;

/// Name of the light that stands for all emissive materials.
pub const EMISSIVE: &str = "emissive";

/// How the exporter wrote the intensities of lights. The three modes of Blender's exporter ("Lighting Mode"),
/// which knows a light's power in watts (points and spots; a spot as if it shone all around) or its
/// irradiance in W/m² (suns), are these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// As KHR_lights_punctual has it (Blender: `SPEC`, "Standard"): candela and lux. Taken as W/sr and W/m²
    /// without a factor. Blender writes 683 lm/W × power / 4π, and 683 lm/W × irradiance:
    /// such a scene is 683 times brighter than the same one exported without units.
    #[default]
    Spec,
    /// Without the luminous efficacy (Blender: `COMPAT`, "Unitless"): power / 4π, that is W/sr, and W/m². The
    /// numbers are relight's own units.
    Unitless,
    /// As Blender holds them (`RAW`, "Raw (Deprecated)"): watts, here divided by 4π to W/sr, and W/m².
    Raw,
}

impl LightUnits {
    /// What turns a number in the file into W/sr (points and spots) or W/m² (directional).
    pub(super) fn factor(self, kind: PunctualKind) -> f64 {
        match (self, kind) {
            (LightUnits::Raw, PunctualKind::Point | PunctualKind::Spot { .. }) => 0.25 / std::f64::consts::PI,
            _ => 1.0,
        }
    }
}
