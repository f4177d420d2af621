//! `flyby bench peers`: this renderer beside other programs on the same surfaces.

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use render::SimdLevel;

use crate::bench::peers::limit::Limit;
use crate::bench::peers::pairs::{Pair, Place};
use crate::bench::peers::povray;
use crate::bench::peers::report::{Compared, Peers, Skipped, Times};
use crate::bench::peers::rows::{ROWS, Row, SPHERE, TERRAIN, TERRAIN_SHADOWS};
use crate::error::{Ending, Error};
use crate::options::Context;
use crate::output;
use crate::progress::Progress;
use crate::stop::Stop;

#[derive(Args, Debug)]
pub(crate) struct Options {
    /// Rows to measure [default: all].
    #[arg(value_name = "ROW", value_parser = rows())]
    rows: Vec<String>,

    /// Measure the rows whose names begin so, besides those named.
    #[arg(long, value_name = "PREFIX")]
    only: Vec<String>,

    /// Turns of both sides; the median counts.
    #[arg(long, value_name = "N", default_value_t = 3,
          value_parser = clap::value_parser!(u32).range(1..=1_000))]
    runs: u32,

    /// Rays along a side where single methods are timed; four times as many where the renderer is timed beside one.
    #[arg(long, value_name = "N", default_value_t = 32,
          value_parser = clap::value_parser!(u32).range(8..=800))]
    side: u32,
}

fn rows() -> PossibleValuesParser {
    ROWS.iter()
        .map(|row| PossibleValue::new(row.name))
        .collect::<Vec<_>>()
        .into()
}

impl Options {
    fn chosen(&self) -> Vec<&'static Row> {
        let all = self.rows.is_empty() && self.only.is_empty();
        let named = |row: &Row| self.rows.iter().any(|name| name == row.name);
        let begun = |row: &Row| self.only.iter().any(|prefix| row.name.starts_with(prefix));
        ROWS.iter()
            .filter(|row| all || named(row) || begun(row))
            .collect()
    }
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Options) -> Result<Ending, Error> {
    let chosen = options.chosen();
    if chosen.is_empty() {
        let names: Vec<_> = ROWS.iter().map(|row| row.name).collect();
        return Err(Error::usage("no row's name begins so")
            .next(format!("the rows are {}", names.join(", "))));
    }
    let folder = tempfile::tempdir()
        .map_err(|error| Error::failed("cannot make a folder for the scenes").because(error))?;
    let place = Place {
        folder: folder.path(),
        has_povray: povray::is_there(),
        side: options.side,
    };
    let stop = Stop::on_signals()?;
    let mut progress = Progress::new(context.output, chosen.len() as u64, 0);
    let mut peers = Peers {
        runs: options.runs,
        simd: SimdLevel::best().to_string(),
        rows: Vec::new(),
        skipped: Vec::new(),
        limits: Vec::new(),
    };
    'rows: for (number, row) in (0..).zip(&chosen) {
        progress.update(number, row.name);
        match place.pairs(row) {
            Err(why) => peers.skipped.push(Skipped { row: row.name, why }),
            Ok(pairs) => {
                for mut pair in pairs {
                    match compared(&mut pair, options.runs, &stop)? {
                        Some(row) => peers.rows.push(row),
                        None => break 'rows,
                    }
                }
            }
        }
    }
    // What bounds us is worth its time only where all of the table is wanted.
    if chosen.len() == ROWS.len() && !stop.is_set() {
        for (name, scene) in [
            ("sphere-3", SPHERE),
            ("terrain", TERRAIN),
            ("terrain-shadows", TERRAIN_SHADOWS),
        ] {
            peers.limits.push(Limit::of(name, scene, folder.path())?);
        }
    }
    progress.finish();
    // Also what was measured before it was stopped.
    output::print(context.output, &peers)?;
    if stop.is_set() {
        return Err(Error::interrupted("the measurement was stopped"));
    }
    Ok(Ending::Done)
}

/// Both sides, in turns; `None` if it was stopped before the last one.
fn compared(pair: &mut Pair<'_>, runs: u32, stop: &Stop) -> Result<Option<Compared>, Error> {
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        if stop.is_set() {
            return Ok(None);
        }
        ours.push((pair.ours.turn)()?);
        theirs.push((pair.theirs.turn)()?);
    }
    let times = Times::of(ours).zip(Times::of(theirs));
    Ok(times.map(|(ours, theirs)| Compared::new(pair, ours, theirs)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::peers::pairs::Side;
    use crate::bench::peers::rows::{Budget, What};

    #[test]
    fn every_row_without_a_peer_of_its_own_is_made_ready() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place {
            folder: folder.path(),
            has_povray: true,
            side: 8,
        };
        for row in ROWS {
            let is_crate = matches!(row.what, What::Fidget { .. } | What::Noise { .. });
            let is_absent = matches!(row.what, What::Absent { .. });
            let ready = !is_absent && (cfg!(feature = "peers") || !is_crate);
            if matches!(row.what, What::Absent { ours: Some(_), .. }) {
                // Renders for its rate; tests/cli does that.
                continue;
            }
            match place.pairs(row) {
                Ok(pairs) => assert!(ready && !pairs.is_empty(), "{}", row.name),
                Err(why) => assert!(!ready && !why.is_empty(), "{}: {why}", row.name),
            }
        }
    }

    #[test]
    fn sides_take_turns() {
        let order = std::cell::RefCell::new(Vec::new());
        let side = |name: &'static str, seconds: f64| Side {
            called: name.to_owned(),
            turn: Box::new({
                let order = &order;
                move || {
                    order.borrow_mut().push(name);
                    Ok(seconds)
                }
            }),
            amount: None,
        };
        let mut pair = Pair {
            name: "row".to_owned(),
            ours: side("a", 2.0),
            theirs: side("b", 3.0),
            budget: Budget::Open,
        };
        let stop = Stop::on_signals().unwrap();
        let result = compared(&mut pair, 2, &stop).unwrap().unwrap();
        assert_eq!(result.ratio, 1.5);
        drop(pair);
        assert_eq!(order.into_inner(), ["a", "b", "a", "b"]);
    }
}
