//! Operations on constants, done once at compilation. The same arithmetic as the machine's, so folding moves no bit.

use crate::arithmetic::{length, onto_sphere, power, select, smoothstep};
use crate::noise;
use crate::program::plan::Act;

/// A number or a vector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Value {
    Scalar(f64),
    Vector([f64; 3]),
}

impl Value {
    fn scalar(self) -> f64 {
        match self {
            Self::Scalar(value) => value,
            Self::Vector([value, ..]) => value,
        }
    }

    fn vector(self) -> [f64; 3] {
        match self {
            Self::Vector(value) => value,
            Self::Scalar(value) => [value; 3],
        }
    }
}

/// What the operation gives if it needs nothing but these constants.
pub(crate) fn constant(act: &Act, args: &[Option<Value>]) -> Option<Value> {
    let args: Vec<Value> = args.iter().copied().collect::<Option<_>>()?;
    let s = |i: usize| args[i].scalar();
    let v = |i: usize| args[i].vector();
    Some(match act {
        Act::Constant(value) => Value::Scalar(*value),
        Act::ConstantVector(value) => Value::Vector(*value),
        Act::Position | Act::Time | Act::Cascade(_) => return None,
        Act::Curve(curve) => Value::Scalar(curve.value(s(0))),
        Act::Vector => Value::Vector([s(0), s(1), s(2)]),
        Act::Component(i) => Value::Scalar(v(0)[*i]),
        Act::VectorAdd => Value::Vector([0, 1, 2].map(|i| v(0)[i] + v(1)[i])),
        Act::VectorSub => Value::Vector([0, 1, 2].map(|i| v(0)[i] - v(1)[i])),
        Act::Scale => Value::Vector(v(0).map(|a| a * s(1))),
        Act::Length => Value::Scalar(length(v(0))),
        Act::Dot => {
            let (a, b) = (v(0), v(1));
            Value::Scalar(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
        }
        Act::OntoSphere(radius) => {
            let factor = onto_sphere(*radius, length(v(0)));
            Value::Vector(v(0).map(|a| a * factor))
        }
        Act::OntoPlane => Value::Vector([v(0)[0], v(0)[1], 0.0]),
        Act::Unary(unary) => Value::Scalar(unary.value(s(0))),
        Act::Binary(binary) => Value::Scalar(binary.value(s(0), s(1))),
        Act::Power(exponent) => Value::Scalar(power(*exponent, s(0))),
        Act::SmoothStep(low, high) => Value::Scalar(smoothstep(*low, *high, s(0))),
        Act::Select => Value::Scalar(select(s(0), s(1), s(2))),
        Act::Shape(shape) => Value::Scalar(shape.value(match args[..] {
            [a, b] => [a.scalar(), b.scalar(), 0.0],
            _ => v(0),
        })),
        Act::Grid(surface) => Value::Scalar(surface.value(v(0))),
        Act::AnyNoise(noise) => Value::Scalar(noise.value_at(v(0))),
        Act::NoiseGradient(noise) => Value::Vector(noise.gradient_at(v(0))),
        Act::Noise(lattice) => {
            let [(x, u), (y, v), (z, w)] = v(0).map(noise::split);
            Value::Scalar(f64::from(noise::value(
                noise::corners(*lattice, [x, y, z]),
                [u, v, w],
            )))
        }
    })
}
