//! What a noise's gradient can be over a box of its coordinates: its value midway, and its steepest change on either side.

use super::gradient::split;
use super::kind::Noise;
use crate::interval::Interval;

/// Beyond so many cells from the origin there are no offsets within cells.
const FAR: f64 = 1e15;

impl Noise {
    /// All components of the gradient over a box of coordinates, skewed ones if the noise is skewed.
    ///
    /// Skewed coordinates are never nearer to each other than the places they stand for, so the bound by places holds.
    pub(crate) fn slopes_over(&self, spans: [Interval; 3]) -> [Interval; 3] {
        let steepest = self.slope() + self.slope_rounding();
        let all = Interval::new(-steepest, steepest).widen();
        let Some((middle, reach)) = middle(spans) else {
            return [all; 3];
        };
        let [(x, u), (y, v), (z, w)] = middle.map(split);
        let gradient = self.jet([x, y, z], [u, v, w]).gradient;
        let room = self.bend() * reach + 2.0 * self.slope_rounding();
        gradient.map(|part| Interval::point(f64::from(part)).expand(room).meet(all))
    }
}

/// The middle of a box, and the greatest distance from it within the box, f32 offsets included; `None` if it is too far or too wide.
fn middle(spans: [Interval; 3]) -> Option<([f64; 3], f64)> {
    /// Twice the rounding of three offsets to f32.
    const OFFSETS: f64 = 2.1e-7;
    let near = spans
        .iter()
        .all(|span| span.low <= span.high && span.magnitude() < FAR);
    if !near {
        return None;
    }
    let middle = spans.map(|span| 0.5 * (span.low + span.high));
    let [x, y, z] = [0, 1, 2].map(|k| {
        let Interval { low, high } = spans[k];
        let half = crate::interval::larger(high - middle[k], middle[k] - low);
        half + 4.0 * f64::EPSILON * spans[k].magnitude()
    });
    Some((
        middle,
        (x * x + y * y + z * z).sqrt() * (1.0 + 1e-12) + OFFSETS,
    ))
}
