//! What `flyby noise measure` prints.

use std::io::{self, Write};
use std::path::PathBuf;

use serde::Serialize;

use super::measure::{Settings, Statistics, Values};
use super::rings::{Ring, Summary, rings};
use super::source::{Varied, whole};
use crate::output::{Report, columns};

/// `noise measure`.
#[derive(Serialize)]
pub(crate) struct Measured {
    /// How it was measured.
    pub(crate) settings: Settings,
    /// What was found, in the order asked for.
    pub(crate) noises: Vec<Noise>,
    /// The plots that were written.
    pub(crate) plots: Vec<PathBuf>,
}

/// One noise's measurements. Wavenumbers are cycles per lattice cell.
#[derive(Serialize)]
pub(crate) struct Noise {
    /// Its name or expression.
    pub(crate) name: String,
    /// How realisations differ.
    varied: Varied,
    /// The distribution of its values.
    values: Values,
    /// Its spectrum in a few numbers.
    pub(crate) summary: Summary,
    /// Radial power and anisotropy.
    pub(crate) rings: Vec<Ring>,
    /// Power density along a line.
    pub(crate) line: Vec<Line>,
    /// Variance at places along a line, a sixteenth of a cell apart.
    variances: Vec<f64>,
}

/// Power along a line at one wavenumber.
#[derive(Clone, Copy, Serialize)]
pub(crate) struct Line {
    /// Cycles per cell.
    pub(crate) wavenumber: f64,
    /// Power density per cycle per cell.
    pub(crate) power: f64,
}

impl Noise {
    /// The report of what was measured.
    pub(crate) fn new(name: String, statistics: &Statistics) -> Self {
        let rings = rings(&statistics.plane);
        let line = statistics.line.iter().enumerate().skip(1);
        Self {
            name,
            varied: statistics.varied,
            values: statistics.values,
            summary: Summary::new(statistics, &rings),
            rings,
            line: line
                .map(|(k, &power)| Line {
                    wavenumber: whole(k) * statistics.line_step,
                    power,
                })
                .collect(),
            variances: statistics.covariance.diagonal().collect(),
        }
    }
}

/// A wavenumber that may not exist.
fn maybe(wavenumber: Option<f64>) -> String {
    wavenumber.map_or_else(|| "none".to_owned(), |k| format!("{k:.2}"))
}

impl Report for Measured {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let Settings {
            realisations,
            cells,
            samples,
            ..
        } = self.settings;
        writeln!(
            out,
            "{realisations} realisations, {cells} x {cells} lattice cells, {samples} x {samples} \
             samples a cell"
        )?;
        writeln!(
            out,
            "wavenumbers in cycles per cell, power in dB above a white noise of unit density"
        )?;
        for noise in &self.noises {
            noise.table(out)?;
        }
        for plot in &self.plots {
            writeln!(out, "wrote {}", plot.display())?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        for plot in &self.plots {
            writeln!(out, "{}", plot.display())?;
        }
        Ok(())
    }
}

impl Noise {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        /// Rings of the table to an octave.
        const PER_OCTAVE: f64 = 3.0;
        let Values {
            mean,
            variance,
            least,
            greatest,
        } = self.values;
        let summary = &self.summary;
        let [low, high] = summary.variance_along_line;
        writeln!(out, "\n{}", self.name)?;
        writeln!(
            out,
            "  values        mean {mean:.4}, variance {variance:.4}, from {least:.3} to {greatest:.3}"
        )?;
        writeln!(
            out,
            "  stationarity  variance along a line from {low:.2} to {high:.2} of its mean"
        )?;
        writeln!(
            out,
            "  peak          {:.2} at {:.1} dB; -3 dB at {}, -20 dB at {}, first null {}",
            summary.peak,
            summary.peak_db,
            maybe(summary.down_3_db),
            maybe(summary.down_20_db),
            maybe(summary.first_null)
        )?;
        if let Some(exponent) = summary.line_exponent {
            writeln!(out, "  on a line     power goes as k^{exponent:.2}")?;
        }
        writeln!(
            out,
            "  isotropy      anisotropy at most {:.1} dB up to -20 dB",
            summary.anisotropy_db
        )?;
        let mut table = columns(["wavenumber", "power dB", "anisotropy dB"]);
        let mut next = 0.0;
        for ring in &self.rings {
            if ring.wavenumber < next {
                continue;
            }
            table.add_row([
                format!("{:.3}", ring.wavenumber),
                format!("{:.1}", ring.power_db),
                format!("{:.1}", ring.anisotropy_db),
            ]);
            next = ring.wavenumber * libm::exp2(1.0 / PER_OCTAVE);
        }
        for line in table.lines() {
            writeln!(out, "  {}", line.trim_end())?;
        }
        Ok(())
    }
}
