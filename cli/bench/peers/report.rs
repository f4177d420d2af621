//! The table of peers.

use std::io::{self, Write};

use serde::Serialize;

use super::limit::Limit;
use super::pairs::{Pair, Side};
use super::rows::Budget;
use crate::output::{self, Report};
use crate::progress::amount;

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
    /// What our time is spent on.
    pub(crate) limits: Vec<Limit>,
}

/// One row.
#[derive(Serialize, Debug)]
pub(crate) struct Compared {
    /// What it is called.
    pub(crate) row: String,
    /// Our CPU time.
    pub(crate) ours: Times,
    /// What our side is called.
    pub(crate) side: String,
    /// How much our side does in a second, where that is told.
    pub(crate) ours_per_second: Option<f64>,
    /// Against whom.
    pub(crate) peer: String,
    /// The peer's CPU time.
    pub(crate) theirs: Times,
    /// How much the peer does in a second.
    pub(crate) theirs_per_second: Option<f64>,
    /// Of what so much is done.
    pub(crate) unit: Option<&'static str>,
    /// How many times faster we are, by the medians; where the budget is a cost, how many times as long we take.
    pub(crate) ratio: f64,
    /// Which way the ratio is to go.
    pub(crate) wanted: Wanted,
    /// The ratio wanted.
    pub(crate) budget: Option<f64>,
    /// What to aim for beyond it.
    pub(crate) aim: Option<f64>,
    /// Whether the budget is kept.
    pub(crate) reached: Option<bool>,
}

/// Which way a ratio is to go.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Wanted {
    /// The peer's time over ours is at least the budget.
    AtLeast,
    /// Our time over the peer's is at most the budget.
    AtMost,
    /// The peer's time over ours, without a budget.
    Open,
}

impl Compared {
    /// A pair that was timed.
    pub(crate) fn new(pair: &Pair<'_>, ours: Times, theirs: Times) -> Self {
        let faster = theirs.median / ours.median;
        let (wanted, ratio, budget, aim) = match pair.budget {
            Budget::Faster(budget) => (Wanted::AtLeast, faster, Some(budget), None),
            Budget::Costs { most, aim } => (Wanted::AtMost, 1.0 / faster, Some(most), aim),
            Budget::Open => (Wanted::Open, faster, None, None),
        };
        let rate =
            |side: &Side<'_>, times: Times| side.amount.map(|amount| amount.count / times.median);
        Self {
            row: pair.name.clone(),
            ours,
            side: pair.ours.called.clone(),
            ours_per_second: rate(&pair.ours, ours),
            peer: pair.theirs.called.clone(),
            theirs,
            theirs_per_second: rate(&pair.theirs, theirs),
            unit: pair.ours.amount.map(|amount| amount.of),
            ratio,
            wanted,
            budget,
            aim,
            reached: budget.map(|budget| match wanted {
                Wanted::AtMost => ratio <= budget,
                Wanted::AtLeast | Wanted::Open => ratio >= budget,
            }),
        }
    }

    fn budget(&self) -> String {
        let aim = self.aim.map(|aim| format!(", aim {aim:.1}"));
        match self.budget {
            None => String::new(),
            Some(budget) => {
                let sign = match self.wanted {
                    Wanted::AtMost => "≤",
                    Wanted::AtLeast | Wanted::Open => "≥",
                };
                format!("{sign} {budget:.1}{}", aim.unwrap_or_default())
            }
        }
    }

    fn rate(&self) -> String {
        let Some((rate, unit)) = self.ours_per_second.zip(self.unit) else {
            return String::new();
        };
        format!("{} {unit}/s", amount(rate))
    }
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

    fn show(self) -> String {
        let unit = |seconds: f64| {
            if seconds < 1e-3 {
                format!("{:.1} µs", seconds * 1e6)
            } else if seconds < 1.0 {
                format!("{:.1} ms", seconds * 1e3)
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
        let mut table = output::columns([
            "row", "ours", "rate", "peer", "theirs", "ratio", "budget", "",
        ]);
        for row in &self.rows {
            table.add_row([
                row.row.clone(),
                row.ours.show(),
                row.rate(),
                row.peer.clone(),
                row.theirs.show(),
                format!("{:.2}", row.ratio),
                row.budget(),
                match row.reached {
                    Some(true) => "met",
                    Some(false) => "missed",
                    None => "",
                }
                .to_owned(),
            ]);
        }
        writeln!(out, "{table}")?;
        writeln!(
            out,
            "CPU time of one thread, median (least to most) of {} turns; ours at {}. A ratio that is to be at most \
             something is our time over the peer's, any other the peer's over ours.",
            self.runs, self.simd
        )?;
        for limit in &self.limits {
            writeln!(out, "{}", limit.show())?;
        }
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
    use crate::bench::peers::pairs::Amount;

    #[test]
    fn medians_and_spreads() {
        let times = Times::of(vec![0.3, 0.1, 0.2]).unwrap();
        assert_eq!((times.median, times.least, times.most), (0.2, 0.1, 0.3));
        assert_eq!(Times::of(vec![0.4, 0.2]).unwrap().median, 0.2);
        assert_eq!(Times::of(Vec::new()), None);
        assert_eq!(times.show(), "200.0 ms (100.0 ms to 300.0 ms)");
        assert_eq!(
            Times::of(vec![5e-6]).unwrap().show(),
            "5.0 µs (5.0 µs to 5.0 µs)"
        );
    }

    fn compared(budget: Budget, ours: f64, theirs: f64) -> Compared {
        let side = |called: &str, count: f64| Side {
            called: called.to_owned(),
            turn: Box::new(|| Ok(0.0)),
            amount: Some(Amount { count, of: "rays" }),
        };
        let pair = Pair {
            name: "row".to_owned(),
            ours: side("flyby", 2e6),
            theirs: side("peer", 1e6),
            budget,
        };
        let times = |seconds: f64| Times::of(vec![seconds]).unwrap();
        Compared::new(&pair, times(ours), times(theirs))
    }

    #[test]
    fn budgets_are_judged_in_their_own_direction() {
        let faster = compared(Budget::Faster(4.0), 2.0, 10.0);
        assert_eq!((faster.ratio, faster.reached), (5.0, Some(true)));
        assert_eq!(
            compared(Budget::Faster(6.0), 2.0, 10.0).reached,
            Some(false)
        );
        let budget = Budget::Costs {
            most: 25.0,
            aim: Some(12.0),
        };
        let cost = compared(budget, 10.0, 0.5);
        assert_eq!((cost.ratio, cost.reached), (20.0, Some(true)));
        assert_eq!(cost.budget(), "≤ 25.0, aim 12.0");
        assert_eq!(compared(budget, 10.0, 0.25).reached, Some(false));
        let open = compared(Budget::Open, 2.0, 1.0);
        assert_eq!((open.ratio, open.reached), (0.5, None));
        assert_eq!(open.rate(), "1.00 M rays/s");
    }

    #[test]
    fn a_table_says_what_was_kept_what_was_missed_and_what_was_left_out() {
        let peers = Peers {
            runs: 1,
            simd: "scalar".to_owned(),
            rows: vec![
                compared(Budget::Faster(4.0), 2.0, 10.0),
                compared(Budget::Faster(6.0), 2.0, 10.0),
            ],
            skipped: vec![Skipped {
                row: "other",
                why: "it is not here".to_owned(),
            }],
            limits: Vec::new(),
        };
        let mut out = Vec::new();
        peers.table(&mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        for part in [
            "met",
            "missed",
            "≥ 6.0",
            "5.00",
            "skipped other: it is not here",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let json = serde_json::to_value(&peers).unwrap();
        assert_eq!(json["rows"][1]["wanted"], "at_least");
        assert_eq!(json["rows"][1]["reached"], false);
    }
}
