//! What is measured: realisations of a stochastic field.

use field::hash::{hash, unit};
use field::{Interval, Points, Program, Scratch, SimdLevel};
use scene::ExpressionError;

use crate::error::Error;

/// A noise with a name of its own.
pub(crate) struct Preset {
    /// Its name on the command line.
    pub(crate) name: &'static str,
    /// Its expression; `None` is white noise, which is no function of space.
    expression: Option<&'static str>,
    /// What it is.
    pub(crate) about: &'static str,
}

/// Every noise that has a name; other fields are given as expressions.
pub(crate) const PRESETS: &[Preset] = &[
    Preset {
        name: "gradient",
        expression: Some("noise(p, key)"),
        about: "gradient noise, thesis eq. (4.9) (figs 4.5 to 4.7)",
    },
    Preset {
        name: "value",
        expression: Some("value_noise(p, key)"),
        about: "value noise, thesis eq. (4.11)",
    },
    Preset {
        name: "value-gradient",
        expression: Some("value_gradient_noise(p, key)"),
        about: "value-gradient noise, thesis eq. (4.12)",
    },
    Preset {
        name: "simplex",
        expression: Some("simplex(p, key)"),
        about: "simplex noise, thesis §4.3.2",
    },
    Preset {
        name: "sparse",
        expression: Some("sparse(p, #{nodes: 1, key: key})"),
        about: "sparse convolution with a node to a cell, thesis eq. (4.13) (figs 4.10 to 4.12)",
    },
    Preset {
        name: "sparse3",
        expression: Some("sparse(p, #{nodes: 3, key: key})"),
        about: "the same with three nodes to a cell",
    },
    Preset {
        name: "sparse-linear",
        expression: Some(r#"sparse(p, #{nodes: 1, kernel: "linear", key: key})"#),
        about: "the same with a linear kernel (fig. 4.13)",
    },
    Preset {
        name: "sparse-disc",
        expression: Some(r#"sparse(p, #{scatter: "disc", key: key})"#),
        about: "sparse convolution over nodes that keep apart",
    },
    Preset {
        name: "spot",
        expression: Some("spot(p, #{key: key})"),
        about: "spot noise, thesis eq. (4.17)",
    },
    Preset {
        name: "cellular",
        expression: Some("cellular(p, #{key: key})"),
        about: "the distance to the nearest node, thesis eq. (4.18) (figs 4.15 to 4.17)",
    },
    Preset {
        name: "cellular2",
        expression: Some("cellular(p, #{weights: [-1, 1], key: key})"),
        about: "the second distance less the first",
    },
    Preset {
        name: "wavelet",
        expression: Some("wavelet(p, key)"),
        about: "wavelet noise, thesis eq. (4.23) (fig. 4.21)",
    },
    Preset {
        name: "gradient-2d",
        expression: Some("gradient_noise(p, #{dimensions: 2, key: key})"),
        about: "gradient noise of the plane, where the others are slices of noises of space",
    },
    Preset {
        name: "value-2d",
        expression: Some("value_noise(p, #{dimensions: 2, key: key})"),
        about: "value noise of the plane",
    },
    Preset {
        name: "sparse-2d",
        expression: Some("sparse(p, #{dimensions: 2, nodes: 1, key: key})"),
        about: "sparse convolution of the plane (its picture: fig. 4.10a)",
    },
    Preset {
        name: "cellular-2d",
        expression: Some("cellular(p, #{dimensions: 2, key: key})"),
        about: "the distance to the nearest node of the plane (its picture: fig. 4.15a)",
    },
    Preset {
        name: "white",
        expression: None,
        about: "independent Gaussian numbers of unit power density: the reference, 0 dB everywhere",
    },
    Preset {
        name: "fbm0.2",
        expression: Some("fbm(p, #{hurst: 0.2, octaves: 6, key: key})"),
        about: "rescale-and-add with H = 0.2 (fig. 3.11)",
    },
    Preset {
        name: "fbm0.5",
        expression: Some("fbm(p, #{hurst: 0.5, octaves: 6, key: key})"),
        about: "rescale-and-add with H = 0.5 (fig. 3.11)",
    },
    Preset {
        name: "fbm0.8",
        expression: Some("fbm(p, #{hurst: 0.8, octaves: 6, key: key})"),
        about: "rescale-and-add with H = 0.8 (fig. 3.11)",
    },
];

/// A stochastic field.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Source {
    /// Independent Gaussian numbers at the samples.
    White,
    /// A field expression.
    Field(String),
}

/// How realisations of a field differ.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Varied {
    /// Each is computed with another `key`.
    ByKey,
    /// The expression does not use `key`: each is looked at elsewhere, whole lattice cells away.
    ByPlace,
    /// Each is drawn anew.
    Drawn,
}

/// One realisation, ready to be sampled.
pub(crate) enum Realisation {
    White {
        /// From which its numbers start.
        key: u32,
        /// Standard deviation of a sample by the volume that it stands for.
        density: f64,
    },
    Field {
        program: Box<Program>,
        scratch: Box<Scratch>,
        /// Where its origin lies.
        offset: [f64; 3],
    },
}

/// Samples on a line or in rows, lattice cells apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Raster {
    /// Samples in a row.
    pub(crate) width: usize,
    /// Rows.
    pub(crate) height: usize,
    /// Distance of neighbours in lattice cells.
    pub(crate) spacing: f64,
    /// Third coordinate of all of them.
    pub(crate) z: f64,
}

impl Source {
    /// The noise of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let preset = PRESETS.iter().find(|preset| preset.name == name)?;
        Some(match preset.expression {
            None => Self::White,
            Some(text) => Self::Field(text.to_owned()),
        })
    }

    /// How its realisations differ; the error is the expression's.
    pub(crate) fn varied(&self) -> Result<Varied, Error> {
        match self {
            Self::White => Ok(Varied::Drawn),
            Self::Field(text) => {
                let alone = scene::expression(text, &[("key", 0.0)])
                    .map_err(|error| mistaken(text, error))?;
                Ok(if alone.unused.is_empty() {
                    Varied::ByKey
                } else {
                    Varied::ByPlace
                })
            }
        }
    }

    /// Realisation `number` of those that start from `key`.
    pub(crate) fn realisation(
        &self,
        varied: Varied,
        key: u32,
        number: u32,
    ) -> Result<Realisation, Error> {
        let random = |axis: u32| hash(&[key, number, axis]);
        let text = match self {
            Self::White => {
                return Ok(Realisation::White {
                    key: random(0),
                    density: 1.0,
                });
            }
            Self::Field(text) => text,
        };
        let alone = scene::expression(text, &[("key", f64::from(random(0)))])
            .map_err(|error| mistaken(text, error))?;
        let program = Program::compile(&alone.graph, &[alone.root], Interval::point(0.0)).map_err(
            |error| Error::usage(format!("the field `{text}` cannot be evaluated")).because(error),
        )?;
        // Whole cells, so that the lattice stays where it is: noises are not stationary within a cell.
        let far = |axis: u32| f64::from(random(axis) >> 14) - 131_072.0;
        Ok(Realisation::Field {
            program: Box::new(program),
            scratch: Box::default(),
            offset: match varied {
                Varied::ByPlace => [far(0), far(1), far(2)],
                Varied::ByKey | Varied::Drawn => [0.0; 3],
            },
        })
    }
}

/// A mistake in an expression from the command line, with its place.
fn mistaken(text: &str, error: ExpressionError) -> Error {
    let help = error.help.clone();
    let said = Error::usage(format!("`{text}` is no field")).because(error);
    match help {
        Some(help) => said.next(help),
        None => said,
    }
}

impl Realisation {
    /// The values at the raster's places, row by row.
    pub(crate) fn sample(&mut self, raster: &Raster, out: &mut Vec<f64>) {
        out.clear();
        out.resize(raster.width * raster.height, 0.0);
        match self {
            Self::White { key, density } => {
                let cell = if raster.height > 1 {
                    raster.spacing * raster.spacing
                } else {
                    raster.spacing
                };
                let deviation = (*density / cell).sqrt();
                for (i, out) in (0u32..).zip(out) {
                    *out = deviation * gaussian(*key, i);
                }
            }
            Self::Field {
                program,
                scratch,
                offset: [x0, y0, z0],
            } => {
                let place = |i: usize| whole(i) * raster.spacing;
                let x: Vec<f64> = (0..raster.width).map(|i| place(i) + *x0).collect();
                let z = vec![raster.z + *z0; raster.width];
                let still = vec![0.0; raster.width];
                for (row, out) in out.chunks_exact_mut(raster.width).enumerate() {
                    let y = vec![place(row) + *y0; raster.width];
                    let points = Points {
                        x: &x,
                        y: &y,
                        z: &z,
                        footprint: &still,
                        time: &still,
                    };
                    program.evaluate(SimdLevel::best(), &points, scratch, &mut [out]);
                }
            }
        }
    }
}

/// Number `i` of a sequence of independent Gaussian numbers, by Box and Muller's method.
fn gaussian(key: u32, i: u32) -> f64 {
    let radius = (-2.0 * libm::log(1.0 - unit(hash(&[key, i, 0])))).sqrt();
    radius * libm::cos(std::f64::consts::TAU * unit(hash(&[key, i, 1])))
}

/// A count as a number.
#[expect(
    clippy::cast_precision_loss,
    reason = "counts of samples are far below 2^53"
)]
pub(crate) fn whole(count: usize) -> f64 {
    count as f64
}
