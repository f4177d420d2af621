//! Values with gradients and complete Hessians, thesis eqs. (2.17), (2.18) mended: ERRATA (the mixed terms count).
//!
//! Where a function has no second derivative it counts as 0; on a corner one side is taken, as with gradients.

use crate::arithmetic::{Binary, Unary};
use crate::curve::Curve;
use crate::grid::Surface;
use crate::interval::Interval;
use crate::noise::jet::Jet2;
use crate::noise::{self, Lattice, Noise};
use crate::number::Number;
use crate::range::Arithmetic;
use crate::range::function::Function;
use crate::range::noise::lattice::gradient_noise;
use crate::shape::{Local, Shape};

/// A value, its gradient and its Hessian by the three coordinates.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Jet {
    /// f.
    pub value: f64,
    /// ∇f.
    pub gradient: [f64; 3],
    /// ∂²f/∂xᵢ∂xⱼ, symmetric.
    pub hessian: [[f64; 3]; 3],
}

impl Jet {
    /// The coordinate of that number, where it is `value`.
    pub const fn coordinate(value: f64, axis: usize) -> Self {
        let mut gradient = [0.0; 3];
        gradient[axis] = 1.0;
        Self {
            value,
            gradient,
            hessian: [[0.0; 3]; 3],
        }
    }

    /// φ of it, given φ and its two derivatives there.
    fn chain(self, value: f64, slope: f64, bend: f64) -> Self {
        let g = self.gradient;
        let mut hessian = self.hessian;
        for (i, row) in hessian.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry = *entry * slope + bend * (g[i] * g[j]);
            }
        }
        Self {
            value,
            gradient: g.map(|part| part * slope),
            hessian,
        }
    }

    /// s·self + t·other but for the value.
    fn mixed(self, other: Self, value: f64, s: f64, t: f64) -> Self {
        let mut result = Self { value, ..self };
        for i in 0..3 {
            result.gradient[i] = self.gradient[i] * s + other.gradient[i] * t;
            for j in 0..3 {
                result.hessian[i][j] = self.hessian[i][j] * s + other.hessian[i][j] * t;
            }
        }
        result
    }

    /// The first where `first`, else the second.
    fn pick(self, other: Self, first: bool) -> Self {
        if first { self } else { other }
    }
}

impl Number for Jet {
    fn constant(value: f64) -> Self {
        Self {
            value,
            gradient: [0.0; 3],
            hessian: [[0.0; 3]; 3],
        }
    }

    fn plus(self, other: Self) -> Self {
        self.mixed(other, self.value + other.value, 1.0, 1.0)
    }

    fn minus(self, other: Self) -> Self {
        self.mixed(other, self.value - other.value, 1.0, -1.0)
    }

    fn times(self, factor: f64) -> Self {
        self.chain(self.value * factor, factor, 0.0)
    }

    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.value, other.value);
        let mut product = self.mixed(other, a * b, b, a);
        for i in 0..3 {
            for j in 0..3 {
                product.hessian[i][j] +=
                    self.gradient[i] * other.gradient[j] + self.gradient[j] * other.gradient[i];
            }
        }
        product
    }

    fn over(self, other: Self) -> Self {
        // From f = q b: f's derivatives less q's share of b's, over b.
        let (a, b) = (self.value, other.value);
        let q = a / b;
        let mut quotient = self.mixed(other, q, 1.0 / b, -q / b);
        let g = quotient.gradient;
        for i in 0..3 {
            for j in 0..3 {
                quotient.hessian[i][j] -= (g[i] * other.gradient[j] + g[j] * other.gradient[i]) / b;
            }
        }
        quotient
    }

    fn unary(self, unary: Unary) -> Self {
        self.apply(Function::Unary(unary))
    }

    fn min(self, other: Self) -> Self {
        let (a, b) = Binary::Min.slopes(self.value, other.value, 0.0);
        self.pick(other, a > b)
    }

    fn max(self, other: Self) -> Self {
        let (a, b) = Binary::Max.slopes(self.value, other.value, 0.0);
        self.pick(other, a > b)
    }

    fn power(self, exponent: f64) -> Self {
        self.apply(Function::Power(exponent))
    }

    fn clamp01(self) -> Self {
        self.apply(Function::Clamp)
    }

    fn select(self, negative: Self, other: Self) -> Self {
        negative.pick(other, self.value < 0.0)
    }

    fn gate(self, live: bool) -> Self {
        self.pick(Self::constant(0.0), live)
    }
}

impl Local for Jet {
    fn at(&self) -> f64 {
        self.value
    }

    fn through(self, [value, slope, bend]: [f64; 3]) -> Self {
        self.chain(value, slope, bend)
    }
}

impl Arithmetic for Jet {
    fn any(range: Interval) -> Self {
        Self::constant(f64::any(range))
    }

    fn range(&self) -> Interval {
        Interval::point(self.value)
    }

    fn within(self, _: Interval) -> Self {
        self
    }

    fn blurred(self, _: f64) -> Self {
        self
    }

    fn hull(self, _: Self) -> Self {
        self
    }

    fn apply(self, function: Function) -> Self {
        let a = self.value;
        self.chain(function.value(a), function.slope(a), function.bend(a))
    }

    fn curve(self, curve: &Curve) -> Self {
        let (value, slope, bend) = curve.value_slope_bend(self.value);
        self.chain(value, slope, bend)
    }

    fn shape(shape: &Shape, at: [Self; 3]) -> Self {
        shape.value(at)
    }

    fn grid(surface: &Surface, at: [Self; 3]) -> Self {
        let bent = surface.bent(at.map(|part| part.value));
        let mut result = Self::constant(bent.value);
        for (i, a) in at.iter().enumerate() {
            result = result.mixed(*a, bent.value, 1.0, bent.gradient[i]);
            for (j, b) in at.iter().enumerate() {
                let bend = bent.hessian[i][j];
                for (row, g) in result.hessian.iter_mut().zip(a.gradient) {
                    for (entry, h) in row.iter_mut().zip(b.gradient) {
                        *entry += bend * (g * h);
                    }
                }
            }
        }
        result
    }

    /// The value is that of evaluation to the bit; the derivatives are exact to f64.
    fn noise(lattice: Lattice, at: [Self; 3]) -> Self {
        let value = f64::noise(lattice, at.map(|part| part.value));
        let exact = gradient_noise(lattice, at);
        Self { value, ..exact }
    }

    /// Value and derivatives are those of evaluation, good to f32.
    fn any_noise(noise: &Noise, at: [Self; 3]) -> Self {
        let jet = noise_at(noise, &at);
        let slopes = jet.gradient.map(f64::from);
        let bends = [0, 1, 2].map(|axis| jet.row(axis).map(f64::from));
        composed(f64::from(jet.value), slopes, bends, &at)
    }

    /// A noise has no third derivatives here: those of its gradient's components count as 0.
    fn noise_slopes(noise: &Noise, at: [Self; 3]) -> [Self; 3] {
        let jet = noise_at(noise, &at);
        [0, 1, 2].map(|axis| {
            let slopes = jet.row(axis).map(f64::from);
            composed(f64::from(jet.gradient[axis]), slopes, [[0.0; 3]; 3], &at)
        })
    }
}

fn noise_at(noise: &Noise, at: &[Jet; 3]) -> Jet2 {
    let [(x, u), (y, v), (z, w)] = at.map(|part| noise::split(part.value));
    noise.jet2([x, y, z], [u, v, w])
}

/// A function of three numbers with these derivatives by them, thesis eq. (2.18) mended: ERRATA.
fn composed(value: f64, slopes: [f64; 3], bends: [[f64; 3]; 3], at: &[Jet; 3]) -> Jet {
    let mut sum = Jet::constant(value);
    for k in 0..3 {
        for i in 0..3 {
            sum.gradient[i] += slopes[k] * at[k].gradient[i];
            for j in 0..3 {
                sum.hessian[i][j] += slopes[k] * at[k].hessian[i][j];
                for l in 0..3 {
                    sum.hessian[i][j] += bends[k][l] * at[k].gradient[i] * at[l].gradient[j];
                }
            }
        }
    }
    sum
}
