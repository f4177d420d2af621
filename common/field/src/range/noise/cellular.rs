//! Cellular noise in any arithmetic: distances to the nodes that may be among the nearest, sorted by (5.28).
//!
//! The thesis has φ₁ and φ₂ alone, "due to the difficulty in determining the third and fourth smallest distances"
//! (§5.4.3). Inserting each distance into a sorted list takes a minimum and a maximum per place, which every arithmetic
//! has; of a set of uncertain distances the list then holds ranges of the smallest, the second smallest, and so on.
//! Nodes that are certainly farther than enough others are never looked at.

use super::Near;
use crate::noise::cellular::{Cellular, Norm, ORDERS, Psi, REACH};
use crate::range::Arithmetic;

/// Beyond so many cells the noise's range says as much as the distances.
const CELLS_MAX: i32 = 343;

/// Room for f32 in comparisons of distances.
const ROOM: f64 = 2e-6;

/// The exact noise; `None` where it is too far or too wide.
pub(super) fn sum<T: Arithmetic>(cellular: &Cellular, at: &[T; 3]) -> Option<T> {
    let flat = [at[0].clone(), at[1].clone(), T::constant(0.0)];
    let at = if cellular.is_planar() { &flat } else { at };
    let near = Near::new(at, 2, CELLS_MAX)?;
    let weights = cellular.weights();
    let direct = cellular.psi() == Psi::Square && cellular.norm() == Norm::Two;
    let cap = if direct { REACH * REACH } else { REACH };
    let mut sorted = vec![T::constant(cap); weights.len()];
    for node in candidates(cellular, &near) {
        let ways = near.from(node);
        let mut length = if direct {
            super::squares(ways)
        } else {
            length(cellular.norm(), ways)
        };
        for slot in &mut sorted {
            let (nearer, farther) = (slot.clone().min(length.clone()), slot.clone().max(length));
            (*slot, length) = (nearer, farther);
        }
    }
    let mut total = T::constant(-cellular.bias());
    for (distance, weight) in sorted.into_iter().zip(weights) {
        let psi = match cellular.psi() {
            Psi::Square if !direct => distance.square(),
            Psi::Plain | Psi::Square => distance,
            Psi::Power(e) => distance.max(T::constant(0.0)).power(e),
        };
        total = total.plus(psi.times(*weight));
    }
    Some(total.settled(at))
}

/// The nodes that can be among those that count, anywhere in range.
fn candidates<T: Arithmetic>(cellular: &Cellular, near: &Near<T>) -> Vec<[f64; 3]> {
    let norm = cellular.norm();
    let Some(last) = cellular.weights().len().checked_sub(1) else {
        return Vec::new();
    };
    // However the place lies, as many nodes as there are orders are no farther than these.
    let mut most = [REACH; ORDERS];
    let mut seen: Vec<([f64; 3], f64)> = Vec::new();
    for ring in 0..=2 {
        for step in near.steps(ring) {
            let outside = |k: usize| (near.first[k] - step[k]).max(step[k] - near.last[k]);
            let farther = [0, 1, 2].map(outside).into_iter().max() < Some(ring);
            if (ring > 0 && farther) || norm.length_of(near.gap(step)) > most[last] + ROOM {
                continue;
            }
            for node in cellular.nodes(near.cell(step)) {
                let node = [0, 1, 2].map(|k| node[k] + f64::from(step[k]));
                let low = norm.length_of(near.least(node));
                if low > most[last] + ROOM {
                    continue;
                }
                let far = [0, 1, 2].map(|k| {
                    let span = near.spans[k];
                    crate::interval::larger(span.high - node[k], node[k] - span.low)
                });
                let high = norm.length_of(far);
                seen.push((node, low));
                let mut at = ORDERS;
                while at > 0 && high < most[at - 1] {
                    at -= 1;
                }
                if at < ORDERS {
                    most[at..].rotate_right(1);
                    most[at] = high;
                }
            }
        }
        if most[last] + ROOM < f64::from(ring) {
            break;
        }
    }
    seen.retain(|(_, low)| *low <= most[last] + ROOM);
    seen.into_iter().map(|(node, _)| node).collect()
}

/// ‖d‖ as the norm has it, thesis eq. (4.20).
fn length<T: Arithmetic>(norm: Norm, ways: [T; 3]) -> T {
    let whole = |[x, y, z]: [T; 3]| x.plus(y).plus(z);
    match norm {
        Norm::One => whole(ways.map(T::abs)),
        Norm::Two => T::distance(ways),
        Norm::Most => {
            let [x, y, z] = ways.map(T::abs);
            x.max(y).max(z)
        }
        Norm::Other(p) => whole(ways.map(|way| way.abs().power(p))).power(1.0 / p),
    }
}
