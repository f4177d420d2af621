//! A limit of the queue that is shorter than the work: the job is done all the same, through as many allocations as it takes.

use std::collections::BTreeSet;
use std::time::Duration;

use serde_json::Value;

use crate::engine::{Engine, Kind};
use crate::flight::Flight;
use crate::harness::scenes::{FLYBY, lasting};
use crate::harness::{frames, wait};

/// How long one thread would take; no allocation may run for longer than a minute, the shortest limit of Slurm.
const WORK: Duration = Duration::from_secs(120);

#[test]
#[ignore = "long: tests/run --all"]
fn a_job_is_done_through_allocations_of_a_minute() {
    let Some(engine) = Engine::slurm(1) else {
        return;
    };
    let work = lasting(WORK);
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
