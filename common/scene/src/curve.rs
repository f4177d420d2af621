//! Numbers that may change over time.

/// A number over time; instants are seconds from image 0.
#[derive(Clone, PartialEq, Debug, serde::Serialize, serde::Deserialize)]
pub enum Curve {
    /// The same at every instant.
    Constant(f64),
    /// Straight lines between (instant, value) keys, constant outside; instants rise.
    Linear(Vec<(f64, f64)>),
    /// Monotone cubic through (instant, value) keys, constant outside; instants rise.
    Smooth(Vec<(f64, f64)>),
}

impl Curve {
    /// The value at an instant; 0 for a curve without keys, which no valid scene holds.
    ///
    /// Between two keys the value never leaves the range of their two values.
    pub fn at(&self, time: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Linear(keys) => between(keys, time, |span| {
                span.low.1 + (span.high.1 - span.low.1) * span.u
            }),
            Self::Smooth(keys) => between(keys, time, |span| hermite(keys, span)),
        }
    }

    /// The least and the largest value over all time; `None` for a curve without keys.
    pub fn extremes(&self) -> Option<(f64, f64)> {
        let values = self.values();
        let first = values.first().copied()?;
        Some(values.iter().fold((first, first), |(low, high), &value| {
            (
                if value < low { value } else { low },
                if value > high { value } else { high },
            )
        }))
    }

    /// Its keys' values, in order.
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::Constant(value) => vec![*value],
            Self::Linear(keys) | Self::Smooth(keys) => keys.iter().map(|key| key.1).collect(),
        }
    }

    /// Its keys; none for a constant.
    pub fn keys(&self) -> &[(f64, f64)] {
        match self {
            Self::Constant(_) => &[],
            Self::Linear(keys) | Self::Smooth(keys) => keys,
        }
    }
}

impl From<f64> for Curve {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

/// The two keys around an instant, and how far it is from one to the other, 0 … 1.
struct Span {
    index: usize,
    low: (f64, f64),
    high: (f64, f64),
    u: f64,
}

fn between(keys: &[(f64, f64)], time: f64, value: impl FnOnce(Span) -> f64) -> f64 {
    let after = keys.partition_point(|key| key.0 <= time);
    match (after.checked_sub(1), keys.get(after)) {
        (Some(index), Some(&high)) => {
            let low = keys[index];
            value(Span {
                index,
                low,
                high,
                u: (time - low.0) / (high.0 - low.0),
            })
        }
        (Some(last), None) => keys[last].1,
        (None, Some(first)) => first.1,
        (None, None) => 0.0,
    }
}

/// Cubic Hermite with the slopes of Fritsch and Butland (1984), which keep it monotone.
fn hermite(keys: &[(f64, f64)], span: Span) -> f64 {
    let width = span.high.0 - span.low.0;
    let (m0, m1) = (
        slope_at(keys, span.index) * width,
        slope_at(keys, span.index + 1) * width,
    );
    let u = span.u;
    let v = 1.0 - u;
    let value = span.low.1 * (v * v * (1.0 + 2.0 * u))
        + span.high.1 * (u * u * (1.0 + 2.0 * v))
        + m0 * (u * v * v)
        - m1 * (u * u * v);
    // Rounding alone could leave the keys' range.
    let (low, high) = if span.low.1 < span.high.1 {
        (span.low.1, span.high.1)
    } else {
        (span.high.1, span.low.1)
    };
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// Weighted harmonic mean of the neighbouring slopes; 0 at both ends and at every extremum.
fn slope_at(keys: &[(f64, f64)], index: usize) -> f64 {
    if index == 0 || index + 1 == keys.len() {
        return 0.0;
    }
    let (a, b, c) = (keys[index - 1], keys[index], keys[index + 1]);
    let (h0, h1) = (b.0 - a.0, c.0 - b.0);
    let (d0, d1) = ((b.1 - a.1) / h0, (c.1 - b.1) / h1);
    if d0 * d1 <= 0.0 {
        return 0.0;
    }
    let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
    (w0 + w1) / (w0 / d0 + w1 / d1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn curves_pass_through_their_keys_and_stay_constant_outside() {
        let keys = vec![(0.0, 1.0), (1.0, 3.0), (4.0, -2.0)];
        for curve in [Curve::Linear(keys.clone()), Curve::Smooth(keys.clone())] {
            for &(time, value) in &keys {
                assert_eq!(curve.at(time), value);
            }
            assert_eq!(curve.at(-5.0), 1.0);
            assert_eq!(curve.at(9.0), -2.0);
            assert_eq!(curve.extremes(), Some((-2.0, 3.0)));
        }
        assert_eq!(Curve::Linear(keys).at(0.5), 2.0);
        assert_eq!(Curve::Constant(7.0).at(1e9), 7.0);
    }

    proptest! {
        #[test]
        fn smooth_curves_never_overshoot(
            steps in prop::collection::vec((0.01f64..10.0, -100.0f64..100.0), 2..20),
            u in 0.0f64..1.0,
        ) {
            let mut time = 0.0;
            let keys: Vec<_> = steps
                .into_iter()
                .map(|(step, value)| { time += step; (time, value) })
                .collect();
            let curve = Curve::Smooth(keys.clone());
            for pair in keys.windows(2) {
                let value = curve.at(pair[0].0 + (pair[1].0 - pair[0].0) * u);
                let (low, high) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
                prop_assert!((low..=high).contains(&value));
            }
        }
    }
}
