//! Ticks of a logarithmic axis: round numbers, so many that one reads values between them, so few that their labels have room.

/// Ticks fewer than this say nothing of values between them.
const LEAST: usize = 3;
/// More than this are no longer looked at one by one.
const MOST: usize = 9;

/// Round numbers within a range, of at most one digit that changes from one to the next.
pub fn ticks(low: f64, high: f64) -> Vec<f64> {
    let within = |value: &f64| *value >= low && *value <= high;
    let decades = |factors: &[f64]| -> Vec<f64> {
        let exponents = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let all = exponents.flat_map(|e| factors.iter().map(move |f| f * 10f64.powi(e)));
        all.filter(within).collect()
    };
    for factors in [&[1.0][..], &[1.0, 3.0], &[1.0, 2.0, 5.0]] {
        let found = decades(factors);
        if (LEAST..=MOST).contains(&found.len()) {
            return found;
        }
    }
    if high > 1e3 * low {
        // More decades than ticks: every so many.
        let found = decades(&[1.0]);
        return found
            .iter()
            .copied()
            .step_by(found.len().div_ceil(MOST))
            .collect();
    }
    // Within a decade: the widest even steps that leave enough ticks. They grow by 2.5 at most, so the next wider step's two
    // ticks at most mean fewer than 7.5 of these.
    let power = 10f64.powf((high - low).log10().floor());
    let even = |step: f64| -> Vec<f64> {
        let first = (low / step).ceil() as i64;
        let all = (first..).map(|i| i as f64 * step);
        all.take_while(|v| *v <= high).collect()
    };
    let steps = [5.0, 2.0, 1.0, 0.5, 0.2].map(|f| f * power);
    let mut tried = steps.into_iter().map(even);
    tried.find(|found| found.len() >= LEAST).unwrap_or_default()
}

/// A number of an axis without digits that say nothing.
pub fn label(value: f64) -> String {
    let digits = (2 - value.abs().max(1e-12).log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_ticks_whatever_their_range() {
        // Ends anywhere within a decade, and from a tenth to fifteen decades between them.
        let lows = (0..200).map(|i| 10f64.powf(-4.0 + 0.0371 * f64::from(i)));
        let ratios: Vec<f64> = (0..200).map(|i| 1.1 * 10f64.powf(0.075 * f64::from(i))).collect();
        for (low, high) in lows.flat_map(|low| ratios.iter().map(move |r| (low, r * low))) {
            let found = ticks(low, high);
            assert!((LEAST..=MOST).contains(&found.len()), "{low} {high}: {found:?}");
            assert!(found.iter().all(|v| *v >= low && *v <= high));
            assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
            let labels: Vec<String> = found.iter().map(|v| label(*v)).collect();
            assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
        }
        assert_eq!(ticks(0.9, 1200.0), [1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(
            [0.02, 0.5, 1.0, 300.0, 6.75].map(label),
            ["0.02", "0.5", "1", "300", "6.75"]
        );
    }
}
