//! Discrete surfaces over ranges, by the mean value theorem: what a box of samples says of values and slopes.

use crate::grid::Surface;
use crate::interval::larger;
use crate::range::Arithmetic;

/// f(c) + Σ αᵢ (xᵢ − cᵢ), αᵢ the middle of the slopes along axis i over the box, give or take half of
/// their width; and no farther than the samples of the box.
pub(super) fn mean_value<T: Arithmetic>(surface: &Surface, at: [T; 3]) -> T {
    let spans = at.each_ref().map(T::range);
    let (range, slopes) = surface.over(spans);
    let bounded = spans.iter().all(|span| span.magnitude() < 1e15);
    if !bounded {
        return T::any(range);
    }
    let centre = spans.map(|span| 0.5 * (span.low + span.high));
    let mut sum = T::constant(surface.value(centre));
    let mut error = surface.blur(range);
    for ((part, slopes), (span, centre)) in at.into_iter().zip(slopes).zip(spans.iter().zip(centre))
    {
        if slopes.magnitude() == 0.0 {
            continue;
        }
        let alpha = 0.5 * (slopes.low + slopes.high);
        let steeper = larger(slopes.high - alpha, alpha - slopes.low);
        let half = larger(span.high - centre, centre - span.low);
        error += steeper * half * (1.0 + 1e-12);
        sum = sum.plus(part.minus(T::constant(centre)).times(alpha));
    }
    sum.blurred(error).within(range)
}
