//! Pilot mode on real engines: a coordinator that submits its own workers.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;

use serde_json::Value;

use crate::engine::{Engine, Kind};
use crate::flight::{Flight, renders_the_same};
use crate::harness::scenes::{ENDLESS, FLYBY, TINY, slow};
use crate::harness::{Place, wait};

/// What the queue shows of anybody's, a line for each task.
fn queue(engine: &Engine, options: &[&str]) -> Vec<String> {
    let words = [&["-h", "-r", "-o", "%F_%K %T %j"][..], options].concat();
    let said = engine.slurm_tool("squeue", &words);
    said.lines().map(str::to_owned).collect()
}

#[test]
#[ignore = "long: tests/run --all"]
fn slurm_gives_the_frames_of_one_process() {
    let Some(engine) = Engine::slurm(2) else {
        return;
    };
    let flight = Flight::new(&engine, Kind::Slurm, "idle = '3 s'");
    renders_the_same(&flight);
    assert!(queue(&engine, &[]).is_empty());
    // Who had nothing to do had left by itself, and nobody wants another.
    wait::until("no allocation is wanted", || {
        (flight.count("wanted") == 0).then_some(())
    });
}

#[test]
#[ignore = "long: tests/run --all"]
fn grid_engine_gives_the_frames_of_one_process() {
    let Some(mut engine) = Engine::gridengine(2, &[]) else {
        return;
    };
    if !engine.add_ssh() {
        return;
    }
    // Its hosts have networks of their own: a tunnel to each brings its workers to the coordinator's loopback.
    let more = "coordinator = '127.0.0.1:9000'\nmode = 'pilot'\nidle = '3 s'";
    let flight = Flight::new(&engine, Kind::GridEngine, more);
    let config = engine.folder.join("ssh/config").display().to_string();
    let there = format!("127.0.0.1:9000:{}", flight.farm.address);
    let _tunnels = ["ge1", "ge2"].map(|host| {
        let mut tunnel = std::process::Command::new("ssh");
        tunnel.args(["-F", &config, "-N", "-R", &there, host]);
        flight.farm.place.start_command("tunnel", tunnel)
    });
    renders_the_same(&flight);
    assert!(!engine.tool("qstat", &["-u", "*"]).contains("flyby-"));
}

#[test]
#[ignore = "long: tests/run --all"]
fn grid_engine_s_hosts_join_over_tls() {
    let Some(engine) = Engine::gridengine(2, &[]) else {
        return;
    };
    let flight = Flight::over_tls(&engine, Kind::GridEngine, "mode = 'pilot'\nidle = '3 s'");
    renders_the_same(&flight);
    let tokens = flight
        .farm
        .flyby(["token", "list", "--output", "json"])
        .json();
    // One token for all of them.
    assert_eq!(
        tokens["tokens"].as_array().map(Vec::len),
        Some(1),
        "{tokens}"
    );
    assert!(tokens["tokens"][0]["used"].as_u64() > Some(0), "{tokens}");
}

#[test]
#[ignore = "long: tests/run --all"]
fn hosts_without_a_queue_give_the_frames_of_one_process() {
    let Some(engine) = Engine::ssh() else {
        return;
    };
    for kind in [Kind::Ssh, Kind::Local] {
        let flight = Flight::new(&engine, kind, "max_running = 2");
        renders_the_same(&flight);
    }
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_job_outlives_the_time_limit_of_its_allocations() {
    let Some(engine) = Engine::slurm(1) else {
        return;
    };
    let flight = Flight::new(
        &engine,
        Kind::Slurm,
        "max_running = 1\ntime_limit = '1 min'",
    );
    // As long as it takes until a second allocation was needed.
    let resolution = ["--resolution", "200x150", "--rays", "4"];
    let job = flight
        .farm
        .submit(&[&[FLYBY, "--frames", "0..500"], &resolution[..]].concat());
    let arrays = || {
        let all = queue(&engine, &["-t", "all"]);
        let mut arrays: Vec<_> = all
            .iter()
            .filter_map(|line| line.split('_').next())
            .map(str::to_owned)
            .collect();
        arrays.dedup();
        arrays.len()
    };
    wait::until("a second allocation is there", || {
        (arrays() >= 2).then_some(())
    });
    let before = flight.farm.job(job).number("blocks_done");
    flight.farm.wait_acknowledged(job, before + 1);
    // The first one left in time: nothing was lost with it.
    let now = flight.farm.job(job);
    assert_eq!(now.number("attempts_lost"), 0, "{now:?}");
    assert_eq!(now.number("blocks_again"), 0, "{now:?}");
    let timeouts = queue(&engine, &["-t", "TIMEOUT"]);
    assert!(timeouts.is_empty(), "{timeouts:?}");
    assert_eq!(flight.site()["trouble"], Value::Null);

    // Nobody needs it any more: what waits is deleted, what runs leaves.
    flight.farm.flyby(["job", "cancel", &job.to_string()]).ok();
    flight.clean();
    flight.has_left_nothing();
    assert!(queue(&engine, &[]).is_empty());
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_job_outlives_a_node_and_a_scancel_from_outside() {
    let Some(engine) = Engine::slurm(2) else {
        return;
    };
    let flight = Flight::new(&engine, Kind::Slurm, "max_running = 4\nidle = '30 s'");
    let job = flight.farm.submit(&slow().with(&[FLYBY]));
    flight.farm.wait_acknowledged(job, 1);
    engine.tool("slurm-node", &["kill", "n2"]);
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);

    let job = flight.farm.submit(&slow().with(&[FLYBY]));
    flight.farm.wait_acknowledged(job, 1);
    engine.slurm_tool("scancel", &["--user=root"]);
    flight.wait_trouble(&["somebody deleted allocation", "another takes its place"]);
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
}

#[test]
#[ignore = "long: tests/run --all"]
fn what_was_deleted_stays_deleted_where_the_site_says_so() {
    let Some(engine) = Engine::slurm(1) else {
        return;
    };
    let more = "max_running = 1\ncancelled = 'stop'";
    let flight = Flight::new(&engine, Kind::Slurm, more);
    let job = flight.farm.submit(&ENDLESS);
    flight.farm.wait_acknowledged(job, 1);
    engine.slurm_tool("scancel", &["--user=root"]);
    flight.wait_trouble(&["somebody deleted allocation", "cancelled = \"stop\""]);
    wait::until("the job says why it waits", || {
        let why = flight.farm.flyby(["job", "why", &job.to_string()]).ok();
        why.contains("somebody deleted allocation").then_some(())
    });
    assert!(queue(&engine, &[]).is_empty());
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_coordinator_that_was_killed_finds_its_allocations_and_leaves_no_orphan() {
    let Some(engine) = Engine::slurm(2) else {
        return;
    };
    let mut flight = Flight::new(&engine, Kind::Slurm, "max_running = 2");
    let job = flight.farm.submit(&ENDLESS);
    flight.farm.wait_acknowledged(job, 1);
    let before = queue(&engine, &["-t", "all"]);
    assert_eq!(before.len(), 2, "{before:?}");
    flight.farm.coordinator.kill();
    flight.farm.start_again();
    wait::until("the queue was asked again", || {
        (flight.site()["asked_unix_ms"].as_u64().is_some() && flight.count("running") == 2)
            .then_some(())
    });
    let done = flight.farm.job(job).number("blocks_done");
    flight.farm.wait_acknowledged(job, done + 1);
    assert_eq!(
        queue(&engine, &["-t", "all"]),
        before,
        "nothing was submitted twice"
    );

    flight.farm.coordinator.kill();
    flight.clean();
    assert!(queue(&engine, &[]).is_empty());
    flight.has_left_nothing();
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_refusal_is_said_as_the_queue_said_it() {
    let Some(engine) = Engine::slurm(1) else {
        return;
    };
    let flight = Flight::new(&engine, Kind::Slurm, "queue = 'nope'");
    let job = flight
        .farm
        .submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
    flight.wait_trouble(&["invalid partition specified: nope", "site's `queue`"]);
    let why = flight.farm.flyby(["job", "why", &job.to_string()]).ok();
    assert!(why.contains("invalid partition specified: nope"), "{why}");
    let status = flight.farm.flyby(["farm", "status"]).ok();
    assert!(
        status.contains("invalid partition specified: nope"),
        "{status}"
    );
}

#[test]
#[ignore = "long: tests/run --all"]
fn an_allocation_that_fails_says_why() {
    let Some(engine) = Engine::slurm(1) else {
        return;
    };
    // A program that ends at once.
    let broken = Place::new();
    let program = broken.write(
        "flyby",
        format!(
            "#!/bin/sh\n[ \"$1\" != version ] || exec {} \"$@\"\necho 'the moon is wrong' >&2\nexit 3\n",
            env!("CARGO_BIN_EXE_flyby")
        ),
    );
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    let program = program.display().to_string();
    let flight = Flight::with_program(&engine, Kind::Slurm, &program, "max_running = 1");
    flight
        .farm
        .submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
    flight.wait_trouble(&["failed: FAILED (NonZeroExitCode)", "the moon is wrong"]);
}
