//! A program without its finest noises, and how far those can move the field: Worley and Hart's early exit, as a
//! program of its own.
//!
//! What is left out of a sum counts as the middle of its range. Ranges of the whole program then hold the coarse one's
//! values too, step by step, and so do the rules of how a step's value changes with its arguments' ([`super::bounds`]):
//! here all places stand still, and only what was left out changes.

use super::bounds::{Pass, middle};
use super::fold::{self, Value};
use super::plan::{Act, Plan, Step};
use super::{Code, Program};
use crate::arithmetic::Binary;
use crate::op::Kind;
use crate::surroundings::Surroundings;

/// Most octaves of a program that is cut: each is left out once to see what that does.
const OCTAVES_MAX: usize = 128;

/// How many octaves are kept of each noise and cascade of a program, in their order. A noise by itself is one octave.
#[derive(Clone, PartialEq, Debug)]
pub struct Cut {
    kept: Vec<usize>,
}

impl Program {
    /// The cut that leaves no more than `share` of the octaves, those left out that move the first root least. `None` if
    /// nothing bounds what it would be moved by, or there are too many.
    pub fn cut(&self, share: f64, around: &Surroundings) -> Option<Cut> {
        let octaves: Vec<usize> = self.plan.steps.iter().filter_map(octaves).collect();
        let mut left: usize = octaves.iter().sum();
        if left > OCTAVES_MAX {
            return None;
        }
        let most = left as f64 * share;
        let mut cut = Cut { kept: octaves };
        let mut moved: Vec<Vec<f64>> = Vec::new();
        for i in 0..cut.kept.len() {
            let whole = cut.kept[i];
            let by = (0..=whole).map(|kept| {
                cut.kept[i] = kept;
                self.moved_by(&cut, around)
            });
            moved.push(by.collect());
            cut.kept[i] = whole;
        }
        while left as f64 > most {
            let more = |i: usize| match cut.kept[i] {
                0 => f64::INFINITY,
                kept => moved[i][kept - 1] - moved[i][kept],
            };
            let next = (0..moved.len()).min_by(|&i, &j| more(i).total_cmp(&more(j)))?;
            if !more(next).is_finite() {
                return None;
            }
            cut.kept[next] -= 1;
            left -= 1;
        }
        Some(cut)
    }

    /// The program without what is left out. The cut may be that of another program with the same noises.
    pub fn coarse(&self, cut: &Cut) -> Option<Self> {
        let plan = self.plan.cut(cut);
        let code = Code::new(&plan).ok()?;
        Some(Self::of_code(plan, code))
    }

    /// No value of the first root is farther than this from that of [`Self::coarse`], both as they are computed; may be infinite.
    pub fn moved_by(&self, cut: &Cut, around: &Surroundings) -> f64 {
        let bounds = Pass::of_cut(around, &cut.kept).run(&self.plan);
        let root = self.plan.roots.first().map(|&root| bounds[root].change());
        root.map_or(f64::INFINITY, |change| change.offset)
    }
}

/// How many octaves a step has, if it is a noise or a cascade.
fn octaves(step: &Step) -> Option<usize> {
    match &step.act {
        Act::Noise(_) | Act::AnyNoise(_) => Some(1),
        Act::Cascade(cascade) => Some(cascade.octaves.len()),
        _ => None,
    }
}

impl Plan {
    fn cut(&self, cut: &Cut) -> Self {
        let mut kept = cut.kept.iter().copied();
        let mut steps = Steps::default();
        let mut now = Vec::with_capacity(self.steps.len());
        for step in &self.steps {
            let args = step.args.iter().map(|&arg| now[arg]).collect();
            let keeps = octaves(step).map(|octaves| octaves.min(kept.next().unwrap_or(octaves)));
            let middle = keeps.map_or(0.0, |keeps| middle(&step.act, keeps));
            let act = match (&step.act, keeps) {
                (Act::Noise(_) | Act::AnyNoise(_) | Act::Cascade(_), Some(0)) => {
                    now.push(steps.push(Act::Constant(middle), Vec::new(), step.kind));
                    continue;
                }
                (Act::Cascade(cascade), Some(keeps)) => {
                    let mut cascade = cascade.clone();
                    cascade.octaves.truncate(keeps);
                    Act::Cascade(cascade)
                }
                (act, _) => act.clone(),
            };
            let mut place = steps.push(act, args, step.kind);
            if middle != 0.0 {
                let middle = steps.push(Act::Constant(middle), Vec::new(), Kind::Scalar);
                place = steps.push(Act::Binary(Binary::Add), vec![place, middle], Kind::Scalar);
            }
            now.push(place);
        }
        let roots = self.roots.iter().map(|&root| now[root]).collect();
        let steps = steps.steps;
        Self::live(steps, roots)
    }
}

/// Steps, and what those are that are constant.
#[derive(Default)]
struct Steps {
    steps: Vec<Step>,
    values: Vec<Option<Value>>,
}

impl Steps {
    /// Appends a step, done already if its arguments are constant.
    fn push(&mut self, act: Act, args: Vec<usize>, kind: Kind) -> usize {
        let known: Vec<_> = args.iter().map(|&arg| self.values[arg]).collect();
        let value = fold::constant(&act, &known);
        let (act, args) = match value {
            Some(Value::Scalar(value)) => (Act::Constant(value), Vec::new()),
            Some(Value::Vector(value)) => (Act::ConstantVector(value), Vec::new()),
            None => (act, args),
        };
        self.steps.push(Step { act, args, kind });
        self.values.push(value);
        self.steps.len() - 1
    }
}
