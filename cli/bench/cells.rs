//! Sphere tracing with the slope bound of each lattice cell, which its eight gradients give; past the thesis, beside its table 5.1.
//!
//! A cell is cut into boxes, and the gradient's range over each (`Program::slopes_over_box`) gives what the noise's slope can be
//! there: the length of its gradient, or its fall along the ray. A value g then proves the way on which all layers together
//! cannot have fallen by g, cell after cell; nothing is evaluated where the ray goes from one cell to the next.

use std::cell::RefCell;
use std::collections::HashMap;

use field::{Interval, Program};
use render::methods::{Along as _, FieldAlong, Tally};

/// Amplitude and frequency of each layer of eq. (5.11).
const LAYERS: [(f64, f64); 3] = [(0.3, 4.0), (0.15, 8.0), (0.05, 16.0)];

/// A cell's bound may be this much more than what is seen in it.
const CLOSE: f64 = 0.3;

/// Most boxes of a cell that are cut; then what is proven counts.
const BOXES_MAX: u32 = 40;

/// The bound that holds in every cell, reached in some: ERRATA row 1782.
const STEEPEST: f64 = 3.75;

/// What of a cell's slopes is a bound.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Known {
    /// The length of the gradient.
    Length,
    /// How steeply the noise falls along the ray.
    Fall,
}

/// The bounds of every cell that was met.
pub(crate) struct Cells {
    noise: Program,
    direction: [f64; 3],
    known: Known,
    seen: RefCell<HashMap<[i64; 3], f64>>,
}

impl Cells {
    /// Bounds for rays of one direction at gradient noise.
    pub(crate) fn new(direction: [f64; 3], known: Known) -> Result<Self, String> {
        let alone = scene::expression("noise(p)", &[]).map_err(|error| error.to_string())?;
        let noise = Program::compile(&alone.graph, &[alone.root], Interval::point(0.0))
            .map_err(|error| error.to_string())?;
        Ok(Self {
            noise,
            direction,
            known,
            seen: RefCell::default(),
        })
    }

    /// The bound in a cell of the noise.
    pub(crate) fn bound(&self, cell: [i64; 3]) -> f64 {
        if let Some(known) = self.seen.borrow().get(&cell) {
            return *known;
        }
        let most = self.most(cell);
        let most = if most < STEEPEST { most } else { STEEPEST };
        self.seen.borrow_mut().insert(cell, most);
        most
    }

    /// By branch and bound: the box that may be steepest is cut until it cannot be much steeper than a place that was seen.
    fn most(&self, cell: [i64; 3]) -> f64 {
        let low = cell.map(|part| part as f64);
        let whole = low.map(|low| Interval::new(low, low + 1.0));
        let mut open = vec![(self.steepest(whole), whole)];
        let mut seen = 0.0;
        for _ in 0..BOXES_MAX {
            let (place, most) = (0..open.len()).fold((0, 0.0), |(place, most), i| {
                if open[i].0 > most {
                    (i, open[i].0)
                } else {
                    (place, most)
                }
            });
            if most <= seen + CLOSE {
                return most;
            }
            let (_, over) = open.swap_remove(place);
            let middle = over.map(|side| 0.5 * (side.low + side.high));
            let here = self.steepest(middle.map(Interval::point));
            seen = if here > seen { here } else { seen };
            for corner in 0..8u32 {
                let part = [0, 1, 2].map(|k| match corner >> k & 1 {
                    0 => Interval::new(over[k].low, middle[k]),
                    _ => Interval::new(middle[k], over[k].high),
                });
                open.push((self.steepest(part), part));
            }
        }
        open.iter().fold(
            0.0,
            |most, (here, _)| if *here > most { *here } else { most },
        )
    }

    /// How steep the noise can be over a box; at least 0.
    fn steepest(&self, over: [Interval; 3]) -> f64 {
        let zero = Interval::point(0.0);
        let slopes = self.noise.slopes_over_box(over, zero, 0.0).slopes;
        match self.known {
            Known::Length => {
                let [x, y, z] = slopes.map(Interval::magnitude);
                (x * x + y * y + z * z).sqrt()
            }
            Known::Fall => {
                let fall = (0..3).fold(0.0, |fall, k| {
                    let (e, slope) = (self.direction[k], slopes[k]);
                    fall - e * if e > 0.0 { slope.low } else { slope.high }
                });
                if fall > 0.0 { fall } else { 0.0 }
            }
        }
    }

    /// The first root along a ray, as fig. 5.5 without speculation has it.
    pub(crate) fn first(
        &self,
        ray: &FieldAlong<'_>,
        span: Interval,
        epsilon: f64,
        tally: &mut Tally,
    ) -> Option<f64> {
        let mut t = span.low;
        while t < span.high {
            tally.points += 1;
            tally.steps += 1;
            let next = self.clear(ray, t, ray.value(t).abs(), span.high);
            if next - t < epsilon {
                return Some(next);
            }
            t = next;
        }
        None
    }

    /// How far a ray certainly goes before the field has changed by `budget`.
    fn clear(&self, ray: &FieldAlong<'_>, from: f64, mut budget: f64, end: f64) -> f64 {
        let mut t = from;
        while t < end {
            // ‖p‖ falls by 1 per metre at most.
            let (mut steepest, mut border) = (1.0, end);
            for (amplitude, frequency) in LAYERS {
                let (cell, leaves) = cell(ray, frequency, t);
                steepest += amplitude * frequency * self.bound(cell);
                border = if leaves < border { leaves } else { border };
            }
            let fall = steepest * (border - t);
            if fall >= budget {
                return t + budget / steepest;
            }
            budget -= if fall > 0.0 { fall } else { 0.0 };
            t = border;
        }
        end
    }
}

/// The lattice cell of a layer at a distance, and where the ray leaves it.
fn cell(ray: &FieldAlong<'_>, frequency: f64, t: f64) -> ([i64; 3], f64) {
    /// A distance beyond a border that belongs to the next cell.
    const BEYOND: f64 = 1e-12;
    let mut leaves = f64::INFINITY;
    let cell = [0, 1, 2].map(|k| {
        let (place, rate) = (
            frequency * (ray.origin[k] + (t + BEYOND) * ray.direction[k]),
            frequency * ray.direction[k],
        );
        let low = place.floor();
        if rate != 0.0 {
            let border = if rate > 0.0 { low + 1.0 } else { low };
            let there = t + (border - place) / rate + 2.0 * BEYOND;
            leaves = if there < leaves { there } else { leaves };
        }
        #[expect(clippy::cast_possible_truncation, reason = "cells are few")]
        let number = low as i64;
        number
    });
    (cell, leaves)
}
