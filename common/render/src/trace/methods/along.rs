//! A field along one ray, in the arithmetics that methods ask for.

use field::{Interval, Place, Program, Reduced, Segment, Slope};

/// g(t) = f(r(t)), thesis eq. (5.3).
pub trait Along {
    /// g(t).
    fn value(&self, t: f64) -> f64;
    /// G(T) by intervals.
    fn interval(&self, t: Interval) -> Interval;
    /// G(T) and G′(T) by intervals.
    fn slope(&self, t: Interval) -> Slope<1>;
    /// G(T) by standard affine arithmetic, condensed to the ray's symbol.
    fn affine(&self, t: Interval) -> Reduced<1>;
    /// G(T) by reduced affine arithmetic.
    fn reduced(&self, t: Interval) -> Reduced<1>;
}

/// A program's first root along a ray, with all detail.
#[derive(Clone, Copy, Debug)]
pub struct FieldAlong<'a> {
    /// The field.
    pub program: &'a Program,
    /// Where t = 0, world metres.
    pub origin: [f64; 3],
    /// Which way, a unit vector.
    pub direction: [f64; 3],
    /// Seconds from image 0.
    pub time: f64,
}

impl FieldAlong<'_> {
    fn segment(&self, t: Interval) -> Segment {
        Segment {
            origin: self.origin,
            direction: self.direction,
            t,
            footprint: Interval::point(0.0),
            time: self.time,
        }
    }

    /// G(T) and G′(T) of the exact field, whose noises are not rounded to f32.
    #[cfg(test)]
    pub(super) fn exact(&self, t: Interval) -> Slope<1> {
        self.program.along_exact(&self.segment(t))
    }
}

impl Along for FieldAlong<'_> {
    fn value(&self, t: f64) -> f64 {
        let at = [0, 1, 2].map(|axis| self.origin[axis] + t * self.direction[axis]);
        self.program.at(&Place {
            at,
            footprint: 0.0,
            time: self.time,
        })
    }

    fn interval(&self, t: Interval) -> Interval {
        self.program.along_interval(&self.segment(t))
    }

    fn slope(&self, t: Interval) -> Slope<1> {
        self.program.along_slope(&self.segment(t))
    }

    fn affine(&self, t: Interval) -> Reduced<1> {
        self.program.along_affine(&self.segment(t))
    }

    fn reduced(&self, t: Interval) -> Reduced<1> {
        self.program.along_reduced(&self.segment(t))
    }
}
