//! What all sums of influences have in common: T − Σ aᵢ gᵢ(x), their rules and their bounds.

use super::Refusal;
use super::kernel::Kernel;
use super::supports::Supports;
use super::within::{Known, Within};
use crate::interval::{Interval, larger};

/// Pieces along each axis over which a sum is bounded.
const PIECES: u32 = 6;

/// What holds for every term of a sum.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Rules {
    pub(crate) kernel: Kernel,
    /// T of thesis eq. (2.9).
    pub(crate) threshold: f64,
    /// Whether the distance to the nearest support is added beyond all of them, thesis eq. (7.9).
    pub(crate) far: bool,
}

/// A sum, for its bounds.
pub(crate) trait Summed {
    /// A length over which its terms change.
    fn size(&self) -> f64;
    /// Σ |aᵢ| max gᵢ.
    fn weight(&self) -> f64;
    /// The values of a term aᵢ gᵢ over a region, and a bound of its slope.
    fn term(&self, i: usize, within: &Within) -> (Interval, f64);
    /// All second derivatives of a term along unit directions.
    fn bend(&self, i: usize, within: &Within) -> Interval;
    /// How far the region is outside of all supports: negative within one.
    fn beyond(&self, within: &Within) -> Interval;
}

impl Rules {
    /// The rules, which are the first three numbers, and the rest.
    pub(crate) fn split(params: &[f64]) -> Result<(Self, &[f64]), Refusal> {
        let [kernel, threshold, far, rest @ ..] = params else {
            return Err((
                "a kernel, a threshold and whether there is a far field",
                0.0,
            ));
        };
        let rules = Self {
            kernel: Kernel::from_number(*kernel).ok_or(("a kernel", *kernel))?,
            threshold: *threshold,
            far: *far == 1.0,
        };
        if *far != 0.0 && *far != 1.0 {
            return Err(("0 or 1 for its far field", *far));
        }
        if rules.far && !rules.kernel.ends() {
            return Err(("no far field where the kernel has no end", 1.0));
        }
        Ok((rules, rest))
    }

    /// The bounds of a sum, found over pieces: over a small one only few terms matter.
    pub(crate) fn bound(&self, sum: &impl Summed, supports: &Supports, within: &Within) -> Known {
        let rounding = 256.0 * f64::EPSILON * (self.threshold.abs() + sum.weight());
        let all = &supports.all;
        let around = within.clipped(all);
        let mut known = match around {
            None => self.over(sum, supports, within, rounding),
            Some(near) if near.is_bounded() => {
                let pieces = near.pieces(0.75 * sum.size(), PIECES);
                Known::over(&pieces, |piece| self.over(sum, supports, piece, rounding))
            }
            Some(near) => self.over(sum, supports, &near, rounding),
        };
        if around.is_some() && !all.covers(&within.parts) {
            // Where there is no term at all.
            let empty = Interval::point(self.threshold).expand(rounding);
            known = known.and(self.with_far(sum, within, empty, 0.0, rounding));
        }
        known
    }

    /// All second derivatives of a sum along unit directions, found over pieces.
    ///
    /// Far fields bend down without a bound where the nearest support changes.
    pub(crate) fn bend(&self, sum: &impl Summed, supports: &Supports, within: &Within) -> Interval {
        if self.far && sum.beyond(within).high > 0.0 {
            return Interval::ALL;
        }
        let over = |piece: &Within| {
            let mut total = Interval::point(0.0);
            supports.over(&piece.parts, |i| total = total.add(sum.bend(i, piece)));
            total.neg()
        };
        let none = Interval::point(0.0);
        match within.clipped(&supports.all) {
            None => none,
            Some(near) if near.is_bounded() => {
                let pieces = near.pieces(0.75 * sum.size(), PIECES);
                let bends = pieces.iter().map(over);
                bends.fold(none, Interval::hull)
            }
            Some(near) => over(&near).hull(none),
        }
    }

    fn over(
        &self,
        sum: &impl Summed,
        supports: &Supports,
        within: &Within,
        rounding: f64,
    ) -> Known {
        let mut total = Interval::point(0.0);
        let mut steepness = 0.0;
        supports.over(&within.parts, |i| {
            let (range, slope) = sum.term(i, within);
            total = total.add(range);
            steepness += slope;
        });
        let range = Interval::point(self.threshold).sub(total).expand(rounding);
        self.with_far(sum, within, range, steepness * (1.0 + 1e-9), rounding)
    }

    /// Beyond all supports the sum is 0 and the far field has slope 1; elsewhere there is none.
    fn with_far(
        &self,
        sum: &impl Summed,
        within: &Within,
        range: Interval,
        slope: f64,
        rounding: f64,
    ) -> Known {
        if !self.far {
            return Known {
                range,
                slope,
                rounding,
            };
        }
        let far = sum.beyond(within).max(Interval::point(0.0));
        let rounding = rounding + 16.0 * f64::EPSILON * (far.high + within.norm.magnitude());
        if far.high <= 0.0 {
            return Known {
                range: range.expand(rounding),
                slope,
                rounding,
            };
        }
        let outside = Interval::point(self.threshold).add(far);
        let range = if far.low > 0.0 {
            outside
        } else {
            range.hull(outside)
        };
        Known {
            range: range.expand(rounding),
            slope: larger(slope, 1.0 + 1e-12),
            rounding,
        }
    }
}
