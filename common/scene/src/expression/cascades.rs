//! The noises and their frequency cascades, with options as a map: `#{octaves: 8, hurst: 0.8}`.

use field::op::Params;
use field::{Basis, NodeId, Op};
use rhai::{Array, Dynamic, Map};

use super::Shared;
use super::noises::known_options;
use super::values::{Made, Operand, Scalar, refuse};
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
            Params::Keys | Params::List | Params::OverNoise(_) => {
                unreachable!("a cascade has named options")
            }
        }
    }
}

/// Options of every cascade that are not constants of its own operation.
const MORE: &[&str] = &["noise", "first", "power"];

/// Places among the constants of a cascade over any noise.
const MODEL: usize = 0;
const LACUNARITY: usize = 3;
const HURST: usize = 4;
const OCTAVES: usize = 5;
const GAIN: usize = 9;
const FIRST: usize = 10;

impl Cascade {
    /// A constant of the cascade from its options.
    fn option(&self, options: &Map, option: &str) -> Made<f64> {
        match options.get(option) {
            Some(value) if option == "basis" => basis(value),
            Some(value) => Shared::constant(&format!("{}: {option}", self.name), value),
            None => Ok(self.default_of(option)),
        }
    }

    /// The named constants of [`Op::Cascade`] that say what this cascade does; H is left out where it is given otherwise.
    fn over(&self, options: &Map, without_hurst: bool) -> Made<Vec<f64>> {
        let Params::OverNoise(names) = Op::Cascade.signature().params else {
            unreachable!("it goes over a noise")
        };
        let own = self.options();
        let value = |name: &&str| match *name {
            "model" => Ok(match self.op {
                Op::AltitudeOne => 1.0,
                Op::AltitudeTwo => 2.0,
                Op::RidgedMultifractal => 3.0,
                _ => 0.0,
            }),
            "hurst" if without_hurst => Ok(self.hurst),
            "first" => self.option(options, "first"),
            name if own.contains(&name) => self.option(options, name),
            name => Ok(self.default_of(name)),
        };
        names.iter().map(value).collect()
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
        let known: Vec<_> = cascade.options().iter().chain(MORE).copied().collect();
        known_options(name, options, &known)?;
        let power = match options.get("power") {
            Some(power) => Self::constant(&format!("{name}: power"), power)?,
            None => 1.0,
        };
        let sum = match options.get("hurst") {
            Some(hurst) if hurst.is::<Scalar>() => self.varying(cascade, at, options, hurst)?,
            Some(hurst) if hurst.is_array() => {
                let list = hurst.clone().try_cast::<Array>().unwrap_or_default();
                if list.is_empty() {
                    return refuse(
                        format!("`{name}: hurst` is an empty list"),
                        "hurst: [0.9, 0.8, 0.7] gives one coefficient for each octave",
                    );
                }
                let hursts = list
                    .iter()
                    .map(|hurst| Self::constant(&format!("{name}: hurst"), hurst))
                    .collect::<Made<Vec<_>>>()?;
                self.cascade_over(cascade, at, options, &hursts)?
            }
            _ if options.contains_key("noise") || options.contains_key("first") => {
                self.cascade_over(cascade, at, options, &[])?
            }
            _ => {
                let params = cascade
                    .options()
                    .iter()
                    .map(|option| cascade.option(options, option))
                    .collect::<Made<Vec<_>>>()?;
                self.push(cascade.op, &[at], &params)?
            }
        };
        if power == 1.0 {
            return Ok(Operand::Scalar(sum).into_dynamic());
        }
        self.power(
            &Operand::Scalar(sum).into_dynamic(),
            &Dynamic::from_float(power),
        )
    }

    /// The node of a cascade by its name.
    pub(super) fn cascade_node(&self, name: &str, at: NodeId, options: &Map) -> Made<NodeId> {
        let cascade = CASCADES.iter().find(|cascade| cascade.name == name);
        let cascade = cascade.expect("it names one of the table");
        let at = Operand::Vector(at).into_dynamic();
        let made = self.cascade(cascade, &at, options)?;
        self.scalar(name, Self::operand(name, &made)?)
    }

    /// A cascade over any noise, with a Hurst coefficient for each octave if there are some.
    fn cascade_over(
        &self,
        cascade: &Cascade,
        at: NodeId,
        options: &Map,
        hursts: &[f64],
    ) -> Made<NodeId> {
        let mut params = cascade.over(options, !hursts.is_empty())?;
        if !hursts.is_empty() && !options.contains_key("octaves") {
            #[expect(
                clippy::cast_precision_loss,
                reason = "a list has at most 1024 entries"
            )]
            let count = hursts.len() as f64;
            params[OCTAVES] = count;
        }
        let (op, constants) = Self::noise_option(cascade.name, options.get("noise"))?;
        params.push(f64::from(op.code()));
        params.extend(constants);
        params.extend(hursts);
        self.push(Op::Cascade, &[at], &params)
    }

    /// A cascade with H varying over space (thesis §3.3.3): octaves, each a cascade of one, put together as its model
    /// says with the weights r^{−iH(x)}.
    ///
    /// Where level of detail fades an octave, (3.45) and the multifractal hand on what is left of it; finer ones are
    /// not there at all then.
    fn varying(
        &self,
        cascade: &Cascade,
        at: NodeId,
        options: &Map,
        hurst: &Dynamic,
    ) -> Made<NodeId> {
        let name = cascade.name;
        let hurst = self.scalar(name, Self::operand(name, hurst)?)?;
        let params = cascade.over(options, true)?;
        let (octaves, first, lacunarity) = (params[OCTAVES], params[FIRST], params[LACUNARITY]);
        let whole = (1.0..=48.0).contains(&octaves) && octaves % 1.0 == 0.0;
        if !whole || !(1.1..=16.0).contains(&lacunarity) {
            // The graph says what is wrong with them.
            return self.cascade_over(cascade, at, &without_hurst(options), &[]);
        }
        // r^{−H}, whose powers weight the octaves.
        let factor = self.push(Op::Constant, &[], &[-libm::log(lacunarity)])?;
        let exponent = self.push(Op::Mul, &[hurst, factor], &[])?;
        let fall = self.push(Op::Exp, &[exponent], &[])?;
        let (op, constants) = Self::noise_option(name, options.get("noise"))?;
        let mut carried: Option<(NodeId, NodeId)> = None;
        let mut weight: Option<NodeId> = None;
        let mut i = 0.0;
        while i < first + octaves {
            if i >= first {
                let mut params = params.clone();
                // One octave of the second altitude model is one of the first: basis + ξ.
                if cascade.op == Op::AltitudeTwo {
                    params[MODEL] = 1.0;
                }
                (params[HURST], params[OCTAVES], params[FIRST]) = (0.0, 1.0, i);
                params.push(f64::from(op.code()));
                params.extend(&constants);
                let octave = self.push(Op::Cascade, &[at], &params)?;
                let gain = params[GAIN];
                carried = Some(self.octave(cascade.op, gain, carried, weight, octave)?);
            }
            weight = Some(match weight {
                Some(weight) => self.push(Op::Mul, &[weight, fall], &[])?,
                None => fall,
            });
            i += 1.0;
        }
        let (total, _) = carried.expect("there is an octave");
        Ok(total)
    }

    /// Adds an octave of that weight, 1 if there is none, to a cascade: the sum, and what its model hands on.
    fn octave(
        &self,
        model: Op,
        gain: f64,
        carried: Option<(NodeId, NodeId)>,
        weight: Option<NodeId>,
        octave: NodeId,
    ) -> Made<(NodeId, NodeId)> {
        let constant = |value: f64| self.push(Op::Constant, &[], &[value]);
        let weighed = |node: NodeId| match weight {
            Some(weight) => self.push(Op::Mul, &[weight, node], &[]),
            None => Ok(node),
        };
        let clamped = |node: NodeId| {
            let above = self.push(Op::Max, &[node, constant(0.0)?], &[])?;
            self.push(Op::Min, &[above, constant(1.0)?], &[])
        };
        let Some((total, handed)) = carried else {
            let handed = match model {
                Op::AltitudeTwo => constant(1.0)?,
                _ => octave,
            };
            return Ok((weighed(octave)?, handed));
        };
        match model {
            Op::AltitudeOne => {
                let raised = self.push(Op::Add, &[constant(1.0)?, weighed(octave)?], &[])?;
                let product = self.push(Op::Mul, &[total, raised], &[])?;
                Ok((product, handed))
            }
            Op::AltitudeTwo => {
                let product = self.push(Op::Mul, &[handed, weighed(octave)?], &[])?;
                let handed = clamped(product)?;
                Ok((self.push(Op::Add, &[total, handed], &[])?, handed))
            }
            Op::RidgedMultifractal => {
                let gained = self.push(Op::Mul, &[handed, constant(gain)?], &[])?;
                let signal = self.push(Op::Mul, &[clamped(gained)?, octave], &[])?;
                let total = self.push(Op::Add, &[total, weighed(signal)?], &[])?;
                Ok((total, signal))
            }
            _ => Ok((self.push(Op::Add, &[total, weighed(octave)?], &[])?, handed)),
        }
    }
}

fn without_hurst(options: &Map) -> Map {
    let mut options = options.clone();
    options.remove("hurst");
    options
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
