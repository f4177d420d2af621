//! Tables 5.1 to 5.5 beside the thesis's, as text and as JSON.

use std::io::{self, Write};

use serde::Serialize;

use super::cast::Count;
use super::thesis::Found;
use crate::output::{Report, columns};

/// What was measured of one noise.
#[derive(Serialize, Debug)]
pub(crate) struct Measured {
    /// The noise.
    pub(crate) noise: String,
    /// The field.
    pub(crate) field: String,
    /// η.
    pub(crate) overshoot: f64,
    /// λ_N of the pairs of `tracing`, the thesis's first.
    pub(crate) lambda: Vec<f64>,
    /// How the noise is normalised.
    pub(crate) normalisation: String,
    /// Table 5.1: sphere tracing and speculative sphere tracing with each λ_N.
    pub(crate) tracing: Vec<Count>,
    /// Sphere tracing with the bounds of each lattice cell, where it has any.
    pub(crate) cells: Vec<Count>,
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
    /// Table 5.1: seconds of both.
    pub(crate) tracing: [f64; 2],
    /// Tables 5.2 to 5.4: evaluations.
    pub(crate) evaluations: [f64; 4],
    /// The same, seconds.
    pub(crate) seconds: [f64; 4],
    /// Table 5.5: seconds of reduced AA with interval optimisation over those of speculative sphere tracing.
    pub(crate) slower: f64,
}

impl Thesis {
    /// A row's numbers.
    pub(crate) fn new(found: &Found) -> Self {
        Self {
            steps: found.steps,
            tracing: found.tracing,
            evaluations: found.evaluations,
            seconds: found.seconds,
            slower: found.seconds[3] / found.tracing[1],
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
            "Table 5.1, {} noise: steps per ray, and how many times as many and as long as without speculation (η = {})",
            self.noise, self.overshoot
        )?;
        let mut table = columns([
            "λ_N",
            "λ (5.12)",
            "sphere",
            "speculative",
            "back",
            "steps",
            "thesis",
            "time",
            "thesis",
            "hits",
        ]);
        for (i, pair) in self.tracing.chunks_exact(2).enumerate() {
            let [plain, speculative] = [&pair[0], &pair[1]];
            let [p, s, _] = self.thesis.steps;
            let [slow, fast] = self.thesis.tracing;
            let theirs = |a, b| {
                if i == 0 {
                    ratio(a, b)
                } else {
                    "(no row)".to_owned()
                }
            };
            table.add_row([
                self.lambda.get(i).copied().map(number).unwrap_or_default(),
                plain.lipschitz.map(number).unwrap_or_default(),
                number(plain.steps),
                number(speculative.steps),
                number(speculative.backtracks),
                ratio(plain.steps, speculative.steps),
                theirs(p, s),
                ratio(plain.microseconds, speculative.microseconds),
                theirs(slow, fast),
                format!("{}, {} of {}", plain.hits, speculative.hits, plain.rays),
            ]);
        }
        for count in &self.cells {
            table.add_row([count.method.to_owned(), String::new(), number(count.steps)]);
        }
        let [p, s, b] = self.thesis.steps;
        writeln!(
            out,
            "{table}\nThe thesis at λ_N = {}: {p} and {s} steps, {b} of them taken back.\n",
            self.lambda.first().copied().map(number).unwrap_or_default()
        )
    }

    /// Tables 5.2 to 5.4.
    fn casting(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Tables 5.2 to 5.4, {} noise: evaluations per ray and time, and both over those of reduced AA",
            self.noise
        )?;
        let mut table = columns([
            "method",
            "evaluations",
            "ratio",
            "thesis",
            "ratio",
            "µs per ray",
            "ratio",
            "thesis",
            "hits",
        ]);
        let reduced = self.casting.get(2);
        let of = |part: fn(&Count) -> f64| reduced.map_or(f64::NAN, part);
        for (i, count) in self.casting.iter().enumerate() {
            let (theirs, their_ratio, their_time) = match self.thesis.evaluations.get(i) {
                Some(value) => (
                    number(*value),
                    ratio(*value, self.thesis.evaluations[2]),
                    ratio(self.thesis.seconds[i], self.thesis.seconds[2]),
                ),
                None => ("(no row)".to_owned(), String::new(), String::new()),
            };
            table.add_row([
                count.method.to_owned(),
                number(count.evaluations),
                ratio(count.evaluations, of(|count| count.evaluations)),
                theirs,
                their_ratio,
                number(count.microseconds),
                ratio(count.microseconds, of(|count| count.microseconds)),
                their_time,
                format!("{} of {}", count.hits, count.rays),
            ]);
        }
        writeln!(out, "{table}\n")
    }

    /// Table 5.5, at every λ.
    fn slower(&self, out: &mut dyn Write) -> io::Result<()> {
        let Some(guaranteed) = self.casting.get(3) else {
            return Ok(());
        };
        writeln!(
            out,
            "Table 5.5, {} noise: reduced AA with interval optimisation over speculative sphere tracing (thesis, time: {})",
            self.noise,
            number(self.thesis.slower)
        )?;
        let mut table = columns(["λ_N", "time", "evaluations", "time of one evaluation"]);
        for (lambda, pair) in self.lambda.iter().zip(self.tracing.chunks_exact(2)) {
            let speculative = &pair[1];
            let each = |count: &Count| count.microseconds / count.evaluations;
            table.add_row([
                number(*lambda),
                ratio(guaranteed.microseconds, speculative.microseconds),
                ratio(guaranteed.evaluations, speculative.evaluations),
                ratio(each(guaranteed), each(speculative)),
            ]);
        }
        writeln!(out, "{table}\n")
    }

    fn sensitivity(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Sensitivity to ε, {} noise (speculative sphere tracing with λ_N = {})",
            self.noise,
            self.lambda.first().copied().map(number).unwrap_or_default()
        )?;
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
            "Thesis §5.2.3 and §5.4.3: eq. (5.11) by parallel rays, {0}×{0} of its pixels, ε = {1:.0e} m (fixed beforehand: a thousandth of a pixel). Averages are over the rays that meet the bounding sphere; times are of one thread.\n",
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
