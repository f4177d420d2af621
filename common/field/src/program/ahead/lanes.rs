//! Stretches over lanes: structure of arrays.

use super::stretch::{Stretch, most};
use crate::lanes::Lanes;

/// Stretches are shortened by this share, for the roundings of their own few operations.
const CAUTION: f64 = 1.0 - 1e-9;

/// Lanes of a batch that go through the code together: their registers stay in the processor's nearest cache.
pub(super) const WIDTH: usize = 32;

/// One number per lane.
pub(super) type Row = [f64; WIDTH];

/// A row of a batch's lanes.
#[inline(always)]
pub(super) fn row(lanes: &Lanes, start: usize) -> &Row {
    lanes[start..start + WIDTH]
        .first_chunk()
        .expect("a batch has whole rows")
}

/// Stretches, one per lane, as structure of arrays.
#[derive(Debug)]
#[repr(align(64))]
pub(super) struct Stretches {
    pub(super) low: Row,
    pub(super) high: Row,
    pub(super) fall: Row,
    pub(super) rise: Row,
}

impl Stretches {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            low: [0.0; WIDTH],
            high: [0.0; WIDTH],
            fall: [0.0; WIDTH],
            rise: [0.0; WIDTH],
        })
    }

    #[inline(always)]
    pub(super) fn at(&self, i: usize) -> Stretch {
        Stretch {
            low: self.low[i],
            high: self.high[i],
            fall: self.fall[i],
            rise: self.rise[i],
        }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, i: usize, a: Stretch) {
        self.low[i] = a.low;
        self.high[i] = a.high;
        self.fall[i] = a.fall;
        self.rise[i] = a.rise;
    }

    pub(super) fn copy(&mut self, other: &Self) {
        self.low = other.low;
        self.high = other.high;
        self.fall = other.fall;
        self.rise = other.rise;
    }

    pub(super) fn fill(&mut self, a: Stretch) {
        self.low.fill(a.low);
        self.high.fill(a.high);
        self.fall.fill(a.fall);
        self.rise.fill(a.rise);
    }
}

impl Stretches {
    /// How much of each stretch is clear, ahead of the place and `back` times as far behind it; and how far its
    /// derivative's range spreads, per metre.
    #[inline(always)]
    pub(super) fn clear(
        &self,
        here: Here<'_>,
        length: &Row,
        back: f64,
        [ahead, behind, bend]: [&mut [f64]; 3],
    ) {
        let n = ahead.len();
        let (value, offset, error) = (&here.value[..n], &here.offset[..n], &here.error[..n]);
        let (behind, bend) = (&mut behind[..n], &mut bend[..n]);
        assert!(n <= WIDTH);
        for i in 0..n {
            let rest = value[i] - offset[i];
            let proves = (rest > 0.0) & (value[i] < f64::INFINITY);
            let is_clear = self.low[i] > offset[i];
            // As far as the mean value theorem goes, where the field falls no faster than that.
            let clear = |fall: f64| {
                let way = rest * CAUTION / fall;
                let all = is_clear | (fall <= 0.0) | (way >= length[i]);
                let clear = if all { length[i] } else { way };
                if proves { clear } else { 0.0 }
            };
            let (forth, back) = (
                clear(error[i] - self.fall[i]),
                clear(error[i] + self.rise[i]) * back,
            );
            ahead[i] = forth;
            behind[i] = back;
            bend[i] = 0.5 * (self.rise[i] - self.fall[i]) / length[i];
        }
    }
}

/// What is known of the field at some places.
#[derive(Clone, Copy)]
pub(super) struct Here<'a> {
    /// Its value, and its derivative along the ray.
    pub(super) value: &'a [f64],
    pub(super) slope: &'a [f64],
    /// What they may be wrong by.
    pub(super) offset: &'a [f64],
    pub(super) error: &'a [f64],
}

impl Here<'_> {
    /// How long stretches should be where the derivative's range spreads by `bend` per metre: to where value +
    /// slope s − bend s² is zero. As long as they may be where `bend` is 0, for then nothing is known of it.
    #[inline(always)]
    pub(super) fn guess(&self, bend: &[f64], [shortest, longest]: [&[f64]; 2], length: &mut Row) {
        let n = bend.len();
        let (value, slope, offset) = (&self.value[..n], &self.slope[..n], &self.offset[..n]);
        let (shortest, longest) = (&shortest[..n], &longest[..n]);
        assert!(n <= WIDTH);
        for i in 0..n {
            let rest = most(value[i] - offset[i], 0.0);
            let root = (slope[i] * slope[i] + 4.0 * bend[i] * rest).sqrt();
            let way = most(2.0 * rest / (root - slope[i]), shortest[i]);
            // Nothing that is no number is less.
            let is_known = (bend[i] > 0.0) & (way < longest[i]);
            length[i] = if is_known { way } else { longest[i] };
        }
    }
}
