//! A field as a directed graph of operations: an arena, hash-consed, in topological order.
//!
//! There is no tree anywhere, in memory or on the wire: `x = x + x` repeated
//! sixty-four times is sixty-five nodes.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use crate::grid::{Samples, recipe};
use crate::noise::{self, limits};
use crate::op::{Basis, Kind, Op, Params};
use crate::shape::Shape;

/// Most nodes of a graph.
pub const NODES_MAX: usize = 65_536;

/// Most operations between a node and its farthest source.
pub const DEPTH_MAX: u32 = 4_096;

/// Most octaves of a cascade: beyond it a lattice cell is smaller than the position's precision.
pub const OCTAVES_MAX: f64 = 48.0;

/// Most keys of a curve.
pub const KEYS_MAX: usize = 4_096;

/// Most numbers of a shape's list.
pub const LIST_MAX: usize = 8_192;

/// Most constants after the named ones of an operation over a noise: the noise's own, and a Hurst coefficient per octave.
const NOISE_CONSTANTS_MAX: usize = 16 + 48;

/// A node of one graph. Its arguments have smaller ids than it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct NodeId(pub u32);

impl NodeId {
    /// The node's place in [`Graph::nodes`].
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// One operation applied to earlier nodes.
#[derive(Clone, PartialEq, Debug)]
pub struct Node {
    /// What it does.
    pub op: Op,
    /// To what; as many as the operation's signature asks.
    pub args: Vec<NodeId>,
    /// With which constants; finite, −0 written as +0.
    pub params: Vec<f64>,
}

/// Why a node was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GraphError {
    /// Too many nodes.
    #[error("the field has more than {NODES_MAX} operations")]
    TooManyNodes,
    /// Nested too deeply.
    #[error("the field is nested more than {DEPTH_MAX} operations deep")]
    TooDeep,
    /// A constant is NaN or infinite.
    #[error("a constant of `{0}` is {1}; constants must be finite")]
    NotFinite(&'static str, f64),
    /// Wrong number of arguments or constants, or one of another kind, or not an earlier node.
    #[error("`{0}` does not take these arguments")]
    Arguments(&'static str),
    /// A constant outside its range.
    #[error("`{op}` wants {wanted}, not {value}")]
    Range {
        /// The operation.
        op: &'static str,
        /// What it accepts, in words.
        wanted: &'static str,
        /// What it was given.
        value: f64,
    },
}

/// A field, or several that share their parts.
#[derive(Clone, Default, Debug)]
pub struct Graph {
    nodes: Vec<Node>,
    depths: Vec<u32>,
    known: HashMap<(Op, Vec<NodeId>, Vec<u64>), NodeId>,
    /// The samples of files, by the numbers that nodes know them by: no part of what the field is called.
    files: BTreeMap<u32, Arc<Samples>>,
}

impl PartialEq for Graph {
    fn eq(&self, other: &Self) -> bool {
        self.nodes == other.nodes
    }
}

impl Graph {
    /// A graph without nodes.
    pub fn new() -> Self {
        Self::default()
    }

    /// The node that applies `op`, new or the one that already does just this.
    pub fn push(&mut self, op: Op, args: &[NodeId], params: &[f64]) -> Result<NodeId, GraphError> {
        let params: Vec<f64> = params.iter().map(|value| value + 0.0).collect();
        self.check(op, args, &params)?;
        let bits = params.iter().map(|value| value.to_bits()).collect();
        let name = (op, args.to_vec(), bits);
        if let Some(&known) = self.known.get(&name) {
            return Ok(known);
        }
        let depth = args
            .iter()
            .map(|arg| self.depths[arg.index()] + 1)
            .max()
            .unwrap_or(0);
        if depth > DEPTH_MAX {
            return Err(GraphError::TooDeep);
        }
        if self.nodes.len() >= NODES_MAX {
            return Err(GraphError::TooManyNodes);
        }
        let id = NodeId(u32::try_from(self.nodes.len()).expect("NODES_MAX fits"));
        self.nodes.push(Node {
            op,
            args: args.to_vec(),
            params,
        });
        self.depths.push(depth);
        self.known.insert(name, id);
        Ok(id)
    }

    /// The constant `value`.
    pub fn constant(&mut self, value: f64) -> Result<NodeId, GraphError> {
        self.push(Op::Constant, &[], &[value])
    }

    /// Gives the samples of a file, by the number that nodes know it by: a field can only be compiled where
    /// the files are that it needs.
    pub fn attach(&mut self, file: u32, samples: Arc<Samples>) {
        self.files.insert(file, samples);
    }

    /// The files that were attached.
    pub fn files(&self) -> &BTreeMap<u32, Arc<Samples>> {
        &self.files
    }

    /// The numbers of the files that nodes need.
    pub fn files_needed(&self) -> Vec<u32> {
        let grids = self.nodes.iter().filter(|node| node.op == Op::Grid);
        let mut files: Vec<u32> = grids.map(recipe::file).collect();
        files.sort_unstable();
        files.dedup();
        files
    }

    /// All nodes; each stands after its arguments.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// What the node yields.
    pub fn kind(&self, id: NodeId) -> Kind {
        self.nodes[id.index()].op.signature().result
    }

    /// The value of a constant node.
    pub fn as_constant(&self, id: NodeId) -> Option<f64> {
        let node = &self.nodes[id.index()];
        (node.op == Op::Constant).then(|| node.params[0])
    }

    fn check(&self, op: Op, args: &[NodeId], params: &[f64]) -> Result<(), GraphError> {
        let signature = op.signature();
        let fits = args.len() == signature.args.len()
            && args
                .iter()
                .zip(signature.args)
                .all(|(arg, &kind)| arg.index() < self.nodes.len() && self.kind(*arg) == kind);
        let counted = match signature.params {
            Params::Named(names) => params.len() == names.len(),
            Params::OverNoise(names) => {
                params.len() <= names.len() + NOISE_CONSTANTS_MAX
                    && limits::split_noise(params, names.len()).is_some()
            }
            Params::Keys => {
                !params.is_empty() && params.len().is_multiple_of(2) && params.len() <= 2 * KEYS_MAX
            }
            Params::List => params.len() <= LIST_MAX,
        };
        if !fits || !counted {
            return Err(GraphError::Arguments(signature.name));
        }
        if let Some(&value) = params.iter().find(|value| !value.is_finite()) {
            return Err(GraphError::NotFinite(signature.name, value));
        }
        check_ranges(op, params)
    }
}

fn check_ranges(op: Op, params: &[f64]) -> Result<(), GraphError> {
    let signature = op.signature();
    let refuse = |wanted, value| {
        Err(GraphError::Range {
            op: signature.name,
            wanted,
            value,
        })
    };
    if let Some(Err((wanted, value))) = Shape::new(op, params) {
        return refuse(wanted, value);
    }
    let (Params::Named(names) | Params::OverNoise(names)) = signature.params else {
        if signature.params == Params::List {
            return Ok(());
        }
        return match params
            .chunks_exact(2)
            .zip(params.chunks_exact(2).skip(1))
            .find(|(a, b)| a[0] >= b[0])
        {
            Some((_, late)) => refuse("instants that rise", late[0]),
            None => Ok(()),
        };
    };
    for (&name, &value) in names.iter().zip(params) {
        match name {
            "basis" if Basis::from_number(value).is_none() => return refuse("a basis", value),
            "key" if value < 0.0 || value > f64::from(u32::MAX) || value % 1.0 != 0.0 => {
                return refuse("a key from 0 to 4294967295", value);
            }
            "lacunarity" if !(1.1..=16.0).contains(&value) => {
                return refuse("a lacunarity from 1.1 to 16", value);
            }
            "hurst" if !(-4.0..=4.0).contains(&value) => {
                return refuse("a Hurst coefficient from -4 to 4", value);
            }
            "octaves" if !(1.0..=OCTAVES_MAX).contains(&value) || value % 1.0 != 0.0 => {
                return refuse("1 to 48 whole octaves", value);
            }
            "detail" if !(0.0..=16.0).contains(&value) => {
                return refuse("a level-of-detail constant from 0 (none) to 16", value);
            }
            "radius" if value <= 0.0 => return refuse("a radius above 0", value),
            "exponent" if !(1.0 / 16.0..=16.0).contains(&value) => {
                return refuse("an exponent from 1/16 to 16", value);
            }
            _ => {}
        }
    }
    if let Some((wanted, value)) = recipe::complaint(op, params) {
        return refuse(wanted, value);
    }
    match op {
        Op::SmoothStep if params[0] >= params[1] => {
            refuse("its first edge below its second", params[0])
        }
        Op::Cascade | Op::NoiseGradient => match over_noise(op, names, params) {
            Some((wanted, value)) => refuse(wanted, value),
            None => Ok(()),
        },
        op if limits::is_noise(op) => match limits::refused(op, params) {
            Some((wanted, value)) => refuse(wanted, value),
            None => Ok(()),
        },
        _ => Ok(()),
    }
}

/// What is wrong with the constants of an operation over a noise.
fn over_noise(op: Op, names: &[&str], params: &[f64]) -> Option<limits::Refused> {
    let (inner, constants, after) = limits::split_noise(params, names.len())?;
    if let Some(refused) = limits::refused(inner, constants) {
        return Some(refused);
    }
    let named = |name: &str| {
        let at = names.iter().position(|known| *known == name);
        at.map_or(0.0, |at| params[at])
    };
    if op == Op::NoiseGradient {
        let smooth = noise::Noise::new(inner, constants).is_some_and(|n| n.bend().is_finite());
        return match after {
            _ if !smooth => Some(("a noise whose gradient is continuous", params[0])),
            [first, ..] => Some(("nothing after the noise", *first)),
            [] => None,
        };
    }
    let (octaves, first, model) = (named("octaves"), named("first"), named("model"));
    if !matches!(model, 0.0 | 1.0 | 2.0 | 3.0) {
        return Some(("a model from 0 to 3", model));
    }
    if !(0.0..OCTAVES_MAX).contains(&first) || first % 1.0 != 0.0 || first + octaves > OCTAVES_MAX {
        return Some(("octaves that end at the 48th", first));
    }
    #[expect(clippy::cast_precision_loss, reason = "it is at most 64")]
    let count = after.len() as f64;
    if count != 0.0 && count != octaves {
        return Some(("one Hurst coefficient for each octave", count));
    }
    after
        .iter()
        .find(|hurst| !(-4.0..=4.0).contains(*hurst))
        .map(|hurst| ("a Hurst coefficient from -4 to 4", *hurst))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubling_sixty_four_times_is_sixty_five_nodes() {
        let mut graph = Graph::new();
        let mut x = graph.push(Op::Time, &[], &[]).unwrap();
        for _ in 0..64 {
            x = graph.push(Op::Add, &[x, x], &[]).unwrap();
        }
        assert_eq!(graph.nodes().len(), 65);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mut graph = Graph::new();
        let p = graph.push(Op::Position, &[], &[]).unwrap();
        let one = graph.constant(1.0).unwrap();
        assert_eq!(graph.constant(-0.0).unwrap(), graph.constant(0.0).unwrap());
        assert!(graph.constant(f64::NAN).is_err());
        assert_eq!(
            graph.push(Op::Add, &[p, one], &[]),
            Err(GraphError::Arguments("+"))
        );
        assert_eq!(
            graph.push(Op::Add, &[one], &[]),
            Err(GraphError::Arguments("+"))
        );
        assert_eq!(
            graph.push(Op::Neg, &[NodeId(99)], &[]),
            Err(GraphError::Arguments("neg"))
        );
        assert!(graph.push(Op::Noise, &[p], &[0.5]).is_err());
        assert!(
            graph
                .push(Op::Linear, &[one], &[0.0, 1.0, 0.0, 2.0])
                .is_err()
        );
    }

    #[test]
    fn opcodes_are_unique_and_never_move() {
        for (before, after) in Op::ALL.iter().zip(&Op::ALL[1..]) {
            assert!(before.code() < after.code());
        }
        assert_eq!(Op::from_code(64), Some(Op::Noise));
        assert_eq!(Op::from_code(0), None);
    }
}
