//! `flyby bench farm`: what the farm itself costs.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};

use crate::bench::farm::disk::Disk;
use crate::bench::farm::measure::{Bench, scheduler};
use crate::bench::farm::report::{Costs, Measured, ROWS};
use crate::error::{Ending, Error};
use crate::options::Context;
use crate::output;
use crate::progress::Progress;
use crate::stop::Stop;

/// Tiles of one pixel for each whole block: both take about as long.
const TILES_PER_BLOCK: u64 = 128;

/// Fewest and most whole blocks.
const BLOCKS: (u64, u64) = (512, 16_384);

/// Steps of the progress bar.
const STEPS: u64 = 7;

#[derive(Args, Debug)]
pub(crate) struct Options {
    /// Rows to print; what no row needs is not measured [default: all].
    #[arg(value_name = "ROW", value_parser = rows())]
    rows: Vec<String>,

    /// Tiles of the scheduler's rows and of those of one pixel; a 128th as many whole blocks.
    #[arg(long, value_name = "N", default_value_t = 1_000_000,
          value_parser = clap::value_parser!(u64).range(1_000..=10_000_000))]
    tiles: u64,

    /// Where to make the temporary folder, on the disk that is to be measured [default: the system's].
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
}

fn rows() -> PossibleValuesParser {
    ROWS.iter()
        .map(|row| PossibleValue::new(row.name))
        .collect::<Vec<_>>()
        .into()
}

/// Runs the command.
pub(crate) fn run(context: &Context, options: &Options) -> Result<Ending, Error> {
    let folder = options.folder.clone().unwrap_or_else(std::env::temp_dir);
    let folder = tempfile::Builder::new()
        .prefix("flyby-")
        .tempdir_in(&folder)
        .map_err(|error| {
            Error::failed(format!("cannot make a folder in `{}`", folder.display())).because(error)
        })?;
    let stop = Stop::on_signals()?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| Error::failed("cannot start the runtime").because(error))?;
    let bench = Bench {
        context,
        runtime: &runtime,
        stop: &stop,
        folder: folder.path(),
    };
    let blocks = (options.tiles / TILES_PER_BLOCK).clamp(BLOCKS.0, BLOCKS.1);
    let mut costs = Costs {
        tiles: options.tiles,
        blocks,
        rows: Vec::new(),
    };
    let wants = |names: &[&str]| {
        options.rows.is_empty() || options.rows.iter().any(|row| names.contains(&&**row))
    };
    let mut progress = Progress::new(context.output, STEPS, 0);
    let mut step = 0;
    let mut say = |what: &str| {
        progress.update(step, what);
        step += 1;
    };
    let mut found = Vec::new();
    if wants(&["scheduler"]) {
        say("the scheduler alone");
        found.push(("scheduler", Some(scheduler(options.tiles, &stop)?)));
    }
    let mut disk = None;
    if wants(&["disk-syncs", "disk-write", "blocks-share"]) {
        say("the disk alone");
        let measured = Disk::of(folder.path())?;
        found.push(("disk-syncs", Some(measured.syncs_per_second)));
        found.push(("disk-write", Some(measured.megabytes_per_second)));
        disk = Some(measured.megabytes_per_second);
    }
    if wants(&["blocks", "blocks-share"]) {
        say("whole blocks");
        let rate = bench.blocks(blocks)?;
        found.push(("blocks", Some(rate)));
        found.push(("blocks-share", disk.map(|disk| rate / disk)));
    }
    let of_empty = [
        "submit",
        "one-worker",
        "one-worker-cpu",
        "sixteen-workers",
        "sixteen-workers-cpu",
        "killed",
        "memory",
    ];
    if wants(&of_empty) {
        let empty = bench.empty(options.tiles, &mut say)?;
        let memory = empty.peak_bytes.map(|bytes| bytes as f64 / 1_048_576.0);
        let values = [
            Some(empty.submit),
            Some(empty.alone.tiles_per_second),
            empty.alone.cpu_us,
            Some(empty.crew.tiles_per_second),
            empty.crew.cpu_us,
            Some(empty.again as f64),
            memory,
        ];
        found.extend(of_empty.into_iter().zip(values));
    }
    if wants(&["restart"]) {
        say("a restart");
        found.push(("restart", Some(bench.restart(options.tiles)?)));
    }
    progress.finish();
    for row in ROWS.iter().filter(|row| wants(&[row.name])) {
        let value = found.iter().find(|(name, _)| *name == row.name);
        // What the system does not tell is left out.
        let value = value.and_then(|(_, value)| *value);
        costs
            .rows
            .extend(value.map(|value| Measured::new(row, value, options.tiles)));
    }
    output::print(context.output, &costs)?;
    Ok(Ending::Done)
}
