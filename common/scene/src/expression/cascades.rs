//! The noises and their frequency cascades, with options as a map: `#{octaves: 8, hurst: 0.8}`.

use field::op::Params;
use field::{Basis, Op};
use rhai::{Dynamic, Map};

use super::Shared;
use super::options::Options;
use super::values::{Made, Operand, refuse};

/// A cascade's name, what it does, and what its options are where they are not given.
pub(super) struct Cascade {
    pub(super) name: &'static str,
    op: Op,
    basis: Basis,
    hurst: f64,
    xi: f64,
}

pub(super) const CASCADES: &[Cascade] = &[
    Cascade {
        name: "fbm",
        op: Op::Sum,
        basis: Basis::Plain,
        hurst: 0.8,
        xi: 0.0,
    },
    Cascade {
        name: "turbulence",
        op: Op::Sum,
        basis: Basis::Absolute,
        hurst: 1.0,
        xi: 0.0,
    },
    Cascade {
        name: "ridged",
        op: Op::Sum,
        basis: Basis::Ridged,
        hurst: 0.8,
        xi: 0.0,
    },
    Cascade {
        name: "altitude1",
        op: Op::AltitudeOne,
        basis: Basis::Plain,
        hurst: 0.8,
        xi: 0.6,
    },
    Cascade {
        name: "altitude2",
        op: Op::AltitudeTwo,
        basis: Basis::Plain,
        hurst: 0.8,
        xi: 0.6,
    },
    Cascade {
        name: "ridged_multifractal",
        op: Op::RidgedMultifractal,
        basis: Basis::Ridged,
        hurst: 1.0,
        xi: 0.0,
    },
];

const BASES: [(&str, Basis); 3] = [
    ("plain", Basis::Plain),
    ("absolute", Basis::Absolute),
    ("ridged", Basis::Ridged),
];

impl Cascade {
    fn default_of(&self, option: &str) -> f64 {
        match option {
            "basis" => self.basis.number(),
            "lacunarity" | "gain" => 2.0,
            "hurst" => self.hurst,
            "octaves" => 8.0,
            "xi" => self.xi,
            "offset" | "detail" => 1.0,
            _ => 0.0,
        }
    }

    fn options(&self) -> &'static [&'static str] {
        match self.op.signature().params {
            Params::Named(names) => names,
            Params::Keys | Params::List => unreachable!("a cascade has named options"),
        }
    }
}

impl Shared {
    /// Gradient noise over the lattice of a key.
    pub(super) fn noise(&self, at: &Dynamic, key: f64) -> Made<Dynamic> {
        let at = Self::vector("noise", at)?;
        Ok(Operand::Scalar(self.push(Op::Noise, &[at], &[key])?).into_dynamic())
    }

    /// A cascade of noises at a place.
    pub(super) fn cascade(&self, cascade: &Cascade, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        let name = cascade.name;
        let at = Self::vector(name, at)?;
        let known = cascade.options();
        Options::new(name, known, options)?;
        let params = known
            .iter()
            .map(|option| match options.get(*option) {
                Some(value) if *option == "basis" => basis(value),
                Some(value) => Self::constant(&format!("{name}: {option}"), value),
                None => Ok(cascade.default_of(option)),
            })
            .collect::<Made<Vec<_>>>()?;
        Ok(Operand::Scalar(self.push(cascade.op, &[at], &params)?).into_dynamic())
    }
}

fn basis(value: &Dynamic) -> Made<f64> {
    let name = value.clone().into_string().unwrap_or_default();
    match BASES.iter().find(|(known, _)| *known == name) {
        Some((_, basis)) => Ok(basis.number()),
        None => refuse(
            format!("there is no basis `{value}`"),
            "it is \"plain\", \"absolute\" or \"ridged\"",
        ),
    }
}
