//! Takes a field apart into the seed's own distance and the rest.
//!
//! Along a ray the distance to a plane or a sphere is known exactly; only the
//! rest, a terrain's displacement, needs a modulus. A ray that grazes a planet then
//! steps as far as the mountains allow, not as far as the ground below.

use field::{Graph, NodeId, Op};
use scene::description::Seed;

/// A field that is its seed's distance plus something.
pub(crate) struct Split {
    /// The graph with the rest added to it.
    pub(crate) graph: Graph,
    /// The field less the seed's ‖x‖ or z.
    pub(crate) rest: NodeId,
}

/// Most terms of a sum that are looked at.
const TERMS_MAX: usize = 256;

/// The split of `field`; `None` unless it is a sum in which the seed's ‖x‖ or z stands just once.
pub(crate) fn split(graph: &Graph, field: NodeId, seed: &Seed) -> Option<Split> {
    let mut terms = Vec::new();
    let mut open = vec![(field, Sign::Plus)];
    while let Some((id, sign)) = open.pop() {
        let node = &graph.nodes()[id.index()];
        match node.op {
            Op::Add => open.extend([(node.args[1], sign), (node.args[0], sign)]),
            Op::Sub => open.extend([(node.args[1], sign.turned()), (node.args[0], sign)]),
            Op::Neg => open.push((node.args[0], sign.turned())),
            _ => terms.push((id, sign)),
        }
        if open.len() + terms.len() > TERMS_MAX {
            return None;
        }
    }
    let distance = terms
        .iter()
        .position(|&(id, sign)| sign == Sign::Plus && is_distance(graph, id, seed))?;
    terms.remove(distance);
    let mut graph = graph.clone();
    let mut rest = graph.constant(0.0).ok()?;
    for (id, sign) in terms {
        let op = match sign {
            Sign::Plus => Op::Add,
            Sign::Minus => Op::Sub,
        };
        rest = graph.push(op, &[rest, id], &[]).ok()?;
    }
    Some(Split { graph, rest })
}

/// Whether a node is ‖x‖ or z, as the seed asks.
fn is_distance(graph: &Graph, id: NodeId, seed: &Seed) -> bool {
    let node = &graph.nodes()[id.index()];
    let wanted = match seed {
        Seed::Plane => Op::Z,
        Seed::Sphere { .. } => Op::Length,
    };
    node.op == wanted && graph.nodes()[node.args[0].index()].op == Op::Position
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Sign {
    Plus,
    Minus,
}

impl Sign {
    fn turned(self) -> Self {
        match self {
            Self::Plus => Self::Minus,
            Self::Minus => Self::Plus,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planet_is_split_and_a_scaled_or_doubled_distance_is_not() {
        let seed = Seed::Sphere { radius: 5.0 };
        let mut graph = Graph::new();
        let p = graph.push(Op::Position, &[], &[]).unwrap();
        let length = graph.push(Op::Length, &[p], &[]).unwrap();
        let radius = graph.constant(5.0).unwrap();
        let noise = graph.push(Op::Noise, &[p], &[3.0]).unwrap();
        let seed_field = graph.push(Op::Sub, &[length, radius], &[]).unwrap();
        let planet = graph.push(Op::Sub, &[seed_field, noise], &[]).unwrap();
        let found = split(&graph, planet, &seed).unwrap();
        // 0 − 5 − noise.
        let rest = &found.graph.nodes()[found.rest.index()];
        assert_eq!((rest.op, rest.args[1]), (Op::Sub, noise));
        assert!(split(&graph, planet, &Seed::Plane).is_none());

        let hollow = graph.push(Op::Neg, &[planet], &[]).unwrap();
        assert!(split(&graph, hollow, &seed).is_none());
        let scaled = graph.push(Op::Mul, &[planet, radius], &[]).unwrap();
        assert!(split(&graph, scaled, &seed).is_none());
        // ‖x‖ twice: one of them stays in the rest, whose modulus then knows it.
        let twice = graph.push(Op::Add, &[planet, length], &[]).unwrap();
        assert!(split(&graph, twice, &seed).is_some());
    }
}
