//! The rows of `bench farm`.

use std::io::{self, Write};

use serde::Serialize;

use crate::output::{Report, columns};
use crate::progress::amount;

/// A row as it is known before anything is measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// What it is called.
    pub(crate) name: &'static str,
    /// What is counted.
    pub(crate) unit: &'static str,
    /// What is wanted of it.
    pub(crate) wanted: Wanted,
    /// Whether the budget is meant for [`JUDGED_TILES`] tiles or more.
    pub(crate) is_by_size: bool,
    /// What HyperQueue's authors publish.
    pub(crate) hyperqueue: Option<&'static str>,
}

/// What is wanted of a row.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Wanted {
    /// At least so much.
    AtLeast(f64),
    /// At most so much.
    AtMost(f64),
    /// It stands beside others.
    Open,
}

/// Tiles for which budgets that depend on their number are meant.
pub(crate) const JUDGED_TILES: u64 = 1_000_000;

const fn row(name: &'static str, unit: &'static str, wanted: Wanted) -> Row {
    Row {
        name,
        unit,
        wanted,
        is_by_size: false,
        hyperqueue: None,
    }
}

impl Row {
    const fn by_size(self) -> Self {
        Self {
            is_by_size: true,
            ..self
        }
    }

    const fn beside(self, hyperqueue: &'static str) -> Self {
        Self {
            hyperqueue: Some(hyperqueue),
            ..self
        }
    }
}

/// All rows, in the order in which they are printed.
pub(crate) const ROWS: [Row; 13] = [
    row("scheduler", "events/s", Wanted::AtLeast(1e6)),
    row("disk-syncs", "syncs/s", Wanted::Open),
    row("submit", "s", Wanted::AtMost(1.0)).by_size(),
    row("one-worker", "tiles/s", Wanted::AtLeast(20_000.0)).beside("930 tasks/s"),
    row("one-worker-cpu", "µs/tile", Wanted::Open).beside("23 µs/task"),
    row("sixteen-workers", "tiles/s", Wanted::AtLeast(20_000.0))
        .beside("11,300 tasks/s; 30,000 with 128 cpus each"),
    row("sixteen-workers-cpu", "µs/tile", Wanted::Open).beside("23 µs/task"),
    row("killed", "tiles again", Wanted::AtMost(0.0)).beside("116 to 138 tasks again"),
    row("restart", "s", Wanted::AtMost(1.0))
        .by_size()
        .beside("0.1 s"),
    row("memory", "MiB", Wanted::AtMost(200.0)).by_size(),
    row("disk-write", "MB/s", Wanted::Open),
    row("blocks", "MB/s", Wanted::Open),
    row("blocks-share", "of disk-write", Wanted::AtLeast(0.7)),
];

/// `bench farm`.
#[derive(Serialize, Debug)]
pub(crate) struct Costs {
    /// Tiles.
    pub(crate) tiles: u64,
    /// Blocks of the rows of whole blocks.
    pub(crate) blocks: u64,
    /// What was measured.
    pub(crate) rows: Vec<Measured>,
}

/// A row that was measured.
#[derive(Serialize, Debug)]
pub(crate) struct Measured {
    /// What it is called.
    pub(crate) row: &'static str,
    /// How much.
    pub(crate) value: f64,
    /// Of what.
    pub(crate) unit: &'static str,
    /// At least so much is wanted.
    pub(crate) at_least: Option<f64>,
    /// At most so much is wanted.
    pub(crate) at_most: Option<f64>,
    /// Whether that is so; null where nothing is wanted or too few tiles were rendered to say.
    pub(crate) reached: Option<bool>,
    /// What HyperQueue's authors publish of the like, measured elsewhere.
    pub(crate) hyperqueue: Option<&'static str>,
}

impl Measured {
    /// A row with what was measured of it, of a job of so many tiles.
    pub(crate) fn new(row: &Row, value: f64, tiles: u64) -> Self {
        let (at_least, at_most) = match row.wanted {
            Wanted::AtLeast(least) => (Some(least), None),
            Wanted::AtMost(most) => (None, Some(most)),
            Wanted::Open => (None, None),
        };
        let is_judged = !row.is_by_size || tiles >= JUDGED_TILES;
        let reached = match row.wanted {
            Wanted::AtLeast(least) => Some(value >= least),
            Wanted::AtMost(most) => Some(value <= most),
            Wanted::Open => None,
        };
        Self {
            row: row.name,
            value,
            unit: row.unit,
            at_least,
            at_most,
            reached: reached.filter(|_| is_judged),
            hyperqueue: row.hyperqueue,
        }
    }

    fn budget(&self) -> String {
        match (self.at_least, self.at_most) {
            (Some(least), _) => format!("≥ {}", number(least)),
            (None, Some(most)) => format!("≤ {}", number(most)),
            (None, None) => String::new(),
        }
    }
}

fn number(value: f64) -> String {
    match value {
        0.0 => "0".to_owned(),
        small if small < 1_000.0 => format!("{small:.2}"),
        large => amount(large),
    }
}

impl Report for Costs {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = columns(["row", "measured", "budget", "", "HyperQueue"]);
        for row in &self.rows {
            table.add_row([
                row.row.to_owned(),
                format!("{} {}", number(row.value), row.unit),
                row.budget(),
                match row.reached {
                    Some(true) => "met",
                    Some(false) => "missed",
                    None if row.at_least.or(row.at_most).is_some() => "too few tiles",
                    None => "",
                }
                .to_owned(),
                row.hyperqueue.unwrap_or_default().to_owned(),
            ]);
        }
        writeln!(out, "{table}")?;
        writeln!(
            out,
            "{} tiles of one pixel, which is a block of 32 bytes, the least that the protocol takes; {} blocks of 32×32 \
             pixels. All is synced before it counts. The renderer paints nothing; its workers, of two threads each, share \
             the machine with the coordinator. HyperQueue's figures are its authors', on other machines.",
            self.tiles, self.blocks
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut rows = self.rows.iter();
        rows.try_for_each(|row| writeln!(out, "{} {:.3}", row.row, row.value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_judged_in_their_own_direction_and_at_their_own_size() {
        let find = |name: &str| ROWS.iter().find(|row| row.name == name).unwrap();
        let reached = |name, value, tiles| Measured::new(find(name), value, tiles).reached;
        assert_eq!(reached("scheduler", 2e6, 10), Some(true));
        assert_eq!(reached("scheduler", 9e5, 10), Some(false));
        assert_eq!(reached("killed", 0.0, 10), Some(true));
        assert_eq!(reached("killed", 1.0, 10), Some(false));
        assert_eq!(reached("memory", 100.0, 10), None);
        assert_eq!(reached("memory", 300.0, JUDGED_TILES), Some(false));
        assert_eq!(reached("disk-syncs", 300.0, JUDGED_TILES), None);
    }

    #[test]
    fn a_table_says_what_was_kept_and_what_was_missed() {
        let row = |number: usize, value| Measured::new(&ROWS[number], value, 10);
        let costs = Costs {
            tiles: 10,
            blocks: 5,
            rows: vec![row(0, 2e6), row(2, 0.5), row(3, 930.0)],
        };
        let mut out = Vec::new();
        costs.table(&mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        for part in [
            "met",
            "missed",
            "too few tiles",
            "≥ 1.00 M",
            "≤ 1.00",
            "930 tasks/s",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
