//! Cascades of noises with their derivatives.

use fearless_simd::Simd;

use super::duals::Duals;
use super::tape::{Sample, Tape};
use super::{directions, triple};
use crate::cascade::{self, Carried, Cascade, Model, Octave, Term};
use crate::lanes::{self, Cells, Lanes};
use crate::noise::batch;
use crate::number::Dual;
use crate::op::Basis;
use crate::points::BATCH;
use crate::program::machine::{self, Count};

/// Room for the octaves of one cascade.
#[derive(Debug)]
#[repr(C, align(64))]
pub(super) struct Octaves<const N: usize> {
    pub(super) cells: Cells,
    /// Directions in the octave's lattice; of use where `N` is 1.
    pub(super) along: [[f32; BATCH]; 3],
    /// All three derivatives of a noise that is not asked along a direction itself.
    pub(super) full: [[f32; BATCH]; 3],
    depth: Lanes,
    pub(super) total: Box<Duals<N>>,
    rest: Box<Duals<N>>,
}

/// Which octave.
#[derive(Clone, Copy)]
struct Place<'a> {
    n: usize,
    i: f64,
    octave: &'a Octave,
    depth: &'a Lanes,
}

impl<const N: usize> Octaves<N> {
    pub(super) fn new() -> Self {
        Self {
            cells: Cells::new(),
            along: [[0.0; BATCH]; 3],
            full: [[0.0; BATCH]; 3],
            depth: [0.0; BATCH],
            total: Duals::new(),
            rest: Duals::new(),
        }
    }

    #[inline(always)]
    pub(super) fn run<S: Simd>(
        &mut self,
        simd: S,
        cascade: &Cascade,
        count: Count,
        at: [&Duals<N>; 3],
        footprint: &Lanes,
        tape: &mut Tape<N>,
    ) -> u64 {
        let n = count.lanes;
        let mut noises = 0;
        let place = at.map(|part| &part.value);
        let Self {
            cells,
            along,
            full,
            depth,
            total,
            rest,
        } = self;
        machine::depths(cascade, n, footprint, depth);
        let mut octaves = 0;
        total.clear(n);
        rest.clear(n);
        for (i, octave) in cascade.octaves.iter().enumerate() {
            let i = cascade::index(i);
            let live = machine::live(depth, count.points, i);
            if live == 0 {
                break;
            }
            noises += live;
            octaves += 1;
            let sample = tape.sample();
            lanes::place(simd, n, octave, place, cells);
            if N == 1 {
                directions(n, &octave.matrix, at, along);
            }
            match &octave.noise {
                None => sample.fill(simd, n, octave.lattice, cells, along),
                Some(any) => {
                    batch::values_gradients(simd, n, any, cells, &mut sample.noise, full);
                    sample.take(n, full, along);
                }
            }
            let place = Place {
                n,
                i,
                octave,
                depth,
            };
            add(cascade.model, place, sample, total, rest);
        }
        tape.keep_cascade(n, octaves, depth);
        noises
    }
}

#[inline(always)]
fn add<const N: usize>(
    model: Model,
    at: Place<'_>,
    sample: &Sample<N>,
    total: &mut Duals<N>,
    rest: &mut Duals<N>,
) {
    match model {
        Model::Sum(Basis::Plain) => add_each(
            at,
            sample,
            total,
            rest,
            #[inline(always)]
            |t, n, c| cascade::sum(Basis::Plain, t, n, c),
        ),
        Model::Sum(Basis::Absolute) => add_each(
            at,
            sample,
            total,
            rest,
            #[inline(always)]
            |t, n, c| cascade::sum(Basis::Absolute, t, n, c),
        ),
        Model::Sum(Basis::Ridged) => add_each(
            at,
            sample,
            total,
            rest,
            #[inline(always)]
            |t, n, c| cascade::sum(Basis::Ridged, t, n, c),
        ),
        Model::AltitudeOne { basis, xi } => {
            add_each(
                at,
                sample,
                total,
                rest,
                #[inline(always)]
                |t, n, c| cascade::altitude_one(basis, xi, t, n, c),
            );
        }
        Model::AltitudeTwo { basis, xi } => {
            add_each(
                at,
                sample,
                total,
                rest,
                #[inline(always)]
                |t, n, c| cascade::altitude_two(basis, xi, t, n, c),
            );
        }
        Model::Ridged { offset, gain } => {
            add_each(
                at,
                sample,
                total,
                rest,
                #[inline(always)]
                |t, n, c| cascade::ridged(offset, gain, t, n, c),
            );
        }
    }
}

#[inline(always)]
fn add_each<const N: usize>(
    Place {
        n,
        i,
        octave,
        depth,
    }: Place<'_>,
    sample: &Sample<N>,
    total: &mut Duals<N>,
    rest: &mut Duals<N>,
    add: impl Fn(Term, Dual<N>, Carried<Dual<N>>) -> Carried<Dual<N>>,
) {
    let (matrix, amplitude) = (octave.matrix, octave.amplitude);
    for (lane, depth) in depth[..n].iter().copied().enumerate() {
        let term = Term {
            first: i == 0.0,
            amplitude,
            weight: cascade::weight(depth, i),
        };
        let mut gradient = sample.slopes(lane);
        if N == 3 {
            let pulled = cascade::pull(&matrix, triple(gradient));
            gradient.copy_from_slice(&pulled);
        }
        let noise = Dual {
            value: f64::from(sample.noise[lane]),
            gradient,
        };
        let (sum, handed) = add(term, noise, (total.at(lane), rest.at(lane)));
        total.set(lane, sum);
        rest.set(lane, handed);
    }
}
