//! Leading rays over the cells: many side by side, one try each at a time.
//!
//! What a try computes is done for all rays in loops that become vectors; between them every ray fetches its cell's function.

use core::sync::atomic::{AtomicBool, Ordering};

use super::{BLOCK, Below, Bounds, CAUTION, Ground, SIDE};
use crate::error::Cancelled;
use crate::trace::bundle::Span;
use crate::trace::tracer::Ray;

/// Rays that are led side by side.
const LANES: usize = 64;

/// The share of a side by which a ray goes over a border, to be in the next cell: less than the room there.
const NUDGE: f64 = 1e-4;

/// How many times as large as the finest cells at a place the coarsest are that are tried there.
const DEPTH: f64 = 1024.0;

/// One over the cells along a block's side; a power of two.
const PER_SIDE: f64 = 1.0 / SIDE as f64;

/// So many clear cells in a row let a ray try larger ones.
const CLEAR_TO_GROW: f64 = 3.0;

/// Most tries along one ray.
const TRIES_MAX: f64 = 512.0;

type Row = [f64; LANES];

/// Rays under way, as structure of arrays. Places are seen from the eye, in the ground's frame.
struct Lanes {
    origin: [Row; 3],
    direction: [Row; 3],
    /// One over x and y of the direction.
    inverse: [Row; 2],
    /// By how much t grows for each metre along the larger of x and y.
    per_metre: Row,
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
    side: f64,
    inverse: f64,
    inverse_reach: f64,
    /// Of the coarsest level.
    last: f64,
    /// Blocks from the eye to the edge of a level.
    half: f64,
    /// Below this height there is no ground.
    floor: f64,
}

#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// 1/a of a power of two.
#[inline(always)]
fn inverse(a: f64) -> f64 {
    f64::from_bits((2046 << 52) - a.to_bits())
}

/// The least power of two, at least 1, that is more than `a`.
#[inline(always)]
fn power_above(a: f64) -> f64 {
    let power = f64::from_bits((a.to_bits() & (0x7ff << 52)) + (1 << 52));
    if a < 1.0 { 1.0 } else { power }
}

/// A whole number below 2³².
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    reason = "the low bits of 2⁵² and the number are the number"
)]
fn whole(a: f64) -> u32 {
    const BITS: f64 = (1_u64 << 52) as f64;
    (a + BITS).to_bits() as u32
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
            side: first.side,
            inverse: 1.0 / first.side,
            inverse_reach: 1.0 / first.reach,
            last: (1_u64 << (self.levels.len() - 1)) as f64,
            half: self.half as f64,
            floor: self.frame.floor(),
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
                spans[lanes.span[i]].clear = lanes.clear[i];
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
            self.origin[axis][i] = origin[axis];
            self.direction[axis][i] = direction[axis];
        }
        self.inverse[0][i] = 1.0 / direction.x;
        self.inverse[1][i] = 1.0 / direction.y;
        let across = most(direction.x.abs(), direction.y.abs());
        self.per_metre[i] = 1.0 / most(across, f64::MIN_POSITIVE);
        self.end[i] = span.end;
        self.clear[i] = span.clear;
        // The coarsest is tried first.
        self.scale[i] = f64::MAX;
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
                self.slope[0][i] = slope.x;
                self.slope[1][i] = slope.y;
                self.slope[2][i] = slope.z;
            }
        }
    }

    /// Which cell every ray tries next.
    #[inline(always)]
    fn place(&mut self, n: usize, scales: Scales) {
        assert!(n <= LANES);
        for i in 0..n {
            let way = |axis: usize, t: f64| self.origin[axis][i] + self.direction[axis][i] * t;
            let t = self.clear[i];
            let far = most(way(0, t).abs(), way(1, t).abs());
            // Rays come nearer, too, but then what is coarser there serves them.
            let finest = most(power_above(far * scales.inverse_reach), self.finest[i]);
            let coarsest = least(finest * DEPTH, scales.last);
            let scale = least(most(self.scale[i], finest), coarsest);
            let ahead = t + NUDGE * scales.side * scale * self.per_metre[i];
            let cells = scales.inverse * inverse(scale);
            let (x, y) = (
                (way(0, ahead) * cells).floor(),
                (way(1, ahead) * cells).floor(),
            );
            // In blocks, from the first corner of the level.
            let (across, along) = (x * PER_SIDE + scales.half, y * PER_SIDE + scales.half);
            let (column, row) = (across.floor(), along.floor());
            let low = least(across, along) >= 0.0;
            let inside = (most(column, row) < 2.0 * scales.half) & (way(2, t) > scales.floor);
            let exists = (finest <= scales.last) & low & inside;
            let within = ((along - row) * SIDE as f64 + (across - column)) * SIDE as f64;
            self.block[i] = whole(row * (2.0 * scales.half) + column);
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
            let (mut first, mut rate) = (self.value[i], 0.0);
            for axis in 0..3 {
                first += self.slope[axis][i] * self.origin[axis][i];
                rate += self.slope[axis][i] * self.direction[axis][i];
            }
            let (near, far) = (first + rate * t, first + rate * exit);
            // Where it is not positive all the way, as far as it is.
            let partly = t + (exit - t) * (near / (near - far)) * (1.0 - CAUTION);
            let is_clear = (near > 0.0) & (far > 0.0);
            let clear = if is_clear { exit } else { partly };
            let clear = if near > 0.0 { clear } else { t };
            let goes_on = (self.exists[i] > 0.0) & (exit > t);
            let clear = if goes_on { clear } else { t };
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
