//! Frequency cascades: octaves of noise, each of its own lattice, thesis §3.2.4 and §3.3.3.
//!
//! Octave i looks at rⁱ Rⁱ⁺¹ a + oᵢ. R is one fixed rotation by the golden angle
//! about (3, 6, 2)/7, after Worley (thesis §3.2.4), so that grids of different
//! octaves never line up and a plane or a sphere never runs along one; oᵢ, within
//! a cell, and the octave's lattice come from the hash of key and octave. All of
//! it is f64, so a planet keeps its millimetres.
//!
//! Level of detail, thesis eqs. (3.41), (3.42) as mended: octave i has the weight
//! clamp(i₁ − i + 1, 0, 1) with i₁ = −(log₂ footprint + detail)/log₂ r, the
//! footprint counted in cells of octave 0; `detail` = 0 switches it off. So the
//! octave whose cell is 2^detail footprints is the last with its full weight.

use crate::arithmetic::clamp01;
use crate::hash;
use crate::noise::{self, Lattice, Noise};
use crate::number::Number;
use crate::op::{Basis, Op};

/// How octaves are put together.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Model {
    /// Σ r^{−iH} basis, thesis eq. (3.40).
    Sum(Basis),
    /// Thesis eq. (3.44).
    AltitudeOne { basis: Basis, xi: f64 },
    /// Thesis eq. (3.45).
    AltitudeTwo { basis: Basis, xi: f64 },
    /// Musgrave's ridged multifractal.
    Ridged { offset: f64, gain: f64 },
}

/// One octave.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Octave {
    pub(crate) lattice: Lattice,
    /// The key of its lattice.
    key: u32,
    /// The noise, unless it is gradient noise over that lattice.
    pub(crate) noise: Option<Noise>,
    /// rⁱ.
    pub(crate) frequency: f64,
    /// rⁱ Rⁱ⁺¹, by rows; skewed, as `shift` is, where the noise is.
    pub(crate) matrix: [[f64; 3]; 3],
    /// oᵢ.
    pub(crate) shift: [f64; 3],
    /// r^{−iH}.
    pub(crate) amplitude: f64,
}

/// What turns a footprint into octaves.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Detail {
    /// Cells of octave 0 per metre.
    pub(crate) scale: f64,
    /// Octaves (of two) between the footprint and the finest cell.
    pub(crate) detail: f64,
    /// 1/log₂ r.
    pub(crate) per_octave: f64,
    /// The number of the cascade's first octave.
    pub(crate) first: f64,
}

/// A cascade of octaves.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Cascade {
    pub(crate) model: Model,
    pub(crate) octaves: Vec<Octave>,
    /// `None`: every octave everywhere.
    pub(crate) detail: Option<Detail>,
}

impl Cascade {
    /// The cascade of a node with these constants, whose argument has `scale` lattice cells per metre, 0 if that is unknown.
    pub(crate) fn new(op: Op, params: &[f64], scale: f64) -> Option<Self> {
        if op == Op::Cascade {
            return Self::over_noise(params, scale);
        }
        let (model, key, lacunarity, hurst, octaves, detail) = match (op, params) {
            (Op::RidgedMultifractal, &[key, r, h, octaves, offset, gain, detail]) => {
                (Model::Ridged { offset, gain }, key, r, h, octaves, detail)
            }
            (_, &[basis, key, r, h, octaves, xi, detail]) => {
                let basis = Basis::from_number(basis)?;
                let model = match op {
                    Op::Sum => Model::Sum(basis),
                    Op::AltitudeOne => Model::AltitudeOne { basis, xi },
                    Op::AltitudeTwo => Model::AltitudeTwo { basis, xi },
                    _ => return None,
                };
                (model, key, r, h, octaves, detail)
            }
            _ => return None,
        };
        let octaves = octaves_of(key, lacunarity, &Amplitudes::Even(hurst), octaves);
        Some(Self {
            model,
            octaves,
            detail: detail_of(detail, scale, lacunarity, 0.0),
        })
    }

    /// The cascade over any noise whose constants [`Op::Cascade`] describes.
    fn over_noise(params: &[f64], scale: f64) -> Option<Self> {
        let [
            model,
            basis,
            key,
            lacunarity,
            hurst,
            octaves,
            xi,
            detail,
            offset,
            gain,
            first,
            ..,
        ] = *params
        else {
            return None;
        };
        let (op, constants, hursts) = noise::limits::split_noise(params, 11)?;
        let basis = Basis::from_number(basis)?;
        let model = match model {
            0.0 => Model::Sum(basis),
            1.0 => Model::AltitudeOne { basis, xi },
            2.0 => Model::AltitudeTwo { basis, xi },
            _ => Model::Ridged { offset, gain },
        };
        let amplitudes = if hursts.is_empty() {
            Amplitudes::Even(hurst)
        } else {
            Amplitudes::Each(first, hursts)
        };
        let mut list = octaves_of(key, lacunarity, &amplitudes, first + octaves);
        list.drain(..noise::kind::whole(first) as usize);
        // Gradient noise keeps its fast loops.
        if op != Op::Noise {
            let noise = Noise::new(op, constants)?;
            for octave in &mut list {
                octave.take(&noise);
            }
        }
        Some(Self {
            model,
            octaves: list,
            detail: detail_of(detail, scale, lacunarity, first),
        })
    }

    /// i₁ + 1 at a footprint: how many octaves count there, a fraction for the last.
    #[inline(always)]
    pub(crate) fn depth(&self, footprint: f64) -> f64 {
        match self.detail {
            Some(Detail {
                scale,
                detail,
                per_octave,
                first,
            }) => 1.0 - (log2(footprint * scale) + detail) * per_octave - first,
            None => f64::INFINITY,
        }
    }

    /// How many octaves have a weight at a footprint.
    pub(crate) fn count(&self, footprint: f64) -> u64 {
        let depth = self.depth(footprint);
        let mut count = 0;
        for i in 0..self.octaves.len() {
            count += u64::from(depth > index(i));
        }
        count
    }
}

/// What an octave leaves: the cascade so far, and what its model hands on.
pub(crate) type Carried<T> = (T, T);

/// An octave's level-of-detail weight: a number, or a range of them along a stretch of a ray.
pub(crate) trait Weight<T>: Copy {
    /// The octave times its amplitude and its weight; 0 where it has none.
    fn weigh(self, octave: T, amplitude: f64) -> T;
}

impl<T: Number> Weight<T> for f64 {
    #[inline(always)]
    fn weigh(self, octave: T, amplitude: f64) -> T {
        octave.times(self * amplitude).gate(self > 0.0)
    }
}

/// An octave's place in its cascade at one point.
#[derive(Clone, Copy)]
pub(crate) struct Term<W = f64> {
    /// Whether it is octave 0.
    pub(crate) first: bool,
    /// r^{−iH}.
    pub(crate) amplitude: f64,
    /// Its level-of-detail weight.
    pub(crate) weight: W,
}

/// What a basis makes of a noise.
#[inline(always)]
pub(crate) fn shape<T: Number>(basis: Basis, noise: T) -> T {
    match basis {
        Basis::Plain => noise,
        Basis::Absolute => noise.abs(),
        Basis::Ridged => ridge(1.0, noise),
    }
}

/// (offset − |noise|)².
#[inline(always)]
fn ridge<T: Number>(offset: f64, noise: T) -> T {
    let t = T::constant(offset).minus(noise.abs());
    t.square()
}

/// Adds one octave of a sum.
#[inline(always)]
pub(crate) fn sum<T: Number, W: Weight<T>>(
    basis: Basis,
    term: Term<W>,
    noise: T,
    (total, rest): Carried<T>,
) -> Carried<T> {
    let octave = term.weight.weigh(shape(basis, noise), term.amplitude);
    (total.plus(octave), rest)
}

/// Adds one octave of the first altitude model.
#[inline(always)]
pub(crate) fn altitude_one<T: Number, W: Weight<T>>(
    basis: Basis,
    xi: f64,
    term: Term<W>,
    noise: T,
    (total, rest): Carried<T>,
) -> Carried<T> {
    let raised = shape(basis, noise).plus(T::constant(xi));
    let octave = term.weight.weigh(raised, term.amplitude);
    let total = if term.first {
        octave
    } else {
        total.mul(T::constant(1.0).plus(octave))
    };
    (total, rest)
}

/// Adds one octave of the second altitude model; it hands on the weight w of eq. (3.45a).
#[inline(always)]
pub(crate) fn altitude_two<T: Number, W: Weight<T>>(
    basis: Basis,
    xi: f64,
    term: Term<W>,
    noise: T,
    (total, rest): Carried<T>,
) -> Carried<T> {
    let raised = shape(basis, noise)
        .plus(T::constant(xi))
        .times(term.amplitude);
    if term.first {
        return (term.weight.weigh(raised, 1.0), T::constant(1.0));
    }
    let rest = rest.mul(raised).clamp01();
    (total.plus(term.weight.weigh(rest.clone(), 1.0)), rest)
}

/// Adds one octave of the ridged multifractal; it hands on the octave's signal.
#[inline(always)]
pub(crate) fn ridged<T: Number, W: Weight<T>>(
    offset: f64,
    gain: f64,
    term: Term<W>,
    noise: T,
    (total, rest): Carried<T>,
) -> Carried<T> {
    let ridge = ridge(offset, noise);
    let signal = if term.first {
        ridge
    } else {
        rest.times(gain).clamp01().mul(ridge)
    };
    let octave = term.weight.weigh(signal.clone(), term.amplitude);
    (total.plus(octave), signal)
}

/// The weight of octave `i` where `depth` octaves count.
#[inline(always)]
pub(crate) fn weight(depth: f64, i: f64) -> f64 {
    clamp01(depth - i)
}

/// An octave's number as a number.
#[inline(always)]
pub(crate) fn index(i: usize) -> f64 {
    /// Octaves are at most 48.
    const MAX: usize = 255;
    f64::from(u8::try_from(if i < MAX { i } else { MAX }).unwrap_or(u8::MAX))
}

impl Octave {
    /// Makes it an octave of another noise.
    fn take(&mut self, noise: &Noise) {
        let noise = noise.keyed(self.key);
        if noise.is_skewed() {
            let columns = [0, 1, 2].map(|j| noise::simplex::skew(self.matrix.map(|row| row[j])));
            self.matrix = [0, 1, 2].map(|i| columns.map(|column| column[i]));
            self.shift = noise::simplex::skew(self.shift);
        }
        self.noise = Some(noise);
    }

    /// Where the octave looks when the cascade is asked at `a`.
    #[inline(always)]
    pub(crate) fn place(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = &self.matrix;
        let [p, q, r] = self.shift;
        [
            a[0] * x + a[1] * y + a[2] * z + p,
            b[0] * x + b[1] * y + b[2] * z + q,
            c[0] * x + c[1] * y + c[2] * z + r,
        ]
    }
}

/// A gradient by an octave's coordinates as one by the cascade's argument, given the octave's matrix.
#[inline(always)]
pub(crate) fn pull([a, b, c]: &[[f64; 3]; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        a[0] * x + b[0] * y + c[0] * z,
        a[1] * x + b[1] * y + c[1] * z,
        a[2] * x + b[2] * y + c[2] * z,
    ]
}

/// The level of detail of a cascade, `None` if it has none.
fn detail_of(detail: f64, scale: f64, lacunarity: f64, first: f64) -> Option<Detail> {
    (detail > 0.0 && scale > 0.0).then(|| Detail {
        scale,
        detail,
        per_octave: 1.0 / libm::log2(lacunarity),
        first,
    })
}

/// The Hurst coefficients of a cascade.
enum Amplitudes<'a> {
    /// H of every octave.
    Even(f64),
    /// Hᵢ (thesis §3.3.3), from the octave of that number on.
    Each(f64, &'a [f64]),
}

impl Amplitudes<'_> {
    /// H of octave `i`.
    fn hurst(&self, i: u32) -> f64 {
        match self {
            Self::Even(hurst) => *hurst,
            Self::Each(first, list) => {
                let at = i.checked_sub(noise::kind::whole(*first));
                at.and_then(|at| list.get(at as usize))
                    .copied()
                    .unwrap_or(0.0)
            }
        }
    }
}

fn octaves_of(key: f64, lacunarity: f64, amplitudes: &Amplitudes<'_>, octaves: f64) -> Vec<Octave> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole and in range: the graph checked them"
    )]
    let (key, octaves) = (key as u32, octaves as u32);
    let step = rotation();
    let mut turn = step;
    let mut frequency = 1.0;
    let mut list = Vec::new();
    for i in 0..octaves {
        let key = hash::hash(&[key, i]);
        list.push(Octave {
            lattice: Lattice::new(key),
            noise: None,
            key,
            frequency,
            matrix: turn.map(|row| row.map(|entry| entry * frequency)),
            shift: [0, 1, 2].map(|axis| hash::unit(hash::hash(&[key, axis]))),
            amplitude: libm::pow(lacunarity, -amplitudes.hurst(i) * f64::from(i)),
        });
        turn = product(step, turn);
        frequency *= lacunarity;
    }
    list
}

/// The rotation from octave to octave: by the golden angle, π(3 − √5), about (3, 6, 2)/7.
fn rotation() -> [[f64; 3]; 3] {
    let (sin, cos) = libm::sincos(2.399_963_229_728_653);
    let [x, y, z] = [3.0 / 7.0, 6.0 / 7.0, 2.0 / 7.0];
    let rest = 1.0 - cos;
    [
        [
            cos + rest * x * x,
            rest * x * y - sin * z,
            rest * x * z + sin * y,
        ],
        [
            rest * x * y + sin * z,
            cos + rest * y * y,
            rest * y * z - sin * x,
        ],
        [
            rest * x * z - sin * y,
            rest * y * z + sin * x,
            cos + rest * z * z,
        ],
    ]
}

fn product(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    a.map(|row| [0, 1, 2].map(|j| row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]))
}

/// log₂ to 1e-10 for positive normal numbers; 0 counts as 2⁻¹⁰²³, and what is no number as a large one.
///
/// The exponent, and for the rest m in [√½, √2) the series of atanh in
/// (m − 1)/(m + 1) to its eleventh power. `libm`'s would not vectorise.
#[inline(always)]
pub(crate) fn log2(x: f64) -> f64 {
    /// √½ as bits: exponents change there.
    const ROOT: u64 = 0x3fe6_a09e_667f_3bcd;
    /// 2⁵² as bits: an integer below 2⁵² or-ed to them is that number above 2⁵².
    const WHOLE: u64 = 0x4330_0000_0000_0000;
    let bits = x.to_bits().wrapping_sub(ROOT);
    // 2048 keeps the exponent's number positive until it has become a float.
    let exponent = (bits.wrapping_add(2048 << 52) >> 52) & 0xfff;
    let m = f64::from_bits((bits & 0x000f_ffff_ffff_ffff).wrapping_add(ROOT));
    let exponent = f64::from_bits(WHOLE | exponent) - (4_503_599_627_370_496.0 + 2048.0);
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let series = 1.0
        + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0)))));
    exponent + 2.885_390_081_777_926_8 * (s * series)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log2_is_close_and_rises() {
        let mut before = f64::NEG_INFINITY;
        for i in 0..200_000 {
            let x = libm::exp2(f64::from(i) * 0.01 - 1000.0) * (1.0 + 1e-3 * f64::from(i % 7));
            assert!(
                (log2(x) - libm::log2(x)).abs() < 1e-10,
                "{x}: {} {}",
                log2(x),
                libm::log2(x)
            );
        }
        for i in 0..100_000 {
            let here = log2(0.4 + f64::from(i) * 2e-5);
            assert!(here > before - 1e-10);
            before = here;
        }
        for (x, exact) in [(1.0, 0.0), (2.0, 1.0), (0.125, -3.0), (1024.0, 10.0)] {
            assert!((log2(x) - exact).abs() < 1e-10);
        }
        assert!(log2(0.0) < -1022.0);
        assert!(log2(f64::INFINITY) > 1023.0);
    }

    #[test]
    fn octaves_turn_without_stretching() {
        for octave in octaves_of(7.0, 2.0, &Amplitudes::Even(1.0), 48.0) {
            for i in 0..3 {
                for j in 0..3 {
                    let dot: f64 = (0..3)
                        .map(|k| octave.matrix[i][k] * octave.matrix[j][k])
                        .sum();
                    let square = octave.frequency * octave.frequency;
                    let exact = if i == j { square } else { 0.0 };
                    assert!((dot - exact).abs() < 1e-13 * square);
                }
            }
        }
    }

    #[test]
    fn detail_ends_at_the_footprint() {
        let params = [0.0, 1.0, 2.0, 1.0, 8.0, 0.0, 1.0];
        let cascade = Cascade::new(Op::Sum, &params, 4.0).unwrap();
        // A cell of octave 2 measures 1/16; with detail 1 its weight is full at a footprint of 1/32.
        let depth = cascade.depth(1.0 / 32.0);
        assert!((weight(depth, 2.0) - 1.0).abs() < 1e-9 && weight(depth, 3.0) < 1e-9);
        assert_eq!(cascade.count(0.0), 8);
        assert_eq!(cascade.count(1e9), 0);
        assert_eq!(cascade.count(0.75 / 32.0), 4);
        let all = Cascade::new(Op::Sum, &[0.0, 1.0, 2.0, 1.0, 8.0, 0.0, 0.0], 4.0).unwrap();
        assert_eq!(all.count(1e9), 8);
    }
}
