//! Numbers as the tables print them: what is not known is a dash.

use relight_scene::image::flicker::Flicker;

const UNKNOWN: &str = "–";

/// So many digits after the point.
pub fn fixed(x: f64, digits: usize) -> String {
    if x.is_finite() {
        format!("{x:.digits$}")
    } else {
        UNKNOWN.into()
    }
}

/// A count, its thousands apart: `212,422`.
pub fn whole(x: f64) -> String {
    let mut text = fixed(x, 0);
    let digits = text.len();
    if x.is_finite() {
        for at in (1..digits).filter(|at| (digits - at).is_multiple_of(3)).rev() {
            text.insert(at, ',');
        }
    }
    text
}

/// `14.8 %`.
pub fn percent(x: f64) -> String {
    within(x, None)
}

/// `14.8 ± 1.2 %`.
pub fn within(x: f64, noise: impl Into<Option<f64>>) -> String {
    unit(fixed(100.0 * x, 1), noise.into())
}

/// `-2.3 ± 0.4 %`, with a sign.
pub fn signed(x: f64, noise: impl Into<Option<f64>>) -> String {
    match x.is_finite() {
        true => unit(format!("{:+.1}", 100.0 * x), noise.into()),
        false => UNKNOWN.into(),
    }
}

/// `0.04, 1.5, 5.7`, in per cent; two digits of each.
pub fn percentiles(flicker: Option<Flicker>) -> String {
    let digits = |x: f64| match 100.0 * x {
        0.0 => "0".into(),
        x => fixed(x, (1.0 - x.abs().log10().floor()).clamp(0.0, 6.0) as usize),
    };
    match flicker {
        Some(found) => [found.median, found.p99, found.p999].map(digits).join(", "),
        None => "no light".into(),
    }
}

fn unit(text: String, noise: Option<f64>) -> String {
    match noise.filter(|noise| noise.is_finite()) {
        _ if text == UNKNOWN => text,
        Some(noise) => format!("{text} ± {:.1} %", 100.0 * noise),
        None => format!("{text} %"),
    }
}
