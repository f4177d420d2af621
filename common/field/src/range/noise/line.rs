//! Cellular noise along a line, where the nodes that count are those of a few stretches, each known from end to end.
//!
//! The squared distance from a node at from + e·along, e the line's symbol, is ‖along‖²e² and a linear function that is the node's own.
//! So which node is the nearest, the second nearest and so on changes where two linear functions meet: sorting those of all
//! nodes, place by place, gives for each order the nodes in turn and where they change. A distance is a convex function of e, so
//! that beside a line an order's extremes lie at the ends of its stretches or where a distance has the line's slope: the band that
//! they make is as narrow as one with its slope can be, where minima of forms (thesis eq. (5.28)) widen with each node.
//!
//! A place that lies off the line by some error has distances that differ by no more than that error's length.

use super::Near;
use super::cellular::{Search, around, is_squared, nearest as by_operations};
use crate::interval::{Interval, larger, smaller};
use crate::noise::cellular::{Cellular, Norm, ORDERS, REACH};
use crate::number::Number;
use crate::range::{Arithmetic, ROUNDING, Reduced};

/// Beyond so many cells the noise's range says about as much as the distances, and costs nothing.
const LENGTH_MAX: f64 = 3.0;

/// More than the rounding of squared distances, none of which is greater than a few hundred, with all the times that two were compared.
const SQUARES: f64 = 1e-11;

/// More than the rounding of a distance, its square, and what a line has beside it.
const DISTANCES: f64 = 1e-12;

/// Sorts distances of a place's range as [`Arithmetic::nearest`] says: those of one symbol are along a line.
pub(crate) fn nearest<const N: usize>(
    cellular: &Cellular,
    near: &Near<Reduced<N>>,
    sorted: &mut [Reduced<N>],
) {
    let Some(line) = Line::of(&near.ways).filter(|_| cellular.norm() == Norm::Two) else {
        return by_operations(cellular, near, sorted);
    };
    if line.square > 0.25 * LENGTH_MAX * LENGTH_MAX {
        for slot in sorted {
            *slot = Reduced::any(Interval::new(0.0, slot.centre));
        }
        return;
    }
    let mut levels = Levels::new(&line, sorted.len());
    around(cellular, near, &mut levels);
    let kept = if is_squared(cellular) {
        Kept::Square
    } else {
        Kept::Length
    };
    for (slot, level) in sorted.iter_mut().zip(&levels.levels) {
        let Some((band, image)) = levels.band(level, kept) else {
            continue;
        };
        // A square s² of a place r off the line is at most (s + r)².
        let off = match kept {
            Kept::Length => line.off,
            Kept::Square => line.off * (2.0 * image.high.sqrt() + line.off),
        };
        let mut form = Reduced {
            centre: band.centre,
            along: [0.0; N],
            error: band.error + off,
        };
        form.along[line.symbol] = band.slope;
        let form = form.checked().within(image.expand(off));
        *slot = if image.high + off < slot.centre {
            form
        } else {
            form.min(*slot)
        };
    }
}

/// Places from + e·along, |e| ≤ 1, give or take `off`.
struct Line {
    from: [f64; 3],
    along: [f64; 3],
    /// ‖along‖².
    square: f64,
    /// Which symbol e is.
    symbol: usize,
    /// How far from the line its places may be.
    off: f64,
}

impl Line {
    /// `None` where more than one symbol counts.
    fn of<const N: usize>(at: &[Reduced<N>; 3]) -> Option<Self> {
        let counts = |n: &usize| at.iter().any(|part| part.along[*n] != 0.0);
        let mut symbols = (0..N).filter(counts);
        let symbol = symbols.next().unwrap_or(0);
        let along = at.each_ref().map(|part| part.along[symbol]);
        symbols.next().is_none().then(|| Self {
            from: at.each_ref().map(|part| part.centre),
            along,
            square: super::square(along),
            symbol,
            off: super::square(at.each_ref().map(|part| part.error)).sqrt() * (1.0 + ROUNDING),
        })
    }
}

/// A node as the line sees it.
struct Node {
    /// The way to it from the line's middle.
    way: [f64; 3],
    /// The squared distance without ‖along‖²e²: the value at e = 0, and the slope.
    value: f64,
    slope: f64,
}

impl Node {
    fn new(line: &Line, at: [f64; 3]) -> Self {
        let ([x, y, z], [a, b, c]) = (at, line.from);
        let way = [x - a, y - b, z - c];
        Self {
            way,
            value: super::square(way),
            slope: -2.0 * inner(way, line.along),
        }
    }

    #[inline(always)]
    fn linear(&self, e: f64) -> f64 {
        self.value + self.slope * e
    }

    /// The squared distance, without what would be lost of a small one.
    #[inline(always)]
    fn distance_squared(&self, line: &Line, e: f64) -> f64 {
        let off = |k: usize| self.way[k] - e * line.along[k];
        super::square([off(0), off(1), off(2)])
    }
}

/// Where a level's node changes, or an end of the line.
#[derive(Clone, Copy)]
struct Turn {
    e: f64,
    /// The node from here on, and its linear function here.
    node: usize,
    value: f64,
    at: [f64; 3],
    /// The squared distance.
    square: f64,
}

impl Turn {
    fn new(line: &Line, nodes: &[Node], e: f64, node: usize) -> Self {
        let ([x, y, z], [a, b, c]) = (line.from, line.along);
        let value = nodes[node].linear(e);
        Self {
            e,
            node,
            value,
            at: [x + e * a, y + e * b, z + e * c],
            square: value + line.square * (e * e),
        }
    }
}

/// The nodes of one order in turn, from e = −1 to 1; empty where no node was found for it.
type Level = Vec<Turn>;

/// The levels of all orders that count, nearest first.
struct Levels<'a> {
    line: &'a Line,
    nodes: Vec<Node>,
    levels: [Level; ORDERS],
    orders: usize,
    /// The greatest distance in the last level.
    farthest: f64,
    /// What is sorted in, and room for what becomes of it and of a level.
    carried: Level,
    nearer: Level,
    farther: Level,
}

impl<'a> Levels<'a> {
    fn new(line: &'a Line, orders: usize) -> Self {
        Self {
            line,
            nodes: Vec::with_capacity(8),
            levels: Default::default(),
            orders,
            farthest: REACH,
            carried: Level::new(),
            nearer: Level::new(),
            farther: Level::new(),
        }
    }

    /// The turns of the last order that counts.
    fn last(&self) -> &[Turn] {
        self.levels[..self.orders].last().map_or(&[], |level| level)
    }

    /// Sorts a node into the levels.
    fn sort_in(&mut self, node: Node) {
        self.nodes.push(node);
        let (line, nodes) = (self.line, &self.nodes[..]);
        self.carried.clear();
        let ends = [-1.0, 1.0].map(|e| Turn::new(line, nodes, e, nodes.len() - 1));
        self.carried.extend(ends);
        for (level, order) in self.levels.iter_mut().zip(1..=self.orders) {
            if level.is_empty() {
                std::mem::swap(level, &mut self.carried);
                break;
            }
            let farther = (order < self.orders).then_some(&mut self.farther);
            sort(
                line,
                nodes,
                [level, &self.carried],
                &mut self.nearer,
                farther,
            );
            std::mem::swap(level, &mut self.nearer);
            std::mem::swap(&mut self.carried, &mut self.farther);
        }
        let most = |most: f64, turn: &Turn| larger(turn.square, most);
        self.farthest = match self.last() {
            [] => REACH,
            turns => smaller(turns.iter().fold(0.0, most).sqrt(), REACH),
        };
    }
}

impl Search for Levels<'_> {
    /// The least that a cell's nodes can have of a squared distance beside ‖along‖²e² is a concave function of e, as the least of linear
    /// ones is: where it is above a level's at both ends of a stretch it is above it between them.
    fn reaches(&self, [x, y, z]: [f64; 3]) -> bool {
        let gap = |low: f64, at: f64| larger(larger(low - at, at - low - 1.0), 0.0);
        let nearer = |turn: &Turn| {
            let [a, b, c] = turn.at;
            super::square([gap(x, a), gap(y, b), gap(z, c)]) < turn.square + SQUARES
        };
        let last = self.last();
        last.is_empty() || last.iter().any(nearer)
    }

    fn add(&mut self, at: [f64; 3]) -> f64 {
        let node = Node::new(self.line, at);
        let last = self.last();
        // What is nowhere nearer at a turn is nowhere nearer between: both are linear there.
        if last.is_empty() || last.iter().any(|turn| node.linear(turn.e) < turn.value) {
            self.sort_in(node);
        }
        self.farthest
    }
}

impl Levels<'_> {
    /// What a level's distances stay close to, and all of them; `None` of a level without nodes.
    fn band(&self, level: &[Turn], kept: Kept) -> Option<(Beside, Interval)> {
        let line = self.line;
        let at = |node: &Node, e: f64| {
            let square = node.distance_squared(line, e);
            match kept {
                Kept::Length => square.sqrt(),
                Kept::Square => square,
            }
        };
        let end = |turn: &Turn| at(&self.nodes[turn.node], turn.e);
        let slope = 0.5 * (end(level.last()?) - end(level.first()?));
        let (mut band, mut image) = (NOWHERE, NOWHERE);
        for stretch in level.windows(2) {
            let (from, to) = (stretch[0].e, stretch[1].e);
            let node = &self.nodes[stretch[0].node];
            for e in [from, to] {
                let value = at(node, e);
                image = reached(image, value);
                band = reached(band, value - slope * e);
            }
            let nearest = inner(node.way, line.along) / line.square;
            let rise = match kept {
                Kept::Square => 0.5 * slope / line.square,
                Kept::Length => {
                    let across = node.distance_squared(line, nearest);
                    slope * (across / (line.square * (line.square - slope * slope))).sqrt()
                }
            };
            let sloping = nearest + rise;
            if from < nearest && nearest < to {
                image = reached(image, at(node, nearest));
            }
            if from < sloping && sloping < to {
                band = reached(band, at(node, sloping) - slope * sloping);
            }
        }
        // Nodes are told apart by their squares.
        let room = match kept {
            Kept::Length => SQUARES / larger(image.low, SQUARES.sqrt()),
            Kept::Square => SQUARES,
        } + DISTANCES;
        let beside = Beside {
            centre: 0.5 * (band.low + band.high),
            slope,
            error: 0.5 * (band.high - band.low) + room,
        };
        let image = Interval::new(larger(image.low - room, 0.0), image.high + room);
        Some((beside, image))
    }
}

/// What is known of a distance.
#[derive(Clone, Copy, PartialEq)]
enum Kept {
    Length,
    Square,
}

/// centre + slope·e, give or take an error.
struct Beside {
    centre: f64,
    slope: f64,
    error: f64,
}

/// Sorts two levels by place.
fn sort(
    line: &Line,
    nodes: &[Node],
    [a, b]: [&[Turn]; 2],
    nearer: &mut Level,
    mut farther: Option<&mut Level>,
) {
    let mut push = |e: f64, near: usize, far: usize| {
        for (level, node) in [(Some(&mut *nearer), near), (farther.as_deref_mut(), far)] {
            let Some(level) = level else { continue };
            if e == -1.0 {
                level.clear();
            }
            if e == 1.0 || level.last().is_none_or(|last| last.node != node) {
                level.push(Turn::new(line, nodes, e, node));
            }
        }
    };
    let (mut i, mut j, mut start) = (0, 0, -1.0);
    while let ([p, p_next, ..], [q, q_next, ..]) = (&a[i..], &b[j..]) {
        let end = smaller(p_next.e, q_next.e);
        let apart = |e: f64| nodes[q.node].linear(e) - nodes[p.node].linear(e);
        let sorted = |first: bool| {
            if first {
                (p.node, q.node)
            } else {
                (q.node, p.node)
            }
        };
        let (before, after) = (apart(start), apart(end));
        let first = before > 0.0 || (before == 0.0 && after >= 0.0);
        let (near, far) = sorted(first);
        push(start, near, far);
        let second = after > 0.0 || (after == 0.0 && first);
        if second != first {
            let across = start + (end - start) * (before / (before - after));
            push(larger(start, smaller(across, end)), far, near);
        }
        if end >= 1.0 {
            let (near, far) = sorted(second);
            push(1.0, near, far);
            break;
        }
        start = end;
        i += usize::from(p_next.e <= end);
        j += usize::from(q_next.e <= end);
    }
}

/// No value yet.
const NOWHERE: Interval = Interval {
    low: f64::INFINITY,
    high: f64::NEG_INFINITY,
};

#[inline(always)]
fn reached(range: Interval, value: f64) -> Interval {
    Interval {
        low: smaller(range.low, value),
        high: larger(range.high, value),
    }
}

#[inline(always)]
fn inner([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> f64 {
    a * x + b * y + c * z
}
