//! What a bake expects of its asset's errors, and says in it.

use relight_format::Estimates;
use serde::{Deserialize, Serialize};

/// Names of the estimates in the file (SPEC 6.10).
const TARGET: &str = "target_error";
const ERROR: &str = "error_indirect";
const ERROR_NOISE: &str = "error_noise";
const BIAS: &str = "bias_indirect";
const BIAS_NOISE: &str = "bias_noise";
const WITHOUT_POINTS: &str = "share_without_points";
const WITHOUT_LIGHT: &str = "share_without_light";
const WIDE: &str = "share_wide";

/// Bias beyond which a bake is called wrong.
pub const MOST_BIAS: f64 = 0.05;
/// Error beyond which a bake is called wrong.
pub const MOST_ERROR: f64 = 0.25;
/// A setting will do for an error that was asked for if it is expected to err by up to so much more: estimates are no better, and the
/// next step of a search may err by much less.
pub const CLOSE_ENOUGH: f64 = 1.15;
/// Standard errors within which an estimate accuses nobody.
pub const DOUBT: f64 = 2.0;
/// Shares of what is seen from which on they are a reason.
const REASON: f64 = 0.02;
const REASON_WIDE: f64 = 0.25;

/// An error in words.
pub fn percent(error: f64) -> String {
    format!("{:.1} %", 100.0 * error)
}

/// What a bake expects of its asset's indirect light, from its own check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// Root of relMSE of the indirect layer.
    pub error: f64,
    /// Its standard error.
    pub error_noise: f64,
    /// Relative error of the mean of the indirect layer.
    pub bias: f64,
    /// Its standard error.
    pub bias_noise: f64,
    /// Share of what the probes see that has no point near it.
    pub without_points: f64,
    /// Share of the probes with indirect light that get none.
    pub without_light: f64,
    /// Share of what the probes see that has only points wider than the finest level's.
    pub wide: f64,
    /// The error that was asked for, if one was.
    pub target: Option<f64>,
}

/// What an estimate says of a bake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Within bounds.
    Right,
    /// It may be within or not: the probes are too noisy to tell.
    Unsure,
    /// Beyond a bound.
    Wrong,
}

impl Expected {
    /// Of an asset, if its bake has measured itself.
    pub fn of(estimates: Option<&Estimates>) -> Option<Expected> {
        let of = |name: &str| {
            let mut values = estimates.iter().flat_map(|e| &e.values);
            values.find(|e| e.0 == name).map(|e| e.1)
        };
        let or_none = |name: &str| of(name).unwrap_or(0.0);
        Some(Expected {
            error: of(ERROR)?,
            error_noise: or_none(ERROR_NOISE),
            bias: or_none(BIAS),
            bias_noise: or_none(BIAS_NOISE),
            without_points: or_none(WITHOUT_POINTS),
            without_light: or_none(WITHOUT_LIGHT),
            wide: or_none(WIDE),
            target: of(TARGET),
        })
    }

    /// Keeps it with the other estimates of an asset.
    pub fn store(&self, estimates: &mut Option<Estimates>) {
        let values = [
            (TARGET, self.target.unwrap_or(f64::NAN)),
            (ERROR, self.error),
            (ERROR_NOISE, self.error_noise),
            (BIAS, self.bias),
            (BIAS_NOISE, self.bias_noise),
            (WITHOUT_POINTS, self.without_points),
            (WITHOUT_LIGHT, self.without_light),
            (WIDE, self.wide),
        ];
        let known = estimates.get_or_insert_with(Estimates::default);
        let finite = values.into_iter().filter(|value| value.1.is_finite());
        known
            .values
            .extend(finite.map(|(name, value)| (name.to_owned(), value)));
    }

    /// Whether an error was asked for and missed by more than noise, or a bias in spite of it is beyond bounds.
    pub fn missed(&self) -> bool {
        (self.target).is_some_and(|target| {
            self.least_error() > CLOSE_ENOUGH * target || self.verdict() == Verdict::Wrong
        })
    }

    /// What the error is at least, but for noise. It is relMSE that is as much too large as too small, not its root: where one window says it
    /// all, nothing is sure.
    fn least_error(&self) -> f64 {
        let square = self.error.powi(2);
        let noise = (self.error + self.error_noise).powi(2) - square;
        (square - DOUBT * noise).max(0.0).sqrt()
    }

    /// Whether it is beyond bounds by more than noise. Who errs by more than a bound in measuring knows nothing of it.
    pub fn verdict(&self) -> Verdict {
        let beyond = |value: f64, noise: f64, least: f64, most: f64| match least > most {
            true => Verdict::Wrong,
            false if value > most || noise > most => Verdict::Unsure,
            false => Verdict::Right,
        };
        let (bias, noise) = (self.bias.abs(), self.bias_noise);
        let bias = beyond(bias, noise, bias - DOUBT * noise, MOST_BIAS);
        let error = beyond(self.error, self.error_noise, self.least_error(), MOST_ERROR);
        match (bias, error) {
            (Verdict::Wrong, _) | (_, Verdict::Wrong) => Verdict::Wrong,
            (Verdict::Unsure, _) | (_, Verdict::Unsure) => Verdict::Unsure,
            _ => Verdict::Right,
        }
    }

    /// What is to be said, loudly where the verdict is [`Verdict::Wrong`]: why, and what mends it; `None` where all is within bounds. `radius`: the coarse radius, metres, if one
    /// was given.
    pub fn complaint(&self, radius: Option<f32>) -> Option<String> {
        let found = format!("its indirect light {}", self.words());
        match self.verdict() {
            Verdict::Right => None,
            Verdict::Unsure => Some(format!(
                "the probes are too noisy to tell whether this asset is right: {found}. A finer bake has more of them."
            )),
            Verdict::Wrong => Some(format!(
                "this asset is wrong: {found} (more than {} or {}). {}",
                percent(MOST_ERROR),
                percent(MOST_BIAS),
                self.reasons(radius)
            )),
        }
    }

    /// Error and bias, each with its standard error.
    fn words(&self) -> String {
        format!(
            "is expected to err by {:.1} ± {:.1} %, with a bias of {:+.1} ± {:.1} %",
            100.0 * self.error,
            100.0 * self.error_noise,
            100.0 * self.bias,
            100.0 * self.bias_noise
        )
    }

    /// Why, and what mends it.
    fn reasons(&self, radius: Option<f32>) -> String {
        let mut all = Vec::new();
        if self.without_points > REASON {
            all.push(format!(
                "{} of what the probes see has no points, since no light was followed from there: name a place that sees it with \
                 --viewpoint X,Y,Z.",
                percent(self.without_points)
            ));
        }
        if self.wide > REASON_WIDE {
            all.push(format!(
                "{} of what they see has coarse points only: name the place that is looked from with --viewpoint X,Y,Z, or give a \
                 smaller --coarse-radius.",
                percent(self.wide)
            ));
        }
        if self.without_light > REASON {
            all.push(format!(
                "{} of the probes get no indirect light at all, since no link leads there: a smaller --epsilon keeps more links.",
                percent(self.without_light)
            ));
        }
        all.push(match radius {
            Some(radius) => format!(
                "Points may be too far apart: leave --coarse-radius out, or give less than {radius} m; --preset fine errs less, too."
            ),
            None => "Finer points and more links err less: --preset fine, or --lights with the lights that will be played.".into(),
        });
        all.join(" ")
    }
}

/// One line on the error that a bake expects of its asset, if it has measured itself.
pub fn line(estimates: Option<&Estimates>) -> Option<String> {
    let expected = Expected::of(estimates)?;
    let asked = (expected.target).map_or_else(String::new, |t| format!(" (--target-error {})", percent(t)));
    let doubt = match expected.verdict() {
        Verdict::Right => "",
        Verdict::Unsure => "; the probes were too noisy to tell whether that is so",
        Verdict::Wrong => "; that is wrong, bake finer",
    };
    Some(format!("indirect light {}{asked}{doubt}", expected.words()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_alone_never_accuses() {
        let of = |bias, bias_noise, error, error_noise| {
            Expected {
                bias,
                bias_noise,
                error,
                error_noise,
                ..Expected::default()
            }
            .verdict()
        };
        assert_eq!(of(-0.04, 0.0, 0.2, 0.0), Verdict::Right);
        assert_eq!(of(-0.12, 0.04, 0.2, 0.0), Verdict::Unsure);
        assert_eq!(of(-0.12, 0.03, 0.2, 0.0), Verdict::Wrong);
        assert_eq!(of(0.0, 0.0, 0.4, 0.1), Verdict::Unsure);
        assert_eq!(of(0.0, 0.0, 0.4, 0.01), Verdict::Wrong);
        // Probes that see one bright spot each know nothing, least of all that there is no error.
        assert_eq!(of(0.0, 0.0, 0.0, 0.7), Verdict::Unsure);
        assert_eq!(of(0.0, 0.06, 0.1, 0.01), Verdict::Unsure);
        // One window of many: its square is known to itself.
        let one = 9.0f64;
        assert_eq!(of(0.0, 0.0, one, one * (2f64.sqrt() - 1.0)), Verdict::Unsure);
    }

    #[test]
    fn what_is_stored_is_read_again() {
        let expected = Expected {
            error: 0.1,
            error_noise: 0.01,
            bias: -0.02,
            bias_noise: 0.003,
            without_points: 0.5,
            without_light: 0.25,
            wide: 0.125,
            target: None,
        };
        let mut estimates = None;
        expected.store(&mut estimates);
        assert_eq!(Expected::of(estimates.as_ref()), Some(expected));
        assert_eq!(
            line(estimates.as_ref()).unwrap(),
            "indirect light is expected to err by 10.0 ± 1.0 %, with a bias of -2.0 ± 0.3 %"
        );
    }
}
