//! How much the images of a job differ in what they cost, and so how far the rest may be from the mean.
//!
//! Neighbouring images resemble each other, so that ten of them say less of the rest than ten drawn by lot: numbers of
//! images are divided by (1 + ρ)/(1 − ρ), with ρ the correlation of an image with the one before it.

/// The largest cost of an image that is counted; more is taken for this. Squares of a million such fit.
const COST_MAX: u64 = 1 << 40;

/// Parts in which the spread is counted.
pub(crate) const PARTS: u64 = 1_000;

/// Where so few images are measured that nothing can be said of their spread.
const UNKNOWN: u64 = PARTS / 2;

/// What is always possible: workers that are slowed down, encoding, the last tiles.
const LEAST: u64 = PARTS / 12;

/// The correlation that is counted at most, in parts.
const CORRELATION_MAX: i128 = 980;

/// What the images of a job cost, in the order in which they were finished.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spread {
    count: u32,
    sum: u128,
    squares: u128,
    /// Of each with the one before it.
    products: u128,
    last: u64,
}

impl Spread {
    /// Notes what an image cost.
    pub(crate) fn note(&mut self, cost: u64) {
        let cost = cost.min(COST_MAX);
        self.products += u128::from(cost) * u128::from(self.last);
        self.count = self.count.saturating_add(1);
        self.sum += u128::from(cost);
        self.squares += u128::from(cost) * u128::from(cost);
        self.last = cost;
    }

    /// How far the mean of `left` further images may be from that of these, in parts of [`PARTS`] of it: about
    /// one and a half standard deviations.
    pub(crate) fn of(&self, left: u32) -> u64 {
        let n = i128::from(self.count);
        if n < 3 || self.sum == 0 {
            return UNKNOWN;
        }
        let signed = |value: u128| i128::try_from(value).unwrap_or(i128::MAX);
        let mean = signed(self.sum) / n;
        let variance = (signed(self.squares) - mean * mean * n) / (n - 1);
        if variance <= 0 || mean <= 0 {
            return LEAST;
        }
        let covariance = signed(self.products) / (n - 1) - mean * mean;
        let correlation = (covariance.saturating_mul(1_000) / variance).clamp(0, CORRELATION_MAX);
        let independent = |images: i128| {
            (images * 1_000 * (1_000 - correlation) / (1_000 + correlation)).max(1_000)
        };
        let (seen, left) = (independent(n), independent(i128::from(left.max(1))));
        // In millionths of the mean's square.
        let relative = variance.saturating_mul(1_000_000) / (mean * mean).max(1);
        let error = relative.saturating_mul(1_000) / seen + relative.saturating_mul(1_000) / left;
        let parts = u128::try_from(error).unwrap_or(0).isqrt() * 3 / 2;
        u64::try_from(parts)
            .unwrap_or(u64::MAX)
            .clamp(LEAST, 2 * PARTS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn images_that_are_alike_are_told_closely_and_others_widely() {
        let mut spread = Spread::default();
        assert_eq!(spread.of(10), UNKNOWN);
        for _ in 0..20 {
            spread.note(1_000_000);
        }
        assert_eq!(spread.of(100), LEAST);
        let of = |costs: &[u64]| {
            let mut spread = Spread::default();
            costs.iter().for_each(|&cost| spread.note(cost));
            spread.of(100)
        };
        let by_turns: Vec<u64> = (0..40).map(|image| 800_000 + image % 2 * 400_000).collect();
        let in_two_halves: Vec<u64> = (0..40)
            .map(|image| 800_000 + image / 20 * 400_000)
            .collect();
        let (by_turns, in_two_halves) = (of(&by_turns), of(&in_two_halves));
        assert!((LEAST..120).contains(&by_turns), "{by_turns}");
        assert!(in_two_halves > 3 * by_turns, "{in_two_halves} {by_turns}");
    }

    #[test]
    fn the_largest_costs_do_not_overflow() {
        let mut spread = Spread::default();
        for image in 0..1_000_000_u64 {
            spread.note(u64::MAX >> (image % 2));
        }
        assert_eq!(spread.of(u32::MAX), LEAST);
    }
}
