//! The shapes of thesis chapter 2 as functions: a place, a list of parts, options.

use std::rc::Rc;

use field::{NodeId, Op};
use rhai::{Array, Dynamic, Engine, Map};

use super::Shared;
use super::bezier;
use super::options::{self, Options};
use super::skeletons;
use super::values::{Made, Operand, Vector, refuse};

/// A shape made of a list of parts.
struct Listed {
    name: &'static str,
    make: fn(&Shared, NodeId, &Array, &Map) -> Made<NodeId>,
}

/// A shape that is told by options alone.
struct Plain {
    name: &'static str,
    make: fn(&Shared, NodeId, &Map) -> Made<NodeId>,
}

const LISTED: &[Listed] = &[
    Listed {
        name: "polynomial",
        make: polynomial,
    },
    Listed {
        name: "blobs",
        make: blobs,
    },
    Listed {
        name: "distances",
        make: skeletons::distances,
    },
    Listed {
        name: "convolution",
        make: skeletons::convolution,
    },
    Listed {
        name: "bezier_tetrahedra",
        make: bezier::tetrahedra,
    },
];

const PLAIN: &[Plain] = &[
    Plain {
        name: "superquadric",
        make: superquadric,
    },
    Plain {
        name: "sphere",
        make: sphere,
    },
];

/// The kernels by their numbers.
const KERNELS: [&str; 6] = ["blinn", "metaballs", "wyvill", "murakami", "hart", "cauchy"];

/// Kernels that never end, and so leave no room for a far field.
const ENDLESS: [&str; 2] = ["blinn", "cauchy"];

/// Adds the shapes to the language: each with and without a place before all else, and options after.
pub(super) fn register(engine: &mut Engine, shared: &Rc<Shared>) {
    for shape in LISTED {
        let make = |shared: &Rc<Shared>| {
            let shared = shared.clone();
            move |at: Option<&Dynamic>, parts: &Array, given: &Map| {
                let at = shared.at(shape.name, at)?;
                (shape.make)(&shared, at, parts, given).map(|id| Operand::Scalar(id).into_dynamic())
            }
        };
        let f = make(shared);
        engine.register_fn(shape.name, move |parts: Array| f(None, &parts, &Map::new()));
        let f = make(shared);
        engine.register_fn(shape.name, move |parts: Array, given: Map| {
            f(None, &parts, &given)
        });
        let f = make(shared);
        engine.register_fn(shape.name, move |at: Vector, parts: Array| {
            f(Some(&Dynamic::from(at)), &parts, &Map::new())
        });
        let f = make(shared);
        engine.register_fn(shape.name, move |at: Vector, parts: Array, given: Map| {
            f(Some(&Dynamic::from(at)), &parts, &given)
        });
    }
    for shape in PLAIN {
        let make = |shared: &Rc<Shared>| {
            let shared = shared.clone();
            move |at: Option<&Dynamic>, given: &Map| {
                let at = shared.at(shape.name, at)?;
                (shape.make)(&shared, at, given).map(|id| Operand::Scalar(id).into_dynamic())
            }
        };
        let f = make(shared);
        engine.register_fn(shape.name, move || f(None, &Map::new()));
        let f = make(shared);
        engine.register_fn(shape.name, move |given: Map| f(None, &given));
        let f = make(shared);
        engine.register_fn(shape.name, move |at: Vector| {
            f(Some(&Dynamic::from(at)), &Map::new())
        });
        let f = make(shared);
        engine.register_fn(shape.name, move |at: Vector, given: Map| {
            f(Some(&Dynamic::from(at)), &given)
        });
    }
}

impl Shared {
    /// The vector that was given, else the point itself.
    fn at(&self, function: &str, at: Option<&Dynamic>) -> Made<NodeId> {
        match at {
            Some(at) => Self::vector(function, at),
            None => self.push(Op::Position, &[], &[]),
        }
    }
}

/// `polynomial([[i, j, k, c], ...])`: Σ c xⁱ yʲ zᵏ.
fn polynomial(shared: &Shared, at: NodeId, terms: &Array, given: &Map) -> Made<NodeId> {
    Options::new("polynomial", &[], given)?;
    let mut params = Vec::with_capacity(4 * terms.len());
    for term in terms {
        let numbers = options::numbers("polynomial", term)?;
        if numbers.len() != 4 {
            return refuse(
                format!(
                    "a term of `polynomial` has four numbers, not {}",
                    numbers.len()
                ),
                "[2, 0, 1, 5] is 5 x**2 z",
            );
        }
        params.extend(numbers);
    }
    shared.push(Op::Polynomial, &[at], &params)
}

/// `superquadric(#{e1: 1, e2: 1, size: [1, 1, 1]})`, thesis eq. (2.6).
fn superquadric(shared: &Shared, at: NodeId, given: &Map) -> Made<NodeId> {
    let options = Options::new("superquadric", &["e1", "e2", "size"], given)?;
    let size = options.numbers("size", [1.0; 3])?;
    if let Some(wrong) = size.iter().find(|length| **length <= 0.0) {
        return refuse(
            format!("`superquadric: size` wants lengths above 0, not {wrong}"),
            "size is half its width, depth and height",
        );
    }
    let at = shared.stretched(at, size.map(|length| 1.0 / length))?;
    let params = [options.number("e1", 1.0)?, options.number("e2", 1.0)?];
    shared.push(Op::Superquadric, &[at], &params)
}

/// `sphere(#{radius: 1, exponent: 0.5})`: r ((x·x/r²)ⁿ − 1), thesis eq. (2.20).
fn sphere(shared: &Shared, at: NodeId, given: &Map) -> Made<NodeId> {
    let options = Options::new("sphere", &["radius", "exponent"], given)?;
    let radius = options.number("radius", 1.0)?;
    let exponent = options.number("exponent", 0.5)?;
    if radius <= 0.0 {
        return refuse(
            format!("`sphere: radius` wants a length above 0, not {radius}"),
            "it is in metres",
        );
    }
    let constant = |value: f64| shared.push(Op::Constant, &[], &[value]);
    let size = constant(radius)?;
    if exponent == 0.5 {
        let length = shared.push(Op::Length, &[at], &[])?;
        return shared.push(Op::Sub, &[length, size], &[]);
    }
    let at = shared.stretched(at, [1.0 / radius; 3])?;
    let square = shared.push(Op::Dot, &[at, at], &[])?;
    let power = shared.push(Op::Power, &[square], &[exponent])?;
    let grown = shared.push(Op::Mul, &[size, power], &[])?;
    shared.push(Op::Sub, &[grown, size], &[])
}

/// `blobs([[x, y, z, radius, weight], ...], #{...})`, thesis eqs. (2.9) and (7.9).
fn blobs(shared: &Shared, at: NodeId, points: &Array, given: &Map) -> Made<NodeId> {
    let known = ["kernel", "radius", "weight", "threshold", "far"];
    let options = Options::new("blobs", &known, given)?;
    let (radius, weight) = (
        options.number("radius", 1.0)?,
        options.number("weight", 1.0)?,
    );
    let mut params = rules(&options, 2)?.to_vec();
    for point in points {
        let mut point = options::numbers("blobs", point)?;
        if !(3..=5).contains(&point.len()) {
            return refuse(
                format!(
                    "a point of `blobs` has three to five numbers, not {}",
                    point.len()
                ),
                "[x, y, z], [x, y, z, radius] or [x, y, z, radius, weight]",
            );
        }
        if point.len() == 3 {
            point.push(radius);
        }
        if point.len() == 4 {
            point.push(weight);
        }
        params.extend(point);
    }
    shared.push(Op::Blobs, &[at], &params)
}

/// Kernel, threshold and far field, as every sum of influences takes them.
pub(super) fn rules(options: &Options<'_>, kernel: usize) -> Made<[f64; 3]> {
    let kernel = options.name("kernel", &KERNELS, kernel)?;
    let endless = ENDLESS.contains(&KERNELS[kernel]);
    let far = options.flag("far", !endless)?;
    let number = u32::try_from(kernel).unwrap_or(u32::MAX);
    Ok([
        f64::from(number),
        options.number("threshold", 0.5)?,
        f64::from(u8::from(far)),
    ])
}

impl Shared {
    /// A vector's components times factors.
    pub(super) fn stretched(&self, at: NodeId, factors: [f64; 3]) -> Made<NodeId> {
        let [x, y, z] = factors;
        if x == 1.0 && y == 1.0 && z == 1.0 {
            return Ok(at);
        }
        if x == y && y == z {
            let factor = self.push(Op::Constant, &[], &[x])?;
            return self.push(Op::Scale, &[at, factor], &[]);
        }
        let mut parts = [at; 3];
        for ((part, op), factor) in parts.iter_mut().zip([Op::X, Op::Y, Op::Z]).zip(factors) {
            let component = self.push(op, &[at], &[])?;
            let factor = self.push(Op::Constant, &[], &[factor])?;
            *part = self.push(Op::Mul, &[component, factor], &[])?;
        }
        self.push(Op::Vector, &parts, &[])
    }
}
