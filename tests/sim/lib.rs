//! A whole farm in one thread: the scheduler, its store and disk, several sessions, and a simulated
//! network, clock and processor, all from one key.
//!
//! Messages are late and come twice; links are cut; workers are killed, frozen, cut off, drained, stopped, slow and
//! wrong, and their clocks jump and stand still; the coordinator is frozen, its clock jumps, its disk is full, its
//! machine crashes and loses, tears and reorders whatever was not synced; jobs wait for others, and users change
//! their minds; a polled site cannot be reached, its tasks are killed and their hosts gone, and a coordinator takes up what an
//! earlier one left there. However that goes, every job ends by itself, none begins before those that it waits for,
//! every frame is whole and right, nothing acknowledged is rendered or fetched again, every lease ends and every queue is bounded.
//!
//! A failure names its key and the smallest farm that fails with it; `replay` shows that again.
//! Mistakes that are planted around the scheduler are all caught (`bugs`). `FLYBY_SIM_KEYS=10000` looks longer.
#![cfg(test)]

mod bugs;
mod clock;
mod coordinator;
mod disk;
mod farm;
mod message;
mod plan;
mod random;
mod run;
mod site;
mod user;
mod witness;
mod worker;

use plan::{Plan, Troubles};
use run::{all, number_from};

#[test]
fn in_peace() {
    let report = all(0..20, |key| Plan::new(key, Troubles::NONE));
    assert_eq!(report.incidents, 0);
}

#[test]
fn everything_at_once() {
    all(0..100, |key| Plan::new(key, Troubles::ALL));
}

#[test]
fn crashes_of_the_coordinator() {
    let troubles = Troubles {
        crashes: 60,
        fulls: 20,
        ..Troubles::NONE
    };
    let report = all(0..40, |key| Plan::new(key, troubles));
    assert!(report.adopted > report.restarts / 4, "{report:?}");
}

#[test]
fn clocks_of_workers() {
    let troubles = Troubles {
        clocks: 300,
        cuts: 100,
        ..Troubles::NONE
    };
    all(0..number_from("FLYBY_SIM_KEYS").unwrap_or(15), |key| {
        Plan::new(key, troubles)
    });
}

#[test]
fn sites_that_are_polled() {
    let troubles = Troubles {
        aways: 100,
        deaths: 100,
        crashes: 15,
        fulls: 10,
        kills: 8,
        cuts: 30,
        ..Troubles::NONE
    };
    let report = all(0..number_from("FLYBY_SIM_KEYS").unwrap_or(40), |key| {
        let plan = Plan::new(key, troubles);
        let sites = 1 + key % 2;
        Plan { sites, ..plan }
    });
    assert!(report.fetched > report.keys * 10, "{report:?}");
    assert!(report.adopted > 0 && report.lost > 0, "{report:?}");
}

#[test]
fn users_who_change_their_minds() {
    let troubles = Troubles {
        wishes: 400,
        failures: 20,
        crashes: 40,
        fulls: 20,
        ..Troubles::NONE
    };
    all(0..number_from("FLYBY_SIM_KEYS").unwrap_or(100), |key| {
        Plan::new(key, troubles)
    });
}

#[test]
fn wrong_pixels_are_noticed_where_a_tile_is_rendered_twice() {
    let troubles = Troubles {
        liars: 500,
        slow: 300,
        cuts: 150,
        freezes: 50,
        ..Troubles::NONE
    };
    let report = all(0..40, |key| Plan::new(key, troubles));
    assert!(report.incidents > 0);
}

#[test]
fn a_liar_among_others_is_found_and_no_frame_of_its_making_stays() {
    let troubles = Troubles {
        liars: 150,
        slow: 200,
        ..Troubles::NONE
    };
    for share in [1_000_000, 200_000] {
        let report = all(0..60, |key| {
            let plan = Plan::new(key, troubles);
            Plan {
                verify: share,
                workers: plan.workers.max(3),
                images: 3 * plan.images,
                ..plan
            }
        });
        assert!(report.convicted > 0, "{share}: {report:?}");
    }
}

#[test]
#[ignore = "long: tests/run --all"]
fn everything_at_once_for_long() {
    let keys = number_from("FLYBY_SIM_KEYS").unwrap_or(1_000);
    let report = all(0..keys, |key| {
        // Larger farms than those above, so that each lives through more.
        let plan = Plan::new(key, Troubles::ALL);
        Plan {
            images: 4 * plan.images + 20,
            jobs: plan.jobs + 1,
            ..plan
        }
    });
    assert!(report.events >= keys * 10_000, "{report:?}");
}
