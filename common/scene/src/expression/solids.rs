//! Joining and deforming surfaces: constructive solid geometry, blends, metamorphosis, domain deformations.
//!
//! Most of it is made of operations that are there already; normals then come out right by the chain
//! rule: ∇(f₀ ∘ d) = Jᵀ ∇f₀(d(x)) (thesis eq. (2.15) and its normal, mended: ERRATA).

use std::rc::Rc;

use field::{NodeId, Op};
use rhai::{Array, Dynamic, Engine, Map};

use super::Shared;
use super::options::{self, Options};
use super::values::{Made, Operand, Scalar, refuse};

/// A boolean operation on solids.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Boolean {
    Union,
    Intersection,
    Difference,
}

impl Boolean {
    fn name(self) -> &'static str {
        match self {
            Self::Union => "union",
            Self::Intersection => "intersection",
            Self::Difference => "difference",
        }
    }
}

/// Adds them to the language.
pub(super) fn register(engine: &mut Engine, shared: &Rc<Shared>) {
    for boolean in [Boolean::Union, Boolean::Intersection, Boolean::Difference] {
        let name = boolean.name();
        let s = shared.clone();
        engine.register_fn(name, move |a: Dynamic, b: Dynamic| {
            s.joined(boolean, &[a, b], &Map::new())
        });
        let s = shared.clone();
        engine.register_fn(name, move |a: Dynamic, b: Dynamic, given: Map| {
            s.joined(boolean, &[a, b], &given)
        });
        let s = shared.clone();
        engine.register_fn(name, move |parts: Array| {
            s.joined(boolean, &parts, &Map::new())
        });
        let s = shared.clone();
        engine.register_fn(name, move |parts: Array, given: Map| {
            s.joined(boolean, &parts, &given)
        });
    }
    let s = shared.clone();
    engine.register_fn("blend", move |a: Dynamic, b: Dynamic, width: Dynamic| {
        let mut given = Map::new();
        given.insert("width".into(), width);
        s.joined(Boolean::Union, &[a, b], &given)
    });
    let s = shared.clone();
    engine.register_fn("morph", move |a: Dynamic, b: Dynamic, u: Dynamic| {
        s.morph(&a, &b, &u)
    });
    let s = shared.clone();
    engine.register_fn("twist", move |at: Dynamic, rate: Dynamic| {
        s.twist(&at, &rate)
    });
    let s = shared.clone();
    engine.register_fn("free_form", move |at: Dynamic, moves: Array, given: Map| {
        s.free_form(&at, &moves, &given)
    });
    let s = shared.clone();
    engine.register_fn("taper", move |at: Dynamic, given: Map| s.taper(&at, &given));
    let s = shared.clone();
    engine.register_fn("bend", move |at: Dynamic, given: Map| s.bend(&at, &given));
}

impl Shared {
    /// The union, intersection or difference of solids, thesis eqs. (2.13) and (2.14) mended, or a local blend.
    fn joined(&self, boolean: Boolean, parts: &[Dynamic], given: &Map) -> Made<Dynamic> {
        let name = boolean.name();
        let options = Options::new(name, &["sharpness", "width"], given)?;
        if options.has("sharpness") && options.has("width") {
            return refuse(
                format!("`{name}` takes a sharpness or a width, not both"),
                "sharpness blends everywhere (Ricci), width only near the seam",
            );
        }
        let local = options.has("width");
        let size = if local {
            options.number("width", 0.0)?
        } else {
            options.number("sharpness", 0.0)?
        };
        let plain = !local && !options.has("sharpness");
        let kind = match (boolean, local) {
            (Boolean::Union, false) => 0.0,
            (_, false) => 1.0,
            (Boolean::Union, true) => 2.0,
            (_, true) => 3.0,
        };
        let mut joined: Option<NodeId> = None;
        for part in parts {
            let part = self.scalar(name, Self::operand(name, part)?)?;
            joined = Some(match joined {
                None => part,
                Some(before) => {
                    let part = match boolean {
                        Boolean::Difference => self.push(Op::Neg, &[part], &[])?,
                        _ => part,
                    };
                    match (plain, boolean) {
                        (true, Boolean::Union) => self.push(Op::Min, &[before, part], &[])?,
                        (true, _) => self.push(Op::Max, &[before, part], &[])?,
                        (false, _) => self.push(Op::Blend, &[before, part], &[kind, size])?,
                    }
                }
            });
        }
        match joined {
            Some(id) => Ok(Operand::Scalar(id).into_dynamic()),
            None => refuse(
                format!("`{name}` joins at least one surface"),
                format!("it is used like {name}(a, b) or {name}([a, b, c])"),
            ),
        }
    }

    /// (1 − u) a + u b with u held between 0 and 1, thesis eq. (2.16) mended: a at u = 0.
    fn morph(&self, a: &Dynamic, b: &Dynamic, u: &Dynamic) -> Made<Dynamic> {
        let held = match Self::operand("morph", u)? {
            Operand::Number(u) => Dynamic::from_float(u.clamp(0.0, 1.0)),
            u => {
                let u = self.scalar("morph", u)?;
                let (zero, one) = (self.number(0.0)?, self.number(1.0)?);
                let above = self.push(Op::Max, &[u, zero], &[])?;
                Dynamic::from(Scalar(self.push(Op::Min, &[above, one], &[])?))
            }
        };
        self.mix(a, b, &held)
    }

    pub(super) fn number(&self, value: f64) -> Made<NodeId> {
        self.push(Op::Constant, &[], &[value])
    }

    /// Undoes a twist about z of `rate` radians a metre (Barr 1984): where the twisted body's points come from.
    fn twist(&self, at: &Dynamic, rate: &Dynamic) -> Made<Dynamic> {
        let at = Self::vector("twist", at)?;
        let rate = self.scalar("twist", Self::operand("twist", rate)?)?;
        let [x, y, z] = self.parts(at)?;
        let angle = self.push(Op::Mul, &[z, rate], &[])?;
        let cos = self.push(Op::Cos, &[angle], &[])?;
        let sin = self.push(Op::Sin, &[angle], &[])?;
        let product = |a, b| self.push(Op::Mul, &[a, b], &[]);
        let u = self.push(Op::Add, &[product(x, cos)?, product(y, sin)?], &[])?;
        let v = self.push(Op::Sub, &[product(y, cos)?, product(x, sin)?], &[])?;
        Ok(Operand::Vector(self.push(Op::Vector, &[u, v, z], &[])?).into_dynamic())
    }

    /// Undoes a taper along z (Barr 1984): between `low` and `high` the section's scale goes from the first to the second.
    fn taper(&self, at: &Dynamic, given: &Map) -> Made<Dynamic> {
        let at = Self::vector("taper", at)?;
        let options = Options::new("taper", &["low", "high", "scale"], given)?;
        let (low, high) = (options.number("low", -1.0)?, options.number("high", 1.0)?);
        let [first, second] = options.numbers("scale", [1.0, 0.5])?;
        if low >= high {
            return refuse(
                format!("`taper` wants its low below its high, not {low} and {high}"),
                "they are heights in metres",
            );
        }
        if first <= 0.0 || second <= 0.0 {
            return refuse(
                "`taper` wants scales above 0",
                "scale: [1, 0.5] halves the width from low to high",
            );
        }
        let [x, y, z] = self.parts(at)?;
        let raised = self.push(Op::Max, &[z, self.number(low)?], &[])?;
        let held = self.push(Op::Min, &[raised, self.number(high)?], &[])?;
        let above = self.push(Op::Sub, &[held, self.number(low)?], &[])?;
        let slope = self.number((second - first) / (high - low))?;
        let change = self.push(Op::Mul, &[above, slope], &[])?;
        let scale = self.push(Op::Add, &[self.number(first)?, change], &[])?;
        let (u, v) = (
            self.push(Op::Div, &[x, scale], &[])?,
            self.push(Op::Div, &[y, scale], &[])?,
        );
        Ok(Operand::Vector(self.push(Op::Vector, &[u, v, z], &[])?).into_dynamic())
    }

    /// Undoes a bend of what stands along z (Barr 1984): towards +x, by `rate` radians a metre between `low` and
    /// `high`. What is at the height `centre` stays where it is, and beyond both ends the body goes on straight.
    fn bend(&self, at: &Dynamic, given: &Map) -> Made<Dynamic> {
        let at = Self::vector("bend", at)?;
        let options = Options::new("bend", &["rate", "low", "high", "centre"], given)?;
        let (low, high) = (options.number("low", -1.0)?, options.number("high", 1.0)?);
        let rate = options.number("rate", 0.5)?;
        let centre = options.number("centre", 0.5 * (low + high))?;
        if rate == 0.0 {
            return Ok(Operand::Vector(at).into_dynamic());
        }
        let part = |part: f64| self.push(Op::Bend, &[at], &[part, rate, low, high, centre]);
        let y = self.push(Op::Y, &[at], &[])?;
        let straight = self.push(Op::Vector, &[part(0.0)?, y, part(1.0)?], &[])?;
        Ok(Operand::Vector(straight).into_dynamic())
    }

    /// Moves the place by a free-form deformation (Sederberg and Parry 1986): a lattice of displacements over a
    /// box, x fastest, joined by Bernstein polynomials. Beyond the box they go on as on its faces.
    fn free_form(&self, at: &Dynamic, moves: &Array, given: &Map) -> Made<Dynamic> {
        let name = "free_form";
        let at = Self::vector(name, at)?;
        let options = Options::new(name, &["min", "max", "counts"], given)?;
        let counts = options.numbers("counts", [2.0; 3])?;
        let mut params = counts.map(|count| count - 1.0).to_vec();
        params.extend(options.numbers("min", [-1.0; 3])?);
        params.extend(options.numbers("max", [1.0; 3])?);
        let moves = moves
            .iter()
            .map(|each| options::place(name, each))
            .collect::<Made<Vec<_>>>()?;
        let mut parts = [at; 3];
        for (axis, part) in parts.iter_mut().enumerate() {
            let mut params = params.clone();
            params.extend(moves.iter().map(|each| each[axis]));
            *part = self.push(Op::Bernstein, &[at], &params)?;
        }
        let way = self.push(Op::Vector, &parts, &[])?;
        Ok(Operand::Vector(self.push(Op::VectorAdd, &[at, way], &[])?).into_dynamic())
    }

    /// The components of a vector.
    pub(super) fn parts(&self, at: NodeId) -> Made<[NodeId; 3]> {
        Ok([
            self.push(Op::X, &[at], &[])?,
            self.push(Op::Y, &[at], &[])?,
            self.push(Op::Z, &[at], &[])?,
        ])
    }
}
