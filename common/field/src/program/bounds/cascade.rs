//! Ranges and changes of frequency cascades, octave by octave.

use super::{Bound, Change, NOISE, Pass};
use crate::cascade::{self, Cascade, Model, Octave};
use crate::interval::{Interval, larger};
use crate::noise::Noise;
use crate::op::Basis;

/// How far the norm of rⁱ Rⁱ⁺¹ may be above rⁱ, relatively.
const STRETCH: f64 = 1.0 + 1e-12;

/// Twice the error of `cascade::log2`, and room for its rounding.
const LOG_ROUNDING: f64 = 3e-10;

const ONE: Part = Part {
    range: Interval::point(1.0),
    change: Change::NONE,
};

/// A number on its way through a cascade.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    pub(crate) range: Interval,
    change: Change,
}

impl Part {
    fn scaled(self, factor: f64) -> Self {
        let range = self.range.mul(Interval::point(factor));
        Self {
            range,
            change: self
                .change
                .times(factor.abs())
                .rounded(range.magnitude(), 1.0),
        }
    }

    /// Where it counts as `middle` instead.
    fn left_out(self, middle: f64) -> Self {
        let range = self.range.hull(Interval::point(middle));
        let most = larger(range.high - middle, middle - range.low);
        Self {
            range,
            change: Change::new(most, 0.0).rounded(range.magnitude(), 4.0),
        }
    }

    fn raised(self, by: f64) -> Self {
        let range = self.range.add(Interval::point(by));
        Self {
            range,
            change: self.change.rounded(range.magnitude(), 1.0),
        }
    }
}

fn shaped(basis: Basis, noise: Part) -> Part {
    match basis {
        Basis::Plain => noise,
        Basis::Absolute => Part {
            range: noise.range.abs(),
            change: noise.change,
        },
        Basis::Ridged => ridge(1.0, noise),
    }
}

/// (offset − |n|)²: |s² − t²| = |s + t||s − t|.
fn ridge(offset: f64, noise: Part) -> Part {
    let base = Interval::point(offset).sub(noise.range.abs());
    let range = base.square();
    let change = noise
        .change
        .rounded(base.magnitude(), 1.0)
        .times(2.0 * base.magnitude());
    Part {
        range,
        change: change.rounded(range.magnitude(), 1.0),
    }
}

/// What stands for an octave that is left out: the middle of what it can be, where octaves are added by themselves.
pub(super) fn middle(cascade: &Cascade, i: usize) -> f64 {
    let Model::Sum(basis) = cascade.model else {
        return 0.0;
    };
    let octave = &cascade.octaves[i];
    let noise = Part {
        range: octave.noise.as_ref().map_or(NOISE, Noise::range),
        change: Change::NONE,
    };
    shaped(basis, noise).range.middle() * octave.amplitude
}

impl Pass<'_> {
    pub(super) fn cascade(&mut self, cascade: &Cascade, at: &Bound) -> Bound {
        let zero = Interval::point(0.0);
        let mut total = Part {
            range: zero,
            change: Change::NONE,
        };
        let mut rest = total;
        let keeps = self.keeps();
        for (i, octave) in cascade.octaves.iter().enumerate() {
            let weight = self.weight(cascade, i);
            if weight.range.high <= 0.0 && keeps >= cascade.octaves.len() {
                break;
            }
            let noise = Part {
                range: octave.noise.as_ref().map_or(NOISE, Noise::range),
                change: self.octave(octave, at),
            };
            let amplitude = octave.amplitude;
            let held = |octave: Part| {
                if i < keeps {
                    octave
                } else {
                    octave.left_out(middle(cascade, i))
                }
            };
            match cascade.model {
                Model::Sum(basis) => {
                    let octave = self.times(shaped(basis, noise), weight).scaled(amplitude);
                    total = self.plus(total, held(octave));
                }
                Model::AltitudeOne { basis, xi } => {
                    let octave = self
                        .times(shaped(basis, noise).raised(xi), weight)
                        .scaled(amplitude);
                    let octave = held(octave);
                    total = if i == 0 {
                        octave
                    } else {
                        self.times(total, octave.raised(1.0))
                    };
                }
                Model::AltitudeTwo { basis, xi } => {
                    let raised = shaped(basis, noise).raised(xi).scaled(amplitude);
                    if i == 0 {
                        let octave = self.times(raised, weight);
                        total = held(octave);
                        rest.range = Interval::point(1.0);
                    } else {
                        rest = self.clamped(rest, raised);
                        let octave = self.times(rest, weight);
                        total = self.plus(total, held(octave));
                    }
                }
                Model::Ridged { offset, gain } => {
                    let ridge = ridge(offset, noise);
                    rest = if i == 0 {
                        ridge
                    } else {
                        let gained = self.clamped(rest.scaled(gain), ONE);
                        self.times(gained, ridge)
                    };
                    let octave = self.times(rest, weight).scaled(amplitude);
                    total = self.plus(total, held(octave));
                }
            }
        }
        self.scalar(total.range, total.change)
    }

    /// The change of one octave's noise, the rounding of its coordinates included.
    fn octave(&mut self, octave: &Octave, at: &Bound) -> Change {
        let frequency = octave.frequency * STRETCH;
        let place = at
            .change()
            .times(frequency)
            .rounded(at.magnitude() * frequency + 1.0, 8.0);
        match &octave.noise {
            None => self.noise(place),
            // Skewing at most doubles the coordinates, and their rounding.
            Some(noise) if noise.is_skewed() => {
                let more = at.magnitude() * frequency * 2.0 + 2.0;
                self.any_noise(noise, place.rounded(more, 8.0))
            }
            Some(noise) => self.any_noise(noise, place),
        }
    }

    /// The level-of-detail weight of octave `i`. It changes with the footprint, where it is neither 0 nor 1.
    pub(crate) fn weight(&mut self, cascade: &Cascade, i: usize) -> Part {
        let Some(detail) = cascade.detail else {
            return ONE;
        };
        let i = cascade::index(i);
        let Interval { low, high } = self.around.footprint;
        let slack = LOG_ROUNDING * detail.per_octave;
        let range = Interval::new(
            cascade::weight(cascade.depth(high) - slack, i),
            cascade::weight(cascade.depth(low) + slack, i),
        );
        if range.width() == 0.0 {
            return Part {
                range,
                change: Change::NONE,
            };
        }
        // Below this footprint the weight is 1.
        let full = libm::exp2(-detail.detail - (i + detail.first) / detail.per_octave)
            / detail.scale
            * (1.0 - 1e-9);
        let per_metre = detail.per_octave / (std::f64::consts::LN_2 * larger(low, full));
        let change = Change::new(slack, self.around.footprint_slope * per_metre);
        Part {
            range,
            change: self.limited(range, change),
        }
    }

    fn plus(&mut self, a: Part, b: Part) -> Part {
        let range = a.range.add(b.range);
        let change = a.change.plus(b.change).rounded(range.magnitude(), 1.0);
        Part {
            range,
            change: self.limited(range, change),
        }
    }

    fn times(&mut self, a: Part, b: Part) -> Part {
        let range = a.range.mul(b.range);
        let change = a
            .change
            .times(b.range.magnitude())
            .plus(b.change.times(a.range.magnitude()));
        Part {
            range,
            change: self.limited(range, change.rounded(range.magnitude(), 2.0)),
        }
    }

    /// The product, held between 0 and 1.
    fn clamped(&mut self, a: Part, b: Part) -> Part {
        let Part { range, change } = self.times(a, b);
        let range = range.clamp(0.0, 1.0);
        Part {
            range,
            change: self.limited(range, change),
        }
    }
}
