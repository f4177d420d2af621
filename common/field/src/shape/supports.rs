//! Which terms of a sum matter at a place: their supports, sorted in space and boxed in groups.
//!
//! A term is 0 outside its support, and adding 0 is exact: terms that are passed over change no bit.

use super::within::Extent;
use crate::interval::Interval;

/// Terms of one group.
const GROUP: usize = 8;

/// By so much tubes are wider than they need be, for rounding.
const ROOM: f64 = 1.0 + 1e-6;

/// The same, of how far from their centres balls are looked at.
const ROUNDINGS: f64 = 256.0 * f64::EPSILON;

/// What holds some straight rays: at the way t along it, all that lies within `radius` + `spread` · t of its axis, as far
/// as that may be.
pub(crate) struct Tube {
    pub(crate) start: [f64; 3],
    pub(crate) direction: [f64; 3],
    /// ‖direction‖⁻².
    pub(crate) inverse: f64,
    pub(crate) radius: f64,
    pub(crate) spread: f64,
    /// No ray takes longer for a metre.
    pub(crate) slowness: f64,
}

/// The supports of a sum's terms, in the order in which they are summed.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Supports {
    groups: Vec<Group>,
    /// The box around all of them.
    pub(crate) all: Extent,
}

/// The supports of some neighbours in the list, axis by axis, so that all are looked at together.
#[derive(Clone, PartialEq, Debug)]
struct Group {
    hull: Extent,
    /// Balls around the boxes, which may be infinite; of −∞ where there is none.
    centre: [[f64; GROUP]; 3],
    radius: [f64; GROUP],
    min: [[f64; GROUP]; 3],
    max: [[f64; GROUP]; 3],
}

impl Supports {
    /// Sorts the terms so that neighbours in the list are neighbours in space, and boxes them.
    pub(crate) fn sorted<T>(terms: &mut [T], of: impl Fn(&T) -> Extent) -> Self {
        let centres: Vec<[f64; 3]> = terms.iter().map(|term| centre(&of(term))).collect();
        let frame = Extent::around(&centres, 0.0);
        terms.sort_by_key(|term| morton(centre(&of(term)), &frame));
        let extents: Vec<Extent> = terms.iter().map(of).collect();
        Self {
            groups: extents.chunks(GROUP).map(Group::new).collect(),
            all: hull(&extents),
        }
    }

    /// Calls `visit` with every term whose support holds the place, in order.
    #[inline]
    pub(crate) fn at(&self, place: [f64; 3], visit: impl FnMut(usize)) {
        self.over(&place.map(Interval::point), visit);
    }

    /// Calls `visit` with every term whose support may meet the tube, in order.
    #[inline(always)]
    pub(crate) fn along(&self, tube: &Tube, mut visit: impl FnMut(usize)) {
        for (group, terms) in self.groups.iter().enumerate() {
            let mut meeting = terms.along(tube);
            while meeting != 0 {
                visit(group * GROUP + meeting.trailing_zeros() as usize);
                meeting &= meeting - 1;
            }
        }
    }

    /// Calls `visit` with every term whose support meets the box, in order.
    #[inline(always)]
    pub(crate) fn over(&self, parts: &[Interval; 3], mut visit: impl FnMut(usize)) {
        for (group, terms) in self.groups.iter().enumerate() {
            if terms.hull.meets(parts) {
                let mut meeting = terms.meeting(parts);
                while meeting != 0 {
                    visit(group * GROUP + meeting.trailing_zeros() as usize);
                    meeting &= meeting - 1;
                }
            }
        }
    }
}

impl Group {
    fn new(extents: &[Extent]) -> Self {
        // Where there is no term nothing is met.
        let empty = Extent::around(&[], 0.0);
        let of = |i: usize| extents.get(i).unwrap_or(&empty);
        let radius = |i: usize| {
            let [x, y, z] = [0, 1, 2].map(|k| 0.5 * (of(i).max[k] - of(i).min[k]));
            if i < extents.len() {
                (x * x + y * y + z * z).sqrt()
            } else {
                f64::NEG_INFINITY
            }
        };
        Self {
            hull: hull(extents),
            centre: [0, 1, 2].map(|k| std::array::from_fn(|i| centre(of(i))[k])),
            radius: std::array::from_fn(radius),
            min: [0, 1, 2].map(|k| std::array::from_fn(|i| of(i).min[k])),
            max: [0, 1, 2].map(|k| std::array::from_fn(|i| of(i).max[k])),
        }
    }

    /// Which terms may meet the tube, as bits.
    ///
    /// A ray that is within r of a centre has gone no farther than that is from its start, and r; as wide as the tube is there,
    /// the centre must be near the axis.
    #[inline(always)]
    fn along(&self, tube: &Tube) -> u32 {
        let ([cx, cy, cz], [x, y, z]) = (&self.centre, tube.start);
        let [dx, dy, dz] = tube.direction;
        let mut meeting = 0;
        for i in 0..GROUP {
            let (x, y, z) = (cx[i] - x, cy[i] - y, cz[i] - z);
            let t = (x * dx + y * dy + z * dz) * tube.inverse;
            let (ax, ay, az) = (x - dx * t, y - dy * t, z - dz * t);
            let away = (x * x + y * y + z * z).sqrt();
            let near = self.radius[i] + tube.radius + ROUNDINGS * away;
            let way = (away + near) * tube.slowness;
            let wide = (near + tube.spread * way) * ROOM;
            let misses = (ax * ax + ay * ay + az * az > wide * wide) | (near < 0.0);
            meeting |= u32::from(!misses) << i;
        }
        meeting
    }

    /// Which terms meet the box, as bits.
    #[inline(always)]
    fn meeting(&self, [x, y, z]: &[Interval; 3]) -> u32 {
        let ([ax, ay, az], [bx, by, bz]) = (&self.min, &self.max);
        let mut meeting = 0;
        for i in 0..GROUP {
            let meets = (x.low <= bx[i])
                & (x.high >= ax[i])
                & (y.low <= by[i])
                & (y.high >= ay[i])
                & (z.low <= bz[i])
                & (z.high >= az[i]);
            meeting |= u32::from(meets) << i;
        }
        meeting
    }
}

/// The middle of a box; 0 along axes on which it has none.
fn centre(extent: &Extent) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let middle = 0.5 * (extent.min[k] + extent.max[k]);
        if middle.is_nan() { 0.0 } else { middle }
    })
}

fn hull(extents: &[Extent]) -> Extent {
    let all = extents.iter().copied().reduce(Extent::hull);
    all.unwrap_or(Extent::around(&[], 0.0))
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
