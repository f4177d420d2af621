//! Cellular noise in any arithmetic: distances to the nodes that may be among the nearest, sorted by (5.28).
//!
//! The thesis has φ₁ and φ₂ alone, "due to the difficulty in determining the third and fourth smallest distances"
//! (§5.4.3). Inserting each distance into a sorted list takes a minimum and a maximum per place, which every arithmetic
//! has; of a set of uncertain distances the list then holds ranges of the smallest, the second smallest, and so on.
//! Nodes that are certainly farther than enough others are never looked at. Along a line there is a narrower way: `line`.

use super::Near;
use crate::interval::{Interval, larger};
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
    let squared = is_squared(cellular);
    let cap = if squared { REACH * REACH } else { REACH };
    let mut room: [T; ORDERS] = std::array::from_fn(|_| T::constant(cap));
    let sorted = &mut room[..weights.len()];
    T::nearest(cellular, &near, sorted);
    let mut total = T::constant(-cellular.bias());
    for (distance, weight) in sorted.iter().zip(weights) {
        let distance = distance.clone();
        let psi = match cellular.psi() {
            Psi::Square if !squared => distance.square(),
            Psi::Plain | Psi::Square => distance,
            Psi::Power(e) => distance.max(T::constant(0.0)).power(e),
        };
        total = total.plus(psi.times(*weight));
    }
    Some(total.settled(at))
}

/// Whether distances are kept as their squares, which are what counts and need no root.
pub(super) fn is_squared(cellular: &Cellular) -> bool {
    cellular.psi() == Psi::Square && cellular.norm() == Norm::Two
}

/// Sorts the distances of all nodes that may count into `sorted`, which begins with the greatest there can be.
pub(crate) fn nearest<T: Arithmetic>(cellular: &Cellular, near: &Near<T>, sorted: &mut [T]) {
    for (node, _) in Candidates::new(cellular, near).seen {
        let ways = near.from(node);
        let mut length = if is_squared(cellular) {
            super::squares(ways)
        } else {
            length(cellular.norm(), ways)
        };
        for slot in &mut *sorted {
            let (nearer, farther) = (slot.clone().min(length.clone()), slot.clone().max(length));
            (*slot, length) = (nearer, farther);
        }
    }
}

/// The nodes that can be among those that count, anywhere in range.
struct Candidates<'a, T> {
    norm: Norm,
    near: &'a Near<T>,
    /// However the place lies, as many nodes as there are orders are no farther than these.
    most: Vec<f64>,
    /// Nodes, and how near they may be.
    seen: Vec<([f64; 3], f64)>,
}

impl<'a, T: Arithmetic> Candidates<'a, T> {
    fn new(cellular: &Cellular, near: &'a Near<T>) -> Self {
        let mut found = Self {
            norm: cellular.norm(),
            near,
            most: vec![REACH; cellular.weights().len()],
            seen: Vec::new(),
        };
        if !found.most.is_empty() {
            around(cellular, near, &mut found);
        }
        let farthest = found.farthest();
        found.seen.retain(|(_, low)| *low <= farthest + ROOM);
        found
    }

    fn farthest(&self) -> f64 {
        self.most.last().copied().unwrap_or(0.0)
    }
}

impl<T: Arithmetic> Search for Candidates<'_, T> {
    fn add(&mut self, node: [f64; 3]) -> f64 {
        let low = self.norm.length_of(self.near.least(node));
        if low <= self.farthest() + ROOM {
            self.seen.push((node, low));
            let far = [0, 1, 2].map(|k| {
                let span = self.near.spans[k];
                larger(span.high - node[k], node[k] - span.low)
            });
            let high = self.norm.length_of(far);
            let at = self.most.partition_point(|most| *most <= high);
            if at < self.most.len() {
                self.most[at..].rotate_right(1);
                self.most[at] = high;
            }
        }
        self.farthest()
    }
}

/// What looks for the nodes that count.
pub(super) trait Search {
    /// Whether nodes of a cell can count, given its lower corner.
    fn reaches(&self, _cell: [f64; 3]) -> bool {
        true
    }

    /// Takes a node, and answers how far from the range the farthest that counts can be.
    fn add(&mut self, node: [f64; 3]) -> f64;
}

/// Which axes have a cell on a side of its ring, those with fewer first, for they are nearer.
const SIDES: [[bool; 3]; 7] = [
    [true, false, false],
    [false, true, false],
    [false, false, true],
    [true, true, false],
    [true, false, true],
    [false, true, true],
    [true, true, true],
];

/// Shows a search the nodes around a range, those of nearer cells first.
pub(super) fn around<T: Arithmetic>(cellular: &Cellular, near: &Near<T>, search: &mut impl Search) {
    let norm = cellular.norm();
    let measured = |distance: f64| norm.measure_of([distance + ROOM, 0.0, 0.0]);
    let (mut most, mut bound) = (REACH, measured(REACH));
    for ring in 0..=2 {
        let within: &[[bool; 3]] = if ring == 0 { &[[false; 3]] } else { &SIDES };
        for sides in within {
            let along = |k: usize| Along::new(near, k, ring, sides[k]);
            let (x, y, z) = (along(0), along(1), along(2));
            for k in 0..z.count {
                let (k, far) = z.step(k);
                if norm.measure_of([0.0, 0.0, far]) > bound || (k != 0 && cellular.is_planar()) {
                    continue;
                }
                for j in 0..y.count {
                    let (j, aside) = y.step(j);
                    if norm.measure_of([0.0, aside, far]) > bound {
                        continue;
                    }
                    for i in 0..x.count {
                        let (i, ahead) = x.step(i);
                        let corner = [f64::from(i), f64::from(j), f64::from(k)];
                        if norm.measure_of([ahead, aside, far]) > bound || !search.reaches(corner) {
                            continue;
                        }
                        for node in cellular.nodes(near.cell([i, j, k])) {
                            let ([x, y, z], [a, b, c]) = (node, corner);
                            let counts = search.add([x + a, y + b, z + c]);
                            if counts != most {
                                (most, bound) = (counts, measured(counts));
                            }
                        }
                    }
                }
            }
        }
        if most + ROOM < f64::from(ring) {
            break;
        }
    }
}

/// The cells of a ring along an axis: both of its sides, the nearer first, or all between them.
struct Along {
    span: Interval,
    first: i32,
    stride: i32,
    count: i32,
}

impl Along {
    fn new<T>(near: &Near<T>, k: usize, ring: i32, sides: bool) -> Self {
        let span = near.spans[k];
        let (low, high) = (near.first[k] - ring, near.last[k] + ring);
        let (first, stride, count) = if !sides && ring > 0 {
            (low + 1, 1, high - low - 1)
        } else if !sides {
            (low, 1, high - low + 1)
        } else if span.low - f64::from(low) < f64::from(high) + 1.0 - span.high {
            (low, high - low, 2)
        } else {
            (high, low - high, 2)
        };
        Self {
            span,
            first,
            stride,
            count,
        }
    }

    /// One of its cells, and how near the range may come to it along the axis.
    #[inline(always)]
    fn step(&self, i: i32) -> (i32, f64) {
        let step = self.first + i * self.stride;
        let low = f64::from(step);
        let gap = larger(low - self.span.high, self.span.low - (low + 1.0));
        (step, larger(gap, 0.0))
    }
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
