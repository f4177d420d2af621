//! Tables 5.1 to 5.5 beside the thesis's, as text and as JSON.

use std::io::{self, Write};

use serde::Serialize;

use super::cast::Count;
use super::thesis::Row;
use crate::output::{Report, columns};

/// What was measured of one noise.
#[derive(Serialize, Debug)]
pub(crate) struct Measured {
    /// The noise.
    pub(crate) noise: &'static str,
    /// The field.
    pub(crate) field: String,
    /// How the noise is normalised.
    pub(crate) normalisation: &'static str,
    /// Table 5.1: sphere tracing and speculative sphere tracing with the thesis's λ_N, then with a true one.
    pub(crate) tracing: Vec<Count>,
    /// Tables 5.2 to 5.4, then Mitchell's method.
    pub(crate) casting: Vec<Count>,
    /// Reduced AA with interval optimisation and speculative sphere tracing at other ε.
    pub(crate) sensitivity: Vec<Count>,
    /// The thesis's numbers.
    pub(crate) thesis: Thesis,
}

/// What the thesis found, in the order of its tables.
#[derive(Serialize, Debug)]
pub(crate) struct Thesis {
    /// Table 5.1: steps of sphere tracing, of speculative sphere tracing, steps taken back.
    pub(crate) steps: [f64; 3],
    /// Tables 5.2 to 5.4: evaluations.
    pub(crate) evaluations: [f64; 4],
    /// Table 5.5: seconds of reduced AA with interval optimisation over those of speculative sphere tracing.
    pub(crate) slower: f64,
}

impl Thesis {
    /// A row's numbers.
    pub(crate) fn new(row: &Row) -> Self {
        Self {
            steps: row.steps,
            evaluations: row.evaluations,
            slower: row.seconds[3] / row.tracing[1],
        }
    }
}

/// All tables.
#[derive(Serialize, Debug)]
pub(crate) struct Tables {
    /// Pixels along a side of the sampled image.
    pub(crate) side: u32,
    /// ε, metres.
    pub(crate) epsilon: f64,
    /// Per noise.
    pub(crate) noises: Vec<Measured>,
    /// Noises of the thesis's tables that are left out, and why.
    pub(crate) left_out: Vec<String>,
}

/// A ratio as the tables print it.
fn ratio(a: f64, b: f64) -> String {
    format!("{:.3}", a / b)
}

fn number(value: f64) -> String {
    format!("{value:.2}")
}

impl Measured {
    /// Table 5.1.
    fn tracing(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Table 5.1, {} noise: steps per ray (η = {})",
            self.noise,
            super::thesis::OVERSHOOT
        )?;
        let mut table = columns([
            "λ",
            "sphere",
            "speculative",
            "back",
            "ratio",
            "thesis",
            "",
            "",
            "ratio",
        ]);
        for (i, pair) in self.tracing.chunks_exact(2).enumerate() {
            let [plain, speculative] = [&pair[0], &pair[1]];
            let [p, s, b] = self.thesis.steps;
            let mut cells = vec![
                plain.lipschitz.map(number).unwrap_or_default(),
                number(plain.steps),
                number(speculative.steps),
                number(speculative.backtracks),
                ratio(plain.steps, speculative.steps),
            ];
            if i == 0 {
                cells.extend([number(p), number(s), number(b), ratio(p, s)]);
            } else {
                cells.push("(a bound; no row)".to_owned());
            }
            table.add_row(cells);
        }
        writeln!(out, "{table}\n")
    }

    /// Tables 5.2 to 5.4.
    fn casting(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Tables 5.2 to 5.4, {} noise: evaluations per ray, and over those of reduced AA",
            self.noise
        )?;
        let mut table = columns([
            "method",
            "evaluations",
            "ratio",
            "thesis",
            "ratio",
            "µs per ray",
        ]);
        let reduced = self
            .casting
            .get(2)
            .map_or(f64::NAN, |count| count.evaluations);
        for (i, count) in self.casting.iter().enumerate() {
            let (theirs, their_ratio) = match self.thesis.evaluations.get(i) {
                Some(value) => (number(*value), ratio(*value, self.thesis.evaluations[2])),
                None => ("slower than without".to_owned(), String::new()),
            };
            table.add_row([
                count.method.to_owned(),
                number(count.evaluations),
                ratio(count.evaluations, reduced),
                theirs,
                their_ratio,
                number(count.microseconds),
            ]);
        }
        writeln!(out, "{table}\n")
    }

    /// Table 5.5.
    fn slower(&self, out: &mut dyn Write) -> io::Result<()> {
        let (Some(guaranteed), Some(speculative)) = (self.casting.get(3), self.tracing.last())
        else {
            return Ok(());
        };
        writeln!(
            out,
            "Table 5.5, {} noise: reduced AA with interval optimisation takes {} times as long as speculative sphere tracing with λ = {} (thesis: {})\n",
            self.noise,
            ratio(guaranteed.microseconds, speculative.microseconds),
            speculative.lipschitz.map(number).unwrap_or_default(),
            number(self.thesis.slower),
        )
    }

    fn sensitivity(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "Sensitivity to ε, {} noise", self.noise)?;
        let mut table = columns(["ε", "method", "evaluations", "steps", "hits"]);
        for count in &self.sensitivity {
            table.add_row([
                format!("{:.0e}", count.epsilon),
                count.method.to_owned(),
                number(count.evaluations),
                number(count.steps),
                format!("{} of {}", count.hits, count.rays),
            ]);
        }
        writeln!(out, "{table}\n")
    }
}

impl Report for Tables {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Thesis §5.2.3 and §5.4.3: eq. (5.11) by parallel rays, {0}×{0} of its pixels, ε = {1:.0e} m. Averages are over the rays that meet the bounding sphere.\n",
            self.side, self.epsilon
        )?;
        for noise in &self.noises {
            writeln!(out, "{}\n  ({})\n", noise.field, noise.normalisation)?;
            noise.tracing(out)?;
            noise.casting(out)?;
            noise.slower(out)?;
            noise.sensitivity(out)?;
        }
        for reason in &self.left_out {
            writeln!(out, "Left out: {reason}.")?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        for noise in &self.noises {
            for count in noise.tracing.iter().chain(&noise.casting) {
                writeln!(out, "{}", number(count.evaluations))?;
            }
        }
        Ok(())
    }
}
