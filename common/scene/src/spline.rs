//! The natural cubic spline through places: C², so that a camera on it never jerks.

use crate::vector::Vector;

/// A spline through places; constant before its first and after its last instant.
#[derive(Clone, Debug)]
pub(crate) struct Spline {
    times: Vec<f64>,
    places: Vec<Vector>,
    /// Second derivatives at the keys; zero at both ends.
    bends: Vec<Vector>,
}

impl Spline {
    /// The spline through (instant, place) keys, whose instants rise.
    pub(crate) fn new(keys: impl Iterator<Item = (f64, Vector)>) -> Self {
        let (times, places): (Vec<_>, Vec<_>) = keys.unzip();
        let bends = second_derivatives(&times, &places);
        Self {
            times,
            places,
            bends,
        }
    }

    /// The place at an instant; the origin for a spline without keys.
    pub(crate) fn at(&self, time: f64) -> Vector {
        let after = self.times.partition_point(|&key| key <= time);
        let Some(i) = after.checked_sub(1) else {
            return self.places.first().copied().unwrap_or_default();
        };
        if after == self.times.len() {
            return self.places[i];
        }
        let width = self.times[after] - self.times[i];
        let b = (time - self.times[i]) / width;
        let a = 1.0 - b;
        let bend = width * width / 6.0;
        let (ca, cb) = ((a * a * a - a) * bend, (b * b * b - b) * bend);
        std::array::from_fn(|k| {
            a * self.places[i][k]
                + b * self.places[after][k]
                + ca * self.bends[i][k]
                + cb * self.bends[after][k]
        })
    }
}

/// Solves the tridiagonal system of the natural spline (Thomas' algorithm), each axis by itself.
fn second_derivatives(times: &[f64], places: &[Vector]) -> Vec<Vector> {
    let count = times.len();
    let mut bends = vec![[0.0; 3]; count];
    if count < 3 {
        return bends;
    }
    let mut upper = vec![0.0; count];
    for i in 1..count - 1 {
        let (h0, h1) = (times[i] - times[i - 1], times[i + 1] - times[i]);
        let pivot = 2.0 * (h0 + h1) - h0 * upper[i - 1];
        upper[i] = h1 / pivot;
        for k in 0..3 {
            let jump =
                (places[i + 1][k] - places[i][k]) / h1 - (places[i][k] - places[i - 1][k]) / h0;
            bends[i][k] = (6.0 * jump - h0 * bends[i - 1][k]) / pivot;
        }
    }
    for i in (1..count - 1).rev() {
        let after = bends[i + 1];
        for (bend, after) in bends[i].iter_mut().zip(after) {
            *bend -= upper[i] * after;
        }
    }
    bends
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_its_keys_with_continuous_slope_and_bend() {
        let keys = [
            (0.0, [0.0, 1.0, 2.0]),
            (1.0, [3.0, 1.0, -1.0]),
            (1.5, [4.0, 0.0, 0.0]),
            (4.0, [0.0, 0.0, 9.0]),
        ];
        let spline = Spline::new(keys.into_iter());
        for (time, place) in keys {
            assert_eq!(spline.at(time), place);
        }
        assert_eq!(spline.at(-1.0), keys[0].1);
        assert_eq!(spline.at(5.0), keys[3].1);
        let h = 1e-4;
        for (time, _) in &keys[1..3] {
            for k in 0..3 {
                let f = |t: f64| spline.at(time + t)[k];
                let slopes = ((f(0.0) - f(-h)) / h, (f(h) - f(0.0)) / h);
                assert!((slopes.0 - slopes.1).abs() < 1e-2, "slope at {time}");
                let bends = (
                    (f(-2.0 * h) - 2.0 * f(-h) + f(0.0)) / (h * h),
                    (f(2.0 * h) - 2.0 * f(h) + f(0.0)) / (h * h),
                );
                assert!(
                    (bends.0 - bends.1).abs() < 0.05,
                    "bend at {time}: {bends:?}"
                );
            }
        }
    }
}
