//! Wavelet noise, thesis §4.6 after Cook and DeRose: a band of frequencies of an octave, and little else.
//!
//! Random coefficients of quadratic B-splines lose what can be said with B-splines twice as wide, (4.23). The part
//! lost is the orthogonal projection b̄ = P (PᵀGP)⁻¹ PᵀG b, with P the refinement ¼, ¾, ¾, ¼ and G the B-splines'
//! inner products, along each axis in turn; the authors' filters approximate it.
//!
//! One periodic tile of 32³ coefficients is made once. Space is cut into blocks of 32³ cells; each takes the tile
//! shifted and with a sign by the hash of its number, so nothing repeats; where blocks meet, the sum of B-splines
//! goes over smoothly, at the price of some low frequencies there.

use std::sync::OnceLock;

use super::gradient::Lattice;
use super::jet::Real;
use super::node::cell_state;
use crate::hash;

/// Coefficients along an edge of the tile: a power of two.
const SIDE: usize = 32;

/// The mean square of the noise: a deviation of 0.3, so that values stay within about ±1.3.
const VARIANCE: f64 = 0.09;

/// The coefficients.
#[derive(Debug)]
pub(crate) struct Tile {
    coefficients: Vec<f32>,
    /// The greatest of them.
    highest: f64,
}

impl Tile {
    /// The one tile; made when it is first asked for, always the same.
    pub(crate) fn shared() -> &'static Self {
        static TILE: OnceLock<Tile> = OnceLock::new();
        TILE.get_or_init(Self::new)
    }

    fn new() -> Self {
        let detail = detail_filter();
        let count = SIDE * SIDE * SIDE;
        let mut b: Vec<f64> = (0u32..).take(count).map(gaussian).collect();
        let mut lost = b.clone();
        for stride in [1, SIDE, SIDE * SIDE] {
            lost = filtered(&lost, stride, &detail);
        }
        for (b, lost) in b.iter_mut().zip(&lost) {
            *b -= lost;
        }
        // The variance of the noise: each axis' inner products at even distances, over all places of a cell.
        let scale = (VARIANCE / variance(&b)).sqrt();
        #[expect(clippy::cast_possible_truncation, reason = "the noise is an f32")]
        let coefficients: Vec<f32> = b.iter().map(|b| (b * scale) as f32).collect();
        let highest = coefficients.iter().fold(
            0.0f32,
            |most, b| if b.abs() > most { b.abs() } else { most },
        );
        Self {
            coefficients,
            highest: f64::from(highest),
        }
    }

    #[inline(always)]
    fn at(&self, [x, y, z]: [u32; 3]) -> f32 {
        let wrap = |a: u32| a as usize % SIDE;
        self.coefficients[(wrap(z) * SIDE + wrap(y)) * SIDE + wrap(x)]
    }
}

/// How wavelet noise comes about, shown on one line (thesis fig. 4.21): functions at the same places.
#[derive(Clone, PartialEq, Debug)]
pub struct Stages {
    /// The places, in lattice cells.
    pub places: Vec<f64>,
    /// g: B-splines with independent Gaussian coefficients.
    pub random: Vec<f64>,
    /// ḡ: as much of it as B-splines twice as wide can say.
    pub smooth: Vec<f64>,
    /// f = g − ḡ, the noise, (4.23).
    pub detail: Vec<f64>,
}

/// The first row of the noise's coefficients as a noise of one dimension, over its period, at `samples` places a cell.
pub fn stages(samples: u32) -> Stages {
    let random: Vec<f64> = (0u32..).take(SIDE).map(gaussian).collect();
    let smooth = filtered(&random, 1, &detail_filter());
    let detail: Vec<f64> = random
        .iter()
        .zip(&smooth)
        .map(|(b, lost)| b - lost)
        .collect();
    let samples = if samples > 0 { samples } else { 1 };
    let places = |cell: u32| (0..samples).map(move |i| (cell, f64::from(i) / f64::from(samples)));
    let all: Vec<(u32, f64)> = (0u32..).take(SIDE).flat_map(places).collect();
    let along = |b: &[f64]| -> Vec<f64> {
        let at = |&(cell, t): &(u32, f64)| {
            let coefficient = |step: usize| b[(cell as usize + SIDE + step - 1) % SIDE];
            let s = 1.0 - t;
            let weights = [0.5 * (s * s), 0.5 + t * s, 0.5 * (t * t)];
            (0..3).map(|step| weights[step] * coefficient(step)).sum()
        };
        all.iter().map(at).collect()
    };
    Stages {
        random: along(&random),
        smooth: along(&smooth),
        detail: along(&detail),
        places: all.iter().map(|&(cell, t)| f64::from(cell) + t).collect(),
    }
}

/// No value is farther from zero: the B-splines are positive and add up to 1.
pub(crate) fn range() -> f64 {
    Tile::shared().highest
}

/// No slope is greater: along an axis it is a mean of differences of neighbouring coefficients.
pub(crate) fn slope() -> f64 {
    2.0 * 1.732_050_808 * Tile::shared().highest
}

/// No second derivative along a direction is greater: those by one axis are means of second differences, at most
/// four coefficients', those by two of differences of differences, so that all nine are at most 4.
pub(crate) fn bend() -> f64 {
    12.0 * Tile::shared().highest
}

/// The noise at an offset within a cell.
#[inline(always)]
pub(crate) fn at<R: Real>(lattice: Lattice, cell: [u32; 3], offset: [f32; 3]) -> R {
    let tile = Tile::shared();
    let weights = [0, 1, 2].map(
        #[inline(always)]
        |axis| splines(R::variable(offset[axis], axis)),
    );
    let mut total = R::constant(0.0);
    for (k, wz) in (0u32..3).zip(weights[2]) {
        for (j, wy) in (0u32..3).zip(weights[1]) {
            let row = wz.by(wy);
            for (i, wx) in (0u32..3).zip(weights[0]) {
                let at = [cell[0], cell[1], cell[2]];
                let at = [
                    at[0].wrapping_add(i).wrapping_sub(1),
                    at[1].wrapping_add(j).wrapping_sub(1),
                    at[2].wrapping_add(k).wrapping_sub(1),
                ];
                total = total.plus(row.by(wx).times(coefficient(tile, lattice, at)));
            }
        }
    }
    total
}

/// The coefficient of a cell's B-spline.
pub(crate) fn coefficient_of(lattice: Lattice, cell: [u32; 3]) -> f64 {
    f64::from(coefficient(Tile::shared(), lattice, cell))
}

/// The coefficient of a cell: its block's part of the tile.
#[inline(always)]
fn coefficient(tile: &Tile, lattice: Lattice, cell: [u32; 3]) -> f32 {
    let state = cell_state(lattice, cell.map(|a| a >> 5));
    let hash = hash::finish_high(state);
    let hash = hash ^ (hash >> 15);
    let shifted = [
        cell[0].wrapping_add(hash >> 27),
        cell[1].wrapping_add(hash >> 22),
        cell[2].wrapping_add(hash >> 17),
    ];
    let sign = f32::from_bits(1.0f32.to_bits() | ((hash << 15) & 0x8000_0000));
    tile.at(shifted) * sign
}

/// The three quadratic B-splines that reach a place, the place at `t` between the middle one's borders.
#[inline(always)]
fn splines<R: Real>(t: R) -> [R; 3] {
    let t0 = t.value();
    let s = 1.0 - t0;
    [
        t.chain(0.5 * (s * s), -s, 1.0),
        t.chain(0.5 + t0 * s, 1.0 - 2.0 * t0, -2.0),
        t.chain(0.5 * (t0 * t0), t0, 1.0),
    ]
}

/// A normally distributed number, by Box and Muller.
fn gaussian(i: u32) -> f64 {
    let unit = |k: u32| hash::unit(hash::hash(&[0x7761_7665, i, k]));
    let radius = (-2.0 * libm::log(1.0 - unit(0))).sqrt();
    radius * libm::cos(2.0 * core::f64::consts::PI * unit(1))
}

type Row = [f64; SIDE];

/// P (PᵀGP)⁻¹ PᵀG along one axis of the tile, whose entries depend on the row's parity and the distance alone: two rows.
fn detail_filter() -> [Row; 2] {
    const HALF: usize = SIDE / 2;
    let inner = |d: usize| match if d > HALF { SIDE - d } else { d } {
        0 => 66.0 / 120.0,
        1 => 26.0 / 120.0,
        2 => 1.0 / 120.0,
        _ => 0.0,
    };
    // Column c of P refines the wide spline c into the narrow ones from 2c − 1 on.
    let refined = |i: usize, c: usize| match (i + SIDE + 1 - 2 * c) % SIDE {
        0 | 3 => 0.25,
        1 | 2 => 0.75,
        _ => 0.0,
    };
    let mut pg = [[0.0; SIDE]; HALF];
    for (c, row) in pg.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = (0..SIDE)
                .map(|i| refined(i, c) * inner(i.abs_diff(j)))
                .sum();
        }
    }
    let mut gram = [[0.0; HALF]; HALF];
    for (c, row) in gram.iter_mut().enumerate() {
        for (e, entry) in row.iter_mut().enumerate() {
            *entry = (0..SIDE).map(|j| pg[c][j] * refined(j, e)).sum();
        }
    }
    let projected = solved(gram, pg);
    [0, 1].map(|i| {
        let mut row = [0.0; SIDE];
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = (0..HALF).map(|c| refined(i, c) * projected[c][j]).sum();
        }
        row
    })
}

/// The solution of a positive definite system for many right sides, by Gauss's elimination.
fn solved<const N: usize>(mut a: [[f64; N]; N], mut b: [Row; N]) -> [Row; N] {
    for pivot in 0..N {
        for row in 0..N {
            if row == pivot {
                continue;
            }
            let factor = a[row][pivot] / a[pivot][pivot];
            let (above, rights) = (a[pivot], b[pivot]);
            for (entry, above) in a[row].iter_mut().zip(above) {
                *entry -= factor * above;
            }
            for (entry, right) in b[row].iter_mut().zip(rights) {
                *entry -= factor * right;
            }
        }
    }
    for (row, own) in b.iter_mut().enumerate() {
        for entry in own {
            *entry /= a[row][row];
        }
    }
    b
}

/// Every line of the tile along an axis, times the filter.
fn filtered(values: &[f64], stride: usize, [even, odd]: &[Row; 2]) -> Vec<f64> {
    let mut out = vec![0.0; values.len()];
    for (at, out) in out.iter_mut().enumerate() {
        let i = at / stride % SIDE;
        let first = at - i * stride;
        let row = if i.is_multiple_of(2) { even } else { odd };
        // Row i is row i mod 2, moved along.
        let moved = i - i % 2;
        *out = (0..SIDE)
            .map(|j| row[(j + SIDE - moved) % SIDE] * values[first + j * stride])
            .sum();
    }
    out
}

/// The mean square over space of the sum of B-splines with these coefficients.
fn variance(b: &[f64]) -> f64 {
    let inner: Row = {
        let mut row = [0.0; SIDE];
        for (d, weight) in [
            (0, 66.0),
            (1, 26.0),
            (2, 1.0),
            (SIDE - 1, 26.0),
            (SIDE - 2, 1.0),
        ] {
            row[d] = weight / 120.0;
        }
        row
    };
    // The Gram matrix is the same in every row.
    let shifted = {
        let mut odd = [0.0; SIDE];
        for (j, entry) in odd.iter_mut().enumerate() {
            *entry = inner[(j + SIDE - 1) % SIDE];
        }
        odd
    };
    let mut moved = b.to_vec();
    for stride in [1, SIDE, SIDE * SIDE] {
        moved = filtered(&moved, stride, &[inner, shifted]);
    }
    let sum: f64 = b.iter().zip(&moved).map(|(a, b)| a * b).sum();
    #[expect(clippy::cast_precision_loss, reason = "it is 32768")]
    let count = b.len() as f64;
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_wide_splines_can_say_is_gone() {
        // Projecting what is left gives nothing.
        let tile = Tile::shared();
        let mut left: Vec<f64> = tile.coefficients.iter().map(|b| f64::from(*b)).collect();
        let whole: f64 = left.iter().map(|b| b * b).sum();
        let detail = detail_filter();
        for stride in [1, SIDE, SIDE * SIDE] {
            left = filtered(&left, stride, &detail);
        }
        let rest: f64 = left.iter().map(|b| b * b).sum();
        assert!(rest < 1e-9 * whole, "{rest} of {whole}");
        assert!(
            (variance(
                &tile
                    .coefficients
                    .iter()
                    .map(|b| f64::from(*b))
                    .collect::<Vec<_>>()
            ) - VARIANCE)
                .abs()
                < 1e-6
        );
    }

    #[test]
    fn the_stages_add_up_and_the_smooth_one_is_a_spline_twice_as_wide() {
        let Stages {
            places,
            random,
            smooth,
            detail,
        } = stages(8);
        assert_eq!((places.len(), places[9]), (SIDE * 8, 1.125));
        for i in 0..places.len() {
            assert!((smooth[i] + detail[i] - random[i]).abs() < 1e-12);
        }
        // Within two cells it is one parabola: its third differences are 0. The noise's are not.
        let third = |f: &[f64], i: usize| (f[i + 3] - 3.0 * f[i + 2] + 3.0 * f[i + 1] - f[i]).abs();
        let least = |f: &[f64]| {
            let across = |phase: usize| {
                (0..SIDE / 2 - 1)
                    .map(|pair| third(f, (2 * pair + phase) * 8 + 6))
                    .fold(0.0, f64::max)
            };
            f64::min(across(0), across(1))
        };
        assert!(least(&smooth) < 1e-12, "{}", least(&smooth));
        assert!(least(&detail) > 1e-3, "{}", least(&detail));
    }

    #[test]
    fn low_frequencies_are_absent() {
        // The mean over a cube of 8³ cells has less than a third of the power, 0.008, that independent coefficients leave it.
        let noise = |x: f64, y: f64, z: f64| {
            let [(a, u), (b, v), (c, w)] = [x, y, z].map(super::super::split);
            f64::from(at::<f32>(Lattice::new(3), [a, b, c], [u, v, w]))
        };
        let (mut means, mut blocks) = (0.0, 0.0);
        for block in 0..200u32 {
            let mut sum = 0.0;
            let corner = [0, 1, 2].map(|k| f64::from(hash::hash(&[block, k]) % 4096) + 8.0);
            for i in 0..4096u32 {
                let part = |shift: u32| f64::from((i >> shift) & 15) * 0.5;
                sum += noise(
                    corner[0] + part(0),
                    corner[1] + part(4),
                    corner[2] + part(8),
                );
            }
            let mean = sum / 4096.0;
            means += mean * mean;
            blocks += 1.0;
        }
        let share = means / blocks / VARIANCE;
        assert!(share < 2.5e-3, "{share}");
    }
}
