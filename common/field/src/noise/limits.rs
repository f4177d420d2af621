//! What the constants of a noise may be.

use super::cellular::{DENSITY_MAX, DENSITY_MIN, EXPONENT_MAX, NORM_MAX};
use super::sparse::{Kernel, NODES_MAX, Scatter};
use super::spot::{STRETCH_MAX, VARIETY_MAX};
use crate::op::{Op, Params};

/// What a constant should have been, and what it is.
pub(crate) type Refused = (&'static str, f64);

/// Whether the operation is a noise: a function of a place and constants, the first of them a key.
pub(crate) fn is_noise(op: Op) -> bool {
    matches!(
        op,
        Op::Noise
            | Op::ValueNoise
            | Op::ValueGradientNoise
            | Op::SimplexNoise
            | Op::SparseNoise
            | Op::CellularNoise
            | Op::PlaneCellularNoise
            | Op::SpotNoise
            | Op::WaveletNoise
    )
}

/// What is wrong with a noise's constants; there are as many as its signature names, all finite.
pub(crate) fn refused(op: Op, params: &[f64]) -> Option<Refused> {
    let key = *params.first()?;
    if !(0.0..=f64::from(u32::MAX)).contains(&key) || key % 1.0 != 0.0 {
        return Some(("a key from 0 to 4294967295", key));
    }
    match (op, &params[1..]) {
        (Op::SparseNoise, &[nodes, kernel, scatter]) => sparse(nodes, kernel, scatter),
        (Op::SpotNoise, &[nodes, kernel, stretch, variety, ..]) => {
            let uniform = Scatter::Uniform.number();
            sparse(nodes, kernel, uniform).or_else(|| spot(stretch, variety))
        }
        (
            Op::CellularNoise | Op::PlaneCellularNoise,
            &[norm, density, ref weights @ .., raised, unbiased],
        ) => cellular(norm, density, weights).or_else(|| {
            // Fewer would too often be out of reach in the plane.
            if op == Op::PlaneCellularNoise && density < 1.0 {
                return Some((
                    "a density from 1 to 8 nodes per cell in two dimensions",
                    density,
                ));
            }
            if !(0.0..=EXPONENT_MAX - 1.0).contains(&raised) {
                return Some(("an exponent from 1 to 4", 1.0 + raised));
            }
            (unbiased != 0.0 && unbiased != 1.0).then_some(("0 or 1", unbiased))
        }),
        _ => None,
    }
}

fn sparse(nodes: f64, kernel: f64, scatter: f64) -> Option<Refused> {
    if !(1.0..=NODES_MAX).contains(&nodes) || nodes % 1.0 != 0.0 {
        return Some(("1 to 8 whole nodes per cell", nodes));
    }
    if Kernel::from_number(kernel).is_none() {
        return Some(("a kernel", kernel));
    }
    match Scatter::from_number(scatter) {
        None => Some(("a scatter", scatter)),
        Some(Scatter::Disc) if nodes != 1.0 => {
            Some(("1 node per cell where they keep apart", nodes))
        }
        Some(_) => None,
    }
}

fn spot(stretch: f64, variety: f64) -> Option<Refused> {
    if !(1.0..=STRETCH_MAX).contains(&stretch) {
        return Some(("a stretch from 1 to 8", stretch));
    }
    if !(0.0..=VARIETY_MAX).contains(&variety) {
        return Some(("a variety of sizes from 0 to 0.875", variety));
    }
    None
}

fn cellular(norm: f64, density: f64, weights: &[f64]) -> Option<Refused> {
    if norm != 0.0 && !(1.0..=NORM_MAX).contains(&norm) {
        return Some(("a norm from 1 to 16, or \"max\"", norm));
    }
    if !(DENSITY_MIN..=DENSITY_MAX).contains(&density) {
        return Some(("a density from 0.25 to 8 nodes per cell", density));
    }
    if weights.iter().all(|weight| *weight == 0.0) {
        return Some(("a weight that is not 0", 0.0));
    }
    weights
        .iter()
        .find(|weight| weight.abs() > 1e6)
        .map(|weight| ("weights of at most 1e6", *weight))
}

/// The noise after the first `named` constants of an operation over one, as `Params::OverNoise` describes:
/// its operation, its constants, and what follows them.
pub(crate) fn split_noise(params: &[f64], named: usize) -> Option<(Op, &[f64], &[f64])> {
    let (&code, rest) = params.get(named..)?.split_first()?;
    let op = Op::ALL
        .iter()
        .copied()
        .find(|op| is_noise(*op) && f64::from(op.code()) == code)?;
    let Params::Named(names) = op.signature().params else {
        return None;
    };
    (rest.len() >= names.len()).then(|| {
        let (own, after) = rest.split_at(names.len());
        (op, own, after)
    })
}
