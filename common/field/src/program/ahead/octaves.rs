//! The stretches of noises and of cascades of them, from what they are at the places.

use fearless_simd::Simd;

use super::Place;
use super::lanes::{Row, Stretches, WIDTH, row};
use super::stretch::{Stretch, least, most, steepness, turn};
use crate::cascade::{self, Carried, Cascade, Model, Octave, Term, Weight};
use crate::noise::Limits;
use crate::number::Number;
use crate::op::Basis;
use crate::program::slopes::{Sample, Tape};

/// Error of a noise's derivative, as a share of the greatest there is, if more is not known: it is computed in f32, good to 3·10⁻⁶.
const SLOPE_ROUNDING: f64 = 1e-4;

/// Error of a noise's derivative along a unit direction.
#[inline(always)]
fn error(limits: Limits) -> f64 {
    let (share, known) = (SLOPE_ROUNDING * limits.slope, 2.0 * limits.slope_rounding);
    most(share, known)
}

/// Error of a cascade's depth.
const DEPTH_ROUNDING: f64 = 1e-9;

/// Longer than any cascade.
const DEEP: f64 = 1e9;

/// Room for the octaves of one cascade.
#[derive(Debug)]
pub(super) struct Octaves {
    pub(super) length: Row,
    /// How far stretches reach behind their places, as a share of `length`.
    pub(super) back: f64,
    /// The greatest speed of the cascade's argument, and how far its velocity may turn.
    speed: Row,
    turn: Row,
    shallow: Row,
    deep: Row,
    pub(super) noise: Stretches,
    pub(super) total: Stretches,
    rest: Stretches,
}

/// Footprints at the places, and how fast they grow at most.
#[derive(Clone, Copy)]
pub(super) struct Growth<'a> {
    pub(super) footprint: &'a Row,
    pub(super) rate: f64,
}

/// A range of weights.
#[derive(Clone, Copy)]
struct Weights {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Weight<Stretch> for Weights {
    #[inline(always)]
    fn weigh(self, octave: Stretch, amplitude: f64) -> Stretch {
        // Weights and amplitudes are not negative.
        let (slight, full) = (self.low * amplitude, self.high * amplitude);
        let below = |a: f64| a * if a < 0.0 { full } else { slight };
        let above = |a: f64| a * if a > 0.0 { full } else { slight };
        Stretch::new(
            (below(octave.low), above(octave.high)),
            (below(octave.fall), above(octave.rise)),
        )
    }
}

impl Octaves {
    pub(super) fn new() -> Self {
        Self {
            length: [0.0; WIDTH],
            back: 0.0,
            speed: [0.0; WIDTH],
            turn: [0.0; WIDTH],
            shallow: [0.0; WIDTH],
            deep: [0.0; WIDTH],
            noise: *Stretches::new(),
            total: *Stretches::new(),
            rest: *Stretches::new(),
        }
    }

    /// How fast the argument goes, and how far it turns.
    #[inline(always)]
    pub(super) fn argument(&mut self, [a, b, c]: [&Stretches; 3]) {
        for i in 0..WIDTH {
            let parts = [a.at(i), b.at(i), c.at(i)];
            self.speed[i] = steepness(parts);
            self.turn[i] = turn(parts);
        }
    }

    /// The stretches of a noise, from what it is at the places.
    #[inline(always)]
    pub(super) fn noise(
        &mut self,
        limits: Limits,
        sample: &Sample<1>,
        start: usize,
        frequency: f64,
    ) {
        let [slopes] = &sample.gradient;
        let (slopes, values) = (&slopes[start..][..WIDTH], &sample.noise[start..][..WIDTH]);
        // Not read from memory in the loop, which writes there: it would not become vectors.
        let back = self.back;
        let (lowest, highest) = (limits.middle - limits.range, limits.middle + limits.range);
        let error = error(limits);
        for i in 0..WIDTH {
            let speed = self.speed[i] * frequency;
            let steepest = limits.slope * speed;
            let way = speed * self.length[i];
            let room =
                limits.bend * speed * way + limits.slope * self.turn[i] * frequency + error * speed;
            let slope = f64::from(slopes[i]);
            let fall = most(slope - room, -steepest);
            let rise = least(slope + room, steepest);
            let value = f64::from(values[i]);
            // Behind the place a rise leads down.
            let (descent, ascent) = (most(-fall, back * rise), most(rise, -back * fall));
            let down = -most(descent, 0.0) * self.length[i] - limits.rounding;
            let up = most(ascent, 0.0) * self.length[i] + limits.rounding;
            self.noise.low[i] = most(value + down, lowest);
            self.noise.high[i] = least(value + up, highest);
            self.noise.fall[i] = fall;
            self.noise.rise[i] = rise;
        }
    }

    /// The stretches of a noise of which nothing is known.
    #[inline(always)]
    fn any_noise(&mut self, limits: Limits, frequency: f64) {
        for i in 0..WIDTH {
            let steepest = limits.slope * self.speed[i] * frequency;
            self.noise.low[i] = limits.middle - limits.range;
            self.noise.high[i] = limits.middle + limits.range;
            self.noise.fall[i] = -steepest;
            self.noise.rise[i] = steepest;
        }
    }

    /// The least and the greatest depth of a cascade on the stretches.
    #[inline(always)]
    fn depths(&mut self, cascade: &Cascade, depth: &Row, Growth { footprint, rate }: Growth<'_>) {
        let Some(detail) = cascade.detail else {
            (self.shallow, self.deep) = (*depth, *depth);
            return;
        };
        let per_octave = detail.per_octave * core::f64::consts::LOG2_E;
        for i in 0..WIDTH {
            let growth = rate * self.length[i];
            let least_footprint = footprint[i] - growth;
            let change = if least_footprint > 0.0 {
                per_octave * growth / least_footprint
            } else {
                DEEP
            };
            let change = if growth > 0.0 { change } else { 0.0 } + DEPTH_ROUNDING;
            self.shallow[i] = depth[i] - change;
            self.deep[i] = depth[i] + change;
        }
    }

    #[inline(always)]
    pub(super) fn run<S: Simd>(
        &mut self,
        simd: S,
        cascade: &Cascade,
        at: [&Stretches; 3],
        growth: Growth<'_>,
        tape: &Tape<1>,
        place: &mut Place,
    ) {
        let (evaluated, depth) = tape.cascade_at(place.cascade);
        simd.vectorize(
            #[inline(always)]
            || {
                self.argument(at);
                self.depths(cascade, row(depth, place.start), growth);
            },
        );
        self.total.fill(Stretch::constant(0.0));
        self.rest.fill(Stretch::constant(0.0));
        for (k, octave) in cascade.octaves.iter().enumerate() {
            let i = cascade::index(k);
            // Also an octave that no place has may have a weight on some stretch.
            if k >= evaluated && self.deep.iter().all(|deep| *deep <= i) {
                break;
            }
            let limits = octave.noise.as_ref().map_or(Limits::GRADIENT, Limits::of);
            simd.vectorize(
                #[inline(always)]
                || {
                    if k < evaluated {
                        let sample = tape.sample_at(place.sample + k);
                        self.noise(limits, sample, place.start, octave.frequency);
                    } else {
                        self.any_noise(limits, octave.frequency);
                    }
                },
            );
            simd.vectorize(
                #[inline(always)]
                || {
                    if k == 0 {
                        self.add::<true>(cascade.model, octave, i);
                    } else {
                        self.add::<false>(cascade.model, octave, i);
                    }
                },
            );
        }
        place.sample += evaluated;
        place.cascade += 1;
    }

    /// Adds an octave's noise. Shapes and models have loops of their own, so that none of them decides anything.
    #[inline(always)]
    fn add<const FIRST: bool>(&mut self, model: Model, octave: &Octave, i: f64) {
        match model {
            Model::Sum(basis) => {
                self.shape(basis);
                self.each::<FIRST>(
                    octave,
                    i,
                    #[inline(always)]
                    |t, n, c| cascade::sum(Basis::Plain, t, n, c),
                );
            }
            Model::AltitudeOne { basis, xi } => {
                self.shape(basis);
                self.each::<FIRST>(
                    octave,
                    i,
                    #[inline(always)]
                    |t, n, c| cascade::altitude_one(Basis::Plain, xi, t, n, c),
                );
            }
            Model::AltitudeTwo { basis, xi } => {
                self.shape(basis);
                self.each::<FIRST>(
                    octave,
                    i,
                    #[inline(always)]
                    |t, n, c| cascade::altitude_two(Basis::Plain, xi, t, n, c),
                );
            }
            Model::Ridged { offset, gain } => self.each::<FIRST>(
                octave,
                i,
                #[inline(always)]
                |t, n, c| cascade::ridged(offset, gain, t, n, c),
            ),
        }
    }

    /// Turns the noise into what the basis makes of it.
    #[inline(always)]
    fn shape(&mut self, basis: Basis) {
        let noise = &mut self.noise;
        match basis {
            Basis::Plain => {}
            Basis::Absolute => {
                for i in 0..WIDTH {
                    noise.set(i, cascade::shape(Basis::Absolute, noise.at(i)));
                }
            }
            Basis::Ridged => {
                for i in 0..WIDTH {
                    noise.set(i, cascade::shape(Basis::Ridged, noise.at(i)));
                }
            }
        }
    }

    #[inline(always)]
    fn each<const FIRST: bool>(
        &mut self,
        octave: &Octave,
        i: f64,
        add: impl Fn(Term<Weights>, Stretch, Carried<Stretch>) -> Carried<Stretch>,
    ) {
        let amplitude = octave.amplitude;
        for lane in 0..WIDTH {
            let term = Term {
                first: FIRST,
                amplitude,
                weight: Weights {
                    low: cascade::weight(self.shallow[lane], i),
                    high: cascade::weight(self.deep[lane], i),
                },
            };
            let carried = (self.total.at(lane), self.rest.at(lane));
            let (sum, handed) = add(term, self.noise.at(lane), carried);
            self.total.set(lane, sum);
            self.rest.set(lane, handed);
        }
    }
}
