//! Alias table: draws an index in proportion to its weight in constant time (Walker 1977, Vose 1991).

/// A discrete distribution. Equal weights give equal tables: construction has a fixed order.
#[derive(Clone, Debug)]
pub(super) struct AliasTable {
    /// Chance to keep entry `i` rather than its alias.
    keep: Vec<f32>,
    alias: Vec<u32>,
    /// Weight of each entry over the sum of all.
    probability: Vec<f32>,
}

impl AliasTable {
    /// `None` if no weight is above zero. Weights that are not finite or not above zero count as zero.
    pub fn new(weights: &[f64]) -> Option<AliasTable> {
        let weights: Vec<f64> = weights
            .iter()
            .map(|&w| if w.is_finite() && w > 0.0 { w } else { 0.0 })
            .collect();
        let peak = weights.iter().copied().fold(0.0, f64::max);
        if peak <= 0.0 {
            return None;
        }
        // Relative to the largest, so that the sum cannot overflow.
        let total: f64 = weights.iter().map(|w| w / peak).sum();
        let n = weights.len();
        let probability: Vec<f64> = weights.iter().map(|w| w / peak / total).collect();
        let mut scaled: Vec<f64> = probability.iter().map(|p| p * n as f64).collect();
        let (mut small, mut large) = (Vec::new(), Vec::new());
        for (i, &s) in scaled.iter().enumerate() {
            if s < 1.0 { small.push(i) } else { large.push(i) }
        }
        let mut keep = vec![1.0f32; n];
        let mut alias: Vec<u32> = (0..n as u32).collect();
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            keep[s] = scaled[s] as f32;
            alias[s] = l as u32;
            scaled[l] = (scaled[l] + scaled[s]) - 1.0;
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // What rounding leaves in `small` belongs to itself, except that nothing may draw a weight of zero.
        if let Some(best) = (0..n).find(|&i| weights[i] == peak) {
            for s in small.into_iter().filter(|&s| weights[s] <= 0.0) {
                (keep[s], alias[s]) = (0.0, best as u32);
            }
        }
        Some(AliasTable {
            keep,
            alias,
            probability: probability.iter().map(|&p| p as f32).collect(),
        })
    }

    /// An index, from a random number in [0, 1).
    pub fn sample(&self, random: f32) -> usize {
        let place = f64::from(random) * self.keep.len() as f64;
        let i = (place as usize).min(self.keep.len() - 1);
        if (place - i as f64) < f64::from(self.keep[i]) {
            i
        } else {
            self.alias[i] as usize
        }
    }

    /// Probability of index `i`.
    pub fn probability(&self, i: usize) -> f32 {
        self.probability[i]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: the weights themselves; 10^6 evenly spaced numbers find each share to 1e-5.
    #[test]
    fn shares_are_proportional_to_weights() {
        for weights in [
            vec![3.0, 0.0, 1.0, 4.0],
            vec![1.0],
            vec![1e-300, 1e300],
            vec![0.0, f64::NAN, 2.0],
        ] {
            let table = AliasTable::new(&weights).unwrap();
            let n = 1_000_000;
            let mut count = vec![0; weights.len()];
            (0..n).for_each(|i| count[table.sample((i as f32 + 0.5) / n as f32)] += 1);
            for (i, c) in count.iter().enumerate() {
                assert!((f64::from(*c) / f64::from(n) - f64::from(table.probability(i))).abs() < 1e-5);
            }
        }
        assert!(AliasTable::new(&[]).is_none() && AliasTable::new(&[0.0, -1.0]).is_none());
    }
}
