//! Algebraic surfaces: any polynomial in x, y and z, thesis §2.2.2.

use super::Refusal;
use super::within::{Known, Within};
use crate::interval::Interval;
use crate::number::Number;

/// Highest power of one coordinate.
const POWER_MAX: usize = 16;

/// Pieces along each axis over which a polynomial is bounded.
const PIECES: u32 = 4;

/// Σ c xⁱ yʲ zᵏ, summed in the order given.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Polynomial {
    terms: Vec<Term>,
    /// Its derivatives by x, y and z.
    slopes: [Vec<Term>; 3],
    /// Its second derivatives by xx, yy and zz, and by yz, xz and xy.
    bends: [[Vec<Term>; 3]; 2],
    /// Highest power of each coordinate.
    powers: [usize; 3],
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Term {
    powers: [usize; 3],
    factor: f64,
}

impl Polynomial {
    /// From four numbers a term: three powers and the coefficient.
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        if params.is_empty() || !params.len().is_multiple_of(4) {
            return Err(("terms of four numbers: three powers and a coefficient", 0.0));
        }
        let mut terms = Vec::with_capacity(params.len() / 4);
        for term in params.chunks_exact(4) {
            let mut powers = [0; 3];
            for (power, &value) in powers.iter_mut().zip(term) {
                *power = (0..=POWER_MAX)
                    .find(|whole| f64::from(u8::try_from(*whole).unwrap_or(0)) == value)
                    .ok_or(("whole powers from 0 to 16", value))?;
            }
            terms.push(Term {
                powers,
                factor: term[3],
            });
        }
        let slopes = [0, 1, 2].map(|axis| derivative(&terms, axis));
        let bends = [[(0, 0), (1, 1), (2, 2)], [(1, 2), (0, 2), (0, 1)]]
            .map(|pairs| pairs.map(|(first, second)| derivative(&slopes[first], second)));
        let powers = [0, 1, 2].map(|axis| {
            terms
                .iter()
                .map(|term| term.powers[axis])
                .max()
                .unwrap_or(0)
        });
        Ok(Self {
            terms,
            slopes,
            bends,
            powers,
        })
    }

    /// Its value.
    #[inline]
    pub(crate) fn value<N: Number>(&self, at: [N; 3]) -> N {
        if self.powers.iter().all(|power| *power <= 4) {
            self.with_powers::<N, 5>(at)
        } else {
            self.with_powers::<N, { POWER_MAX + 1 }>(at)
        }
    }

    #[inline]
    fn with_powers<N: Number, const M: usize>(&self, [x, y, z]: [N; 3]) -> N {
        let x = powers::<N, M>(x, self.powers[0]);
        let y = powers::<N, M>(y, self.powers[1]);
        let z = powers::<N, M>(z, self.powers[2]);
        let mut sum = N::constant(0.0);
        for term in &self.terms {
            let [i, j, k] = term.powers;
            let mut product = N::constant(term.factor);
            for (power, list) in [(i, &x), (j, &y), (k, &z)] {
                if power > 0 {
                    product = product.mul(list[power].clone());
                }
            }
            sum = sum.plus(product);
        }
        sum
    }

    pub(crate) fn bound(&self, within: &Within) -> Known {
        if !within.is_bounded() {
            return self.bound_piece(within);
        }
        Known::over(&Self::pieces(within), |piece| self.bound_piece(piece))
    }

    /// All second derivatives along unit directions.
    pub(crate) fn bend(&self, within: &Within) -> Interval {
        if !within.is_bounded() {
            return self.bend_piece(within);
        }
        let pieces = Self::pieces(within).into_iter();
        let bends = pieces.map(|piece| self.bend_piece(&piece));
        bends.reduce(Interval::hull).unwrap_or(Interval::ALL)
    }

    fn pieces(within: &Within) -> Vec<Within> {
        let widest = within.parts.iter().fold(0.0, |most: f64, part| {
            if part.width() > most {
                part.width()
            } else {
                most
            }
        });
        within.pieces(widest / f64::from(PIECES), PIECES)
    }

    /// By Gershgorin's circles about the Hessian's diagonal.
    fn bend_piece(&self, within: &Within) -> Interval {
        let [diagonal, across] = self
            .bends
            .each_ref()
            .map(|lists| lists.each_ref().map(|terms| range(terms, &within.parts)));
        let [yz, xz, xy] = across.map(Interval::magnitude);
        let rows = [(0, xy + xz), (1, xy + yz), (2, xz + yz)];
        rows.map(|(axis, rest)| diagonal[axis].expand(rest))
            .into_iter()
            .reduce(Interval::hull)
            .unwrap_or(Interval::ALL)
    }

    /// By the natural extension of the polynomial, and by that of its gradient about the middle.
    fn bound_piece(&self, within: &Within) -> Known {
        let over = |terms: &[Term], parts: &[Interval; 3]| range(terms, parts);
        let natural = over(&self.terms, &within.parts);
        let slopes = [0, 1, 2].map(|axis| over(&self.slopes[axis], &within.parts));
        let [x, y, z] = slopes.map(|slope| Interval::point(slope.magnitude()).square());
        let slope = x.add(y).add(z).sqrt().high;
        let most: f64 = self
            .terms
            .iter()
            .map(|term| range(&[*term], &within.parts).magnitude())
            .sum();
        // A power or product adds one rounding, and so does every sum.
        let steps = self.terms.len() + self.powers.iter().sum::<usize>() + 4;
        let steps = f64::from(u32::try_from(steps).unwrap_or(u32::MAX));
        let rounding = 2.0 * most * steps * f64::EPSILON;
        let mut range = natural;
        if within.is_bounded() {
            let middle = within.parts.map(|part| 0.5 * (part.low + part.high));
            let mut centred = over(&self.terms, &middle.map(Interval::point));
            for k in 0..3 {
                let way = within.parts[k].sub(Interval::point(middle[k]));
                centred = centred.add(slopes[k].mul(way));
            }
            range = natural.meet(centred);
        }
        Known {
            range: range.expand(rounding),
            slope,
            rounding,
        }
    }
}

/// The first powers of a number, from 0 to `most`.
#[inline]
fn powers<N: Number, const M: usize>(a: N, most: usize) -> [N; M] {
    let mut list: [N; M] = std::array::from_fn(|_| N::constant(1.0));
    if most > 0 {
        list[1] = a.clone();
    }
    for power in 2..=most {
        let half = list[power / 2].clone();
        list[power] = if power.is_multiple_of(2) {
            half.square()
        } else {
            list[power - 1].clone().mul(a.clone())
        };
    }
    list
}

fn derivative(terms: &[Term], axis: usize) -> Vec<Term> {
    let lowered = |term: &Term| {
        let mut lower = *term;
        let power = term.powers[axis];
        lower.powers[axis] = power.checked_sub(1)?;
        lower.factor *= f64::from(u8::try_from(power).ok()?);
        Some(lower)
    };
    terms.iter().filter_map(lowered).collect()
}

fn range(terms: &[Term], parts: &[Interval; 3]) -> Interval {
    let mut sum = Interval::point(0.0);
    for term in terms {
        let mut product = Interval::point(term.factor);
        for (power, part) in term.powers.into_iter().zip(parts) {
            if power > 0 {
                product = product.mul(raised(*part, power));
            }
        }
        sum = sum.add(product);
    }
    sum
}

/// aⁿ, n ≥ 1: even powers are never negative.
fn raised(a: Interval, n: usize) -> Interval {
    let base = if n.is_multiple_of(2) { a.abs() } else { a };
    let exponent = i32::try_from(n).unwrap_or(i32::MAX);
    let power = |a: f64| {
        let mut power = 1.0;
        for _ in 0..exponent {
            power *= a;
        }
        power
    };
    let raised = Interval::new(power(base.low), power(base.high))
        .widen()
        .widen();
    if base.low >= 0.0 && raised.low < 0.0 {
        Interval::new(0.0, raised.high)
    } else {
        raised
    }
}
