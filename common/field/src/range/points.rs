//! Points among the arithmetics: the definition that all others are checked against.

use crate::curve::Curve;
use crate::grid::Surface;
use crate::interval::Interval;
use crate::noise::{self, Lattice, Noise};
use crate::range::Arithmetic;
use crate::range::function::Function;
use crate::shape::Shape;

impl Arithmetic for f64 {
    fn any(range: Interval) -> Self {
        if range.low == range.high {
            range.low
        } else {
            0.5 * (range.low + range.high)
        }
    }

    fn range(&self) -> Interval {
        Interval::point(*self)
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
        function.value(self)
    }

    fn curve(self, curve: &Curve) -> Self {
        curve.value(self)
    }

    fn shape(shape: &Shape, at: [Self; 3]) -> Self {
        shape.value(at)
    }

    fn grid(surface: &Surface, at: [Self; 3]) -> Self {
        surface.value(at)
    }

    fn noise(lattice: Lattice, at: [Self; 3]) -> Self {
        let [(x, u), (y, v), (z, w)] = at.map(noise::split);
        f64::from(noise::value(noise::corners(lattice, [x, y, z]), [u, v, w]))
    }

    fn any_noise(noise: &Noise, at: [Self; 3]) -> Self {
        let [(x, u), (y, v), (z, w)] = at.map(noise::split);
        f64::from(noise.value([x, y, z], [u, v, w]))
    }

    fn noise_slopes(noise: &Noise, at: [Self; 3]) -> [Self; 3] {
        let [(x, u), (y, v), (z, w)] = at.map(noise::split);
        noise.jet([x, y, z], [u, v, w]).gradient.map(f64::from)
    }
}
