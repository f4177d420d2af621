//! How steep a field is and how it curves, as fields themselves: what modulation functions with differential
//! dependencies are made of, which thesis §2.4.1 leaves to the future.
//!
//! They are central differences over a distance that the scene states: the field is built again at the place moved by
//! ± that distance along each axis. So they are there for every field, with bounds and normals of their own, and the
//! distance says how large the features are that count: slopes of details below it are averaged out.

use std::collections::BTreeMap;
use std::rc::Rc;

use field::{NodeId, Op};
use rhai::{Dynamic, Engine};

use super::Shared;
use super::values::{Made, Operand, refuse};

/// A function of a field and of the distance that it is taken over.
type OverDistance = fn(&Shared, &Dynamic, &Dynamic) -> Made<Dynamic>;

/// Adds them to the language.
pub(super) fn register(engine: &mut Engine, shared: &Rc<Shared>) {
    let all: [(&str, OverDistance); 3] = [
        ("gradient", Shared::gradient_over),
        ("slope", Shared::slope_over),
        ("curvature", Shared::curvature_over),
    ];
    for (name, function) in all {
        let s = shared.clone();
        engine.register_fn(name, move |f: Dynamic, over: Dynamic| {
            function(&s, &f, &over)
        });
    }
}

impl Shared {
    fn gradient_over(&self, f: &Dynamic, over: &Dynamic) -> Made<Dynamic> {
        let gradient = self.differences("gradient", f, over)?;
        Ok(Operand::Vector(gradient).into_dynamic())
    }

    fn slope_over(&self, f: &Dynamic, over: &Dynamic) -> Made<Dynamic> {
        let gradient = self.differences("slope", f, over)?;
        Ok(Operand::Scalar(self.push(Op::Length, &[gradient], &[])?).into_dynamic())
    }

    /// The distance that a difference is taken over.
    fn distance(function: &str, over: &Dynamic) -> Made<f64> {
        let over = Self::constant(function, over)?;
        if (1e-6..=1e9).contains(&over) {
            return Ok(over);
        }
        refuse(
            format!("`{function}` is taken over a distance from 1e-6 to 1e9 metres, not {over}"),
            "the size of the smallest features that should count",
        )
    }

    /// (f(x + h e) − f(x − h e)) / 2h along each axis e, h = `over`.
    fn differences(&self, function: &str, f: &Dynamic, over: &Dynamic) -> Made<NodeId> {
        let over = Self::distance(function, over)?;
        let f = self.scalar(function, Self::operand(function, f)?)?;
        let mut parts = [f; 3];
        for (axis, part) in parts.iter_mut().enumerate() {
            let (before, after) = (self.moved(f, axis, -over)?, self.moved(f, axis, over)?);
            *part = if before == after {
                self.number(0.0)?
            } else {
                let rise = self.push(Op::Sub, &[after, before], &[])?;
                self.push(Op::Mul, &[rise, self.number(0.5 / over)?], &[])?
            };
        }
        self.push(Op::Vector, &parts, &[])
    }

    /// The trace of the Hessian, Σ (f(x + h e) − 2 f(x) + f(x − h e)) / h² over the axes, h = `over`: positive in
    /// hollows, negative on ridges.
    fn curvature_over(&self, f: &Dynamic, over: &Dynamic) -> Made<Dynamic> {
        let name = "curvature";
        let over = Self::distance(name, over)?;
        let f = self.scalar(name, Self::operand(name, f)?)?;
        let twice = self.push(Op::Add, &[f, f], &[])?;
        let mut sum = None;
        for axis in 0..3 {
            let (before, after) = (self.moved(f, axis, -over)?, self.moved(f, axis, over)?);
            if before == after {
                continue;
            }
            let around = self.push(Op::Add, &[before, after], &[])?;
            let bend = self.push(Op::Sub, &[around, twice], &[])?;
            sum = Some(match sum {
                None => bend,
                Some(sum) => self.push(Op::Add, &[sum, bend], &[])?,
            });
        }
        let Some(sum) = sum else {
            return Ok(Dynamic::from_float(0.0));
        };
        let share = self.number(1.0 / (over * over))?;
        Ok(Operand::Scalar(self.push(Op::Mul, &[sum, share], &[])?).into_dynamic())
    }

    /// The field `f` as it is at the place moved by `way` along an axis.
    fn moved(&self, f: NodeId, axis: usize, way: f64) -> Made<NodeId> {
        let nodes = self.graph.borrow().nodes()[..=f.index()].to_vec();
        let mut needed = vec![false; nodes.len()];
        needed[f.index()] = true;
        for (index, node) in nodes.iter().enumerate().rev() {
            if needed[index] {
                node.args.iter().for_each(|arg| needed[arg.index()] = true);
            }
        }
        let mut by = [0.0; 3];
        by[axis] = way;
        let mut now: BTreeMap<NodeId, NodeId> = BTreeMap::new();
        for (id, node) in (0..).map(NodeId).zip(&nodes) {
            if !needed[id.index()] {
                continue;
            }
            let is_position = |id: &NodeId| nodes[id.index()].op == Op::Position;
            let moved = match node.op {
                Op::Position => self.shifted(id, by)?,
                // What lies on a plane moves on it, and not at all by a way across it.
                Op::OntoPlane if node.args.iter().all(is_position) => {
                    self.shifted(id, [by[0], by[1], 0.0])?
                }
                op => {
                    let args: Vec<_> = node.args.iter().map(|arg| now[arg]).collect();
                    self.push(op, &args, &node.params)?
                }
            };
            now.insert(id, moved);
        }
        Ok(now[&f])
    }

    /// A vector and a constant way; itself if that is none.
    fn shifted(&self, vector: NodeId, by: [f64; 3]) -> Made<NodeId> {
        if by == [0.0; 3] {
            return Ok(vector);
        }
        let [x, y, z] = by;
        let way = [self.number(x)?, self.number(y)?, self.number(z)?];
        let way = self.push(Op::Vector, &way, &[])?;
        self.push(Op::VectorAdd, &[vector, way], &[])
    }
}
