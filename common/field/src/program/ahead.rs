//! How far ahead of a place and behind it a field has no root: its derivative bounded on the stretch of the ray around it.
//!
//! One evaluation with its derivative gives every noise n and its derivative n′ at the place. Within a distance
//! s of it no derivative of the noise leaves n′ ± (B s + …), for the second derivatives of a noise
//! have a bound B, and so no value leaves n + [−s, s]·n′. These ranges go through the code as
//! [`stretch::Stretch`]es, without another noise, and give the field's least derivative m on the stretch: by the
//! mean value theorem f(x) + m s bounds the field from below; behind, its greatest does. What an octave weighs, and so how steep it can
//! be, is known at the place: far less than anywhere. Segment tracing (Galin et al. 2020) does this with
//! Lipschitz bounds; with second derivatives rays close in on roots like Newton's method.
//!
//! How long a stretch should be follows from how far the derivative's range spread on the one before, per metre: to where
//! it would be just clear. A longer one has a wider range, and less of it is clear than of the right one; there as much
//! of it is clear as its slope allows.

mod lanes;
mod octaves;
mod stretch;

use fearless_simd::Simd;

use crate::arithmetic::{Binary, Unary};
use crate::noise::Limits;
use crate::number::Number;
use crate::program::code::{Code, FOOTPRINT, Instruction, Operation, TIME};
use crate::program::machine;
use crate::program::slopes::Slopes;
use lanes::{Here, Stretches, WIDTH, row};
use octaves::{Growth, Octaves};
pub(crate) use stretch::Stretch;
use stretch::{least, most};

/// What is known of the field and wanted of the rays, lane by lane.
#[derive(Clone, Copy, Debug)]
pub struct Outlook<'a> {
    /// What values may be wrong by, in the field's unit: rounding; of [`crate::Taylor`].
    pub offset: &'a [f64],
    /// What derivatives may be wrong by, in the field's unit per metre: rounding, and what levels of detail
    /// change; of [`crate::Taylor`].
    pub slope: &'a [f64],
    /// How far ahead anything is worth knowing, metres.
    pub limit: &'a [f64],
    /// How far to look at least, metres; more than 0.
    pub least: &'a [f64],
    /// How far to look at most, metres, and where nothing else says how far.
    pub most: &'a [f64],
    /// How fast footprints grow along a ray at most.
    pub footprint_slope: f64,
    /// Where to look.
    pub sides: Sides,
}

/// On which sides of a place a stretch lies.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sides {
    /// Ahead alone.
    Ahead,
    /// As far behind the place as ahead of it: nearly twice as much is seen for the same work, by somewhat wider ranges.
    Both,
}

impl Sides {
    /// How far stretches reach behind, as a share of how far they reach ahead.
    fn back(self) -> f64 {
        match self {
            Self::Ahead => 0.0,
            Self::Both => 1.0,
        }
    }
}

/// The registers of stretches.
#[derive(Debug)]
#[expect(clippy::vec_box, reason = "results take their places by pointer")]
pub(crate) struct Ahead {
    registers: Vec<Box<Stretches>>,
    constants: Vec<f64>,
    result: Box<Stretches>,
    octaves: Box<Octaves>,
}

impl Default for Ahead {
    fn default() -> Self {
        Self {
            registers: Vec::new(),
            constants: Vec::new(),
            result: Stretches::new(),
            octaves: Box::new(Octaves::new()),
        }
    }
}

/// Whether stretches of these operations are bounded.
pub(crate) fn bounds(code: &Code) -> bool {
    code.instructions
        .iter()
        .all(|instruction| match &instruction.act {
            Operation::Slope(..) | Operation::Shape(_) | Operation::Grid(_) => false,
            Operation::AnyNoise(noise) => noise.bend().is_finite(),
            Operation::Cascade(cascade) => {
                let noises = cascade.octaves.iter().filter_map(|o| o.noise.as_ref());
                noises.into_iter().all(|noise| noise.bend().is_finite())
            }
            _ => true,
        })
}

impl Ahead {
    /// Makes room for the code and sets its constants.
    pub(crate) fn prepare(&mut self, code: &Code) {
        let (registers, constants) = (&mut self.registers, &mut self.constants);
        let set = |lanes: &mut Stretches, value| lanes.fill(Stretch::constant(value));
        machine::prepare(registers, constants, code, Stretches::new, set);
    }

    /// How far ahead of some places no root can be, and how far behind them. It looks as far as it guesses from `bend`,
    /// which it replaces. What the code gave at the places is in `along`.
    #[inline(always)]
    pub(crate) fn run<S: Simd>(
        &mut self,
        simd: S,
        code: &Code,
        along: &Slopes<1>,
        outlook: Outlook<'_>,
        root: usize,
        [ahead, behind, bend]: [&mut [f64]; 3],
    ) {
        let duals = along.register(root);
        let (value, slope) = (&duals.value, &duals.gradient[0]);
        let back = outlook.sides.back();
        self.octaves.back = back;
        let chunks = ahead.chunks_mut(WIDTH).zip(behind.chunks_mut(WIDTH));
        let chunks = chunks.zip(bend.chunks_mut(WIDTH)).enumerate();
        for (chunk, ((ahead, behind), bend)) in chunks {
            let start = chunk * WIDTH;
            let points = ahead.len();
            let end = start + points;
            let here = Here {
                value: &value[start..end],
                slope: &slope[start..end],
                offset: &outlook.offset[start..end],
                error: &outlook.slope[start..end],
            };
            let (least, most) = (&outlook.least[start..end], &outlook.most[start..end]);
            let row = &mut self.octaves.length;
            here.guess(bend, [least, most], row);
            let last = row[points - 1];
            row[points..].fill(last);
            self.inputs(start, along);
            let mut place = Place {
                start,
                sample: 0,
                cascade: 0,
            };
            for instruction in &code.instructions {
                self.step(
                    simd,
                    instruction,
                    along,
                    outlook.footprint_slope,
                    &mut place,
                );
                std::mem::swap(&mut self.registers[instruction.result], &mut self.result);
            }
            let length = &self.octaves.length;
            self.registers[root].clear(here, length, back, [ahead, behind, bend]);
        }
    }

    /// The places' own stretches.
    #[inline(always)]
    fn inputs(&mut self, start: usize, along: &Slopes<1>) {
        let (length, back) = (&self.octaves.length, self.octaves.back);
        for (i, register) in self.registers[..3].iter_mut().enumerate() {
            let from = along.register(i);
            let (at, slope) = (row(&from.value, start), row(&from.gradient[0], start));
            for lane in 0..WIDTH {
                let way = slope[lane] * length[lane];
                let (end, start) = (at[lane] + way, at[lane] - way * back);
                let ends = (least(start, end), most(start, end));
                register.set(lane, Stretch::new(ends, (slope[lane], slope[lane])));
            }
        }
        // The footprint is no argument of anything but cascades, and time stands still.
        let time = row(&along.register(TIME).value, start);
        let register = &mut self.registers[TIME];
        for (lane, time) in time.iter().enumerate() {
            register.set(lane, Stretch::constant(*time));
        }
    }

    #[inline(always)]
    fn step<S: Simd>(
        &mut self,
        simd: S,
        instruction: &Instruction,
        along: &Slopes<1>,
        footprint_slope: f64,
        place: &mut Place,
    ) {
        let [a, b, c] = instruction.args.map(|arg| &*self.registers[arg]);
        let out = &mut *self.result;
        match &instruction.act {
            Operation::Unary(unary) => unary_lanes(*unary, a, out),
            Operation::Binary(binary) => binary_lanes(*binary, [a, b], out),
            Operation::Select => each3([a, b, c], out, Stretch::select),
            Operation::Length => each3(
                [a, b, c],
                out,
                #[inline(always)]
                |a, b, c| Stretch::length([a, b, c]),
            ),
            Operation::OntoSphere(radius) => each(
                a,
                out,
                #[inline(always)]
                |a| a.inverse(*radius),
            ),
            Operation::Power(exponent) => each(a, out, |a| a.power(*exponent)),
            Operation::SmoothStep(low, high) => each(
                a,
                out,
                #[inline(always)]
                |a| a.smoothstep(*low, *high),
            ),
            Operation::Curve(curve) => each(a, out, |a| a.curve(curve)),
            Operation::Noise(_) | Operation::AnyNoise(_) => {
                let limits = match &instruction.act {
                    Operation::AnyNoise(noise) => Limits::of(noise),
                    _ => Limits::GRADIENT,
                };
                let octaves = &mut *self.octaves;
                let from = along.tape.sample_at(place.sample);
                place.sample += 1;
                simd.vectorize(
                    #[inline(always)]
                    || {
                        octaves.argument([a, b, c]);
                        octaves.noise(limits, from, place.start, 1.0);
                    },
                );
                out.copy(&octaves.noise);
            }
            Operation::Cascade(cascade) => {
                let octaves = &mut *self.octaves;
                let growth = Growth {
                    footprint: row(&along.register(FOOTPRINT).value, place.start),
                    rate: footprint_slope,
                };
                octaves.run(simd, cascade, [a, b, c], growth, &along.tape, place);
                out.copy(&octaves.total);
            }
            Operation::Slope(..) | Operation::Shape(_) | Operation::Grid(_) => {
                unreachable!("their stretches are not bounded")
            }
        }
    }
}

/// How far the code has been followed for which lanes.
#[derive(Clone, Copy)]
struct Place {
    /// The first lane of the batch.
    start: usize,
    /// The next of the tape's samples and cascades.
    sample: usize,
    cascade: usize,
}

#[inline(always)]
fn each(a: &Stretches, out: &mut Stretches, f: impl Fn(Stretch) -> Stretch) {
    for i in 0..WIDTH {
        out.set(i, f(a.at(i)));
    }
}

#[inline(always)]
fn each2([a, b]: [&Stretches; 2], out: &mut Stretches, f: impl Fn(Stretch, Stretch) -> Stretch) {
    for i in 0..WIDTH {
        out.set(i, f(a.at(i), b.at(i)));
    }
}

#[inline(always)]
fn each3(
    [a, b, c]: [&Stretches; 3],
    out: &mut Stretches,
    f: impl Fn(Stretch, Stretch, Stretch) -> Stretch,
) {
    for i in 0..WIDTH {
        out.set(i, f(a.at(i), b.at(i), c.at(i)));
    }
}

/// One loop per function, so that none of them decides anything.
#[inline(always)]
fn unary_lanes(unary: Unary, a: &Stretches, out: &mut Stretches) {
    macro_rules! lanes {
        ($($unary:ident)+) => {
            match unary {
                $(Unary::$unary => each(
                    a,
                    out,
                    #[inline(always)]
                    |a| a.unary(Unary::$unary),
                ),)+
            }
        };
    }
    lanes!(Neg Abs Sqrt Sin Cos Exp);
}

#[inline(always)]
fn binary_lanes(binary: Binary, args: [&Stretches; 2], out: &mut Stretches) {
    macro_rules! lanes {
        ($($binary:ident)+) => {
            match binary {
                $(Binary::$binary => each2(
                    args,
                    out,
                    #[inline(always)]
                    |a, b| Binary::$binary.of_numbers(a, b),
                ),)+
            }
        };
    }
    lanes!(Add Sub Mul Div Min Max);
}
