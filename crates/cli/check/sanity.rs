//! What must hold of any light.

use super::case::Measure;
use glam::DVec3;
use relight_play::frame::light::Lit;

/// That all light is finite, that light which is a sum of positive parts is nowhere negative, and that the negative
/// parts of indirect light, which differences between levels may leave, are small.
pub fn sane(lit: &Lit) -> Vec<Measure> {
    let all = || lit.emission.iter().chain(&lit.direct).chain(&lit.indirect);
    let broken = all().filter(|v| !v.is_finite()).count();
    let negative = lit
        .emission
        .iter()
        .chain(&lit.direct)
        .filter(|v| v.min_element() < 0.0)
        .count();
    let sum = |sign: f64| -> f64 {
        let parts = lit
            .indirect
            .iter()
            .map(|v| (v.as_dvec3() * sign).max(DVec3::ZERO));
        parts.sum::<DVec3>().element_sum()
    };
    let (below, above) = (sum(-1.0), sum(1.0));
    let share = if above > 0.0 { below / above } else { below };
    vec![
        Measure::none("not finite", broken, "every value must be a number"),
        Measure::none("negative direct light", negative, "a sum of non-negative parts"),
        Measure::new(
            "negative indirect light",
            share,
            1e-3,
            "share of all: what the final clamp at zero may add, below a tenth of the error",
        ),
    ]
}
