//! Making nodes: arithmetic on numbers stays numbers, the rest goes into the graph.

use field::{NodeId, Op};
use rhai::Dynamic;

use super::Shared;
use super::values::{Made, Operand, refuse};
use crate::curve::Curve;
use crate::description::Seed;

impl Shared {
    /// A node of the graph, or the graph's reason against it.
    pub(super) fn push(&self, op: Op, args: &[NodeId], params: &[f64]) -> Made<NodeId> {
        self.graph
            .borrow_mut()
            .push(op, args, params)
            .or_else(|error| {
                refuse(
                    error.to_string(),
                    "see the constants and options of the call",
                )
            })
    }

    /// The value of an argument, or an error that says what the function wants.
    pub(super) fn operand(function: &str, value: &Dynamic) -> Made<Operand> {
        match Operand::from_dynamic(value) {
            Some(operand) => Ok(operand),
            None => refuse(
                format!(
                    "`{function}` does not take {}",
                    super::refusal::kind(value.type_name())
                ),
                "it takes numbers, fields and vectors",
            ),
        }
    }

    /// The node of a number or a field.
    pub(super) fn scalar(&self, function: &str, operand: Operand) -> Made<NodeId> {
        match operand {
            Operand::Scalar(id) => Ok(id),
            Operand::Number(value) => {
                self.push(Op::Constant, &[], &[Self::finite(function, value)?])
            }
            Operand::Vector(_) => refuse(
                format!("`{function}` wants a number here, not a vector"),
                "take a component such as p.x, or length(...)",
            ),
        }
    }

    /// The node of a vector.
    pub(super) fn vector(function: &str, value: &Dynamic) -> Made<NodeId> {
        match Self::operand(function, value)? {
            Operand::Vector(id) => Ok(id),
            other => refuse(
                format!("`{function}` wants a vector here, not {}", other.kind()),
                "the point is p; vec(x, y, z) makes a vector of numbers",
            ),
        }
    }

    /// A number that must be known when the scene is read.
    pub(super) fn constant(function: &str, value: &Dynamic) -> Made<f64> {
        match Self::operand(function, value)? {
            Operand::Number(number) => Self::finite(function, number),
            other => refuse(
                format!(
                    "`{function}` wants a constant number here, not {}",
                    other.kind()
                ),
                "only constants and what is computed from them",
            ),
        }
    }

    /// A number that a field can hold; `function` is what was to take it.
    pub(super) fn finite(function: &str, number: f64) -> Made<f64> {
        if number.is_finite() {
            return Ok(number);
        }
        refuse(
            format!("`{function}` is given a number that is {number}: numbers must be finite"),
            "a number too large for 64 bits came up in what is computed here",
        )
    }

    /// A function of scalars: of numbers alone it is computed at once.
    pub(super) fn scalars<const N: usize>(
        &self,
        op: Op,
        args: [&Dynamic; N],
        numbers: impl Fn([f64; N]) -> f64,
    ) -> Made<Dynamic> {
        let name = op.signature().name;
        let mut known = [0.0; N];
        let mut all_known = true;
        let mut operands = Vec::with_capacity(N);
        for (place, arg) in known.iter_mut().zip(args) {
            let operand = Self::operand(name, arg)?;
            match operand {
                Operand::Number(number) => *place = number,
                _ => all_known = false,
            }
            operands.push(operand);
        }
        if all_known {
            return Ok(Dynamic::from_float(numbers(known)));
        }
        let nodes = operands
            .into_iter()
            .map(|operand| self.scalar(name, operand))
            .collect::<Made<Vec<_>>>()?;
        Ok(Operand::Scalar(self.push(op, &nodes, &[])?).into_dynamic())
    }

    /// `a` and `b` joined by one of + − * /, at least one of them a field or a vector.
    pub(super) fn arithmetic(&self, op: Op, a: &Dynamic, b: &Dynamic) -> Made<Dynamic> {
        let name = op.signature().name;
        let (a, b) = (Self::operand(name, a)?, Self::operand(name, b)?);
        let made = match (op, a, b) {
            (Op::Add, Operand::Vector(a), Operand::Vector(b)) => {
                Operand::Vector(self.push(Op::VectorAdd, &[a, b], &[])?)
            }
            (Op::Sub, Operand::Vector(a), Operand::Vector(b)) => {
                Operand::Vector(self.push(Op::VectorSub, &[a, b], &[])?)
            }
            (Op::Mul, Operand::Vector(_), Operand::Vector(_)) => {
                return refuse(
                    "two vectors cannot be multiplied with `*`",
                    "their inner product is dot(a, b)",
                );
            }
            (Op::Mul, Operand::Vector(vector), factor)
            | (Op::Mul, factor, Operand::Vector(vector)) => self.scaled(vector, factor)?,
            (Op::Div, _, Operand::Number(0.0)) => {
                return refuse(super::language::BY_ZERO, super::language::BY_ZERO_HELP);
            }
            (Op::Div, Operand::Vector(vector), Operand::Number(by)) => {
                self.scaled(vector, Operand::Number(1.0 / by))?
            }
            (Op::Div, Operand::Vector(vector), by @ Operand::Scalar(_)) => {
                let by = self.scalar(name, by)?;
                let one = self.push(Op::Constant, &[], &[1.0])?;
                let inverse = self.push(Op::Div, &[one, by], &[])?;
                self.scaled(vector, Operand::Scalar(inverse))?
            }
            (_, Operand::Vector(_), _) | (_, _, Operand::Vector(_)) => {
                return refuse(
                    format!("{} `{name}` {} has no meaning", a.kind(), b.kind()),
                    "take a component such as p.x, length(...), or make a vector with vec(x, y, z)",
                );
            }
            _ => self.scalar_arithmetic(op, a, b)?,
        };
        Ok(made.into_dynamic())
    }

    fn scaled(&self, vector: NodeId, factor: Operand) -> Made<Operand> {
        if factor == Operand::Number(1.0) {
            return Ok(Operand::Vector(vector));
        }
        let factor = self.scalar("*", factor)?;
        Ok(Operand::Vector(self.push(
            Op::Scale,
            &[vector, factor],
            &[],
        )?))
    }

    fn scalar_arithmetic(&self, op: Op, a: Operand, b: Operand) -> Made<Operand> {
        use Operand::Number;
        let same = match (op, a, b) {
            (Op::Add | Op::Sub, kept, Number(0.0))
            | (Op::Add, Number(0.0), kept)
            | (Op::Mul | Op::Div, kept, Number(1.0))
            | (Op::Mul, Number(1.0), kept) => Some(kept),
            _ => None,
        };
        if let Some(same) = same {
            return Ok(same);
        }
        let name = op.signature().name;
        let (a, b) = (self.scalar(name, a)?, self.scalar(name, b)?);
        Ok(Operand::Scalar(self.push(op, &[a, b], &[])?))
    }

    /// −a.
    pub(super) fn negated(&self, a: &Dynamic) -> Made<Dynamic> {
        let made = match Self::operand("-", a)? {
            Operand::Vector(vector) => self.scaled(vector, Operand::Number(-1.0))?,
            Operand::Number(number) => Operand::Number(-number),
            Operand::Scalar(id) => Operand::Scalar(self.push(Op::Neg, &[id], &[])?),
        };
        Ok(made.into_dynamic())
    }

    /// a to a constant power: products where it is whole, sign(a)|a|^e where not.
    pub(super) fn power(&self, a: &Dynamic, exponent: &Dynamic) -> Made<Dynamic> {
        /// Largest whole exponent that is multiplied out.
        const WHOLE_MAX: f64 = 64.0;
        let base = match Self::operand("**", a)? {
            Operand::Number(base) => {
                return refuse(
                    format!("{base} cannot be raised to a field"),
                    "the exponent must be a constant; exp(x * 0.693147) is 2**x",
                );
            }
            operand => self.scalar("**", operand)?,
        };
        let exponent = Self::constant("**", exponent)?;
        if exponent == 0.0 {
            return Ok(Dynamic::from_float(1.0));
        }
        if exponent % 1.0 != 0.0 || exponent.abs() > WHOLE_MAX {
            let id = self.push(Op::Power, &[base], &[exponent])?;
            return Ok(Operand::Scalar(id).into_dynamic());
        }
        let mut left = exponent.abs();
        let (mut square, mut product) = (base, None);
        while left > 0.0 {
            if left % 2.0 == 1.0 {
                product = Some(match product {
                    Some(product) => self.push(Op::Mul, &[product, square], &[])?,
                    None => square,
                });
            }
            left = libm::floor(left / 2.0);
            if left > 0.0 {
                square = self.push(Op::Mul, &[square, square], &[])?;
            }
        }
        let mut power = product.expect("the exponent is not 0");
        if exponent < 0.0 {
            let one = self.push(Op::Constant, &[], &[1.0])?;
            power = self.push(Op::Div, &[one, power], &[])?;
        }
        Ok(Operand::Scalar(power).into_dynamic())
    }

    /// A component of a vector.
    pub(super) fn component(&self, op: Op, vector: NodeId) -> Made<Dynamic> {
        Ok(Operand::Scalar(self.push(op, &[vector], &[])?).into_dynamic())
    }

    /// What a name means that no script defined.
    pub(super) fn name(&self, name: &str) -> Made<Option<Dynamic>> {
        let vector =
            |op, args: &[NodeId], params: &[f64]| self.push(op, args, params).map(Operand::Vector);
        let scalar =
            |op, args: &[NodeId], params: &[f64]| self.push(op, args, params).map(Operand::Scalar);
        let point = || self.push(Op::Position, &[], &[]);
        let meaning = match (name, self.seed) {
            ("p", _) => Operand::Vector(point()?),
            ("t", _) => scalar(Op::Time, &[], &[])?,
            ("PI", _) => Operand::Number(core::f64::consts::PI),
            ("seed" | "height", Seed::Plane) => scalar(Op::Z, &[point()?], &[])?,
            ("seed" | "height", Seed::Sphere { radius }) => {
                let length = self.push(Op::Length, &[point()?], &[])?;
                let radius = self.push(Op::Constant, &[], &[radius])?;
                scalar(Op::Sub, &[length, radius], &[])?
            }
            ("base", Seed::Plane) => vector(Op::OntoPlane, &[point()?], &[])?,
            ("base", Seed::Sphere { radius }) => vector(Op::OntoSphere, &[point()?], &[radius])?,
            ("R", Seed::Sphere { radius }) => Operand::Number(radius),
            ("R", Seed::Plane) => {
                return refuse(
                    "a plane has no radius `R`",
                    "it is the radius of [surface.sphere]",
                );
            }
            _ => match self.curves.get(name) {
                Some(curve) => {
                    self.used.borrow_mut().insert(name.to_owned());
                    self.curve(curve)?
                }
                None => return Ok(None),
            },
        };
        Ok(Some(meaning.into_dynamic()))
    }

    fn curve(&self, curve: &Curve) -> Made<Operand> {
        let op = match curve {
            Curve::Constant(value) => return Ok(Operand::Number(*value)),
            Curve::Linear(_) => Op::Linear,
            Curve::Smooth(_) => Op::Smooth,
        };
        let keys: Vec<f64> = curve
            .keys()
            .iter()
            .flat_map(|&(time, value)| [time, value])
            .collect();
        let time = self.push(Op::Time, &[], &[])?;
        Ok(Operand::Scalar(self.push(op, &[time], &keys)?))
    }
}

/// Functions that are more than one operation, or whose arguments differ in kind.
impl Shared {
    pub(super) fn smoothstep(&self, low: &Dynamic, high: &Dynamic, a: &Dynamic) -> Made<Dynamic> {
        let name = "smoothstep";
        let edges = [Self::constant(name, low)?, Self::constant(name, high)?];
        let a = self.scalar(name, Self::operand(name, a)?)?;
        Ok(Operand::Scalar(self.push(Op::SmoothStep, &[a], &edges)?).into_dynamic())
    }

    /// a + (b − a) u.
    pub(super) fn mix(&self, a: &Dynamic, b: &Dynamic, u: &Dynamic) -> Made<Dynamic> {
        let operand = |value| Self::operand("mix", value);
        if let (Operand::Number(a), Operand::Number(b), Operand::Number(u)) =
            (operand(a)?, operand(b)?, operand(u)?)
        {
            return Ok(Dynamic::from_float(a + (b - a) * u));
        }
        let way = self.join(Op::Sub, b, a)?;
        let part = self.join(Op::Mul, &way, u)?;
        self.join(Op::Add, a, &part)
    }

    /// Arithmetic where both may be plain numbers.
    fn join(&self, op: Op, a: &Dynamic, b: &Dynamic) -> Made<Dynamic> {
        match (Operand::from_dynamic(a), Operand::from_dynamic(b)) {
            (Some(Operand::Number(a)), Some(Operand::Number(b))) => {
                Ok(Dynamic::from_float(match op {
                    Op::Add => a + b,
                    Op::Sub => a - b,
                    _ => a * b,
                }))
            }
            _ => self.arithmetic(op, a, b),
        }
    }

    pub(super) fn dot(&self, a: &Dynamic, b: &Dynamic) -> Made<Dynamic> {
        let (a, b) = (Self::vector("dot", a)?, Self::vector("dot", b)?);
        Ok(Operand::Scalar(self.push(Op::Dot, &[a, b], &[])?).into_dynamic())
    }

    pub(super) fn vec(&self, components: [&Dynamic; 3]) -> Made<Dynamic> {
        let nodes = components
            .into_iter()
            .map(|component| self.scalar("vec", Self::operand("vec", component)?))
            .collect::<Made<Vec<_>>>()?;
        Ok(Operand::Vector(self.push(Op::Vector, &nodes, &[])?).into_dynamic())
    }

    /// The nearest point on the sphere of a radius, or on the plane.
    pub(super) fn onto(&self, v: &Dynamic, radius: Option<&Dynamic>) -> Made<Dynamic> {
        let id = match radius {
            Some(radius) => {
                let radius = Self::constant("onto_sphere", radius)?;
                self.push(
                    Op::OntoSphere,
                    &[Self::vector("onto_sphere", v)?],
                    &[radius],
                )?
            }
            None => self.push(Op::OntoPlane, &[Self::vector("onto_plane", v)?], &[])?,
        };
        Ok(Operand::Vector(id).into_dynamic())
    }
}
