//! `flyby noise`: the statistics by which the thesis judges noises (§4.2).

use std::fs;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Subcommand};
use field::noise::wavelet;

use crate::error::{Ending, Error};
use crate::noise::copies;
use crate::noise::measure::{Settings, Statistics, Window, measure};
use crate::noise::plot::{self, Axis, Curve, Words};
use crate::noise::report::{Measured, Noise};
use crate::noise::rings::decibels;
use crate::noise::source::{PRESETS, Source};
use crate::options::Context;
use crate::output;
use crate::progress::Progress;
use crate::stop::Stop;

#[derive(Subcommand, Debug)]
pub(crate) enum NoiseCommand {
    /// Measures autocovariance, power spectrum, radial power and anisotropy, averaged over
    /// realisations (thesis §4.2).
    Measure(Measure),
}

#[derive(Args, Debug)]
pub(crate) struct Measure {
    /// Noises to measure [default: gradient].
    #[arg(value_name = "NOISE", value_parser = presets())]
    noises: Vec<String>,

    /// A field expression to measure, such as "ridged(p, #{key: key})"; may be repeated. Where it
    /// uses `key`, each realisation has another; where not, each is looked at somewhere else.
    #[arg(long, value_name = "EXPRESSION", help_heading = "What to measure")]
    field: Vec<String>,

    /// Realisations to average over.
    #[arg(long, value_name = "N", default_value_t = 100,
          value_parser = clap::value_parser!(u32).range(2..=100_000), help_heading = "How")]
    realisations: u32,

    /// Side of the measured square in lattice cells, a power of two. Wavenumbers are 1/N apart.
    #[arg(long, value_name = "N", default_value = "32", value_parser = power_of_two, help_heading = "How")]
    cells: usize,

    /// Samples along a cell, a power of two. Wavenumbers go up to N/2.
    #[arg(long, value_name = "N", default_value = "16", value_parser = power_of_two, help_heading = "How")]
    samples: usize,

    /// Samples along a cell of the spectrum on a line, a power of two.
    #[arg(long, value_name = "N", default_value = "64", value_parser = power_of_two, help_heading = "How")]
    line_samples: usize,

    /// Third coordinate of the measured square. At 0 lattice noises are those of two dimensions.
    #[arg(
        long,
        value_name = "Z",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        help_heading = "How"
    )]
    plane: f64,

    /// From which the realisations start.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "How")]
    key: u32,

    /// What the samples are multiplied with before they are transformed; `none` is the thesis's.
    #[arg(long, value_enum, default_value = "hann", help_heading = "How")]
    window: Window,

    /// Folder for plots (SVG); without it only numbers are printed.
    #[arg(short, long, value_name = "DIR", help_heading = "Results")]
    out: Option<PathBuf>,
}

/// Places in each cell at which the making of wavelet noise is drawn.
const STAGES_SAMPLES: u32 = 16;

/// Most samples of one realisation's square.
const SAMPLES_MAX: usize = 1 << 22;

/// Names of noises, as clap completes and refuses them.
fn presets() -> PossibleValuesParser {
    PRESETS
        .iter()
        .map(|preset| PossibleValue::new(preset.name).help(preset.about))
        .collect::<Vec<_>>()
        .into()
}

fn power_of_two(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(number @ 2..=4_096) if number.is_power_of_two() => Ok(number),
        Ok(number) => Err(format!("{number} is no power of two from 2 to 4096")),
        Err(_) => Err(format!("`{text}` is no whole number")),
    }
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: NoiseCommand) -> Result<Ending, Error> {
    let NoiseCommand::Measure(options) = command;
    options.run(context)
}

impl Measure {
    fn run(&self, context: &Context) -> Result<Ending, Error> {
        let settings = self.settings()?;
        if let Some(folder) = &self.out {
            fs::create_dir_all(folder).map_err(|error| cannot_write(folder).because(error))?;
        }
        let sources = self.sources();
        // Mistakes are said before minutes are spent on what stands before them.
        for (_, source) in &sources {
            source.varied()?;
        }
        let rounds = u64::from(settings.realisations);
        let total = rounds * sources.len() as u64;
        let stop = Stop::on_signals()?;
        let mut progress = Progress::new(context.output, total, 0);
        let mut measured = Measured {
            settings,
            noises: Vec::new(),
            plots: Vec::new(),
        };
        for (number, (name, source)) in sources.iter().enumerate() {
            let before = number as u64 * rounds;
            let statistics = measure(source, &settings, |done| {
                progress.update(before + u64::from(done), name);
                if stop.is_set() {
                    return Err(Error::interrupted("the measurement was stopped"));
                }
                Ok(())
            })?;
            if let Some(folder) = &self.out {
                maps(folder, name, number, &statistics, &mut measured.plots)?;
            }
            let noise = Noise::new(name.clone(), &statistics);
            if let Some(folder) = &self.out {
                building(folder, &stem(name, number), &noise, &mut measured.plots)?;
            }
            measured.noises.push(noise);
        }
        progress.finish();
        if let Some(folder) = &self.out {
            charts(folder, &measured.noises, &mut measured.plots)?;
        }
        output::print(context.output, &measured)?;
        Ok(Ending::Done)
    }

    fn settings(&self) -> Result<Settings, Error> {
        let side = self.cells * self.samples;
        let line = self.cells * self.line_samples;
        if side * side > SAMPLES_MAX || line > SAMPLES_MAX {
            return Err(Error::usage(format!(
                "{side} x {side} samples are too many; 2048 x 2048 are the most"
            ))
            .next("choose fewer `--cells` or `--samples`"));
        }
        if !self.plane.is_finite() || self.plane.abs() > 1e6 {
            return Err(Error::usage("the plane is farther away than 1e6 cells"));
        }
        Ok(Settings {
            realisations: self.realisations,
            cells: self.cells,
            samples: self.samples,
            line_samples: self.line_samples,
            z: self.plane,
            key: self.key,
            window: self.window,
        })
    }

    /// What to measure, by name.
    fn sources(&self) -> Vec<(String, Source)> {
        let usual = (self.noises.is_empty() && self.field.is_empty()).then(|| "gradient".into());
        let named = usual
            .iter()
            .chain(&self.noises)
            .filter_map(|name| Some((name.clone(), Source::named(name)?)));
        let given = self
            .field
            .iter()
            .map(|text| (text.clone(), Source::Field(text.clone())));
        named.chain(given).collect()
    }
}

fn cannot_write(path: &Path) -> Error {
    Error::failed(format!("cannot write the plot `{}`", path.display()))
}

/// What the names of a noise's plots begin with.
fn stem(name: &str, number: usize) -> String {
    match PRESETS.iter().any(|preset| preset.name == name) {
        true => name.to_owned(),
        false => format!("field{}", number + 1),
    }
}

/// Draws what copies of a noise add up to (thesis fig. 4.20), and how wavelet noise is made (fig. 4.21).
fn building(
    folder: &Path,
    stem: &str,
    noise: &Noise,
    plots: &mut Vec<PathBuf>,
) -> Result<(), Error> {
    let words = Words {
        title: "Copies of it, each twice as fine and 2^-0.5 as high",
        x: "wavenumber (cycles per cell)",
        y: "power density (dB)",
    };
    let copies = copies::curves(&noise.line);
    let drawn = plot::curves(words, Axis::Logarithmic, &copies);
    write(folder, &format!("{stem}_copies.svg"), drawn, plots)?;
    if noise.name != "wavelet" {
        return Ok(());
    }
    let stages = wavelet::stages(STAGES_SAMPLES);
    let curve = |label: &str, values: &[f64]| Curve {
        label: label.to_owned(),
        points: stages
            .places
            .iter()
            .copied()
            .zip(values.iter().copied())
            .collect(),
    };
    let words = Words {
        title: "How wavelet noise is made: a random spline, its smooth part, and what that lacks",
        x: "x (lattice cells)",
        y: "value",
    };
    let curves = [
        curve("random", &stages.random),
        curve("smooth", &stages.smooth),
        curve("noise", &stages.detail),
    ];
    let drawn = plot::curves(words, Axis::Even, &curves);
    write(folder, "wavelet_stages.svg", drawn, plots)
}

/// Draws what each noise has of its own.
fn maps(
    folder: &Path,
    name: &str,
    number: usize,
    statistics: &Statistics,
    plots: &mut Vec<PathBuf>,
) -> Result<(), Error> {
    let stem = stem(name, number);
    for (kind, drawn) in [
        ("covariance", plot::covariance(name, &statistics.covariance)),
        ("psdf", plot::spectrum(name, &statistics.plane)),
    ] {
        write(folder, &format!("{stem}_{kind}.svg"), drawn, plots)?;
    }
    Ok(())
}

/// Draws the curves of all noises together.
fn charts(folder: &Path, noises: &[Noise], plots: &mut Vec<PathBuf>) -> Result<(), Error> {
    let curves = |points: &dyn Fn(&Noise) -> Vec<(f64, f64)>| -> Vec<Curve> {
        let curve = |noise: &Noise| Curve {
            label: noise.name.clone(),
            points: points(noise),
        };
        noises.iter().map(curve).collect()
    };
    let radial = Words {
        title: "Radial power, thesis eq. (4.8a)",
        x: "wavenumber (cycles per cell)",
        y: "power density (dB)",
    };
    let power = curves(&|noise| {
        let rings = noise.rings.iter();
        rings.map(|ring| (ring.wavenumber, ring.power_db)).collect()
    });
    write(
        folder,
        "radial.svg",
        plot::curves(radial, Axis::Even, &power),
        plots,
    )?;
    let anisotropy = Words {
        title: "Anisotropy, thesis eq. (4.8b)",
        y: "anisotropy (dB)",
        ..radial
    };
    let curve = curves(&|noise| {
        let rings = noise.rings.iter();
        rings
            .map(|ring| (ring.wavenumber, ring.anisotropy_db))
            .collect()
    });
    write(
        folder,
        "anisotropy.svg",
        plot::curves(anisotropy, Axis::Even, &curve),
        plots,
    )?;
    let line = Words {
        title: "Power along a line",
        ..radial
    };
    let curve = curves(&|noise| {
        let line = noise.line.iter();
        line.map(|line| (line.wavenumber, decibels(line.power)))
            .collect()
    });
    write(
        folder,
        "line.svg",
        plot::curves(line, Axis::Logarithmic, &curve),
        plots,
    )
}

fn write(
    folder: &Path,
    name: &str,
    drawn: Result<String, Box<dyn std::error::Error + Send + Sync>>,
    plots: &mut Vec<PathBuf>,
) -> Result<(), Error> {
    let path = folder.join(name);
    let svg = drawn.map_err(|error| cannot_write(&path).because(error))?;
    fs::write(&path, svg).map_err(|error| cannot_write(&path).because(error))?;
    plots.push(path);
    Ok(())
}
