//! Midpoint subdivision and successive random additions on a square (thesis §3.2.3).

use super::gaussian;

/// The stream of random numbers that displacements come from.
const STREAM: u32 = 0x3d1d_0501;

/// Most levels: a grid of 2049² samples.
pub(super) const LEVELS_MAX: u32 = 11;

/// How midpoints are joined to what is there.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Mesh {
    /// Centres of squares, then of the squares between them, at 45° (thesis fig. 3.9).
    Squares,
    /// Midpoints of the edges of triangles: two to a square (thesis fig. 3.8).
    Triangles,
}

/// Which samples are displaced at an iteration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Displaced {
    /// The new ones alone, thesis eqs. (3.28), (3.31).
    Midpoints,
    /// All, by half the variance each, thesis eqs. (3.32), (3.33): successive random additions.
    All,
}

/// A grid of (2^levels + 1)² samples, bounded, whose increments over the whole side have about unit variance.
pub(super) fn heights(
    levels: u32,
    mesh: Mesh,
    displaced: Displaced,
    hurst: f64,
    key: u32,
) -> Vec<f64> {
    let last = 1usize << levels;
    let mut grid = Grid {
        side: last + 1,
        values: vec![0.0; (last + 1) * (last + 1)],
        key,
        levels,
    };
    for corner in [[0, 0], [last, 0], [0, last], [last, last]] {
        grid.displace(corner, core::f64::consts::FRAC_1_SQRT_2, 0);
    }
    let share = match displaced {
        Displaced::Midpoints => 1.0,
        Displaced::All => 0.5,
    };
    for level in 1..=levels {
        let half = last >> level;
        // Thesis eq. (3.31) with i = `level`; two stages of squares each shrink the distance by √2.
        let variance = |steps: f64| {
            share * (1.0 - libm::exp2(2.0 * hurst - 2.0)) * libm::exp2(-2.0 * hurst * steps)
        };
        let whole = f64::from(level);
        match mesh {
            Mesh::Triangles => {
                grid.triangles(half, libm::sqrt(variance(whole)), level);
                if displaced == Displaced::All {
                    grid.old(2 * half, libm::sqrt(variance(whole)), level);
                }
            }
            Mesh::Squares => {
                let (first, second) = (variance(whole - 0.5), variance(whole));
                grid.centres(half, libm::sqrt(first), level);
                grid.edges(half, libm::sqrt(second), level);
                if displaced == Displaced::All {
                    grid.old(2 * half, libm::sqrt(second), level);
                }
            }
        }
    }
    grid.values
}

struct Grid {
    side: usize,
    values: Vec<f64>,
    key: u32,
    levels: u32,
}

impl Grid {
    fn at(&self, [x, y]: [usize; 2]) -> f64 {
        self.values[y * self.side + x]
    }

    /// Adds a random number to a sample. It depends on where the sample is in the square, not on how many levels there will be.
    fn displace(&mut self, [x, y]: [usize; 2], deviation: f64, level: u32) {
        let place = |k: usize| {
            u32::try_from(k << (LEVELS_MAX - self.levels)).expect("at most 2 to LEVELS_MAX")
        };
        let random = gaussian(self.key, STREAM, [level, place(x), place(y)]);
        self.values[y * self.side + x] += deviation * random;
    }

    fn set(&mut self, [x, y]: [usize; 2], value: f64) {
        self.values[y * self.side + x] = value;
    }

    /// The midpoints of the edges of every square and of its rising diagonal.
    fn triangles(&mut self, half: usize, deviation: f64, level: u32) {
        for y in (0..self.side).step_by(half) {
            for x in (0..self.side).step_by(half) {
                let (odd_x, odd_y) = (x / half % 2 == 1, y / half % 2 == 1);
                let ends = match (odd_x, odd_y) {
                    (false, false) => continue,
                    (true, false) => [[x - half, y], [x + half, y]],
                    (false, true) => [[x, y - half], [x, y + half]],
                    (true, true) => [[x - half, y - half], [x + half, y + half]],
                };
                let mean = 0.5 * (self.at(ends[0]) + self.at(ends[1]));
                self.set([x, y], mean);
                self.displace([x, y], deviation, level);
            }
        }
    }

    /// The centres of the squares of side 2 · `half`.
    fn centres(&mut self, half: usize, deviation: f64, level: u32) {
        for y in (half..self.side).step_by(2 * half) {
            for x in (half..self.side).step_by(2 * half) {
                let below = self.at([x - half, y - half]) + self.at([x + half, y - half]);
                let above = self.at([x - half, y + half]) + self.at([x + half, y + half]);
                self.set([x, y], 0.25 * (below + above));
                self.displace([x, y], deviation, level);
            }
        }
    }

    /// The midpoints of the edges of those squares, from the four samples around them, or three at the border.
    fn edges(&mut self, half: usize, deviation: f64, level: u32) {
        let last = self.side - 1;
        for y in (0..self.side).step_by(half) {
            let from = if (y / half).is_multiple_of(2) {
                half
            } else {
                0
            };
            for x in (from..self.side).step_by(2 * half) {
                let (mut sum, mut count) = (0.0, 0.0);
                let mut add = |value: f64| {
                    sum += value;
                    count += 1.0;
                };
                if x >= half {
                    add(self.at([x - half, y]));
                }
                if x + half <= last {
                    add(self.at([x + half, y]));
                }
                if y >= half {
                    add(self.at([x, y - half]));
                }
                if y + half <= last {
                    add(self.at([x, y + half]));
                }
                self.set([x, y], sum / count);
                self.displace([x, y], deviation, level);
            }
        }
    }

    /// Displaces what was there before this iteration.
    fn old(&mut self, step: usize, deviation: f64, level: u32) {
        for y in (0..self.side).step_by(step) {
            for x in (0..self.side).step_by(step) {
                self.displace([x, y], deviation, level);
            }
        }
    }
}
