//! Noises with their derivatives, kept for whoever goes through the code again.

use fearless_simd::Simd;

use super::{duals::Duals, pull, triple};
use crate::lanes::{self, Cells, Lanes};
use crate::noise::Lattice;
use crate::number::Dual;
use crate::points::BATCH;

/// What noises gave, in the order in which the code asks for them.
#[derive(Debug, Default)]
pub(crate) struct Tape<const N: usize> {
    /// Whether every noise is kept; else each takes the place of the last.
    pub(super) keeps: bool,
    samples: Vec<Box<Sample<N>>>,
    /// The next sample's place.
    next: usize,
    /// Of every cascade, how many octaves it has evaluated and its depths.
    cascades: Vec<(usize, Box<Lanes>)>,
    next_cascade: usize,
}

impl<const N: usize> Tape<N> {
    pub(super) fn rewind(&mut self) {
        (self.next, self.next_cascade) = (0, 0);
    }

    /// Where the next noise goes.
    #[inline(always)]
    pub(super) fn sample(&mut self) -> &mut Sample<N> {
        let place = if self.keeps { self.next } else { 0 };
        self.next += 1;
        if place == self.samples.len() {
            self.samples.push(Box::new(Sample {
                noise: [0.0; BATCH],
                gradient: [[0.0; BATCH]; N],
            }));
        }
        &mut self.samples[place]
    }

    /// Where the last noise went.
    pub(super) fn last(&mut self) -> &mut Sample<N> {
        let place = if self.keeps { self.next - 1 } else { 0 };
        &mut self.samples[place]
    }

    pub(super) fn keep_cascade(&mut self, n: usize, octaves: usize, depth: &Lanes) {
        if !self.keeps {
            return;
        }
        if self.next_cascade == self.cascades.len() {
            self.cascades.push((0, Box::new([0.0; BATCH])));
        }
        let (count, kept) = &mut self.cascades[self.next_cascade];
        *count = octaves;
        kept[..n].copy_from_slice(&depth[..n]);
        self.next_cascade += 1;
    }

    /// The noise that was asked for as number `i`.
    pub(crate) fn sample_at(&self, i: usize) -> &Sample<N> {
        &self.samples[i]
    }

    /// The cascade that was asked for as number `i`: how many octaves it evaluated, and its depths.
    pub(crate) fn cascade_at(&self, i: usize) -> (usize, &Lanes) {
        let (octaves, depth) = &self.cascades[i];
        (*octaves, depth)
    }
}

/// One octave's noise over the lanes.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Sample<const N: usize> {
    pub(crate) noise: [f32; BATCH],
    pub(crate) gradient: [[f32; BATCH]; N],
}

impl<const N: usize> Sample<N> {
    /// The noise in `cells`: with its gradient, or its derivative along `along`.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        n: usize,
        lattice: Lattice,
        cells: &mut Cells,
        along: &[[f32; BATCH]; 3],
    ) {
        let Self {
            noise, gradient, ..
        } = self;
        match gradient.as_mut_slice() {
            [slope] => lanes::values_along(simd, n, lattice, cells, along, noise, slope),
            [x, y, z] => lanes::values_gradients(simd, n, lattice, cells, noise, [x, y, z]),
            _ => unreachable!("derivatives are by one or three variables"),
        }
    }

    /// Takes a noise's gradient, or its derivative along `along`.
    #[inline(always)]
    pub(super) fn take(
        &mut self,
        n: usize,
        [x, y, z]: &[[f32; BATCH]; 3],
        along: &[[f32; BATCH]; 3],
    ) {
        let [p, q, r] = along;
        match self.gradient.as_mut_slice() {
            [slope] => {
                for (i, slope) in slope[..n].iter_mut().enumerate() {
                    *slope = x[i] * p[i] + y[i] * q[i] + z[i] * r[i];
                }
            }
            parts => {
                for (part, given) in parts.iter_mut().zip([x, y, z]) {
                    part[..n].copy_from_slice(&given[..n]);
                }
            }
        }
    }

    #[inline(always)]
    pub(super) fn slopes(&self, i: usize) -> [f64; N] {
        let mut slopes = [0.0; N];
        for (slope, lanes) in slopes.iter_mut().zip(&self.gradient) {
            *slope = f64::from(lanes[i]);
        }
        slopes
    }

    /// A value with these derivatives at a place that has its own.
    #[inline(always)]
    pub(super) fn pulled(&self, i: usize, [a, b, c]: [&Duals<N>; 3], value: f64) -> Dual<N> {
        let gradient = self.slopes(i);
        if N == 1 {
            return Dual { value, gradient };
        }
        pull(triple(gradient), [a.at(i), b.at(i), c.at(i)], value)
    }
}
