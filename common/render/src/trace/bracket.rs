//! Closing in on a root between two places of opposite sign.
//!
//! Regula falsi with the Illinois rule: nothing but the two places, their values and the
//! field decides where it ends.

/// Most values asked for within a bracket.
const COUNT_MAX: u32 = 4;

/// A value this small, in footprints, is that of a root.
const ROOT: f64 = 1.0 / 1024.0;

/// A distance with the field's value there.
#[derive(Clone, Copy, Default)]
pub(crate) struct End {
    /// Metres along the ray.
    pub(crate) t: f64,
    /// In the field's unit.
    pub(crate) value: f64,
}

/// Two distances between which a field changes its sign.
#[derive(Clone, Copy, Default)]
pub(crate) struct Bracket {
    /// Where it is positive; a value that stays twice is halved.
    near: End,
    /// Where it is not.
    far: End,
    /// Where the next value is wanted.
    pub(crate) middle: f64,
    count: u32,
    last: Side,
}

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Side {
    #[default]
    None,
    Near,
    Far,
}

impl Bracket {
    /// Between a place with a positive, finite value and one without.
    pub(crate) fn new(near: End, far: End) -> Self {
        let bracket = Self {
            near,
            far,
            ..Self::default()
        };
        Self {
            middle: bracket.chord(),
            ..bracket
        }
    }

    /// Where the straight line between both values is zero.
    fn chord(&self) -> f64 {
        let drop = self.near.value - self.far.value;
        if drop > 0.0 && drop.is_finite() {
            self.near.t + (self.far.t - self.near.t) * (self.near.value / drop)
        } else {
            self.far.t
        }
    }

    /// Takes the value in the middle; returns the root, or chooses another middle.
    pub(crate) fn narrow(&mut self, value: f64, footprint: f64) -> Option<f64> {
        self.count += 1;
        if value.abs() <= ROOT * footprint {
            return Some(self.middle);
        }
        let middle = End {
            t: self.middle,
            value,
        };
        let side = if value > 0.0 { Side::Near } else { Side::Far };
        // The end that stays twice weighs half: else it would stay for ever.
        let weight = if side == self.last { 0.5 } else { 1.0 };
        if value > 0.0 {
            self.near = middle;
            self.far.value *= weight;
        } else {
            self.far = middle;
            self.near.value *= weight;
        }
        self.last = side;
        self.middle = self.chord();
        (self.count >= COUNT_MAX).then_some(self.middle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root(f: impl Fn(f64) -> f64, near: f64, far: f64) -> f64 {
        let end = |t| End { t, value: f(t) };
        let mut bracket = Bracket::new(end(near), end(far));
        loop {
            if let Some(root) = bracket.narrow(f(bracket.middle), 1e-12) {
                return root;
            }
        }
    }

    #[test]
    fn a_line_is_solved_at_once_and_a_curve_closely() {
        assert!((root(|t| 3.0 - t, 2.0, 7.0) - 3.0).abs() < 1e-12);
        assert!((root(|t| 2.0 - t * t, 1.3, 1.5) - 2f64.sqrt()).abs() < 1e-6);
        let steep = root(|t| if t < 1.01 { 1.0 - t } else { -5.0 }, 0.9, 1.5);
        assert!((0.9..=1.5).contains(&steep));
    }
}
