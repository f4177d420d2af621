//! Leading rays over the cells: many side by side, one try each at a time.
//!
//! What a try computes is done for all rays in loops that become vectors; between them every ray fetches its cell's function.
//!
//! All of it is f32, of which twice as many fit into a register, and proves what f64 would: with u = 2⁻²⁴, places are within
//! [`BLUR`] of where they are computed, for which columns have room, and a cell's function within [`CAUTION`] of its terms.

use core::sync::atomic::{AtomicBool, Ordering};

use super::{BLOCK, Below, Bounds, Ground, ROOM, SIDE};
use crate::error::Cancelled;
use crate::trace::bundle::Span;
use crate::trace::larger;
use crate::trace::tracer::Ray;

/// Rays that are led side by side.
const LANES: usize = 64;

/// The share of a side by which a ray goes over a border, to be in the next cell.
const NUDGE: f32 = 1e-3;

/// The share of a side by which places may be blurred for a cell to be tried.
const BLUR_MAX: f32 = 2e-3;

// The room that columns have holds both.
const _: () = assert!((NUDGE + BLUR_MAX) as f64 <= 0.8 * ROOM);

/// By this share of its coordinates, and of twice those of its ray's origin, a place is computed wrong at most, and in which cell it lies.
///
/// A place o + d t takes 3u of |o| and |x|, finding its cell 4u more; where a ray leaves a cell takes 5u of |o| and 6u of the edge.
const BLUR: f32 = 1.0 / 2_097_152.0;

/// By this share of its terms, of their sizes, a function is computed wrong at most, at a distance that is some u wrong: 8u, twice.
const CAUTION: f32 = 1.0 / 1_048_576.0;

/// Of the share of its way up to which a ray goes where a function ends to be positive.
const SHORTER: f32 = 1.0 - 1e-5;

/// Of a ray's direction along the ground, at least, for it to come to another cell.
const ACROSS_MIN: f32 = 1e-20;

/// How many times as large as the finest cells at a place the coarsest are that are tried there.
const DEPTH: f32 = 1024.0;

/// One over the cells along a block's side; a power of two.
const PER_SIDE: f32 = 1.0 / SIDE as f32;

/// So many clear cells in a row let a ray try larger ones.
const CLEAR_TO_GROW: f32 = 3.0;

/// Most tries along one ray.
const TRIES_MAX: f32 = 512.0;

type Row = [f32; LANES];

/// Rays under way, as structure of arrays. Places are seen from the eye, in the ground's frame.
#[repr(align(64))]
struct Lanes {
    origin: [Row; 3],
    direction: [Row; 3],
    /// One over x and y of the direction.
    inverse: [Row; 2],
    /// By how much t grows for each metre along the larger of x and y.
    per_metre: Row,
    /// How far its origin is from the eye, by the largest coordinate.
    away: Row,
    end: Row,
    /// Up to there the ray meets nothing.
    clear: Row,
    /// How many times as large as the first level's the cells of the level are that is tried; a power of two.
    scale: Row,
    /// The same of the finest level that reaches where the ray is.
    finest: Row,
    /// The corner of the cell that is tried, in sides.
    corner: [Row; 2],
    /// Its block among those of its level, and where it is in the block.
    block: [u32; LANES],
    cell: [u32; LANES],
    /// What the cell says.
    value: Row,
    slope: [Row; 3],
    /// Whether there is such a cell, and whether the ray is done: 0 or 1.
    exists: Row,
    is_done: Row,
    /// Cells in a row that were clear.
    in_a_row: Row,
    tries: Row,
    /// The spans that the rays are of.
    span: [usize; LANES],
}

/// The numbers of a ground that every lane needs.
#[derive(Clone, Copy)]
struct Scales {
    side: f32,
    inverse: f32,
    inverse_reach: f32,
    /// Of the coarsest level.
    last: f32,
    /// Blocks from the eye to the edge of a level.
    half: f32,
    /// Below this height there is no ground.
    floor: f32,
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// 1/a of a power of two.
#[inline(always)]
fn inverse(a: f32) -> f32 {
    f32::from_bits((254 << 23) - a.to_bits())
}

/// The least power of two, at least 1, that is more than `a`.
#[inline(always)]
fn power_above(a: f32) -> f32 {
    let power = f32::from_bits((a.to_bits() & (0xff << 23)) + (1 << 23));
    if a < 1.0 { 1.0 } else { power }
}

/// A whole number below 2²³.
#[inline(always)]
fn whole(a: f32) -> u32 {
    const BITS: f32 = (1_u32 << 23) as f32;
    (a + BITS).to_bits() & 0x7f_ffff
}

/// The nearest number of 32 bits.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "what is lost is counted")]
pub(super) fn single(a: f64) -> f32 {
    a as f32
}

/// The largest number of 32 bits that is not above.
fn at_most(a: f64) -> f32 {
    let near = single(a);
    if f64::from(near) > a {
        near.next_down()
    } else {
        near
    }
}

/// The least number of 32 bits that is not below.
fn at_least(a: f64) -> f32 {
    -at_most(-a)
}

impl Ground {
    /// Moves the start of every span to where the ground under its ray is no longer proven clear.
    pub(crate) fn lead(
        &self,
        mut bounds: Bounds<'_>,
        rays: &[Ray],
        spans: &mut [Span],
        cancel: &AtomicBool,
    ) -> Result<(), Cancelled> {
        let first = &self.levels[0];
        let scales = Scales {
            side: single(first.side),
            inverse: single(1.0 / first.side),
            inverse_reach: single(1.0 / first.reach),
            last: (1_u32 << (self.levels.len() - 1)) as f32,
            half: self.half as f32,
            floor: single(self.frame.floor()),
        };
        let level = bounds.level;
        let mut lanes = Lanes::new();
        let (mut n, mut next) = (0, 0);
        while n < LANES && next < spans.len() {
            lanes.set(n, next, rays, &spans[next], self);
            (n, next) = (n + 1, next + 1);
        }
        while n > 0 {
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            level.vectorize(
                #[inline(always)]
                || lanes.place(n, scales),
            );
            lanes.ask(n, self, &mut bounds);
            level.vectorize(
                #[inline(always)]
                || lanes.go(n, scales),
            );
            for i in (0..n).rev() {
                if lanes.is_done[i] == 0.0 {
                    continue;
                }
                let span = &mut spans[lanes.span[i]];
                let clear = f64::from(lanes.clear[i]);
                span.clear = if clear < span.end {
                    larger(span.clear, clear)
                } else {
                    span.end
                };
                if let Some(span) = spans.get(next) {
                    lanes.set(i, next, rays, span, self);
                    next += 1;
                } else {
                    n -= 1;
                    lanes.copy(n, i);
                }
            }
        }
        Ok(())
    }
}

impl Lanes {
    fn new() -> Self {
        let row = [0.0; LANES];
        Self {
            origin: [row; 3],
            direction: [row; 3],
            inverse: [row; 2],
            per_metre: row,
            away: row,
            end: row,
            clear: row,
            scale: row,
            finest: row,
            corner: [row; 2],
            block: [0; LANES],
            cell: [0; LANES],
            value: row,
            slope: [row; 3],
            exists: row,
            is_done: row,
            in_a_row: row,
            tries: row,
            span: [0; LANES],
        }
    }

    /// Puts a ray into a lane.
    fn set(&mut self, i: usize, index: usize, rays: &[Ray], span: &Span, ground: &Ground) {
        let ray = &rays[span.ray];
        let origin = ground.frame.seen(ray.origin - ground.eye);
        let direction = ground.frame.seen(ray.direction);
        for axis in 0..3 {
            self.origin[axis][i] = single(origin[axis]);
            self.direction[axis][i] = single(direction[axis]);
        }
        let [x, y] = [0, 1].map(|axis| self.direction[axis][i]);
        self.inverse[0][i] = 1.0 / x;
        self.inverse[1][i] = 1.0 / y;
        self.per_metre[i] = 1.0 / most(most(x.abs(), y.abs()), ACROSS_MIN);
        self.away[i] = at_least(origin.abs().max_element());
        self.end[i] = at_least(span.end);
        self.clear[i] = at_most(span.clear);
        // The coarsest is tried first.
        self.scale[i] = f32::MAX;
        self.finest[i] = 1.0;
        self.in_a_row[i] = CLEAR_TO_GROW;
        self.tries[i] = 0.0;
        self.span[i] = index;
    }

    /// Copies one lane's ray into another.
    fn copy(&mut self, from: usize, to: usize) {
        for row in self.origin.iter_mut().chain(&mut self.direction) {
            row[to] = row[from];
        }
        for row in self.inverse.iter_mut().chain([
            &mut self.per_metre,
            &mut self.away,
            &mut self.end,
            &mut self.clear,
            &mut self.scale,
            &mut self.finest,
            &mut self.in_a_row,
            &mut self.tries,
        ]) {
            row[to] = row[from];
        }
        self.span[to] = self.span[from];
    }

    /// Fetches what the cells say that are tried.
    fn ask(&mut self, n: usize, ground: &Ground, bounds: &mut Bounds<'_>) {
        // Known to be in range, the rows need no checks of their own.
        assert!(n <= LANES);
        for i in 0..n {
            if self.exists[i] > 0.0 {
                let block = ground.block(bounds, self.scale[i], self.block[i] as usize);
                let Below { value, slope } = block[self.cell[i] as usize % BLOCK];
                self.value[i] = value;
                for (row, slope) in self.slope.iter_mut().zip(slope) {
                    row[i] = slope;
                }
            }
        }
    }

    /// Which cell every ray tries next.
    #[inline(always)]
    fn place(&mut self, n: usize, scales: Scales) {
        assert!(n <= LANES);
        for i in 0..n {
            let way = |axis: usize, t: f32| self.origin[axis][i] + self.direction[axis][i] * t;
            let t = self.clear[i];
            let far = most(way(0, t).abs(), way(1, t).abs());
            // Rays come nearer, too, but then what is coarser there serves them.
            let finest = most(power_above(far * scales.inverse_reach), self.finest[i]);
            let coarsest = least(finest * DEPTH, scales.last);
            let scale = least(most(self.scale[i], finest), coarsest);
            let side = scales.side * scale;
            let ahead = t + NUDGE * side * self.per_metre[i];
            let cells = scales.inverse * inverse(scale);
            let (x, y) = (
                (way(0, ahead) * cells).floor(),
                (way(1, ahead) * cells).floor(),
            );
            // In blocks, from the first corner of the level.
            let (across, along) = (x * PER_SIDE + scales.half, y * PER_SIDE + scales.half);
            let (column, row) = (across.floor(), along.floor());
            // Each compared by itself: what is not a number is in no cell.
            let low = (across >= 0.0) & (along >= 0.0);
            let edge = 2.0 * scales.half;
            let inside = low & (column < edge) & (row < edge) & (way(2, t) > scales.floor);
            let is_sharp = (far + 2.0 * self.away[i]) * BLUR < BLUR_MAX * side;
            let exists = (finest <= scales.last) & inside & is_sharp;
            let within = ((along - row) * SIDE as f32 + (across - column)) * SIDE as f32;
            self.block[i] = whole(row * edge + column);
            self.cell[i] = whole(within);
            self.corner[0][i] = x;
            self.corner[1][i] = y;
            self.finest[i] = finest;
            self.scale[i] = scale;
            self.exists[i] = if exists { 1.0 } else { 0.0 };
        }
    }

    /// How far every ray goes over its cell, and what it tries next.
    #[inline(always)]
    fn go(&mut self, n: usize, scales: Scales) {
        assert!(n <= LANES);
        for i in 0..n {
            let (t, end, scale) = (self.clear[i], self.end[i], self.scale[i]);
            let side = scales.side * scale;
            // Where it leaves the cell, or ends.
            let mut exit = end;
            for axis in 0..2 {
                let direction = self.direction[axis][i];
                let step = if direction > 0.0 { 1.0 } else { 0.0 };
                let edge = (self.corner[axis][i] + step) * side;
                let there = (edge - self.origin[axis][i]) * self.inverse[axis][i];
                exit = if (direction != 0.0) & (there < exit) {
                    there
                } else {
                    exit
                };
            }
            // Along the ray the function is a line.
            let (mut first, mut rate, mut steepest) = (self.value[i], 0.0, f32::MIN_POSITIVE);
            for axis in 0..3 {
                let slope = self.slope[axis][i];
                first += slope * self.origin[axis][i];
                rate += slope * self.direction[axis][i];
                steepest += slope.abs();
            }
            let terms = self.value[i].abs() + steepest * (self.away[i] + exit);
            let wrong = CAUTION * (terms + f32::MIN_POSITIVE);
            let (near, far) = (first + rate * t - wrong, first + rate * exit - wrong);
            // Where it is not positive all the way, as far as it is.
            let partly = t + (exit - t) * (near / (near - far)) * SHORTER;
            let is_clear = (near > 0.0) & (far > 0.0);
            let clear = if is_clear { exit } else { partly };
            let clear = if near > 0.0 { clear } else { t };
            let goes_on = (self.exists[i] > 0.0) & (exit > t);
            // Where a term overflows it is not a number, and proves nothing.
            let clear = if goes_on & (clear > t) { clear } else { t };
            let is_last = !is_clear & (scale == self.finest[i]);
            let is_done = !goes_on | (clear >= end) | is_last | (self.tries[i] >= TRIES_MAX);
            let in_a_row = if is_clear {
                self.in_a_row[i] + 1.0
            } else {
                0.0
            };
            let grown = if in_a_row >= CLEAR_TO_GROW {
                2.0 * scale
            } else {
                scale
            };
            self.clear[i] = clear;
            self.scale[i] = if is_clear { grown } else { 0.5 * scale };
            self.in_a_row[i] = in_a_row;
            self.is_done[i] = if is_done { 1.0 } else { 0.0 };
            self.tries[i] += 1.0;
        }
    }
}
