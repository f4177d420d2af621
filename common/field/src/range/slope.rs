//! Intervals with those of their derivatives: what Mitchell's method and local bounds of the gradient ask.
//!
//! The derivatives hold wherever the function has them, and both sides' where it has a corner, so that between
//! two points it changes by no more than they allow. Where it may jump they are everything.

use crate::arithmetic::Unary;
use crate::curve::Curve;
use crate::grid::Surface;
use crate::interval::Interval;
use crate::noise::Noise;
use crate::number::Number;
use crate::range::Arithmetic;
use crate::range::function::Function;
use crate::range::interval::curve_over;
use crate::range::noise;
use crate::shape::Shape;

/// All values of a function over a region, and all of its derivatives by `N` variables.
///
/// `EXACT` ones hold the exact field alone, without room for the f32 that noises are computed in: a reference.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Slope<const N: usize, const EXACT: bool = false> {
    /// The values.
    pub value: Interval,
    /// The derivatives.
    pub slopes: [Interval; N],
}

impl<const N: usize, const EXACT: bool> Slope<N, EXACT> {
    /// Values over a region through which variable `i` runs at a rate of `rates[i]` per unit.
    pub const fn of_variables(value: Interval, rates: [f64; N]) -> Self {
        let mut slopes = [Interval::point(0.0); N];
        let mut i = 0;
        while i < N {
            slopes[i] = Interval::point(rates[i]);
            i += 1;
        }
        Self { value, slopes }
    }

    fn chain(self, value: Interval, slope: Interval) -> Self {
        Self {
            value,
            slopes: self.slopes.map(|part| part.mul(slope)),
        }
    }

    fn zip(self, other: Self, value: Interval, f: impl Fn(Interval, Interval) -> Interval) -> Self {
        let mut slopes = self.slopes;
        for (part, other) in slopes.iter_mut().zip(other.slopes) {
            *part = f(*part, other);
        }
        Self { value, slopes }
    }

    /// Whichever of two continuous functions counts.
    fn either(self, other: Self, value: Interval) -> Self {
        self.zip(other, value, Interval::hull)
    }
}

impl<const N: usize, const EXACT: bool> Number for Slope<N, EXACT> {
    fn constant(value: f64) -> Self {
        Self::of_variables(Interval::point(value), [0.0; N])
    }

    fn plus(self, other: Self) -> Self {
        self.zip(other, self.value.add(other.value), Interval::add)
    }

    fn minus(self, other: Self) -> Self {
        self.zip(other, self.value.sub(other.value), Interval::sub)
    }

    fn times(self, factor: f64) -> Self {
        let factor = Interval::point(factor);
        self.chain(self.value.mul(factor), factor)
    }

    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.value, other.value);
        self.zip(other, a.mul(b), |p, q| p.mul(b).add(q.mul(a)))
    }

    fn over(self, other: Self) -> Self {
        let value = self.value.div(other.value);
        self.zip(other, value, |p, q| p.sub(value.mul(q)).div(other.value))
    }

    fn unary(self, unary: Unary) -> Self {
        self.apply(Function::Unary(unary))
    }

    fn min(self, other: Self) -> Self {
        if self.value.high < other.value.low {
            self
        } else if other.value.high < self.value.low {
            other
        } else {
            self.either(other, self.value.min(other.value))
        }
    }

    fn max(self, other: Self) -> Self {
        if self.value.low > other.value.high {
            self
        } else if other.value.low > self.value.high {
            other
        } else {
            self.either(other, self.value.max(other.value))
        }
    }

    fn power(self, exponent: f64) -> Self {
        self.apply(Function::Power(exponent))
    }

    fn clamp01(self) -> Self {
        self.apply(Function::Clamp)
    }

    fn select(self, negative: Self, other: Self) -> Self {
        if self.value.high < 0.0 {
            negative
        } else if self.value.low >= 0.0 {
            other
        } else {
            negative.hull(other)
        }
    }

    fn gate(self, live: bool) -> Self {
        if live { self } else { Self::constant(0.0) }
    }

    fn square(self) -> Self {
        self.apply(Function::Square)
    }
}

impl<const N: usize, const EXACT: bool> Arithmetic for Slope<N, EXACT> {
    fn any(range: Interval) -> Self {
        Self {
            value: range,
            slopes: [Interval::ALL; N],
        }
    }

    fn range(&self) -> Interval {
        self.value
    }

    fn within(self, range: Interval) -> Self {
        Self {
            value: self.value.meet(range),
            ..self
        }
    }

    fn blurred(self, error: f64) -> Self {
        Self {
            value: self.value.expand(error),
            ..self
        }
    }

    fn computed(self, error: f64) -> Self {
        if EXACT { self } else { self.blurred(error) }
    }

    fn hull(self, other: Self) -> Self {
        Self::any(Interval::hull(self.value, other.value))
    }

    fn apply(self, function: Function) -> Self {
        let slopes = function.slopes(self.value);
        self.chain(function.image(self.value), slopes)
    }

    /// What is known of the shape's slope, along the way on which a variable carries the place.
    fn shape(shape: &Shape, at: [Self; 3]) -> Self {
        let known = shape.known(at.map(|part| part.value));
        let enclosed = shape.enclosed(at);
        let mut slopes = enclosed.slopes;
        for (i, slope) in slopes.iter_mut().enumerate() {
            let rates = at.map(|part| part.slopes[i].magnitude());
            let most = shape.carried(known.slope, rates);
            if most.is_finite() {
                *slope = slope.meet(Interval::new(-most, most));
            }
        }
        Self { slopes, ..enclosed }
    }

    fn grid(surface: &Surface, at: [Self; 3]) -> Self {
        let (value, slopes) = surface.over(at.map(|part| part.value));
        let zero = Interval::point(0.0);
        let mut result = Self::constant(0.0);
        for (part, slope) in at.into_iter().zip(slopes) {
            result = result.zip(part.chain(zero, slope), zero, Interval::add);
        }
        Self { value, ..result }
    }

    fn curve(self, curve: &Curve) -> Self {
        let steepest = curve.slope_max(self.value) * (1.0 + 1e-12);
        self.chain(
            curve_over(curve, self.value),
            Interval::new(-steepest, steepest),
        )
    }

    fn any_noise(noise: &Noise, at: [Self; 3]) -> Self {
        let mut result = noise::any(noise, at);
        let (steepest, rough) = (noise.slope(), noise.slope_rounding());
        let rough = if EXACT { 0.0 } else { rough };
        for (i, slope) in result.slopes.iter_mut().enumerate() {
            let rates = at.each_ref().map(|part| part.slopes[i].magnitude());
            // An f32 gradient's components are each that far from the exact ones.
            *slope = within(*slope, steepest, &rates).expand(rough * rates.iter().sum::<f64>());
        }
        result
    }

    fn noise_slopes(noise: &Noise, at: [Self; 3]) -> [Self; 3] {
        let bend = noise.bend();
        slopes_over(noise, at.each_ref().map(Self::range)).map(|value| Self {
            value,
            slopes: std::array::from_fn(|i| {
                let rates = at.each_ref().map(|part| part.slopes[i].magnitude());
                within(Interval::ALL, bend, &rates)
            }),
        })
    }
}

/// What of some slopes along a way at these rates a function can have that is nowhere steeper than `steepest`.
fn within(slopes: Interval, steepest: f64, [x, y, z]: &[f64; 3]) -> Interval {
    let most = steepest * (x * x + y * y + z * z).sqrt();
    if most.is_finite() {
        slopes.meet(Interval::new(-most, most).widen())
    } else {
        slopes
    }
}

/// All components of a noise's gradient over a box of its coordinates: those of its kernels, or, if that says less,
/// the gradient midway and its steepest change on either side.
pub(super) fn slopes_over(noise: &Noise, spans: [Interval; 3]) -> [Interval; 3] {
    let at = [0, 1, 2].map(|axis| {
        let mut rates = [0.0; 3];
        rates[axis] = 1.0;
        Slope::<3>::of_variables(spans[axis], rates)
    });
    let kernels = Slope::<3>::any_noise(noise, at).slopes;
    let midway = noise.slopes_over(spans);
    [0, 1, 2].map(|axis| midway[axis].meet(kernels[axis]))
}
