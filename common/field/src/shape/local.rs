//! Numbers that stand at one place: a shape may branch on where that is.

use crate::number::{Dual, Number};

/// A number with a definite value, and perhaps derivatives.
///
/// Shapes look at the value to choose a branch (the nearest segment, the support of a kernel) and
/// then compute with the whole number, so that value and derivatives come from one text.
pub(crate) trait Local: Number {
    /// Its value.
    fn at(&self) -> f64;

    /// A function of this number that has there the value, the first and the second derivative of `jet`.
    fn through(self, jet: [f64; 3]) -> Self;
}

impl Local for f64 {
    #[inline(always)]
    fn at(&self) -> f64 {
        *self
    }

    #[inline(always)]
    fn through(self, [value, ..]: [f64; 3]) -> Self {
        value
    }
}

impl<const N: usize> Local for Dual<N> {
    #[inline(always)]
    fn at(&self) -> f64 {
        self.value
    }

    #[inline(always)]
    fn through(self, [value, slope, _]: [f64; 3]) -> Self {
        self.chain(value, slope)
    }
}

/// arctan.
#[inline]
pub(crate) fn atan<N: Local>(a: N) -> N {
    let x = a.at();
    let inverse = 1.0 / (1.0 + x * x);
    a.through([libm::atan(x), inverse, -2.0 * x * inverse * inverse])
}

/// a · b.
#[inline(always)]
pub(crate) fn dot<N: Number>(a: [N; 3], b: [N; 3]) -> N {
    let [[x, y, z], [u, v, w]] = [a, b];
    x.mul(u).plus(y.mul(v)).plus(z.mul(w))
}

/// a less a constant.
#[inline(always)]
pub(crate) fn less<N: Number>(a: [N; 3], b: [f64; 3]) -> [N; 3] {
    let [x, y, z] = a;
    [
        x.minus(N::constant(b[0])),
        y.minus(N::constant(b[1])),
        z.minus(N::constant(b[2])),
    ]
}

/// The inner product with a constant vector.
#[inline(always)]
pub(crate) fn along<N: Number>([x, y, z]: [N; 3], axis: [f64; 3]) -> N {
    x.times(axis[0])
        .plus(y.times(axis[1]))
        .plus(z.times(axis[2]))
}

/// Vectors that are known beforehand.
pub(crate) mod fixed {
    pub(crate) type Place = [f64; 3];

    pub(crate) fn sub(a: Place, b: Place) -> Place {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
    }

    pub(crate) fn add(a: Place, b: Place) -> Place {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
    }

    pub(crate) fn scale(a: Place, by: f64) -> Place {
        a.map(|part| part * by)
    }

    pub(crate) fn dot(a: Place, b: Place) -> f64 {
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }

    pub(crate) fn cross(a: Place, b: Place) -> Place {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    }

    pub(crate) fn length(a: Place) -> f64 {
        dot(a, a).sqrt()
    }
}
