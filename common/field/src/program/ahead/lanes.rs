//! Stretches over lanes: structure of arrays.

use super::stretch::Stretch;
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
    /// How much of each stretch is clear, where the field has those values and errors.
    #[inline(always)]
    pub(super) fn clear(&self, value: &[f64], [offset, error]: [&[f64]; 2], length: &mut [f64]) {
        let n = length.len();
        let (value, offset, error) = (&value[..n], &offset[..n], &error[..n]);
        assert!(n <= WIDTH);
        for i in 0..n {
            let rest = value[i] - offset[i];
            let proves = (rest > 0.0) & (value[i] < f64::INFINITY);
            let fall = self.fall[i] - error[i];
            // As far as the mean value theorem goes.
            let way = rest * CAUTION / -fall;
            let is_clear = (fall >= 0.0) | (way >= length[i]) | (self.low[i] > offset[i]);
            let clear = if is_clear { length[i] } else { way };
            length[i] = if proves { clear } else { 0.0 };
        }
    }
}
