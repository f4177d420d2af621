//! Numbers that carry their derivatives by a noise's three coordinates.
//!
//! A smooth noise is written once over a [`Real`] and so yields its value
//! (4.1), its gradient (4.2) and its Hessian (4.3). All of them compute the
//! value by the same operations, so it is the same to the bit.

/// A number of f32 precision, with or without derivatives.
pub(crate) trait Real: Copy {
    /// The same everywhere.
    fn constant(value: f32) -> Self;
    /// The coordinate of that number.
    fn variable(value: f32, axis: usize) -> Self;
    /// The number alone.
    fn value(self) -> f32;
    /// a + b.
    fn plus(self, other: Self) -> Self;
    /// a − b.
    fn minus(self, other: Self) -> Self;
    /// a b.
    fn by(self, other: Self) -> Self;
    /// a times a constant.
    fn times(self, factor: f32) -> Self;
    /// a plus a constant.
    fn raised(self, by: f32) -> Self;
    /// A function of a: its value, first and second derivative there.
    fn chain(self, value: f32, slope: f32, bend: f32) -> Self;
}

/// A value and its gradient.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Jet {
    pub(crate) value: f32,
    pub(crate) gradient: [f32; 3],
}

/// A value, its gradient and its Hessian.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Jet2 {
    pub(crate) value: f32,
    pub(crate) gradient: [f32; 3],
    /// By (x, x), (y, y), (z, z), (x, y), (x, z), (y, z).
    pub(crate) hessian: [f32; 6],
}

/// The two axes of each entry of a Hessian.
const AXES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

impl Jet2 {
    /// The Hessian's row of that axis.
    #[inline(always)]
    pub(crate) fn row(&self, axis: usize) -> [f32; 3] {
        let [xx, yy, zz, xy, xz, yz] = self.hessian;
        match axis {
            0 => [xx, xy, xz],
            1 => [xy, yy, yz],
            _ => [xz, yz, zz],
        }
    }
}

impl Real for f32 {
    #[inline(always)]
    fn constant(value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn variable(value: f32, _axis: usize) -> Self {
        value
    }

    #[inline(always)]
    fn value(self) -> f32 {
        self
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self - other
    }

    #[inline(always)]
    fn by(self, other: Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn times(self, factor: f32) -> Self {
        self * factor
    }

    #[inline(always)]
    fn raised(self, by: f32) -> Self {
        self + by
    }

    #[inline(always)]
    fn chain(self, value: f32, _slope: f32, _bend: f32) -> Self {
        value
    }
}

#[inline(always)]
fn each<const N: usize>(f: impl Fn(usize) -> f32) -> [f32; N] {
    let mut list = [0.0; N];
    for (i, entry) in list.iter_mut().enumerate() {
        *entry = f(i);
    }
    list
}

impl Real for Jet {
    #[inline(always)]
    fn constant(value: f32) -> Self {
        Self {
            value,
            gradient: [0.0; 3],
        }
    }

    #[inline(always)]
    fn variable(value: f32, axis: usize) -> Self {
        Self {
            value,
            gradient: each(|i| if i == axis { 1.0 } else { 0.0 }),
        }
    }

    #[inline(always)]
    fn value(self) -> f32 {
        self.value
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: each(|i| self.gradient[i] + other.gradient[i]),
        }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            gradient: each(|i| self.gradient[i] - other.gradient[i]),
        }
    }

    #[inline(always)]
    fn by(self, other: Self) -> Self {
        let (a, b) = (self.value, other.value);
        Self {
            value: a * b,
            gradient: each(|i| self.gradient[i] * b + a * other.gradient[i]),
        }
    }

    #[inline(always)]
    fn times(self, factor: f32) -> Self {
        Self {
            value: self.value * factor,
            gradient: each(|i| self.gradient[i] * factor),
        }
    }

    #[inline(always)]
    fn raised(self, by: f32) -> Self {
        Self {
            value: self.value + by,
            ..self
        }
    }

    #[inline(always)]
    fn chain(self, value: f32, slope: f32, _bend: f32) -> Self {
        Self {
            value,
            gradient: each(|i| self.gradient[i] * slope),
        }
    }
}

impl Real for Jet2 {
    #[inline(always)]
    fn constant(value: f32) -> Self {
        Self {
            value,
            gradient: [0.0; 3],
            hessian: [0.0; 6],
        }
    }

    #[inline(always)]
    fn variable(value: f32, axis: usize) -> Self {
        Self {
            value,
            gradient: each(|i| if i == axis { 1.0 } else { 0.0 }),
            hessian: [0.0; 6],
        }
    }

    #[inline(always)]
    fn value(self) -> f32 {
        self.value
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: each(|i| self.gradient[i] + other.gradient[i]),
            hessian: each(|i| self.hessian[i] + other.hessian[i]),
        }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            gradient: each(|i| self.gradient[i] - other.gradient[i]),
            hessian: each(|i| self.hessian[i] - other.hessian[i]),
        }
    }

    #[inline(always)]
    fn by(self, other: Self) -> Self {
        let (a, b) = (self.value, other.value);
        let (f, g) = (self.gradient, other.gradient);
        Self {
            value: a * b,
            gradient: each(|i| f[i] * b + a * g[i]),
            hessian: each(|n| {
                let (i, j) = AXES[n];
                self.hessian[n] * b + (f[i] * g[j] + f[j] * g[i]) + a * other.hessian[n]
            }),
        }
    }

    #[inline(always)]
    fn times(self, factor: f32) -> Self {
        Self {
            value: self.value * factor,
            gradient: each(|i| self.gradient[i] * factor),
            hessian: each(|i| self.hessian[i] * factor),
        }
    }

    #[inline(always)]
    fn raised(self, by: f32) -> Self {
        Self {
            value: self.value + by,
            ..self
        }
    }

    #[inline(always)]
    fn chain(self, value: f32, slope: f32, bend: f32) -> Self {
        let g = self.gradient;
        Self {
            value,
            gradient: each(|i| g[i] * slope),
            hessian: each(|n| {
                let (i, j) = AXES[n];
                self.hessian[n] * slope + g[i] * g[j] * bend
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_a_product_of_functions() {
        // x² y / (1 + z) at (3, 2, 1): derivatives by hand.
        let [x, y, z] = [(3.0, 0), (2.0, 1), (1.0, 2)].map(|(v, axis)| Jet2::variable(v, axis));
        let w = z.raised(1.0);
        let inverse = w.chain(0.5, -0.25, 0.25);
        let f = x.by(x).by(y).by(inverse);
        assert_eq!(f.value, 9.0);
        assert_eq!(f.gradient, [6.0, 4.5, -4.5]);
        assert_eq!(f.hessian, [2.0, 0.0, 4.5, 3.0, -3.0, -2.25]);
        assert_eq!(f.row(1), [3.0, 0.0, -2.25]);
        let [x, y, z] = [(3.0, 0), (2.0, 1), (1.0, 2)].map(|(v, axis)| Jet::variable(v, axis));
        let w = z.raised(1.0);
        let f = x.by(x).by(y).by(w.chain(0.5, -0.25, 0.25));
        assert_eq!((f.value, f.gradient), (9.0, [6.0, 4.5, -4.5]));
        let half = x.minus(y).plus(Jet::constant(1.0)).times(0.5);
        assert_eq!((half.value(), half.gradient), (1.0, [0.5, -0.5, 0.0]));
    }
}
