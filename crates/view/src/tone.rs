//! Tone mapping: radiance of any brightness to what a screen shows.
//!
//! Sources: Khronos PBR Neutral (as `relight play --png`); Reinhard, Stark, Shirley and Ferwerda 2002, *Photographic Tone
//! Reproduction for Digital Images*, equation 3, on luminance; K. Narkowicz 2015, *ACES Filmic Tone Mapping Curve*, a fit of
//! the Academy's reference rendering for screens, per channel.

use relight_play::scene::environment::luminance;
use relight_play::scene::image::preview::pbr_neutral;
use serde::Deserialize;

/// A tone mapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// Khronos PBR Neutral: colours stay what they are but where it is very bright.
    #[default]
    Neutral,
    /// Filmic contrast.
    Filmic,
    /// Reinhard's: bright parts are compressed most, colours keep their hue.
    Reinhard,
    /// None: what is brighter than white is white.
    Clipped,
}

impl Tone {
    /// Linear Rec. 709 of any brightness to linear Rec. 709 in [0, 1]. Negative values and NaN count as 0.
    pub fn mapped(self, color: [f32; 3]) -> [f32; 3] {
        // Far above what a screen tells from white; keeps infinity out of the arithmetic.
        let color = color.map(|v| if v > 0.0 { v.min(1e15) } else { 0.0 });
        match self {
            Tone::Neutral => pbr_neutral(color),
            Tone::Filmic => {
                color.map(|x| ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0))
            }
            Tone::Reinhard => {
                let shrink = 1.0 / (1.0 + luminance(color.into()));
                color.map(|v| (v * shrink).min(1.0))
            }
            Tone::Clipped => color.map(|v| v.min(1.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Tone; 4] = [Tone::Neutral, Tone::Filmic, Tone::Reinhard, Tone::Clipped];

    /// Truth: the formulas by hand. Filmic of 1: 2.54 / 3.16. Reinhard of a grey of 3: 3 / 4.
    #[test]
    fn curves_are_those_of_their_sources() {
        let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-5, "{a} {b}");
        near(Tone::Filmic.mapped([1.0; 3])[1], 2.54 / 3.16);
        near(Tone::Reinhard.mapped([3.0; 3])[1], 0.75);
        near(Tone::Clipped.mapped([0.3; 3])[1], 0.3);
        near(Tone::Neutral.mapped([0.5; 3])[1], 0.46);
    }

    #[test]
    fn every_brightness_fits_the_screen_and_brighter_is_never_darker() {
        for tone in ALL {
            let mut last = 0.0;
            for stops in -40..=127 {
                let v = tone.mapped([(stops as f32).exp2(); 3])[1];
                assert!((last..=1.0).contains(&v), "{tone:?} at 2^{stops}: {v}");
                last = v;
            }
            assert!(last > 0.99, "{tone:?}: {last}");
            assert_eq!(tone.mapped([f32::NAN, -1.0, 0.0]), [0.0; 3], "{tone:?}");
            assert!(tone.mapped([f32::INFINITY; 3])[0] > 0.99, "{tone:?}");
        }
    }
}
