//! Cellular noise, thesis §4.5 after Worley: weighted distances to the nearest node points.
//!
//! Every cell holds a truly Poisson-distributed number of nodes. So a node may be farther than the cells searched,
//! and Worley adds some where there are few; here distances are held at [`REACH`] instead, which keeps the
//! distribution as it is (one place in a million is farther from its fourth node at the default density), the
//! range finite and the slope bound true. A cell that is farther than the farthest node that counts so far is not
//! looked into (thesis §4.7).

use super::gradient::Lattice;
use super::node::{cell_state, draw, fraction, gap, neighbour, steps};

/// Distances that count: φ₁ to φ₄.
pub const ORDERS: usize = 4;

/// Distances are at most this, in cells.
pub const REACH: f64 = 2.0;

/// Fewest nodes per cell on average.
pub const DENSITY_MIN: f64 = 0.25;

/// Most nodes per cell on average.
pub const DENSITY_MAX: f64 = 8.0;

/// Most nodes of one cell: at a density of 8 one cell in 10¹⁰ would have more.
const NODES_MAX: usize = 32;

/// Greatest exponent of a norm; 0 stands for the maximum norm.
pub const NORM_MAX: f64 = 16.0;

/// How distance is measured, thesis eq. (4.20).
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Norm {
    /// p = 1, Manhattan.
    One,
    /// p = 2, Euclid.
    Two,
    /// p = ∞, the largest coordinate.
    Most,
    /// Any other p.
    Other(f64),
}

impl Norm {
    fn new(p: f64) -> Self {
        if p == 0.0 {
            Self::Most
        } else if p == 1.0 {
            Self::One
        } else if p == 2.0 {
            Self::Two
        } else {
            Self::Other(p)
        }
    }

    /// A number that rises with the length of a vector, quicker to have than the length.
    #[inline(always)]
    fn measure(self, d: [f32; 3]) -> f64 {
        self.measure_of(d.map(f64::from))
    }

    /// The same of numbers that are no f32.
    #[inline(always)]
    fn measure_of(self, d: [f64; 3]) -> f64 {
        let [x, y, z] = d.map(f64::abs);
        match self {
            Self::One => x + y + z,
            Self::Two => x * x + y * y + z * z,
            Self::Most => {
                let xy = if x > y { x } else { y };
                if xy > z { xy } else { z }
            }
            Self::Other(p) => libm::pow(x, p) + libm::pow(y, p) + libm::pow(z, p),
        }
    }

    /// The length from its measure.
    #[inline(always)]
    fn length(self, measure: f64) -> f64 {
        match self {
            Self::One | Self::Most => measure,
            Self::Two => measure.sqrt(),
            Self::Other(p) => libm::pow(measure, 1.0 / p),
        }
    }

    /// The length of a vector.
    pub(crate) fn length_of(self, d: [f64; 3]) -> f64 {
        self.length(self.measure_of(d))
    }

    /// The gradient of the length at a vector that long, thesis eq. (4.19), mended: ERRATA row 1596.
    #[inline(always)]
    fn gradient(self, d: [f32; 3], length: f64) -> [f64; 3] {
        if length <= 0.0 {
            return [0.0; 3];
        }
        let d = d.map(f64::from);
        let sign = |a: f64| if a < 0.0 { -1.0 } else { 1.0 };
        match self {
            Self::One => d.map(sign),
            Self::Two => d.map(|a| a / length),
            Self::Most => {
                let [x, y, z] = d.map(f64::abs);
                let axis = if x >= y && x >= z {
                    0
                } else if y >= z {
                    1
                } else {
                    2
                };
                [0, 1, 2].map(|k| if k == axis { sign(d[k]) } else { 0.0 })
            }
            Self::Other(p) => d.map(|a| sign(a) * libm::pow(a.abs() / length, p - 1.0)),
        }
    }

    /// The steepest slope of the length: 3^(1/p − ½) for p < 2, else 1 (ERRATA row 1596).
    fn slope(self) -> f64 {
        match self {
            Self::One => 1.732_050_808,
            Self::Two | Self::Most => 1.0,
            Self::Other(p) if p < 2.0 => libm::pow(3.0, 1.0 / p - 0.5) * (1.0 + 1e-12),
            Self::Other(_) => 1.0,
        }
    }

    /// The volume of the ball of length 1: 8 Γ(1 + 1/p)³/Γ(1 + 3/p).
    fn ball(self) -> f64 {
        let volume = |p: f64| {
            let g = libm::tgamma(1.0 + 1.0 / p);
            8.0 * g * g * g / libm::tgamma(1.0 + 3.0 / p)
        };
        match self {
            Self::One => volume(1.0),
            Self::Two => volume(2.0),
            Self::Most => 8.0,
            Self::Other(p) => volume(p),
        }
    }
}

/// One cellular noise: Σ a_l (ψ(φ_l) − μ_l).
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Cellular {
    pub(crate) lattice: Lattice,
    norm: Norm,
    weights: [f64; ORDERS],
    /// How many distances count.
    orders: usize,
    /// ψ(d) = d² instead of d.
    squared: bool,
    /// Σ a_l μ_l, or 0.
    bias: f64,
    /// A cell has as many nodes as entries that its hash is not below.
    counts: Vec<u32>,
    /// [`REACH`] as the norm measures it.
    reach: f64,
}

/// What makes a cellular noise.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Options {
    /// p of (4.20), 0 for ∞.
    pub(crate) norm: f64,
    /// Nodes per cell on average.
    pub(crate) density: f64,
    /// a₁ to a₄.
    pub(crate) weights: [f64; ORDERS],
    /// Whether distances are squared.
    pub(crate) squared: bool,
    /// Whether the mean is taken away.
    pub(crate) unbiased: bool,
}

impl Cellular {
    pub(crate) fn new(lattice: Lattice, options: Options) -> Self {
        let norm = Norm::new(options.norm);
        let weights = options.weights;
        let orders = (0..ORDERS)
            .rev()
            .find(|&l| weights[l] != 0.0)
            .map_or(0, |l| l + 1);
        let per_ball = norm.ball() * options.density;
        let power = if options.squared {
            2.0 / 3.0
        } else {
            1.0 / 3.0
        };
        // The cube of φ_l times the density of a ball is a gamma variable of order l.
        let mean = |l: usize| {
            let l = [1.0, 2.0, 3.0, 4.0][l];
            libm::tgamma(l + power) / libm::tgamma(l) * libm::pow(per_ball, -power)
        };
        let bias = if options.unbiased {
            (0..orders).map(|l| weights[l] * mean(l)).sum()
        } else {
            0.0
        };
        let reach = match norm {
            Norm::One | Norm::Most => REACH,
            Norm::Two => REACH * REACH,
            Norm::Other(p) => libm::pow(REACH, p),
        };
        Self {
            lattice,
            norm,
            weights,
            orders,
            squared: options.squared,
            bias,
            counts: poisson(options.density),
            reach,
        }
    }

    /// How distances are measured.
    pub(crate) fn norm(&self) -> Norm {
        self.norm
    }

    /// The weights of the distances that count.
    pub(crate) fn weights(&self) -> &[f64] {
        &self.weights[..self.orders]
    }

    /// Whether ψ(d) is d² instead of d.
    pub(crate) fn squares(&self) -> bool {
        self.squared
    }

    /// What is taken away from the sum.
    pub(crate) fn bias(&self) -> f64 {
        self.bias
    }

    /// The nodes of a cell, as places within it.
    pub(crate) fn nodes(&self, cell: [u32; 3]) -> impl Iterator<Item = [f64; 3]> + use<> {
        let state = cell_state(self.lattice, cell);
        (0..self.count(state))
            .map(move |index| [0, 1, 2].map(|axis| f64::from(fraction(draw(state, index, axis)))))
    }

    /// ψ at its greatest argument.
    fn highest(&self) -> f64 {
        if self.squared { REACH * REACH } else { REACH }
    }

    /// All values lie between these: distances rise with their order, so the extremes have the last few at
    /// [`REACH`] and the others at 0.
    pub(crate) fn range(&self) -> (f64, f64) {
        let (mut low, mut high, mut sum) = (0.0, 0.0, 0.0);
        for weight in self.weights.iter().rev() {
            sum += weight;
            low = if sum < low { sum } else { low };
            high = if sum > high { sum } else { high };
        }
        let margin = self.rounding();
        (
            low * self.highest() - self.bias - margin,
            high * self.highest() - self.bias + margin,
        )
    }

    fn total_weight(&self) -> f64 {
        self.weights.iter().map(|a| a.abs()).sum()
    }

    /// No slope is greater.
    pub(crate) fn slope(&self) -> f64 {
        let psi = if self.squared { 2.0 * REACH } else { 1.0 };
        self.total_weight() * psi * self.norm.slope()
    }

    /// No value is farther from the exact one at its f32 offset: coordinates are good to 2⁻²², and the result is an f32.
    pub(crate) fn rounding(&self) -> f64 {
        let psi = if self.squared { 2.0 * REACH } else { 1.0 };
        (self.total_weight() * psi + self.bias.abs()) * 1e-6
    }

    /// The noise at an offset within a cell, and its gradient.
    pub(crate) fn value_gradient(&self, cell: [u32; 3], offset: [f32; 3]) -> (f32, [f32; 3]) {
        let nearest = self.nearest(cell, offset);
        // 0, unless the place is no number.
        let nothing = 0.0 * f64::from(offset[0] + offset[1] + offset[2]);
        let (mut total, mut gradient) = (nothing, [0.0; 3]);
        let counting = self.weights.iter().zip(nearest).take(self.orders);
        for (&weight, (measure, d)) in counting {
            let length = self.norm.length(measure);
            let (psi, slope) = if self.squared {
                (length * length, 2.0 * length)
            } else {
                (length, 1.0)
            };
            total += weight * psi;
            if measure < self.reach {
                let g = self.norm.gradient(d, length);
                for k in 0..3 {
                    gradient[k] += weight * slope * g[k];
                }
            }
        }
        (narrow(total - self.bias), gradient.map(narrow))
    }

    /// The measures of the nearest nodes and the ways from them, nearest first.
    fn nearest(&self, cell: [u32; 3], offset: [f32; 3]) -> [(f64, [f32; 3]); ORDERS] {
        const STEPS: [[i8; 3]; 125] = steps(2);
        /// Cells that touch the place's own, and itself.
        const INNER: usize = 27;
        let mut best = [(self.reach, [0.0f32; 3]); ORDERS];
        let Some(last) = self.orders.checked_sub(1) else {
            return best;
        };
        for (i, step) in STEPS.into_iter().enumerate() {
            if i == INNER && self.norm.measure(outer_gap(offset)) >= best[last].0 {
                break;
            }
            if i > 0 && self.norm.measure(gap(offset, step)) >= best[last].0 {
                continue;
            }
            let state = cell_state(self.lattice, neighbour(cell, step));
            for index in 0..self.count(state) {
                let d = [(0, 0), (1, 1), (2, 2)].map(|(k, axis)| {
                    offset[k] - (fraction(draw(state, index, axis)) + f32::from(step[k]))
                });
                let measure = self.norm.measure(d);
                if measure < best[last].0 {
                    let mut at = last;
                    while at > 0 && measure < best[at - 1].0 {
                        best[at] = best[at - 1];
                        at -= 1;
                    }
                    best[at] = (measure, d);
                }
            }
        }
        best
    }

    /// How many nodes a cell has.
    fn count(&self, state: u32) -> u32 {
        let hash = draw(state, u32::MAX, 0);
        let mut count = 0;
        for below in &self.counts {
            if hash < *below {
                break;
            }
            count += 1;
        }
        count
    }
}

/// The way to the nearest face of the block of 27 cells around a place's own.
fn outer_gap(offset: [f32; 3]) -> [f32; 3] {
    let mut least = 1.0;
    for t in offset {
        let near = if t < 0.5 { t } else { 1.0 - t };
        least = if near < least { near } else { least };
    }
    [1.0 + least, 0.0, 0.0]
}

#[expect(clippy::cast_possible_truncation, reason = "the noise is an f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// The probabilities of at most 0, 1, … nodes in a cell, as parts of 2³².
fn poisson(density: f64) -> Vec<u32> {
    let mut term = libm::exp(-density);
    let mut below = 0.0;
    let mut list = Vec::with_capacity(NODES_MAX);
    for k in 1..=NODES_MAX {
        below += term;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the cast saturates, as it should"
        )]
        list.push((below * 4_294_967_296.0) as u32);
        #[expect(clippy::cast_precision_loss, reason = "it is at most 32")]
        let k = k as f64;
        term *= density / k;
    }
    list
}
