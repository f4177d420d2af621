//! The table of peers.

use std::io::{self, Write};

use serde::Serialize;

use crate::output::{self, Report};

/// `bench peers`.
#[derive(Serialize)]
pub(crate) struct Peers {
    /// Turns of each row.
    pub(crate) runs: u32,
    /// Instruction set of our side.
    pub(crate) simd: String,
    /// What was compared.
    pub(crate) rows: Vec<Compared>,
    /// What was not, and why.
    pub(crate) skipped: Vec<Skipped>,
}

/// One row.
#[derive(Serialize)]
pub(crate) struct Compared {
    /// What it is called.
    pub(crate) row: &'static str,
    /// Our CPU time.
    pub(crate) ours: Times,
    /// Against whom.
    pub(crate) peer: String,
    /// The peer's CPU time.
    pub(crate) theirs: Times,
    /// How many times faster we are, by the medians.
    pub(crate) ratio: f64,
    /// How many times faster we want to be.
    pub(crate) budget: f64,
    /// Whether we are.
    pub(crate) reached: bool,
}

/// A row that was left out.
#[derive(Serialize)]
pub(crate) struct Skipped {
    /// What it is called.
    pub(crate) row: &'static str,
    /// Why.
    pub(crate) why: String,
}

/// Seconds of several runs.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub(crate) struct Times {
    /// The middle one; of an even number, the earlier of the two.
    pub(crate) median: f64,
    /// The least.
    pub(crate) least: f64,
    /// The most.
    pub(crate) most: f64,
}

impl Times {
    /// `None` of no run.
    pub(crate) fn of(mut seconds: Vec<f64>) -> Option<Self> {
        seconds.sort_by(f64::total_cmp);
        Some(Self {
            median: *seconds.get(seconds.len().checked_sub(1)? / 2)?,
            least: *seconds.first()?,
            most: *seconds.last()?,
        })
    }

    /// These times, each `factor` times as long.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self {
            median: self.median * factor,
            least: self.least * factor,
            most: self.most * factor,
        }
    }

    fn show(self) -> String {
        let unit = |seconds: f64| {
            if seconds < 1.0 {
                format!("{:.0} ms", seconds * 1e3)
            } else {
                format!("{seconds:.2} s")
            }
        };
        format!(
            "{} ({} to {})",
            unit(self.median),
            unit(self.least),
            unit(self.most)
        )
    }
}

impl Report for Peers {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = output::columns(["row", "ours", "peer", "theirs", "faster", "budget", ""]);
        for row in &self.rows {
            table.add_row([
                row.row.to_owned(),
                row.ours.show(),
                row.peer.clone(),
                row.theirs.show(),
                format!("{:.1} ×", row.ratio),
                format!("{:.1} ×", row.budget),
                if row.reached { "reached" } else { "missed" }.to_owned(),
            ]);
        }
        writeln!(out, "{table}")?;
        writeln!(
            out,
            "CPU time of one thread, median (least to most) of {} turns; ours at {}",
            self.runs, self.simd
        )?;
        for skipped in &self.skipped {
            writeln!(out, "skipped {}: {}", skipped.row, skipped.why)?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut rows = self.rows.iter();
        rows.try_for_each(|row| writeln!(out, "{} {:.2}", row.row, row.ratio))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_spreads() {
        let times = Times::of(vec![0.3, 0.1, 0.2]).unwrap();
        assert_eq!((times.median, times.least, times.most), (0.2, 0.1, 0.3));
        assert_eq!(Times::of(vec![0.4, 0.2]).unwrap().median, 0.2);
        assert_eq!(Times::of(Vec::new()), None);
        assert_eq!(times.times(10.0).show(), "2.00 s (1.00 s to 3.00 s)");
        assert_eq!(times.show(), "200 ms (100 ms to 300 ms)");
    }
}
