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

/// Greatest exponent of ψ.
pub const EXPONENT_MAX: f64 = 4.0;

/// What is made of a distance, thesis §4.5.2: ψ rises, and its slope is bounded.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Psi {
    /// ψ(d) = d.
    Plain,
    /// ψ(d) = d².
    Square,
    /// ψ(d) = dᵉ, e from 1 to [`EXPONENT_MAX`]; below 1 the slope at a node would have no bound.
    Power(f64),
}

impl Psi {
    fn new(exponent: f64) -> Self {
        if exponent == 1.0 {
            Self::Plain
        } else if exponent == 2.0 {
            Self::Square
        } else {
            Self::Power(exponent)
        }
    }

    /// ψ at a distance, and its derivative.
    #[inline(always)]
    fn at(self, length: f64) -> (f64, f64) {
        match self {
            Self::Plain => (length, 1.0),
            Self::Square => (length * length, 2.0 * length),
            Self::Power(e) => {
                let slope = libm::pow(length, e - 1.0);
                (slope * length, e * slope)
            }
        }
    }
}

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
    pub(crate) fn measure_of(self, d: [f64; 3]) -> f64 {
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

    /// The steepest slope of the length: n^(1/p − ½) in n dimensions for p < 2, else 1 (ERRATA row 1596).
    fn slope(self, planar: bool) -> f64 {
        let axes = if planar { 2.0 } else { 3.0 };
        match self {
            Self::One if planar => 1.414_213_563,
            Self::One => 1.732_050_808,
            Self::Two | Self::Most => 1.0,
            Self::Other(p) if p < 2.0 => libm::pow(axes, 1.0 / p - 0.5) * (1.0 + 1e-12),
            Self::Other(_) => 1.0,
        }
    }

    /// The volume of the ball of length 1, 8 Γ(1 + 1/p)³/Γ(1 + 3/p), or in the plane its area, 4 Γ(1 + 1/p)²/Γ(1 + 2/p).
    fn ball(self, planar: bool) -> f64 {
        let volume = |p: f64| {
            let g = libm::tgamma(1.0 + 1.0 / p);
            if planar {
                4.0 * g * g / libm::tgamma(1.0 + 2.0 / p)
            } else {
                8.0 * g * g * g / libm::tgamma(1.0 + 3.0 / p)
            }
        };
        match self {
            Self::One => volume(1.0),
            Self::Two => volume(2.0),
            Self::Most if planar => 4.0,
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
    psi: Psi,
    /// Whether all nodes lie in a plane, over which the noise does not change: two dimensions.
    planar: bool,
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
    /// The exponent of ψ.
    pub(crate) exponent: f64,
    /// Whether there are two dimensions.
    pub(crate) planar: bool,
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
        let per_ball = norm.ball(options.planar) * options.density;
        let axes = if options.planar { 2.0 } else { 3.0 };
        let power = options.exponent / axes;
        // The cube of φ_l (in the plane its square) times the density of a ball is a gamma variable of order l.
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
            psi: Psi::new(options.exponent),
            planar: options.planar,
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

    /// What is made of the distances.
    pub(crate) fn psi(&self) -> Psi {
        self.psi
    }

    /// Whether the noise is one of two dimensions.
    pub(crate) fn is_planar(&self) -> bool {
        self.planar
    }

    /// What is taken away from the sum.
    pub(crate) fn bias(&self) -> f64 {
        self.bias
    }

    /// The nodes of a cell, as places within it.
    pub(crate) fn nodes(&self, cell: [u32; 3]) -> impl Iterator<Item = [f64; 3]> + use<> {
        let state = cell_state(self.lattice, cell);
        let count = if self.planar && cell[2] != 0 {
            0
        } else {
            self.count(state)
        };
        let planar = self.planar;
        (0..count).map(move |index| {
            let along = |axis| f64::from(fraction(draw(state, index, axis)));
            let up = if planar { 0.0 } else { along(2) };
            [along(0), along(1), up]
        })
    }

    /// ψ at its greatest argument.
    fn highest(&self) -> f64 {
        self.psi.at(REACH).0
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
        self.total_weight() * self.steepest() * self.norm.slope(self.planar)
    }

    /// ψ′ at its greatest: ψ is convex.
    fn steepest(&self) -> f64 {
        self.psi.at(REACH).1
    }

    /// No value is farther from the exact one at its f32 offset: coordinates are good to 2⁻²², and the result is an f32.
    pub(crate) fn rounding(&self) -> f64 {
        (self.total_weight() * self.steepest() + self.bias.abs()) * 1e-6
    }

    /// The noise at an offset within a cell, and its gradient.
    pub(crate) fn value_gradient(&self, cell: [u32; 3], offset: [f32; 3]) -> (f32, [f32; 3]) {
        // 0, unless the place is no number.
        let nothing = 0.0 * f64::from(offset[0] + offset[1] + offset[2]);
        let (nearest, axes) = if self.planar {
            let flat = [cell[0], cell[1], 0];
            (self.nearest(flat, [offset[0], offset[1], 0.0]), 2)
        } else {
            (self.nearest(cell, offset), 3)
        };
        let (mut total, mut gradient) = (nothing, [0.0; 3]);
        let counting = self.weights.iter().zip(nearest).take(self.orders);
        for (&weight, (measure, d)) in counting {
            let length = self.norm.length(measure);
            let (psi, slope) = self.psi.at(length);
            total += weight * psi;
            if measure < self.reach {
                let g = self.norm.gradient(d, length);
                for k in 0..axes {
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
            if self.planar && step[2] != 0 {
                continue;
            }
            let state = cell_state(self.lattice, neighbour(cell, step));
            for index in 0..self.count(state) {
                let d = [(0, 0), (1, 1), (2, 2)].map(|(k, axis)| {
                    if self.planar && k == 2 {
                        return 0.0;
                    }
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
