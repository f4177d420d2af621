//! A program in any arithmetic: one walk over its plan, at one place, segment or cell.

use crate::arithmetic::Unary;
use crate::cascade::{self, Carried, Cascade, Model, Term};
use crate::interval::Interval;
use crate::noise::{Noise, simplex};
use crate::number::Number;
use crate::op::Kind;
use crate::program::Program;
use crate::program::plan::{Act, Plan, Step};
use crate::range::function::Function;
use crate::range::{Affine, Arithmetic, Jet, Reduced, Slope};

/// Twice the error of [`cascade::log2`] in octaves of two, with room for a lacunarity near one.
pub(crate) const DEPTH_ROUNDING: f64 = 1e-7;

/// A place of a field: where, when, and how large a pixel is there.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Place {
    /// World coordinates, metres.
    pub at: [f64; 3],
    /// Metres that a pixel covers there; 0: all detail.
    pub footprint: f64,
    /// Seconds from image 0.
    pub time: f64,
}

/// A part of a ray: origin + t · direction.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Segment {
    /// Where t = 0, world metres.
    pub origin: [f64; 3],
    /// Which way; t counts its lengths.
    pub direction: [f64; 3],
    /// The part.
    pub t: Interval,
    /// The footprints over it, metres.
    pub footprint: Interval,
    /// Seconds from image 0.
    pub time: f64,
}

/// A part of a pyramid of rays, or any other parallelepiped: thesis §7.3.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cell {
    at: [Reduced<3>; 3],
    /// The footprints in it, metres.
    pub footprint: Interval,
    /// The instants, seconds from image 0.
    pub time: Interval,
}

impl Cell {
    /// The box around `centre` that three half edges span, at footprint and instant 0.
    pub fn of_edges(centre: [f64; 3], edges: [[f64; 3]; 3]) -> Self {
        let at =
            [0, 1, 2].map(|axis| Reduced::of_symbols(centre[axis], edges.map(|edge| edge[axis])));
        Self {
            at,
            footprint: Interval::point(0.0),
            time: Interval::point(0.0),
        }
    }

    /// The places origin + t (direction + e₂ across + e₃ up), t in the interval, thesis eq. (7.11): the first symbol is along t.
    pub fn of_rays(
        origin: [Interval; 3],
        [direction, across, up]: [[f64; 3]; 3],
        t: Interval,
    ) -> Self {
        let half = 0.5 * t.width();
        let t = Reduced::of_symbols(0.5 * (t.low + t.high), [half, 0.0, 0.0]);
        let at = [0, 1, 2].map(|axis| {
            let ray = Reduced::of_symbols(direction[axis], [0.0, across[axis], up[axis]]);
            t.mul(ray).plus(Reduced::any(origin[axis]))
        });
        Self {
            at,
            footprint: Interval::point(0.0),
            time: Interval::point(0.0),
        }
    }
}

impl Cell {
    fn ground(&self) -> Ground<Reduced<3>> {
        Ground {
            at: self.at,
            footprint: self.footprint,
            time: Reduced::any(self.time),
        }
    }
}

/// What a walk over a plan stands on.
struct Ground<T> {
    at: [T; 3],
    footprint: Interval,
    time: T,
}

/// What a plan's steps have given: their numbers one after another, as the plan places them.
struct Values<'a, T> {
    plan: &'a Plan,
    numbers: Vec<T>,
}

impl<T: Arithmetic> Values<'_, T> {
    /// A step's number, or the first component of its vector.
    #[inline]
    fn scalar(&self, step: usize) -> T {
        self.numbers[self.plan.places[step]].clone()
    }

    /// A step's vector, or its number three times.
    #[inline]
    fn vector(&self, step: usize) -> [T; 3] {
        let place = self.plan.places[step];
        match (self.plan.steps[step].kind, &self.numbers[place..]) {
            (Kind::Vector, [x, y, z, ..]) => [x.clone(), y.clone(), z.clone()],
            _ => [self.scalar(step), self.scalar(step), self.scalar(step)],
        }
    }
}

/// What a step gives: a number or a vector.
enum Value<T> {
    Scalar(T),
    Vector([T; 3]),
}

impl<T: Arithmetic> Ground<T> {
    /// The value of every step of a plan.
    fn all<'a>(&self, plan: &'a Plan) -> Values<'a, T> {
        let mut values = Values {
            plan,
            numbers: Vec::with_capacity(plan.numbers),
        };
        for step in &plan.steps {
            match self.step(step, &values) {
                Value::Scalar(number) => values.numbers.push(number),
                Value::Vector(vector) => values.numbers.extend(vector),
            }
        }
        values
    }

    /// The value of the plan's first root; a plan without one is nowhere inside.
    fn first(&self, plan: &Plan) -> T {
        match plan.roots.first() {
            Some(&root) => self.all(plan).scalar(root),
            None => T::constant(f64::INFINITY),
        }
    }

    #[inline]
    fn step(&self, step: &Step, values: &Values<'_, T>) -> Value<T> {
        let s = |i: usize| values.scalar(step.args[i]);
        let v = |i: usize| values.vector(step.args[i]);
        let number = match &step.act {
            Act::ConstantVector(value) => return Value::Vector(each(*value, T::constant)),
            Act::Position => return Value::Vector(self.at.clone()),
            Act::Vector => return Value::Vector([s(0), s(1), s(2)]),
            Act::VectorAdd => return Value::Vector(pairs(v(0), v(1), T::plus)),
            Act::VectorSub => return Value::Vector(pairs(v(0), v(1), T::minus)),
            Act::Scale => {
                let factor = s(1);
                return Value::Vector(each(v(0), |part| part.mul(factor.clone())));
            }
            Act::OntoSphere(radius) => return Value::Vector(onto_sphere(*radius, v(0))),
            Act::OntoPlane => {
                let [x, y, _] = v(0);
                return Value::Vector([x, y, T::constant(0.0)]);
            }
            Act::NoiseGradient(noise) => {
                let slopes = T::noise_slopes(noise, skewed(noise, v(0)));
                // The skewing is symmetric: it is its own transpose.
                return Value::Vector(skewed(noise, slopes));
            }
            Act::Constant(value) => T::constant(*value),
            Act::Time => self.time.clone(),
            Act::Curve(curve) => s(0).curve(curve),
            Act::Component(i) => v(0)[*i].clone(),
            Act::Length => length(v(0)),
            Act::Dot => {
                let [x, y, z] = pairs(v(0), v(1), T::mul);
                x.plus(y).plus(z)
            }
            Act::Unary(unary) => s(0).unary(*unary),
            Act::Binary(binary) => binary.of_numbers(s(0), s(1)),
            Act::Power(exponent) => s(0).power(*exponent),
            Act::SmoothStep(low, high) => s(0).apply(Function::SmoothStep(*low, *high)),
            Act::Select => s(0).select(s(1), s(2)),
            Act::Noise(lattice) => T::noise(*lattice, v(0)),
            Act::Shape(shape) => match step.args[..] {
                [_, _] => T::shape(shape, [s(0), s(1), T::constant(0.0)]),
                _ => T::shape(shape, v(0)),
            },
            Act::AnyNoise(noise) => T::any_noise(noise, skewed(noise, v(0))),
            Act::Cascade(cascade) => octaves(cascade, &v(0), self.footprint),
            Act::Grid(surface) => T::grid(surface, v(0)),
        };
        Value::Scalar(number)
    }
}

/// `f` of each component. An array's own `map` goes through memory.
#[inline(always)]
fn each<T, U>([a, b, c]: [T; 3], f: impl Fn(T) -> U) -> [U; 3] {
    [f(a), f(b), f(c)]
}

#[inline(always)]
fn pairs<T>([a, b, c]: [T; 3], [x, y, z]: [T; 3], f: impl Fn(T, T) -> T) -> [T; 3] {
    [f(a, x), f(b, y), f(c, z)]
}

fn length<T: Number>([x, y, z]: [T; 3]) -> T {
    x.square()
        .plus(y.square())
        .plus(z.square())
        .unary(Unary::Sqrt)
}

/// No component is farther from 0 than the sphere, however little is known of the factor.
fn onto_sphere<T: Arithmetic>(radius: f64, v: [T; 3]) -> [T; 3] {
    let factor = length(v.clone()).apply(Function::OntoSphere(radius));
    let reach = Interval::new(-radius.abs(), radius.abs()).widen();
    v.map(|part| part.mul(factor.clone()).within(reach))
}

/// A cascade: octave by octave, with the weights that its footprints give.
///
/// All models are affine in an octave's weight, so that where the weight is not certain
/// the result lies between those of its least and its greatest value.
fn octaves<T: Arithmetic>(cascade: &Cascade, at: &[T; 3], footprint: Interval) -> T {
    let mut shallow = cascade.depth(footprint.high);
    let mut deep = cascade.depth(footprint.low);
    if footprint.low < footprint.high {
        (shallow, deep) = (shallow - DEPTH_ROUNDING, deep + DEPTH_ROUNDING);
    }
    let mut carried = (T::constant(0.0), T::constant(0.0));
    for (i, octave) in cascade.octaves.iter().enumerate() {
        let i = cascade::index(i);
        if deep.is_nan() || deep <= i {
            break;
        }
        let noise = match &octave.noise {
            None => T::noise(octave.lattice, look(octave, at)),
            Some(noise) => T::any_noise(noise, look(octave, at)),
        };
        let term = |depth: f64| Term {
            first: i == 0.0,
            amplitude: octave.amplitude,
            weight: cascade::weight(depth, i),
        };
        let (least, most) = (term(shallow), term(deep));
        let full = add(cascade.model, most, noise.clone(), carried.clone());
        carried = if least.weight == most.weight {
            full
        } else {
            let few = add(cascade.model, least, noise, carried);
            (few.0.hull(full.0), few.1.hull(full.1))
        };
    }
    carried.0
}

/// The coordinates that a noise is a function of, as `simplex::skew` computes them.
fn skewed<T: Number>(noise: &Noise, at: [T; 3]) -> [T; 3] {
    if !noise.is_skewed() {
        return at;
    }
    let [x, y, z] = at.clone();
    let by = x.plus(y).plus(z).times(simplex::SKEW);
    at.map(|part| part.plus(by.clone()))
}

/// Where an octave looks.
fn look<T: Arithmetic>(octave: &cascade::Octave, at: &[T; 3]) -> [T; 3] {
    each([0, 1, 2], |axis: usize| {
        let [a, b, c] = octave.matrix[axis];
        let [x, y, z] = at.clone();
        x.times(a)
            .plus(y.times(b))
            .plus(z.times(c))
            .plus(T::constant(octave.shift[axis]))
    })
}

fn add<T: Number>(model: Model, term: Term, noise: T, carried: Carried<T>) -> Carried<T> {
    match model {
        Model::Sum(basis) => cascade::sum(basis, term, noise, carried),
        Model::AltitudeOne { basis, xi } => cascade::altitude_one(basis, xi, term, noise, carried),
        Model::AltitudeTwo { basis, xi } => cascade::altitude_two(basis, xi, term, noise, carried),
        Model::Ridged { offset, gain } => cascade::ridged(offset, gain, term, noise, carried),
    }
}

impl Segment {
    fn ground<T: Arithmetic>(&self, t: &T) -> Ground<T> {
        let along = |axis: usize| {
            T::constant(self.origin[axis]).plus(t.clone().times(self.direction[axis]))
        };
        let at = [along(0), along(1), along(2)];
        Ground {
            at,
            footprint: self.footprint,
            time: T::constant(self.time),
        }
    }

    /// t as a form with one symbol, thesis eqs. (5.19), (5.23).
    fn form(&self) -> Reduced<1> {
        let centre = 0.5 * (self.t.low + self.t.high);
        let half = crate::interval::larger(self.t.high - centre, centre - self.t.low);
        let room = 4.0 * f64::EPSILON * centre.abs();
        Reduced::of_symbols(centre, [half + room])
    }
}

impl Program {
    /// The first root's value at a place: that of [`Program::evaluate`] to the bit.
    pub fn at(&self, place: &Place) -> f64 {
        let value = self.ground(place, place.at).first(&self.plan);
        if value.is_nan() { f64::INFINITY } else { value }
    }

    /// The first root's value, gradient and Hessian at a place, thesis eqs. (2.17), (2.18) mended: ERRATA.
    ///
    /// The value is that of [`Program::evaluate`]. A level-of-detail weight counts as constant.
    pub fn jet(&self, place: &Place) -> Jet {
        let at = [0, 1, 2].map(|axis| Jet::coordinate(place.at[axis], axis));
        self.ground(place, at).first(&self.plan)
    }

    fn ground<T: Arithmetic>(&self, place: &Place, at: [T; 3]) -> Ground<T> {
        Ground {
            at,
            footprint: Interval::point(place.footprint),
            time: T::constant(place.time),
        }
    }

    /// All values of the first root over a box of places, by intervals.
    pub fn over_box(&self, at: [Interval; 3], footprint: Interval, time: Interval) -> Interval {
        let ground = Ground {
            at,
            footprint,
            time,
        };
        ground.first(&self.plan)
    }

    /// All values of the first root and of its gradient over a box of places.
    pub fn slopes_over_box(&self, at: [Interval; 3], footprint: Interval, time: f64) -> Slope<3> {
        let variable = |axis: usize| {
            let mut rates = [0.0; 3];
            rates[axis] = 1.0;
            Slope::of_variables(at[axis], rates)
        };
        let ground = Ground {
            at: [variable(0), variable(1), variable(2)],
            footprint,
            time: Slope::constant(time),
        };
        ground.first(&self.plan)
    }

    /// All values of the first root along a segment, by intervals (thesis §5.3.1).
    pub fn along_interval(&self, segment: &Segment) -> Interval {
        segment.ground(&segment.t).first(&self.plan)
    }

    /// All values of the first root and of its derivative along a segment, by intervals.
    pub fn along_slope(&self, segment: &Segment) -> Slope<1> {
        let t = Slope::of_variables(segment.t, [1.0]);
        segment.ground(&t).first(&self.plan)
    }

    /// The same of the exact field alone: noises are not rounded to f32, as evaluation rounds them. A reference.
    pub fn along_exact(&self, segment: &Segment) -> Slope<1> {
        let t = Slope::<1, true>::of_variables(segment.t, [1.0]);
        let Slope { value, slopes } = segment.ground(&t).first(&self.plan);
        Slope { value, slopes }
    }

    /// The first root along a segment as a standard affine form, condensed to the ray's symbol (thesis §5.3.2).
    pub fn along_affine(&self, segment: &Segment) -> Reduced<1> {
        let t = Affine::from_reduced(&segment.form());
        segment.ground(&t).first(&self.plan).to_reduced()
    }

    /// The first root along a segment as a reduced affine form (thesis §5.3.3).
    pub fn along_reduced(&self, segment: &Segment) -> Reduced<1> {
        segment.ground(&segment.form()).first(&self.plan)
    }

    /// The first root over a cell as a reduced affine form of four symbols (thesis eq. (7.11)).
    pub fn over_cell(&self, cell: &Cell) -> Reduced<3> {
        cell.ground().first(&self.plan)
    }

    /// The first component of every step over a cell.
    pub(crate) fn steps_over_cell(&self, cell: &Cell) -> Vec<Reduced<3>> {
        let values = cell.ground().all(&self.plan);
        let steps = 0..self.plan.steps.len();
        steps.map(|step| values.scalar(step)).collect()
    }
}
