//! Which terms of a sum matter at a place: their supports, sorted in space and boxed in groups.
//!
//! A term is 0 outside its support, and adding 0 is exact: terms that are passed over change no bit.

use super::within::Extent;
use crate::interval::Interval;

/// Terms of one group.
const GROUP: usize = 8;

/// The supports of a sum's terms, in the order in which they are summed.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Supports {
    terms: Vec<Extent>,
    groups: Vec<Extent>,
    /// The box around all of them.
    pub(crate) all: Extent,
}

impl Supports {
    /// Sorts the terms so that neighbours in the list are neighbours in space, and boxes them.
    pub(crate) fn sorted<T>(terms: &mut [T], of: impl Fn(&T) -> Extent) -> Self {
        let hull = |extents: &[Extent]| {
            extents
                .iter()
                .copied()
                .reduce(Extent::hull)
                .unwrap_or(Extent::around(&[], 0.0))
        };
        let centre = |extent: &Extent| {
            [0, 1, 2].map(|k| {
                let middle = 0.5 * (extent.min[k] + extent.max[k]);
                if middle.is_nan() { 0.0 } else { middle }
            })
        };
        let centres: Vec<[f64; 3]> = terms.iter().map(|term| centre(&of(term))).collect();
        let frame = Extent::around(&centres, 0.0);
        terms.sort_by_key(|term| morton(centre(&of(term)), &frame));
        let extents: Vec<Extent> = terms.iter().map(of).collect();
        Self {
            groups: extents.chunks(GROUP).map(hull).collect(),
            all: hull(&extents),
            terms: extents,
        }
    }

    /// Calls `visit` with every term whose support holds the place, in order.
    #[inline]
    pub(crate) fn at(&self, place: [f64; 3], mut visit: impl FnMut(usize)) {
        for (group, extent) in self.groups.iter().enumerate() {
            if extent.holds(place) {
                let first = group * GROUP;
                let terms = self.terms[first..].iter().take(GROUP);
                for (i, term) in terms.enumerate() {
                    if term.holds(place) {
                        visit(first + i);
                    }
                }
            }
        }
    }

    /// Calls `visit` with every term whose support meets the box, in order.
    pub(crate) fn over(&self, parts: &[Interval; 3], mut visit: impl FnMut(usize)) {
        for (group, extent) in self.groups.iter().enumerate() {
            if extent.meets(parts) {
                let first = group * GROUP;
                let terms = self.terms[first..].iter().take(GROUP);
                for (i, term) in terms.enumerate() {
                    if term.meets(parts) {
                        visit(first + i);
                    }
                }
            }
        }
    }
}

/// A place's number along a curve that visits neighbours together (Morton's order, ten bits an axis).
fn morton(place: [f64; 3], frame: &Extent) -> u32 {
    let mut code = 0;
    for (k, along) in place.into_iter().enumerate() {
        let width = frame.max[k] - frame.min[k];
        let part = if width > 0.0 {
            1023.0 * ((along - frame.min[k]) / width)
        } else {
            0.0
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 1023"
        )]
        let cell = part as u32;
        for bit in 0..10 {
            code |= (cell >> bit & 1) << (3 * bit + k);
        }
    }
    code
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::{hash, unit};

    #[test]
    fn no_term_that_matters_is_passed_over() {
        let number = |i: u32, k: u32| 10.0 * unit(hash(&[i, k]));
        let mut balls: Vec<([f64; 3], f64)> = (0..100)
            .map(|i| ([0, 1, 2].map(|k| number(i, k)), 0.1 + 0.2 * number(i, 3)))
            .collect();
        let supports = Supports::sorted(&mut balls, |(centre, r)| Extent::around(&[*centre], *r));
        for i in 0..2000 {
            let place = [4, 5, 6].map(|k| number(i, k));
            let mut seen = Vec::new();
            supports.at(place, |term| seen.push(term));
            assert!(seen.windows(2).all(|pair| pair[0] < pair[1]));
            for (k, (centre, r)) in balls.iter().enumerate() {
                let inside = (0..3)
                    .map(|k| (place[k] - centre[k]) * (place[k] - centre[k]))
                    .sum::<f64>()
                    < r * r;
                assert!(!inside || seen.contains(&k));
            }
            let cube = place.map(|x| Interval::new(x, x + 0.5));
            let mut near = Vec::new();
            supports.over(&cube, |term| near.push(term));
            assert!(seen.iter().all(|term| near.contains(term)));
        }
    }
}
