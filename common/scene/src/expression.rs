//! Field expressions: scripts that build a graph once and are never seen again.
//!
//! An expression is Rhai in a sandbox of our own making: no package but what
//! [`language`] gives it, every limit set. Its numbers are Rhai's, its fields are
//! nodes of a [`Graph`]. What Rhai would get silently wrong is refused with a
//! hint or made right: `1/3` divides exactly, `2^3` points to `**`, comparing a
//! field points to `select`.

mod bezier;
mod cascades;
mod differences;
mod grids;
mod language;
pub(crate) mod library;
mod make;
pub(crate) mod noises;
mod options;
mod refusal;
mod shapes;
mod skeletons;
mod solids;
mod values;
mod weierstrass;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use field::{Graph, NodeId};
use rhai::{Dynamic, Engine};

use crate::curve::Curve;
use crate::description::Seed;
use crate::file::Files;
use values::Operand;

/// Most bytes of an expression.
pub(crate) const TEXT_MAX: usize = 64 << 10;

/// Why an expression is no field.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Refusal {
    /// What is wrong, a sentence without its full stop.
    pub(crate) message: String,
    /// What to do about it.
    pub(crate) help: Option<String>,
    /// Line and column in the expression, both from 1; columns count characters.
    pub(crate) position: Option<(usize, usize)>,
}

/// What all expressions of one scene share: the graph that they build, and the names they know.
pub(crate) struct Fields {
    engine: Engine,
    shared: Rc<Shared>,
}

/// What the functions of the language reach.
struct Shared {
    graph: RefCell<Graph>,
    seed: Seed,
    curves: BTreeMap<String, Curve>,
    used: RefCell<BTreeSet<String>>,
    /// Where files are read from, if an expression may name any.
    files: Option<Rc<Files>>,
}

impl Fields {
    /// Of expressions that name no files.
    pub(crate) fn new(seed: Seed, curves: BTreeMap<String, Curve>) -> Self {
        Self::of(seed, curves, None)
    }

    /// Of expressions that may name files.
    pub(crate) fn with_files(
        seed: Seed,
        curves: BTreeMap<String, Curve>,
        files: Rc<Files>,
    ) -> Self {
        Self::of(seed, curves, Some(files))
    }

    fn of(seed: Seed, curves: BTreeMap<String, Curve>, files: Option<Rc<Files>>) -> Self {
        let shared = Rc::new(Shared {
            graph: RefCell::default(),
            seed,
            curves,
            used: RefCell::default(),
            files,
        });
        Self {
            engine: language::engine(&shared),
            shared,
        }
    }

    /// The field that an expression stands for.
    pub(crate) fn field(&self, text: &str) -> Result<NodeId, Refusal> {
        if text.len() > TEXT_MAX {
            return Err(Refusal {
                message: format!("the expression is longer than {TEXT_MAX} bytes"),
                help: None,
                position: None,
            });
        }
        let result = self
            .engine
            .compile(text)
            .map_err(|error| refusal::of_parsing(&error))
            .and_then(|script| {
                self.engine
                    .eval_ast::<Dynamic>(&script)
                    .map_err(|error| refusal::of_evaluation(*error))
            })?;
        self.scalar(&result).map_err(|(message, help)| Refusal {
            message,
            help: Some(help.to_owned()),
            position: None,
        })
    }

    fn scalar(&self, result: &Dynamic) -> Result<NodeId, (String, &'static str)> {
        match Operand::from_dynamic(result) {
            Some(Operand::Scalar(id)) => Ok(id),
            Some(Operand::Number(value)) if !value.is_finite() => Err((
                format!("the expression is {value}, but a field is a finite number"),
                "a number too large for 64 bits came up in what is computed here",
            )),
            Some(Operand::Number(value)) => {
                let node = self.shared.graph.borrow_mut().constant(value);
                node.map_err(|error| (error.to_string(), "check the numbers of the expression"))
            }
            Some(Operand::Vector(_)) => Err((
                "the expression is a vector, but a field is a number at every point".into(),
                "take a component such as .z, or length(...)",
            )),
            None if result.is_unit() => Err((
                "the expression has no value".into(),
                "end it with the value itself, without a semicolon",
            )),
            None => Err((
                format!(
                    "the expression is {}, not a field",
                    refusal::kind(result.type_name())
                ),
                "a field is made of p, t, numbers and functions such as noise(p)",
            )),
        }
    }

    /// Names of the curves that no expression used.
    pub(crate) fn unused_curves(&self) -> Vec<String> {
        let used = self.shared.used.borrow();
        let unused = self
            .shared
            .curves
            .keys()
            .filter(|name| !used.contains(*name));
        unused.cloned().collect()
    }

    /// The graph of all expressions so far.
    pub(crate) fn into_graph(self) -> Graph {
        self.shared.graph.take()
    }
}

/// Names that curves may not have: the language gives them another meaning.
pub(crate) fn is_taken(name: &str) -> bool {
    language::NAMES.contains(&name) || language::FUNCTIONS.contains(&name)
}

/// Whether an expression could use a name at all.
pub(crate) fn is_name(name: &str) -> bool {
    name.len() <= 64
        && name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

#[cfg(test)]
mod tests;
