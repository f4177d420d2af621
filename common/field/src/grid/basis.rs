//! Uniform B-splines of degree 1 to 3 (thesis appendix A, orders 2 to 4): which samples count at a place, and how much.

/// Most samples that count along an axis.
pub(super) const TAPS: usize = 4;

/// The samples that count along one axis: `first` and as many after it as the degree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taps {
    pub(super) first: i64,
    pub(super) weights: [f64; TAPS],
}

/// Which derivative of the basis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Order {
    Value,
    Slope,
    Bend,
}

/// The first sample that counts at a place, and how far the place is from the basis's origin there.
#[expect(
    clippy::cast_possible_truncation,
    reason = "`as` saturates, and far from every grid any sample is right; of no number it is 0, whose offset is none either"
)]
pub(super) fn first(degree: u32, at: f64) -> (i64, f64) {
    let base = libm::floor(if degree == 2 { at + 0.5 } else { at });
    let first = base as i64;
    (
        first.saturating_sub(if degree == 1 { 0 } else { 1 }),
        at - base,
    )
}

/// The weights of the samples around a place, or of their differences' sums.
pub(super) fn taps(degree: u32, order: Order, at: f64) -> Taps {
    let (first, t) = first(degree, at);
    let weights = match (degree, order) {
        (1, Order::Value) => [1.0 - t, t, 0.0, 0.0],
        (1, Order::Slope) => [-1.0, 1.0, 0.0, 0.0],
        (1, Order::Bend) => [0.0; TAPS],
        (2, Order::Value) => {
            let (a, b) = (0.5 - t, 0.5 + t);
            [0.5 * a * a, 0.75 - t * t, 0.5 * b * b, 0.0]
        }
        (2, Order::Slope) => [t - 0.5, -2.0 * t, t + 0.5, 0.0],
        (2, Order::Bend) => [1.0, -2.0, 1.0, 0.0],
        (_, Order::Value) => {
            let s = 1.0 - t;
            let sixth = 1.0 / 6.0;
            [
                sixth * (s * s * s),
                sixth * ((3.0 * t - 6.0) * t * t + 4.0),
                sixth * ((3.0 * s - 6.0) * s * s + 4.0),
                sixth * (t * t * t),
            ]
        }
        (_, Order::Slope) => {
            let s = 1.0 - t;
            [
                -0.5 * (s * s),
                t * (1.5 * t - 2.0),
                -s * (1.5 * s - 2.0),
                0.5 * (t * t),
            ]
        }
        (_, Order::Bend) => {
            let s = 1.0 - t;
            [s, 3.0 * t - 2.0, 3.0 * s - 2.0, t]
        }
    };
    Taps { first, weights }
}
