//! Curves through keys: numbers that change with another number, mostly time.

use crate::interval::Interval;

/// How the keys of a curve are joined.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Join {
    /// By straight lines.
    Linear,
    /// By cubics that never leave the range of the two keys they join and whose
    /// slopes agree at keys (Fritsch and Butland 1984); flat at both ends.
    Smooth,
}

/// A curve through keys, constant before the first and after the last.
#[derive(Clone, PartialEq, Debug)]
pub struct Curve {
    at: Vec<f64>,
    value: Vec<f64>,
    slope: Vec<f64>,
    join: Join,
}

impl Curve {
    /// The curve through `keys`: pairs of an instant and a value, as a flat list. Instants rise; there is at least one.
    pub fn new(join: Join, keys: &[f64]) -> Self {
        let at: Vec<f64> = keys.iter().copied().step_by(2).collect();
        let value: Vec<f64> = keys.iter().copied().skip(1).step_by(2).collect();
        let slope = slopes(&at, &value);
        Self {
            at,
            value,
            slope,
            join,
        }
    }

    /// The value at `t`. NaN at NaN.
    pub fn value(&self, t: f64) -> f64 {
        match self.segment(t) {
            Place::Constant(value) => value,
            Place::Between(i) => self.within(i, t).0,
        }
    }

    /// The value and the derivative at `t`; at a corner, that of the right side.
    pub fn value_slope(&self, t: f64) -> (f64, f64) {
        match self.segment(t) {
            Place::Constant(value) => (value, 0.0),
            Place::Between(i) => self.within(i, t),
        }
    }

    /// The value and the first two derivatives at `t`; at a corner, those of the right side.
    pub fn value_slope_bend(&self, t: f64) -> (f64, f64, f64) {
        let (value, slope) = self.value_slope(t);
        let bend = match self.segment(t) {
            Place::Between(i) if self.join == Join::Smooth => {
                let width = self.at[i + 1] - self.at[i];
                let u = (t - self.at[i]) / width;
                let rise = self.value[i + 1] - self.value[i];
                let (m, n) = (self.slope[i] * width, self.slope[i + 1] * width);
                let (c, d) = (3.0 * rise - 2.0 * m - n, m + n - 2.0 * rise);
                (2.0 * c + u * (6.0 * d)) / (width * width)
            }
            _ => 0.0,
        };
        (value, slope, bend)
    }

    /// All values over `t`.
    pub fn range(&self, t: Interval) -> Interval {
        let mut range =
            Interval::point(self.value(t.low)).hull(Interval::point(self.value(t.high)));
        for (&at, &value) in self.at.iter().zip(&self.value) {
            if at >= t.low && at <= t.high {
                range = range.hull(Interval::point(value));
            }
        }
        range
    }

    /// The one value over all of `t`, if there is just one.
    pub fn constant_over(&self, t: Interval) -> Option<f64> {
        let range = self.range(t);
        (range.low == range.high).then_some(range.low)
    }

    /// A bound of the derivative over `t`.
    pub fn slope_max(&self, t: Interval) -> f64 {
        let mut steepest = 0.0;
        for i in 0..self.at.len() - 1 {
            if self.at[i + 1] < t.low || self.at[i] > t.high {
                continue;
            }
            let chord = ((self.value[i + 1] - self.value[i]) / (self.at[i + 1] - self.at[i])).abs();
            let slope = match self.join {
                Join::Linear => chord,
                // Hermite's derivative is a quadratic: a convex mix of at most 3/2 of the chord and the ends' slopes.
                Join::Smooth => 1.5 * chord + self.slope[i].abs() + self.slope[i + 1].abs(),
            };
            if slope > steepest {
                steepest = slope;
            }
        }
        steepest
    }

    fn segment(&self, t: f64) -> Place {
        let last = self.at.len() - 1;
        if t.is_nan() {
            return Place::Constant(t);
        }
        match self.at.partition_point(|&at| at <= t) {
            0 => Place::Constant(self.value[0]),
            after if after > last => Place::Constant(self.value[last]),
            after => Place::Between(after - 1),
        }
    }

    fn within(&self, i: usize, t: f64) -> (f64, f64) {
        let (a, b) = (self.value[i], self.value[i + 1]);
        let width = self.at[i + 1] - self.at[i];
        let u = (t - self.at[i]) / width;
        let rise = b - a;
        match self.join {
            Join::Linear => (a + u * rise, rise / width),
            Join::Smooth => {
                let (m, n) = (self.slope[i] * width, self.slope[i + 1] * width);
                let c = 3.0 * rise - 2.0 * m - n;
                let d = m + n - 2.0 * rise;
                let value = a + u * (m + u * (c + u * d));
                (value, (m + u * (2.0 * c + u * (3.0 * d))) / width)
            }
        }
    }
}

enum Place {
    Constant(f64),
    Between(usize),
}

/// The slopes at the keys: weighted harmonic means of the chords beside them, 0 at extrema and ends.
fn slopes(at: &[f64], value: &[f64]) -> Vec<f64> {
    let mut slopes = vec![0.0; at.len()];
    for i in 1..at.len().saturating_sub(1) {
        let (before, after) = (at[i] - at[i - 1], at[i + 1] - at[i]);
        let p = (value[i] - value[i - 1]) / before;
        let q = (value[i + 1] - value[i]) / after;
        if p * q > 0.0 {
            let (v, w) = (2.0 * after + before, after + 2.0 * before);
            slopes[i] = (v + w) / (v / p + w / q);
        }
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEYS: [f64; 8] = [0.0, 1.0, 1.0, 3.0, 4.0, 3.0, 5.0, -2.0];

    #[test]
    fn curves_pass_through_their_keys_and_stay_between_them() {
        for join in [Join::Linear, Join::Smooth] {
            let curve = Curve::new(join, &KEYS);
            for key in KEYS.chunks(2) {
                assert_eq!(curve.value(key[0]), key[1]);
            }
            assert_eq!(curve.value(-9.0), 1.0);
            assert_eq!(curve.value(f64::INFINITY), -2.0);
            assert_eq!(curve.constant_over(Interval::new(1.0, 4.0)), Some(3.0));
            assert_eq!(curve.constant_over(Interval::new(0.9, 4.0)), None);
            let all = Interval::new(-1.0, 6.0);
            let steepest = curve.slope_max(all);
            for i in 0..=700 {
                let t = f64::from(i) * 0.01 - 1.0;
                let (value, slope) = curve.value_slope(t);
                assert!((-2.0..=3.0).contains(&value), "{join:?} {t}: {value}");
                assert!(slope.abs() <= steepest, "{join:?} {t}: {slope}");
                assert_eq!(value, curve.value(t));
            }
        }
    }

    #[test]
    fn smooth_curves_have_no_corners() {
        let curve = Curve::new(Join::Smooth, &KEYS);
        for at in [0.0, 1.0, 4.0, 5.0] {
            let (before, after) = (
                curve.value_slope(at - 1e-9).1,
                curve.value_slope(at + 1e-9).1,
            );
            assert!((before - after).abs() < 1e-6, "{at}: {before} {after}");
        }
    }

    #[test]
    fn one_key_is_a_constant() {
        assert_eq!(Curve::new(Join::Smooth, &[3.0, 7.0]).value(99.0), 7.0);
    }
}
