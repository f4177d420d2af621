//! Duals over lanes: structure of arrays.

use crate::lanes::Lanes;
use crate::number::Dual;
use crate::points::BATCH;
use crate::shape::Rows;

/// Duals, one per lane, as structure of arrays.
#[derive(Debug)]
#[repr(align(64))]
pub(crate) struct Duals<const N: usize> {
    pub(crate) value: Lanes,
    pub(crate) gradient: [Lanes; N],
}

impl<const N: usize> Duals<N> {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            value: [0.0; BATCH],
            gradient: [[0.0; BATCH]; N],
        })
    }

    #[inline(always)]
    pub(super) fn at(&self, i: usize) -> Dual<N> {
        let mut gradient = [0.0; N];
        for (part, lanes) in gradient.iter_mut().zip(&self.gradient) {
            *part = lanes[i];
        }
        Dual {
            value: self.value[i],
            gradient,
        }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, i: usize, dual: Dual<N>) {
        self.value[i] = dual.value;
        for (lanes, part) in self.gradient.iter_mut().zip(dual.gradient) {
            lanes[i] = part;
        }
    }

    pub(super) fn clear(&mut self, n: usize) {
        self.value[..n].fill(0.0);
        for lanes in &mut self.gradient {
            lanes[..n].fill(0.0);
        }
    }

    pub(super) fn set_constant(&mut self, value: f64) {
        self.value.fill(value);
        for lanes in &mut self.gradient {
            lanes.fill(0.0);
        }
    }
}

impl<const N: usize> Rows for Duals<N> {
    type Number = Dual<N>;

    #[inline(always)]
    fn at(&self, lane: usize) -> Dual<N> {
        Self::at(self, lane)
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, number: Dual<N>) {
        Self::set(self, lane, number);
    }
}
