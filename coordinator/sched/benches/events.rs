//! How many events a second the scheduler takes, and how much memory tiles in flight need: `sched::load` with 10,000
//! workers and 1,000,000 tiles. `cargo bench -p sched --bench events`
#![expect(clippy::print_stdout, reason = "a bench prints what it measured")]

use std::time::Instant;

use sched::TileShape;
use sched::load::{Load, LoadSize};

const WORKERS: u64 = 10_000;
const TILES: u64 = 1_000_000;

/// Resident memory of this process in bytes; 0 where that cannot be told.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = status
        .split(' ')
        .nth(1)
        .and_then(|pages| pages.parse().ok());
    pages.unwrap_or(0_u64) * 4_096
}

/// What this thread has had of a processor, in seconds: what else the machine does is left out.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = stat
        .split(' ')
        .next()
        .and_then(|first| first.parse::<f64>().ok());
    nanoseconds.unwrap_or(f64::NAN) / 1e9
}

fn run(name: &str, tiles: TileShape, count: u64) {
    let before = resident();
    let size = LoadSize {
        workers: WORKERS,
        squares: count,
    };
    let mut load = Load::new(tiles, size);
    let mut peak = 0;
    let start = (Instant::now(), cpu_seconds());
    while load.step() {
        if load.tiles().is_multiple_of(10_000) {
            peak = peak.max(resident());
        }
    }
    let took = start.0.elapsed();
    let cpu = cpu_seconds() - start.1;
    assert!(load.is_done());
    let rate = load.events() as f64 / cpu;
    let bytes = peak.saturating_sub(before);
    println!(
        "events/{name}: {} tiles, {} events in {cpu:.2} s of one processor ({took:.2?}): {rate:.0} events/s; {} MiB in all, {} bytes per tile",
        load.tiles(),
        load.events(),
        bytes >> 20,
        bytes / count,
    );
}

fn main() {
    let size = TileShape::Size {
        width: 32,
        height: 32,
    };
    let count = std::env::var("TILES")
        .ok()
        .and_then(|count| count.parse().ok());
    let count = count.unwrap_or(TILES);
    run("size", size, count);
    run("time", TileShape::Time { aim: None }, count);
}
