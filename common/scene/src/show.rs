//! Nodes of a graph as one would write them.

use field::op::Params;
use field::{Graph, NodeId, Op};

/// A node as an expression, cut after about `length` characters.
pub(crate) fn node(graph: &Graph, id: NodeId, length: usize) -> String {
    let mut text = String::new();
    write(graph, id, length, &mut text);
    text
}

fn write(graph: &Graph, id: NodeId, length: usize, text: &mut String) {
    if text.len() >= length {
        if !text.ends_with('…') {
            text.push('…');
        }
        return;
    }
    let node = &graph.nodes()[id.index()];
    let signature = node.op.signature();
    let infix = match node.op {
        Op::Add | Op::VectorAdd => Some(" + "),
        Op::Sub | Op::VectorSub => Some(" - "),
        Op::Mul | Op::Scale => Some("*"),
        Op::Div => Some("/"),
        _ => None,
    };
    match (node.op, infix) {
        (Op::Constant, _) => text.push_str(&node.params[0].to_string()),
        (Op::X | Op::Y | Op::Z, _) => {
            write(graph, node.args[0], length, text);
            text.push('.');
            text.push_str(signature.name);
        }
        (_, Some(infix)) => {
            text.push('(');
            write(graph, node.args[0], length, text);
            text.push_str(infix);
            write(graph, node.args[1], length, text);
            text.push(')');
        }
        _ => {
            text.push_str(signature.name);
            if node.args.is_empty() && matches!(signature.params, Params::Named(&[])) {
                return;
            }
            text.push('(');
            for (index, arg) in node.args.iter().enumerate() {
                if index > 0 {
                    text.push_str(", ");
                }
                write(graph, *arg, length, text);
            }
            text.push(')');
        }
    }
}
