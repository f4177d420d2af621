//! Field expressions that stand alone, outside of any scene: for measuring and plotting.

use std::collections::BTreeMap;
use std::fmt;

use field::{Graph, NodeId};

use crate::curve::Curve;
use crate::description::Seed;
use crate::expression::{Fields, Refusal, is_name, is_taken};

/// An expression as a field.
#[derive(Clone, Debug)]
pub struct Alone {
    /// The graph that it built.
    pub graph: Graph,
    /// Its own node: a number at every point.
    pub root: NodeId,
    /// Names that it was given and did not use.
    pub unused: Vec<String>,
}

/// Why an expression is no field.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ExpressionError {
    /// What is wrong, a sentence without its full stop.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
    /// Line and column in the expression, both from 1; columns count characters.
    pub position: Option<(usize, usize)>,
}

impl fmt::Display for ExpressionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((line, column)) = self.position {
            write!(f, "line {line}, column {column}: ")?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for ExpressionError {}

impl From<Refusal> for ExpressionError {
    fn from(refusal: Refusal) -> Self {
        Self {
            message: refusal.message,
            help: refusal.help,
            position: refusal.position,
        }
    }
}

/// Evaluates an expression over a plane seed, with `numbers` as further names.
///
/// A name that the language has already is refused.
pub fn expression(text: &str, numbers: &[(&str, f64)]) -> Result<Alone, ExpressionError> {
    let mut curves = BTreeMap::new();
    for &(name, value) in numbers {
        if is_taken(name) || !is_name(name) {
            return Err(ExpressionError {
                message: format!("`{name}` cannot be given a value"),
                help: None,
                position: None,
            });
        }
        curves.insert(name.to_owned(), Curve::Constant(value));
    }
    let fields = Fields::new(Seed::Plane, curves);
    let root = fields.field(text)?;
    Ok(Alone {
        root,
        unused: fields.unused_curves(),
        graph: fields.into_graph(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_numbers() {
        let with = |key| expression("noise(p, key)", &[("key", key)]).unwrap();
        assert!(with(3.0).unused.is_empty());
        assert_ne!(with(3.0).graph, with(4.0).graph);
        let without = expression("noise(p)", &[("key", 3.0)]).unwrap();
        assert_eq!(without.unused, ["key"]);
    }

    #[test]
    fn mistakes_say_where() {
        let error = expression("1 +\n  nosie(p)", &[]).unwrap_err();
        assert_eq!(error.position, Some((2, 3)));
        assert!(error.help.unwrap().contains("noise"));
        assert!(expression("1", &[("p", 1.0)]).is_err());
    }
}
