//! Leaving out of a program what does not matter in a part of space: branches that are never taken there, bodies that
//! are not there, and what a modulation function holds back altogether.
//!
//! Ranges over cells say which argument a minimum, maximum or selection always takes, where a magnitude is a number
//! itself, and where a smooth step is 0 or 1. What is left computes the same values there, to the bit: no
//! operation is replaced by another one that rounds differently.
//!
//! Of a surface only what is inside must be exact. Where the root is a union, a body that is nowhere near can go even
//! if it is nearer than others: values outside then grow, and stay outside. A fillet of width k between a and b is none
//! where they are k apart, and takes at most k/4 off. So where values above m of a fillet do not matter, those above
//! m + 2k of its arguments do not.

use crate::arithmetic::{Binary, Unary};
use crate::number::Number;
use crate::program::plan::{Act, Plan, Step};
use crate::program::{Code, Program};
use crate::range::{Cell, Reduced};
use crate::shape::Shape;

/// What would do for a step everywhere in the cells.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Fate {
    /// No cell was looked at.
    Unseen,
    /// Any of its arguments whose bits are set.
    Arguments(u8),
    /// This number.
    Constant(f64),
    /// Nothing but itself.
    Kept,
}

impl Fate {
    /// What would do for a step in one cell, if values above `margin` do not matter.
    fn of(step: &Step, values: &[Reduced<3>], margin: Option<f64>) -> Self {
        let arg = |i: usize| values[step.args[i]];
        let range = |i: usize| arg(i).interval();
        if let Some(Join { takes_less, width }) = Join::of(&step.act) {
            // Of the forms' difference, in which what both share is gone.
            let difference = arg(0).minus(arg(1)).interval();
            let (first_less, second_less) = (difference.high < -width, difference.low > width);
            let (mut first, mut second) = if takes_less {
                (first_less, second_less)
            } else {
                (second_less, first_less)
            };
            if let Some(margin) = margin {
                first |= range(1).low > margin;
                second |= range(0).low > margin;
            }
            return match u8::from(first) | u8::from(second) << 1 {
                0 => Self::Kept,
                arguments => Self::Arguments(arguments),
            };
        }
        match &step.act {
            Act::Select if range(0).high < 0.0 => Self::Arguments(0b010),
            Act::Select if range(0).low >= 0.0 => Self::Arguments(0b100),
            Act::Unary(Unary::Abs) if range(0).low > 0.0 => Self::Arguments(0b001),
            Act::SmoothStep(low, _) if range(0).high < *low => Self::Constant(0.0),
            Act::SmoothStep(_, high) if range(0).low > *high => Self::Constant(1.0),
            _ => Self::Kept,
        }
    }

    /// What would do in cells where this would and in others where that would.
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Unseen, other) => other,
            (Self::Arguments(a), Self::Arguments(b)) if a & b != 0 => Self::Arguments(a & b),
            (Self::Constant(a), Self::Constant(b)) if a == b => self,
            _ => Self::Kept,
        }
    }
}

/// A step that takes one of two numbers where they are farther apart than its width.
struct Join {
    takes_less: bool,
    width: f64,
}

impl Join {
    fn of(act: &Act) -> Option<Self> {
        let join = |takes_less, width| Some(Self { takes_less, width });
        match act {
            Act::Binary(Binary::Min) => join(true, 0.0),
            Act::Binary(Binary::Max) => join(false, 0.0),
            Act::Shape(shape) => match &**shape {
                Shape::Blend(blend) => {
                    let (takes_less, width) = blend.local()?;
                    join(takes_less, width)
                }
                _ => None,
            },
            _ => None,
        }
    }
}

impl Program {
    /// Whether anything could be left out anywhere: whether it branches, or holds something back.
    pub fn has_choices(&self) -> bool {
        self.plan.steps.iter().any(|step| {
            let holds_back = matches!(
                step.act,
                Act::Select | Act::Unary(Unary::Abs) | Act::SmoothStep(..)
            );
            holds_back || Join::of(&step.act).is_some()
        })
    }

    /// A program of fewer operations for every place in these cells: inside, its first root's value is the same to the
    /// bit, and outside it is outside. `None` if nothing can be left out.
    ///
    /// A product with what is always 0 there may be +0 where it was −0; nothing but a division by it could tell.
    pub fn simplified(&self, cells: &[Cell]) -> Option<Self> {
        let margins = self.plan.margins();
        let mut fates = vec![Fate::Unseen; self.plan.steps.len()];
        let mut finite = vec![true; self.plan.steps.len()];
        for cell in cells {
            let values = self.steps_over_cell(cell);
            for (i, step) in self.plan.steps.iter().enumerate() {
                fates[i] = fates[i].and(Fate::of(step, &values, margins[i]));
                finite[i] &= values[i].interval().magnitude().is_finite();
            }
            if fates.iter().all(|fate| *fate == Fate::Kept) {
                return None;
            }
        }
        let plan = self.plan.without(&fates, &finite);
        if plan.steps.len() == self.plan.steps.len() {
            return None;
        }
        let code = Code::new(&plan).ok()?;
        Some(Self::of_code(plan, code))
    }
}

impl Plan {
    /// Above which values the arguments of each step do not matter for what is inside, if that can be said: of the union
    /// that is the only root, of unions that are nothing but its parts, and so on.
    fn margins(&self) -> Vec<Option<f64>> {
        let mut uses = vec![0u32; self.steps.len()];
        for arg in self.steps.iter().flat_map(|step| &step.args) {
            uses[*arg] += 1;
        }
        let mut of_step = vec![None; self.steps.len()];
        if let [root] = self.roots[..]
            && uses[root] == 0
        {
            of_step[root] = Some(0.0);
        }
        let mut of_arguments = vec![None; self.steps.len()];
        for (i, step) in self.steps.iter().enumerate().rev() {
            let Some((join, margin)) = Join::of(&step.act).zip(of_step[i]) else {
                continue;
            };
            if !join.takes_less {
                continue;
            }
            let margin = margin + 2.0 * join.width;
            of_arguments[i] = Some(margin);
            for &arg in step.args.iter().filter(|arg| uses[**arg] == 1) {
                of_step[arg] = Some(margin);
            }
        }
        of_arguments
    }

    /// The plan after these fates, less what then is of no use.
    fn without(&self, fates: &[Fate], finite: &[bool]) -> Self {
        let mut steps: Vec<Step> = Vec::with_capacity(self.steps.len());
        let mut now: Vec<usize> = Vec::with_capacity(self.steps.len());
        for (i, step) in self.steps.iter().enumerate() {
            let mut step = step.clone();
            for arg in &mut step.args {
                *arg = now[*arg];
            }
            let is_number = |arg: usize, number: f64| matches!(steps[step.args[arg]].act, Act::Constant(value) if value == number);
            let is_product = matches!(step.act, Act::Binary(Binary::Mul));
            let is_bounded = || self.steps[i].args.iter().all(|&arg| finite[arg]);
            let fate = if is_product && is_number(0, 1.0) {
                Fate::Arguments(0b10)
            } else if is_product && is_number(1, 1.0) {
                Fate::Arguments(0b01)
            } else if is_product && (is_number(0, 0.0) || is_number(1, 0.0)) && is_bounded() {
                Fate::Constant(0.0)
            } else {
                fates[i]
            };
            now.push(match fate {
                Fate::Arguments(bits) => step.args[bits.trailing_zeros() as usize],
                _ => i,
            });
            if let Fate::Constant(value) = fate {
                step.act = Act::Constant(value);
                step.args.clear();
            }
            steps.push(step);
        }
        let roots = self.roots.iter().map(|&root| now[root]).collect();
        Self::live(steps, roots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Graph;
    use crate::graph::NodeId;
    use crate::hash;
    use crate::interval::Interval;
    use crate::op::Op;
    use crate::range::Place;

    /// A union of a noisy ball at x = −3 and a bumpy one at x = 3, whose bumps begin at z = 1.
    fn bodies(join: (Op, &[f64])) -> Program {
        let mut graph = Graph::new();
        let mut push = |op, args: &[NodeId], params: &[f64]| graph.push(op, args, params).unwrap();
        let p = push(Op::Position, &[], &[]);
        let mut ball = |x: f64| {
            let parts = [x, 0.0, 0.0].map(|part| push(Op::Constant, &[], &[part]));
            let centre = push(Op::Vector, &parts, &[]);
            let from = push(Op::VectorSub, &[p, centre], &[]);
            let length = push(Op::Length, &[from], &[]);
            let one = push(Op::Constant, &[], &[1.0]);
            push(Op::Sub, &[length, one], &[])
        };
        let (left, right) = (ball(-3.0), ball(3.0));
        let noise = push(Op::Noise, &[p], &[1.0]);
        let left = push(Op::Add, &[left, noise], &[]);
        let z = push(Op::Z, &[p], &[]);
        let share = push(Op::SmoothStep, &[z], &[1.0, 2.0]);
        let bumps = push(Op::Noise, &[p], &[2.0]);
        let bumps = push(Op::Mul, &[share, bumps], &[]);
        let right = push(Op::Add, &[right, bumps], &[]);
        let all = push(join.0, &[left, right], join.1);
        Program::compile(&graph, &[all], Interval::point(0.0)).unwrap()
    }

    /// Equal to the bit inside, and both outside elsewhere.
    fn agree(few: &Program, whole: &Program, place: &Place) -> bool {
        let (few, whole) = (few.at(place), whole.at(place));
        if whole > 0.0 {
            few > 0.0
        } else {
            few.to_bits() == whole.to_bits()
        }
    }

    fn box_around(centre: [f64; 3], half: f64) -> Cell {
        let mut edges = [[0.0; 3]; 3];
        for (axis, edge) in edges.iter_mut().enumerate() {
            edge[axis] = half;
        }
        Cell::of_edges(centre, edges)
    }

    #[test]
    fn what_is_left_has_the_same_bits_inside_its_cells() {
        for join in JOINS {
            same_bits(&bodies(join));
        }
    }

    /// A crease, and a fillet.
    const JOINS: [(Op, &[f64]); 2] = [(Op::Min, &[]), (Op::Blend, &[2.0, 0.25])];

    fn same_bits(whole: &Program) {
        assert!(whole.has_choices());
        let noises = |program: &Program| {
            let steps = program.plan.steps.iter();
            steps
                .filter(|step| matches!(step.act, Act::Noise(_)))
                .count()
        };
        for (centre, left) in [
            // The left ball with its noise; the right one below and above where its bumps begin.
            ([-3.0, 0.0, 0.0], 1),
            ([3.0, 0.0, 0.0], 0),
            ([3.0, 0.0, 3.0], 1),
        ] {
            let few = whole.simplified(&[box_around(centre, 0.5)]).unwrap();
            assert_eq!(noises(&few), left, "{centre:?}");
            for i in 0..1000 {
                let unit = |axis: u32| hash::unit(hash::hash(&[i, axis])) - 0.5;
                let place = Place {
                    at: [0u32, 1, 2].map(|axis| centre[axis as usize] + unit(axis)),
                    footprint: 0.0,
                    time: 0.0,
                };
                assert!(agree(&few, whole, &place), "{place:?}");
            }
        }
    }

    #[test]
    fn bodies_that_are_elsewhere_go_though_they_are_nearer_than_others() {
        // Sixteen balls in a row, joined by fillets; over all of it, each is the nearest somewhere.
        let mut graph = Graph::new();
        let mut push = |op, args: &[NodeId], params: &[f64]| graph.push(op, args, params).unwrap();
        let p = push(Op::Position, &[], &[]);
        let mut all = None;
        for x in (0..16).map(f64::from) {
            let parts = [x, 0.0, 0.0].map(|part| push(Op::Constant, &[], &[part]));
            let centre = push(Op::Vector, &parts, &[]);
            let from = push(Op::VectorSub, &[p, centre], &[]);
            let length = push(Op::Length, &[from], &[]);
            let radius = push(Op::Constant, &[], &[0.45]);
            let ball = push(Op::Sub, &[length, radius], &[]);
            all = Some(match all {
                None => ball,
                Some(before) => push(Op::Blend, &[before, ball], &[2.0, 0.05]),
            });
        }
        let whole = Program::compile(&graph, &[all.unwrap()], Interval::point(0.0)).unwrap();
        // A pole through ball 7, as long as the row: over it no ball is the nearest everywhere.
        let cells = [-4.0, -2.0, 0.0, 2.0, 4.0].map(|y| {
            Cell::of_edges(
                [7.0, y, 0.0],
                [[0.2, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.2]],
            )
        });
        let few = whole.simplified(&cells).unwrap();
        let balls = |program: &Program| {
            let steps = program.plan.steps.iter();
            steps.filter(|step| matches!(step.act, Act::Length)).count()
        };
        assert!(
            balls(&few) <= 3,
            "{} balls are left of {}",
            balls(&few),
            balls(&whole)
        );
        let mut inside = 0;
        for i in 0..4000 {
            let unit = |axis: u32| 2.0 * hash::unit(hash::hash(&[i, axis])) - 1.0;
            let place = Place {
                at: [7.0 + 0.2 * unit(0), 5.0 * unit(1), 0.2 * unit(2)],
                footprint: 0.0,
                time: 0.0,
            };
            assert!(agree(&few, &whole, &place), "{place:?}");
            inside += u32::from(whole.at(&place) <= 0.0);
        }
        assert!(inside > 100);
    }

    #[test]
    fn bodies_stay_that_come_into_a_cell_while_it_is_looked_at() {
        // One ball stands; another goes away from there, 6 m in a second.
        let mut graph = Graph::new();
        let mut push = |op, args: &[NodeId], params: &[f64]| graph.push(op, args, params).unwrap();
        let p = push(Op::Position, &[], &[]);
        let [zero, six] = [0.0, 6.0].map(|number| push(Op::Constant, &[], &[number]));
        let time = push(Op::Time, &[], &[]);
        let away = push(Op::Mul, &[time, six], &[]);
        let mut ball = |x, radius| {
            let centre = push(Op::Vector, &[x, zero, zero], &[]);
            let from = push(Op::VectorSub, &[p, centre], &[]);
            let length = push(Op::Length, &[from], &[]);
            let radius = push(Op::Constant, &[], &[radius]);
            push(Op::Sub, &[length, radius], &[])
        };
        let (stands, goes) = (ball(zero, 1.0), ball(away, 1.25));
        let both = graph.push(Op::Min, &[stands, goes], &[]).unwrap();
        let whole = Program::compile(&graph, &[both], Interval::new(0.0, 1.0)).unwrap();
        let during = |low: f64, high: f64| {
            let mut cell = box_around([0.0; 3], 1.2);
            cell.time = Interval::new(low, high);
            whole.simplified(&[cell])
        };
        let few = during(0.8, 1.0).unwrap();
        assert!(!few.moves() && during(0.0, 1.0).is_none());
        for i in 0..1000 {
            let unit = |word: u32| hash::unit(hash::hash(&[i, word]));
            let place = Place {
                at: [0, 1, 2].map(|axis| 2.4 * unit(axis) - 1.2),
                footprint: 0.0,
                time: 0.8 + 0.2 * unit(3),
            };
            assert!(agree(&few, &whole, &place), "{place:?}");
        }
    }

    #[test]
    fn what_matters_in_any_cell_stays() {
        let whole = bodies(JOINS[0]);
        let both = [[-3.0, 0.0, 0.0], [3.0, 0.0, 1.2]].map(|centre| box_around(centre, 0.5));
        assert!(whole.simplified(&both).is_none());
        assert!(whole.simplified(&[box_around([0.0; 3], 4.0)]).is_none());
        assert!(whole.simplified(&[]).is_none());
    }
}
