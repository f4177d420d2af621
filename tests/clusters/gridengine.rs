//! What Grid Engine does to a farm: limits of its own, and a host that loses its power with tasks that it never gives up.

use std::collections::BTreeMap;
use std::fs;

use crate::engine::{Engine, Kind};
use crate::flight::Flight;
use crate::harness::scenes::{FLYBY, lasting, small};
use crate::harness::{frames, wait};

/// Most tasks of an array that the queue takes: fewer than an image has tiles by [`SMALL_TILES`].
const TASKS_MAX: usize = 6;

/// The squarest cut of an image of 200×150 pixels into so few: 100×75.
const SQUAREST: usize = 4;

/// In poll mode an image of [`small`] is twelve tiles by this alone.
const SMALL_TILES: &str = "mode = 'poll'\nmin_tile_pixels = 2500\nmax_array_size = 1000";

/// Sets the largest array that the queue takes.
fn limit_arrays(engine: &Engine, tasks: usize) {
    let before = engine.tool("qconf", &["-sconf"]);
    let lines = before
        .lines()
        .map(|line| match line.starts_with("max_aj_tasks") {
            true => format!("max_aj_tasks {tasks}\n"),
            false => format!("{line}\n"),
        });
    // Named like the configuration that it is.
    let file = engine.folder.join("global");
    fs::write(&file, lines.collect::<String>()).unwrap();
    engine.tool("qconf", &["-Mconf", file.to_str().unwrap()]);
}

/// How many tasks each array of ours had, by the queue's own books.
fn arrays(engine: &Engine) -> BTreeMap<String, usize> {
    let books = engine.tool("qacct", &["-j"]);
    let mut arrays = BTreeMap::new();
    for line in books.lines() {
        if let Some(name) = line.strip_prefix("jobname ") {
            *arrays.entry(name.trim().to_owned()).or_insert(0) += 1;
        }
    }
    arrays
}

#[test]
#[ignore = "long: tests/run --all"]
fn an_image_is_cut_as_the_queue_s_arrays_allow_also_where_that_changes() {
    let tasks_max = TASKS_MAX.to_string();
    let Some(engine) = Engine::gridengine(2, &[("GE_MAX_AJ_TASKS", &tasks_max)]) else {
        return;
    };
    let flight = Flight::new(&engine, Kind::GridEngine, SMALL_TILES);
    let job = flight.farm.submit(&small().with(&[FLYBY]));
    flight.farm.wait_done(job);
    frames::are_same(&flight.farm.frames(job), &small().frames);
    // Its tiles were larger: an array for each image.
    wait::until("the queue has its books", || {
        let arrays = arrays(&engine);
        let sizes: Vec<_> = arrays.into_values().collect();
        (sizes == [SQUAREST, SQUAREST]).then_some(())
    });

    // The coordinator does not know of this.
    limit_arrays(&engine, 2);
    let job = flight.farm.submit(&small().with(&[FLYBY]));
    flight.wait_trouble(&["more than 2 tasks", "max_array_size"]);
    let done = flight.farm.wait_done(job);
    frames::are_same(&flight.farm.frames(job), &small().frames);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    flight.clean();
    flight.has_left_nothing();
}

#[test]
#[ignore = "long: tests/run --all"]
fn a_host_that_loses_its_power_takes_no_job_with_it() {
    // As where nobody set `reschedule_unknown`: the queue shows what ran there as running, for ever.
    for mode in [
        "mode = 'poll'\nmin_tile_pixels = 2500",
        "mode = 'pilot'\nidle = '20 s'",
    ] {
        let Some(engine) = Engine::gridengine(2, &[("GE_SLOTS", "1")]) else {
            return;
        };
        let work = lasting(std::time::Duration::from_secs(20));
        let more = format!("{mode}\nmax_running = 2\nahead = 0\nsubmit = ['-r', 'n']");
        let flight = Flight::over_tls(&engine, Kind::GridEngine, &more);
        let job = flight.farm.submit(&work.with(&[FLYBY]));
        let on_ge2 = || {
            let shown = engine.tool("qstat", &["-u", "*", "-s", "r"]);
            shown.lines().any(|line| line.contains("@ge2"))
        };
        wait::until("both hosts render", || {
            (on_ge2() && flight.count("running") == 2).then_some(())
        });
        flight.farm.wait_acknowledged(job, 1);
        engine.tool("poweroff", &["ge2"]);
        // Asked before the trouble is seen: what is found lost is deleted soon after.
        let was_on_ge2 = wait::until("the site's trouble says that a host is gone", || {
            let was_on_ge2 = on_ge2();
            flight
                .has_trouble(&["the queue hears nothing"])
                .then_some(was_on_ge2)
        });
        assert!(was_on_ge2, "the queue has given it up by itself");
        let done = flight.farm.wait_done(job);
        frames::are_same(&flight.farm.frames(job), &work.frames);
        assert_eq!(done.number("blocks_again"), 0, "{done:?}");
        flight.clean();
        flight.has_left_nothing();
        assert!(!engine.tool("qstat", &["-u", "*"]).contains("flyby-"));
    }
}
