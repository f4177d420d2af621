//! A limit of the queue that is shorter than the work: the job is done all the same, through as many allocations as it takes.

use std::collections::BTreeSet;
use std::time::Duration;

use serde_json::Value;

use crate::engine::{Engine, Kind};
use crate::flight::Flight;
use crate::harness::scenes::{FLYBY, Reference};
use crate::harness::{Place, frames, wait};

/// How long one thread would take; no allocation may run for longer than a minute, the shortest limit of Slurm.
const WORK: Duration = Duration::from_secs(120);

/// N of the N×N rays with which it is tried how long images take: enough that what is done once weighs little.
const TRIED: u32 = 8;

/// Images of [`FLYBY`] that keep one thread busy for so long by processor time, whatever else the machine does meanwhile.
pub(crate) fn busy(time: Duration) -> Reference {
    let place = Place::new();
    let tried = format!(
        "--format exr --out tried --resolution 200x150 --rays {TRIED} --frames 0..2 --threads 1"
    );
    let tried = ["render", FLYBY].into_iter().chain(tried.split(' '));
    let mut tried = place.start("tried", tried);
    let mut took = Duration::ZERO;
    wait::until_within(wait::LONG_LIMIT, "images that are tried are there", || {
        took = took.max(tried.cpu_time());
        tried.ended()
    });
    let mut rays = TRIED;
    while took * (rays * rays) < time * (TRIED * TRIED) {
        rays += 1;
    }
    Reference::new(rays)
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_job_is_done_through_allocations_of_a_minute() {
    let Some(engine) = Engine::slurm(1) else {
        return;
    };
    let work = busy(WORK);
    let more = "max_running = 1\nahead = 0\ntime_limit = '1 min'\nidle = '5 s'";
    let flight = Flight::new(&engine, Kind::Slurm, more);
    // Each image is one tile, for which no allocation has time enough.
    let job = flight
        .farm
        .submit(&work.with(&[FLYBY, "--tile", "200x150"]));
    let done = flight.farm.wait_done_within(wait::LONG_LIMIT, job);
    frames::are_same(&flight.farm.frames(job), &work.frames);
    // Whoever ended had left in time: what it had begun was taken up where it was.
    for name in ["blocks_again", "attempts_lost"] {
        assert_eq!(done.number(name), 0, "{done:?}");
    }
    let ended = engine.slurm_tool("squeue", &["-h", "-r", "-t", "all", "-o", "%F %T"]);
    let arrays: BTreeSet<_> = ended
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert!(arrays.len() >= 2, "{ended}");
    assert!(!ended.contains("TIMEOUT"), "{ended}");
    assert_eq!(flight.site()["trouble"], Value::Null);
    flight.clean();
    flight.has_left_nothing();
}
