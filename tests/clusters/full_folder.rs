//! A full home directory at a polled site (thesis §C.4 and §C.5): the site's trouble and no tile's. It is said, no
//! array is submitted meanwhile, others have the tiles, and with room again it goes on from the blocks that are there.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::flight::Flight;
use crate::harness::scenes::{FLYBY, slow, small};
use crate::harness::{Place, SmallDisk, wait};

/// Room for all that a job has there.
const DISK: &str = "4m";

/// Looks within which a site would long have submitted again.
const LOOKS: usize = 6;

/// This machine, polled, with one task at a time and a small disk for a home directory; `None` where that may not be.
fn here(min_tile_pixels: u32) -> Option<(SmallDisk, Flight)> {
    let place = Place::new();
    let disk = SmallDisk::mount(&place, &place.path("there"), DISK)?;
    let more = format!("mode = 'poll'\nmax_running = 1\nmin_tile_pixels = {min_tile_pixels}");
    let program = env!("CARGO_BIN_EXE_flyby");
    let flight = Flight::in_place(place, "kind = 'local'\n", program, &more);
    Some((disk, flight))
}

/// The site's trouble names folder and host, and what to do; also where what is fetched and removed there made room meanwhile.
#[track_caller]
fn says_so(flight: &Flight, disk: &SmallDisk) {
    let there = flight.farm.place.path("there");
    let folder = format!("the folder {}/farm-", there.display());
    let words: [&str; 3] = [&folder, "on this machine is full", "make room there"];
    disk.fill();
    flight.wait_trouble(&words);
    disk.fill();
    let check = ["site", "check", "test", "--sites", "sites.toml"];
    let check = flight.farm.place.flyby(check);
    let says = |word: &&str| check.stdout.contains(*word);
    assert!(!check.status.success() && words.iter().all(says), "{check}");
}

/// However often the site is looked at.
#[track_caller]
fn submits_nothing(flight: &Flight, disk: &SmallDisk) {
    let submitted = || {
        let said = flight.farm.coordinator.stderr();
        said.matches("an array is submitted").count()
    };
    let before = submitted();
    let mut looks = BTreeSet::new();
    wait::until("the site is looked at several times", || {
        disk.fill();
        looks.insert(flight.count("asked_unix_ms"));
        (looks.len() > LOOKS).then_some(())
    });
    assert_eq!(submitted(), before);
}

#[test]
fn full_when_a_job_is_submitted_others_render_it_and_with_room_the_site_does() {
    let Some((disk, mut flight)) = here(5_000) else {
        return;
    };
    disk.fill();
    let job = flight.farm.submit(&small().with(&[FLYBY]));
    says_so(&flight, &disk);
    submits_nothing(&flight, &disk);
    let worker = flight.farm.worker(&["--threads", "1"]);
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), small().digests);
    assert_eq!(flight.count("fetched_blocks"), 0);
    flight.farm.workers[worker].kill();

    let job = flight.farm.submit(&small().with(&[FLYBY]));
    wait::until("somebody is told what the job waits for", || {
        let why = flight.farm.flyby(["job", "why", &job.to_string()]).ok();
        why.contains("is full").then_some(())
    });
    disk.empty();
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), small().digests);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    assert_eq!(flight.site()["trouble"], Value::Null);
}

#[test]
fn full_while_a_task_runs_fails_nothing_and_no_block_comes_twice() {
    // An image is one tile, of which some blocks are there when the rest cannot be written.
    let Some((disk, flight)) = here(30_000) else {
        return;
    };
    let job = flight.farm.submit(&slow().with(&[FLYBY]));
    flight.farm.wait_acknowledged(job, 1);
    says_so(&flight, &disk);
    submits_nothing(&flight, &disk);
    assert_eq!(flight.farm.job(job).state(), "running");
    disk.empty();
    let done = flight.farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
    let (site, blocks) = (flight.site(), done.number("blocks_done"));
    assert_eq!(site["fetched_blocks"].as_u64(), Some(blocks), "{site}");
    assert_eq!(site["fetched_again"], 0, "{site}");
}
