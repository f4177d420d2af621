//! Averages over many realisations: autocovariance and power spectra, thesis eqs. (4.4)–(4.7).
//!
//! Lengths are in lattice cells (units of the expression), wavenumbers in cycles per cell. Power is a
//! density per (cycle per cell), or per its square in the plane: a white noise of unit density
//! is 0 dB at every wavenumber, whatever the raster.

use field::fft::{Complex, Direction, Fft};

use super::source::{Raster, Source, Varied, whole};
use crate::error::Error;

/// Cells that the autocovariance covers.
const COVARIANCE_CELLS: usize = 8;

/// Samples of a cell in the autocovariance.
const COVARIANCE_SAMPLES: usize = 16;

/// What is multiplied with the samples before they are transformed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Window {
    /// A raised cosine: power of one wavenumber stays within two bins of it.
    Hann,
    /// Nothing, as the thesis: where the field is cut off, power leaks into all wavenumbers.
    None,
}

/// How densely and how often is measured.
#[derive(Clone, Copy, PartialEq, Debug, serde::Serialize)]
pub(crate) struct Settings {
    /// Realisations of the field.
    pub(crate) realisations: u32,
    /// Side of the plane and length of the line, in lattice cells.
    pub(crate) cells: usize,
    /// Samples of a cell in the plane.
    pub(crate) samples: usize,
    /// Samples of a cell on the line.
    pub(crate) line_samples: usize,
    /// Third coordinate of the plane.
    pub(crate) z: f64,
    /// From which the realisations start.
    pub(crate) key: u32,
    /// The window of both spectra.
    pub(crate) window: Window,
}

/// What was found.
pub(crate) struct Statistics {
    /// How realisations differ.
    pub(crate) varied: Varied,
    /// Of all samples of the plane.
    pub(crate) values: Values,
    /// Autocovariance along a line.
    pub(crate) covariance: Covariance,
    /// Power density along a line at wavenumbers 0, 1, 2 … times `line_step`; as many as to the highest.
    pub(crate) line: Vec<f64>,
    /// Distance of the line's wavenumbers, cycles per cell.
    pub(crate) line_step: f64,
    /// Power density in the plane.
    pub(crate) plane: Plane,
}

/// The distribution of the values.
#[derive(Clone, Copy, PartialEq, Debug, serde::Serialize)]
pub(crate) struct Values {
    pub(crate) mean: f64,
    pub(crate) variance: f64,
    pub(crate) least: f64,
    pub(crate) greatest: f64,
}

/// R(xᵢ, xⱼ), thesis eqs. (4.4), (4.5): `side`² numbers, row by row.
pub(crate) struct Covariance {
    pub(crate) side: usize,
    /// Distance of neighbours, cells.
    pub(crate) spacing: f64,
    pub(crate) values: Vec<f64>,
}

/// G(k), thesis eq. (4.7): `side`² numbers, wavenumber 0 first, the second half negative ones.
pub(crate) struct Plane {
    pub(crate) side: usize,
    /// Distance of neighbours, cycles per cell.
    pub(crate) step: f64,
    pub(crate) density: Vec<f64>,
}

impl Covariance {
    /// The variance at each place: the main diagonal, of a stationary field a constant.
    pub(crate) fn diagonal(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.side).map(|i| self.values[i * self.side + i])
    }
}

/// Measures a source; `progress` is told how many realisations are done, and may end it.
pub(crate) fn measure(
    source: &Source,
    settings: &Settings,
    mut progress: impl FnMut(u32) -> Result<(), Error>,
) -> Result<Statistics, Error> {
    let varied = source.varied()?;
    let Settings { cells, z, .. } = *settings;
    let plane = Raster {
        width: cells * settings.samples,
        height: cells * settings.samples,
        spacing: 1.0 / whole(settings.samples),
        z,
    };
    let line = Raster {
        width: cells * settings.line_samples,
        height: 1,
        spacing: 1.0 / whole(settings.line_samples),
        z,
    };
    let short = Raster {
        width: COVARIANCE_CELLS * COVARIANCE_SAMPLES,
        height: 1,
        spacing: 1.0 / whole(COVARIANCE_SAMPLES),
        z,
    };
    let mut plane_power = Power::new(2, plane, settings.window)?;
    let mut line_power = Power::new(1, line, settings.window)?;
    let mut moments = Moments::default();
    let mut products = Products::new(short.width);
    let mut samples = Vec::new();
    for number in 0..settings.realisations {
        let mut realisation = source.realisation(varied, settings.key, number)?;
        realisation.sample(&plane, &mut samples);
        moments.add(&samples);
        plane_power.add(&samples);
        realisation.sample(&line, &mut samples);
        line_power.add(&samples);
        realisation.sample(&short, &mut samples);
        products.add(&samples);
        progress(number + 1)?;
    }
    let mut density = line_power.finish(settings.realisations);
    density.truncate(line.width / 2 + 1);
    Ok(Statistics {
        varied,
        values: moments.finish(),
        covariance: Covariance {
            side: short.width,
            spacing: short.spacing,
            values: products.finish(settings.realisations),
        },
        line: density,
        line_step: 1.0 / whole(cells),
        plane: Plane {
            side: plane.width,
            step: 1.0 / whole(cells),
            density: plane_power.finish(settings.realisations),
        },
    })
}

/// The mean of |f̂|² over realisations. Two of them share a transform, one as its real, one as its
/// imaginary part: the sum of their powers at k is (|F(k)|² + |F(−k)|²)/2.
struct Power {
    fft: Fft,
    axes: u32,
    side: usize,
    window: Vec<f64>,
    /// Density of a coefficient's power.
    scale: f64,
    sum: Vec<f64>,
    waiting: Vec<Complex>,
    filled: bool,
}

impl Power {
    fn new(axes: u32, raster: Raster, window: Window) -> Result<Self, Error> {
        let side = raster.width;
        let fft = Fft::new(side).ok_or_else(|| {
            Error::usage(format!(
                "{side} samples in a row cannot be transformed: cells times samples must be a power of two"
            ))
        })?;
        let window: Vec<f64> = (0..side)
            .map(|i| match window {
                Window::None => 1.0,
                Window::Hann => {
                    0.5 - 0.5 * libm::cos(std::f64::consts::TAU * whole(i) / whole(side))
                }
            })
            .collect();
        let kept = window.iter().map(|w| w * w).sum::<f64>();
        let scale = raster.spacing / kept;
        let count = side.pow(axes);
        Ok(Self {
            fft,
            axes,
            side,
            window,
            scale: if axes == 2 { scale * scale } else { scale },
            sum: vec![0.0; count],
            waiting: vec![Complex::default(); count],
            filled: false,
        })
    }

    fn add(&mut self, samples: &[f64]) {
        let rows = samples.chunks_exact(self.side);
        for ((row, samples), waiting) in rows
            .enumerate()
            .zip(self.waiting.chunks_exact_mut(self.side))
        {
            let outer = if self.axes == 2 {
                self.window[row]
            } else {
                1.0
            };
            for ((sample, window), waiting) in samples.iter().zip(&self.window).zip(waiting) {
                let value = sample * window * outer;
                if self.filled {
                    waiting.im = value;
                } else {
                    *waiting = Complex::new(value, 0.0);
                }
            }
        }
        if self.filled {
            self.transform();
        }
        self.filled = !self.filled;
    }

    fn transform(&mut self) {
        self.fft
            .run_axes(Direction::Forward, self.axes, &mut self.waiting);
        let opposite = |i: usize| {
            let (x, y) = (i % self.side, i / self.side);
            let turn = |k: usize| (self.side - k) % self.side;
            if self.axes == 2 {
                turn(y) * self.side + turn(x)
            } else {
                turn(x)
            }
        };
        for (i, sum) in self.sum.iter_mut().enumerate() {
            let power = self.waiting[i].power() + self.waiting[opposite(i)].power();
            *sum += power / 2.0;
        }
    }

    fn finish(mut self, realisations: u32) -> Vec<f64> {
        if self.filled {
            self.transform();
        }
        let scale = self.scale / f64::from(realisations);
        self.sum.iter_mut().for_each(|power| *power *= scale);
        self.sum
    }
}

#[derive(Default)]
struct Moments {
    count: usize,
    sum: f64,
    squares: f64,
    range: Option<(f64, f64)>,
}

impl Moments {
    fn add(&mut self, samples: &[f64]) {
        self.count += samples.len();
        for &sample in samples {
            self.sum += sample;
            self.squares += sample * sample;
            let (least, greatest) = self.range.unwrap_or((sample, sample));
            self.range = Some((
                if sample < least { sample } else { least },
                if sample > greatest { sample } else { greatest },
            ));
        }
    }

    fn finish(self) -> Values {
        let count = whole(self.count);
        let mean = self.sum / count;
        let (least, greatest) = self.range.unwrap_or_default();
        Values {
            mean,
            variance: self.squares / count - mean * mean,
            least,
            greatest,
        }
    }
}

/// Σ fᵢ fⱼ and Σ fᵢ over realisations.
struct Products {
    side: usize,
    sums: Vec<f64>,
    products: Vec<f64>,
}

impl Products {
    fn new(side: usize) -> Self {
        Self {
            side,
            sums: vec![0.0; side],
            products: vec![0.0; side * side],
        }
    }

    fn add(&mut self, samples: &[f64]) {
        for (sum, sample) in self.sums.iter_mut().zip(samples) {
            *sum += sample;
        }
        let rows = self.products.chunks_exact_mut(self.side);
        for (row, a) in rows.zip(samples) {
            for (product, b) in row.iter_mut().zip(samples) {
                *product += a * b;
            }
        }
    }

    fn finish(self, realisations: u32) -> Vec<f64> {
        let count = f64::from(realisations);
        let mean = |i: usize| self.sums[i] / count;
        let covariance = |(i, product)| product / count - mean(i / self.side) * mean(i % self.side);
        self.products.iter().enumerate().map(covariance).collect()
    }
}
