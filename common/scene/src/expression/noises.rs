//! The noises of thesis ch. 4 as functions, with options as a map: `cellular(4*p, #{order: 2, norm: 1})`.
//!
//! One table says which there are and what their options mean; the reader, the messages and the schema follow it.

use field::noise::sparse::{Kernel, Scatter};
use field::{NodeId, Op};
use rhai::{Array, Dynamic, Map};
use serde_json::{Value, json};

use super::Shared;
use super::values::{Made, Operand, refuse};
use crate::file::nearest;

/// A noise: its name, what it is, its options.
pub(super) struct NoiseFunction {
    pub(super) name: &'static str,
    op: Op,
    about: &'static str,
    options: &'static [NoiseOption],
}

/// An option of a noise.
struct NoiseOption {
    name: &'static str,
    /// What stands where it is absent, as one would write it.
    default: &'static str,
    about: &'static str,
}

const KEY: NoiseOption = NoiseOption {
    name: "key",
    default: "0",
    about: "Another key is another noise of the same kind, 0 to 4294967295.",
};

const DIMENSIONS: NoiseOption = NoiseOption {
    name: "dimensions",
    default: "3",
    about: "3, or 2: a noise of the plane, by the place's x and y alone.",
};

pub(super) const NOISES: &[NoiseFunction] = &[
    NoiseFunction {
        name: "gradient_noise",
        op: Op::Noise,
        about: "Gradient noise (4.9), the same as noise(p, key): within 1.037.",
        options: &[KEY, DIMENSIONS],
    },
    NoiseFunction {
        name: "value_noise",
        op: Op::ValueNoise,
        about: "Value noise (4.11): within 1.",
        options: &[KEY, DIMENSIONS],
    },
    NoiseFunction {
        name: "value_gradient_noise",
        op: Op::ValueGradientNoise,
        about: "Value-gradient noise (4.12): within 2.037.",
        options: &[KEY, DIMENSIONS],
    },
    NoiseFunction {
        name: "simplex",
        op: Op::SimplexNoise,
        about: "Simplex noise, gradients on a lattice of tetrahedra: within 1.",
        options: &[KEY],
    },
    NoiseFunction {
        name: "sparse",
        op: Op::SparseNoise,
        about: "Sparse convolution noise (4.13): random nodes of mean height 0 and variance 1, each with a radial kernel.",
        options: &[
            KEY,
            NoiseOption {
                name: "nodes",
                default: "1",
                about: "Nodes per cell, 1 to 8.",
            },
            NoiseOption {
                name: "kernel",
                default: "\"quintic\"",
                about: "\"quintic\" (smooth), \"lewis\" (a raised cosine) or \"linear\" (creases and cusps).",
            },
            NoiseOption {
                name: "scatter",
                default: "\"uniform\"",
                about: "\"uniform\", or \"disc\": nodes keep 0.8 cells apart, which makes the slope bound far smaller.",
            },
            DIMENSIONS,
        ],
    },
    NoiseFunction {
        name: "spot",
        op: Op::SpotNoise,
        about: "Spot noise (4.17): sparse convolution whose kernels are ellipsoids that differ from node to node.",
        options: &[
            KEY,
            NoiseOption {
                name: "nodes",
                default: "1",
                about: "Nodes per cell, 1 to 8.",
            },
            NoiseOption {
                name: "kernel",
                default: "\"quintic\"",
                about: "\"quintic\", \"lewis\" or \"linear\", as of sparse noise.",
            },
            NoiseOption {
                name: "stretch",
                default: "2",
                about: "How many times a spot is longer than wide, 1 to 8.",
            },
            NoiseOption {
                name: "variety",
                default: "0.5",
                about: "Radii run from 1 less this to 1 cell, 0 to 0.875.",
            },
            NoiseOption {
                name: "axis",
                default: "[0, 0, 0]",
                about: "Along which spots are long; [0, 0, 0]: each along one of its own.",
            },
        ],
    },
    NoiseFunction {
        name: "wavelet",
        op: Op::WaveletNoise,
        about: "Wavelet noise (4.23): frequencies of one octave, 1/4 to 1/2 per cell, with a deviation of 0.3.",
        options: &[KEY],
    },
    NoiseFunction {
        name: "cellular",
        op: Op::CellularNoise,
        about: "Cellular noise (4.18): distances to the nearest of Poisson-distributed nodes, less their mean.",
        options: &[
            KEY,
            NoiseOption {
                name: "order",
                default: "1",
                about: "Which distance counts, 1 (the nearest node) to 4.",
            },
            NoiseOption {
                name: "weights",
                default: "[1]",
                about: "Weights of the first to fourth distance instead of `order`: [-1, 1] is the second less the first.",
            },
            NoiseOption {
                name: "norm",
                default: "2",
                about: "The p of the norm (4.20), 1 (Manhattan) to 16, or \"max\".",
            },
            NoiseOption {
                name: "density",
                default: "2",
                about: "Nodes per cell on average, 0.25 to 8.",
            },
            NoiseOption {
                name: "squared",
                default: "false",
                about: "Whether squares of distances take their place: an exponent of 2.",
            },
            NoiseOption {
                name: "exponent",
                default: "1",
                about: "ψ(d) = d to this takes the place of each distance d (thesis §4.5.2), 1 to 4.",
            },
            NoiseOption {
                name: "bias",
                default: "false",
                about: "Whether the mean is left in.",
            },
            DIMENSIONS,
        ],
    },
];

impl NoiseFunction {
    /// The noise of that name.
    pub(super) fn named(name: &str) -> Option<&'static Self> {
        NOISES.iter().find(|noise| noise.name == name)
    }

    fn check_options(&self, options: &Map) -> Made<()> {
        let known = || self.options.iter().map(|option| option.name);
        let unknown = |key: &str| key != "kind" && !known().any(|name| name == key);
        match options.keys().find(|key| unknown(key)) {
            None => Ok(()),
            Some(key) => {
                let help = match nearest(key, known()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("its options are {}", known().collect::<Vec<_>>().join(", ")),
                };
                refuse(format!("`{}` has no option `{key}`", self.name), help)
            }
        }
    }

    /// Whether the options ask for two dimensions.
    fn is_planar(&self, options: &Map) -> Made<bool> {
        let Some(value) = options.get("dimensions") else {
            return Ok(false);
        };
        let name = self.name;
        match Shared::constant(&format!("{name}: dimensions"), value)? {
            3.0 => Ok(false),
            2.0 => Ok(true),
            other => refuse(
                format!("`{name}` has 2 or 3 dimensions, not {other}"),
                "2 is a noise of the plane: it does not change along z",
            ),
        }
    }

    /// Its operation and the constants of that.
    fn made(&self, options: &Map) -> Made<(Op, Vec<f64>)> {
        self.check_options(options)?;
        let mut constants = self.constants(options)?;
        let mut op = self.op;
        if self.is_planar(options)? {
            match op {
                Op::CellularNoise => op = Op::PlaneCellularNoise,
                Op::SparseNoise if options.contains_key("scatter") => {
                    return refuse(
                        "`sparse` has no `scatter` in two dimensions",
                        "its nodes are scattered uniformly there",
                    );
                }
                Op::SparseNoise => constants[3] = Scatter::Plane.number(),
                _ => {}
            }
        }
        Ok((op, constants))
    }

    /// The constants of its operation.
    fn constants(&self, options: &Map) -> Made<Vec<f64>> {
        let name = self.name;
        let number = |option: &str, default: f64| match options.get(option) {
            Some(value) => Shared::constant(&format!("{name}: {option}"), value),
            None => Ok(default),
        };
        let key = number("key", 0.0)?;
        Ok(match self.op {
            Op::SparseNoise => vec![
                key,
                number("nodes", 1.0)?,
                one_of(name, options, "kernel", &KERNELS)?,
                one_of(name, options, "scatter", &SCATTERS)?,
            ],
            Op::SpotNoise => {
                let mut constants = vec![
                    key,
                    number("nodes", 1.0)?,
                    one_of(name, options, "kernel", &KERNELS)?,
                    number("stretch", 2.0)?,
                    number("variety", 0.5)?,
                ];
                constants.extend(axis(name, options)?);
                constants
            }
            Op::CellularNoise => {
                let norm = match options.get("norm").map(text) {
                    Some(Some(text)) if text == "max" => 0.0,
                    Some(Some(_)) => {
                        return refuse(
                            format!("`{name}: norm` is a number or \"max\""),
                            "2 is Euclid's, 1 Manhattan's",
                        );
                    }
                    _ => match number("norm", 2.0)? {
                        // 0 stands for the maximum norm in the graph alone.
                        0.0 => -1.0,
                        norm => norm,
                    },
                };
                let mut constants = vec![key, norm, number("density", 2.0)?];
                constants.extend(weights(name, options)?);
                let squared = flag(name, options, "squared", 0.0)?;
                if options.contains_key("squared") && options.contains_key("exponent") {
                    return refuse(
                        "`cellular` takes `squared` or `exponent`, not both",
                        "squared: true is exponent: 2",
                    );
                }
                constants.push(number("exponent", 1.0 + squared)? - 1.0);
                constants.push(1.0 - flag(name, options, "bias", 0.0)?);
                constants
            }
            _ => vec![key],
        })
    }
}

const KERNELS: [(&str, f64); 3] = [
    ("quintic", Kernel::Quintic.number()),
    ("lewis", Kernel::Lewis.number()),
    ("linear", Kernel::Linear.number()),
];

const SCATTERS: [(&str, f64); 2] = [
    ("uniform", Scatter::Uniform.number()),
    ("disc", Scatter::Disc.number()),
];

/// A value that is text.
pub(super) fn text(value: &Dynamic) -> Option<String> {
    value.clone().into_string().ok()
}

/// The number of an option that is one of some words; the first is the default.
fn one_of(function: &str, options: &Map, option: &str, words: &[(&str, f64)]) -> Made<f64> {
    let Some(value) = options.get(option) else {
        return Ok(words[0].1);
    };
    let given = text(value).unwrap_or_default();
    match words.iter().find(|(word, _)| *word == given) {
        Some((_, number)) => Ok(*number),
        None => {
            let known: Vec<_> = words
                .iter()
                .map(|(word, _)| format!("\"{word}\""))
                .collect();
            refuse(
                format!("`{function}: {option}` cannot be `{value}`"),
                format!("it is {}", known.join(" or ")),
            )
        }
    }
}

fn flag(function: &str, options: &Map, option: &str, default: f64) -> Made<f64> {
    match options.get(option).map(Dynamic::as_bool) {
        None => Ok(default),
        Some(Ok(true)) => Ok(1.0),
        Some(Ok(false)) => Ok(0.0),
        Some(Err(_)) => refuse(
            format!("`{function}: {option}` is true or false"),
            format!("write {option}: true"),
        ),
    }
}

/// The common axis of spots.
fn axis(function: &str, options: &Map) -> Made<[f64; 3]> {
    let mut axis = [0.0; 3];
    let Some(value) = options.get("axis") else {
        return Ok(axis);
    };
    match value.clone().try_cast::<Array>() {
        Some(list) if list.len() == 3 => {
            for (part, value) in axis.iter_mut().zip(&list) {
                *part = Shared::constant(&format!("{function}: axis"), value)?;
            }
            Ok(axis)
        }
        _ => refuse(
            format!("`{function}: axis` is a list of three numbers"),
            "axis: [1, 0, 0] makes spots long in x",
        ),
    }
}

/// a₁ to a₄ of a cellular noise.
fn weights(function: &str, options: &Map) -> Made<[f64; 4]> {
    let mut weights = [0.0; 4];
    let Some(list) = options.get("weights") else {
        let order = match options.get("order") {
            Some(order) => Shared::constant(&format!("{function}: order"), order)?,
            None => 1.0,
        };
        let numbers = [1.0, 2.0, 3.0, 4.0];
        return match numbers.iter().position(|known| *known == order) {
            Some(at) => {
                weights[at] = 1.0;
                Ok(weights)
            }
            None => refuse(
                format!("`{function}` wants an order from 1 to 4, not {order}"),
                "order 1 is the distance to the nearest node",
            ),
        };
    };
    if options.contains_key("order") {
        return refuse(
            format!("`{function}` takes `order` or `weights`, not both"),
            "order: 2 is weights: [0, 1]",
        );
    }
    match list.clone().try_cast::<Array>() {
        Some(list) if (1..=4).contains(&list.len()) => {
            for (weight, value) in weights.iter_mut().zip(&list) {
                *weight = Shared::constant(&format!("{function}: weights"), value)?;
            }
            Ok(weights)
        }
        _ => refuse(
            format!("`{function}: weights` is a list of one to four numbers"),
            "weights: [-1, 1] is the second distance less the first",
        ),
    }
}

impl Shared {
    /// A noise at a place; the options are a map, or a key alone.
    pub(super) fn noise_function(
        &self,
        noise: &NoiseFunction,
        at: &Dynamic,
        options: &Map,
    ) -> Made<Dynamic> {
        let mut at = Self::vector(noise.name, at)?;
        let (op, constants) = noise.made(options)?;
        // Noises of a lattice are those of two dimensions where it is cut through its nodes.
        let cut = matches!(op, Op::Noise | Op::ValueNoise | Op::ValueGradientNoise);
        if cut && noise.is_planar(options)? {
            at = self.push(Op::OntoPlane, &[at], &[])?;
        }
        Ok(Operand::Scalar(self.push(op, &[at], &constants)?).into_dynamic())
    }

    /// The noise that an option `noise` names, alone or as a map with its `kind` and options: operation and constants.
    pub(super) fn noise_option(function: &str, value: Option<&Dynamic>) -> Made<(Op, Vec<f64>)> {
        let Some(value) = value else {
            return Ok((Op::Noise, vec![0.0]));
        };
        let options = value.clone().try_cast::<Map>();
        let kind = match &options {
            Some(options) => options.get("kind").and_then(text),
            None => text(value),
        };
        let name = kind.unwrap_or_default();
        let name = if name == "gradient" {
            "gradient_noise"
        } else {
            &name
        };
        let name = if name == "value" { "value_noise" } else { name };
        let name = if name == "value_gradient" {
            "value_gradient_noise"
        } else {
            name
        };
        let Some(noise) = NoiseFunction::named(name) else {
            let known: Vec<_> = NOISES.iter().map(|noise| noise.name).collect();
            return refuse(
                format!("`{function}: noise` names no noise"),
                format!(
                    "write noise: \"cellular\" or noise: #{{kind: \"cellular\", order: 2}}; there are {}",
                    known.join(", ")
                ),
            );
        };
        let options = options.unwrap_or_default();
        if noise.is_planar(&options)? {
            return refuse(
                format!("`{function}: noise` has three dimensions"),
                "its octaves are turned against each other; take it at `base` for heights over a plane",
            );
        }
        noise.made(&options)
    }

    /// The gradient of a noise at a place, thesis eq. (4.2).
    pub(super) fn noise_gradient(&self, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        let at = Self::vector("gradient", at)?;
        known_options("gradient", options, &["noise", "key"])?;
        let id = self.gradient_node("gradient", at, options)?;
        Ok(Operand::Vector(id).into_dynamic())
    }

    fn gradient_node(&self, function: &str, at: NodeId, options: &Map) -> Made<NodeId> {
        let (op, mut constants) = Self::noise_option(function, options.get("noise"))?;
        let creased = match op {
            Op::CellularNoise => true,
            Op::SparseNoise | Op::SpotNoise => constants[2] == Kernel::Linear.number(),
            _ => false,
        };
        if creased {
            return refuse(
                format!("`{function}` wants a smooth noise: this one's gradient jumps"),
                "simplex, sparse, wavelet and the gradient and value noises are smooth",
            );
        }
        if let Some(key) = options.get("key") {
            constants[0] = Self::constant(&format!("{function}: key"), key)?;
        }
        constants.insert(0, f64::from(op.code()));
        self.push(Op::NoiseGradient, &[at], &constants)
    }

    /// A place moved by three noises, or by the gradient of one: domain warping (thesis §3.3.4).
    pub(super) fn warp(&self, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        let function = "warp";
        let at = Self::vector(function, at)?;
        known_options(
            function,
            options,
            &[
                "noise",
                "key",
                "amount",
                "scale",
                "by",
                "octaves",
                "hurst",
                "lacunarity",
                "detail",
            ],
        )?;
        let number = |option: &str, default: f64| match options.get(option) {
            Some(value) => Self::constant(&format!("warp: {option}"), value),
            None => Ok(default),
        };
        let octaves = number("octaves", 1.0)?;
        let (amount, scale, key) = (
            number("amount", 0.5)?,
            number("scale", 1.0)?,
            number("key", 0.0)?,
        );
        let times = |vector: NodeId, factor: f64| {
            let factor = self.push(Op::Constant, &[], &[factor])?;
            self.push(Op::Scale, &[vector, factor], &[])
        };
        let place = if scale == 1.0 { at } else { times(at, scale)? };
        let way = match options.get("by").map(text) {
            None => None,
            Some(by) => by.as_deref().map(str::to_owned).or(Some(String::new())),
        };
        let way = match way.as_deref() {
            Some("gradient") if octaves != 1.0 => {
                return refuse(
                    "`warp` goes by the gradient of a single noise, not of octaves",
                    "write by: \"vector\", or warp what is warped already",
                );
            }
            Some("gradient") => self.gradient_node(function, place, options)?,
            None | Some("vector") if octaves != 1.0 => {
                let part = |step: f64| {
                    let mut options = options.clone();
                    for taken in ["amount", "scale", "by"] {
                        options.remove(taken);
                    }
                    options.insert("key".into(), ((key + step) % 4_294_967_296.0).into());
                    self.cascade_node("fbm", place, &options)
                };
                self.push(Op::Vector, &[part(0.0)?, part(1.0)?, part(2.0)?], &[])?
            }
            None | Some("vector") => {
                let (op, constants) = Self::noise_option(function, options.get("noise"))?;
                let part = |step: f64| {
                    let mut constants = constants.clone();
                    constants[0] = (key + step) % 4_294_967_296.0;
                    self.push(op, &[place], &constants)
                };
                self.push(Op::Vector, &[part(0.0)?, part(1.0)?, part(2.0)?], &[])?
            }
            Some(_) => {
                return refuse(
                    "`warp: by` is \"vector\" or \"gradient\"",
                    "\"vector\" moves by three noises, \"gradient\" by the slope of one",
                );
            }
        };
        let moved = self.push(Op::VectorAdd, &[at, times(way, amount)?], &[])?;
        Ok(Operand::Vector(moved).into_dynamic())
    }
}

/// Refuses an option that a function does not have.
pub(super) fn known_options(function: &str, options: &Map, known: &[&str]) -> Made<()> {
    let Some(unknown) = options.keys().find(|key| !known.contains(&key.as_str())) else {
        return Ok(());
    };
    let help = match nearest(unknown, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("its options are {}", known.join(", ")),
    };
    refuse(format!("`{function}` has no option `{unknown}`"), help)
}

/// The noises and their options, for the schema.
pub(crate) fn described() -> Value {
    let functions = NOISES.iter().map(|noise| {
        let options = noise.options.iter().map(|option| {
            let about = json!({ "about": option.about, "default": option.default });
            (option.name.to_owned(), about)
        });
        let options: serde_json::Map<String, Value> = options.collect();
        let about = json!({ "about": noise.about, "options": options });
        (noise.name.to_owned(), about)
    });
    Value::Object(functions.collect())
}
