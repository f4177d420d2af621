//! Workers that fail where others succeed are set aside, and let back.

mod situation;

use model::{JobId, Span};
use sched::{Config, Effect, Event};
use situation::*;

const ASIDE: Span = Span::from_secs(300);

fn held(farm: &Farm, id: u64) -> u32 {
    farm.sched.worker(worker(id)).expect("it joined").attempts
}

/// A new job, whose tiles come before those of all older ones.
fn submits(farm: &mut Farm, job: u64) {
    let mut asked = submission(u128::from(job), 4);
    asked.priority = i32::try_from(job).expect("a small number");
    farm.is_told(Event::Submit(asked));
}

/// The attempt that a worker holds, and its image and tile.
fn holds(farm: &Farm, id: u64) -> (u64, u32, u32, u64) {
    let live = (1..1_000).find_map(|number| {
        let (by, image, rect) = farm.sched.attempt(attempt(number))?;
        (by == worker(id)).then_some((number, image.image.0, rect.y0 / 32, image.job.0))
    });
    live.expect("it holds one")
}

/// Worker 1 fails a tile, and worker 2 does that tile.
fn fails_where_another_succeeds(farm: &mut Farm) {
    farm.wants_tiles(2, 0).wants_tiles(1, 1);
    let (number, image, index, job) = holds(farm, 1);
    farm.wants_tiles(1, 0).fails(1, number).wants_tiles(2, 1);
    let (number, again, index_again, _) = holds(farm, 2);
    assert_eq!((again, index_again), (image, index), "what failed is next");
    farm.wants_tiles(2, 0);
    for rect in tile(index).blocks() {
        let mut block = block_ref(number, image, rect);
        block.image.job = JobId(job);
        farm.is_told(Event::BlockStored {
            worker: worker(2),
            block,
            elapsed: Span(1),
            pixels: model::Digest([1; 32]),
        });
    }
}

fn two_workers() -> Farm {
    let mut farm = Farm::new(Config {
        faults_max: 2,
        ..Config::new(EPOCH)
    });
    farm.worker(1, 0).worker(2, 0);
    submits(&mut farm, 1);
    farm
}

#[test]
fn a_worker_that_fails_what_another_does_is_set_aside_for_the_job_and_let_back() {
    let mut farm = two_workers();
    fails_where_another_succeeds(&mut farm);
    farm.wants_tiles(1, 1);
    assert_eq!(held(&farm, 1), 1, "once is not enough");
    let (number, ..) = holds(&farm, 1);
    farm.wants_tiles(1, 0).is_told(Event::GivenBack {
        worker: worker(1),
        attempts: vec![attempt(number)],
    });
    fails_where_another_succeeds(&mut farm);
    farm.wants_tiles(1, 1);
    assert_eq!(held(&farm, 1), 0);
    // Another job has nothing to do with it.
    let mut asked = submission(9, 1);
    asked.priority = -9;
    farm.is_told(Event::Submit(asked));
    assert_eq!(holds(&farm, 1).3, 2);
    let number = holds(&farm, 1).0;
    farm.command_of(2, sched::Command::Remove);
    assert!(farm.sched.attempt(attempt(number)).is_none());
    for _ in 0..ASIDE.0 / 1_000_000 - 1 {
        farm.heartbeat(2, &[])
            .waits_with_heartbeats(Span::from_secs(1), 1, &[]);
    }
    assert_eq!(held(&farm, 1), 0);
    farm.heartbeat(2, &[])
        .waits_with_heartbeats(Span::from_secs(2), 1, &[]);
    assert_eq!(held(&farm, 1), 1, "it is let back");
}

#[test]
fn a_tile_that_a_worker_does_itself_clears_it() {
    let mut farm = two_workers();
    fails_where_another_succeeds(&mut farm);
    farm.wants_tiles(1, 1);
    let (number, image, index, _) = holds(&farm, 1);
    farm.wants_tiles(1, 0).stores_tile(1, number, image, index);
    fails_where_another_succeeds(&mut farm);
    farm.wants_tiles(1, 1);
    assert_eq!(held(&farm, 1), 1);
}

#[test]
fn a_worker_that_is_set_aside_for_two_jobs_is_set_aside_for_the_farm() {
    let mut farm = two_workers();
    for job in 1..3 {
        if job > 1 {
            submits(&mut farm, job);
        }
        assert_eq!(farm.sched.worker(worker(1)).unwrap().aside, None);
        fails_where_another_succeeds(&mut farm);
        fails_where_another_succeeds(&mut farm);
    }
    let until = farm.now + ASIDE;
    assert_eq!(farm.sched.worker(worker(1)).unwrap().aside, Some(until));
    submits(&mut farm, 3);
    farm.wants_tiles(1, 1);
    assert_eq!(held(&farm, 1), 0);
}

#[test]
fn a_tile_that_failed_goes_to_another_worker_first() {
    let mut farm = farm();
    farm.job(1).worker(1, 1).worker(2, 0).never_mind();
    // Worker 2 does not want tiles, so there is nobody else.
    farm.fails(1, 1).wants(&[lease(1, 2, 0, 0)]);
    farm.wants_tiles(2, 1).wants(&[lease(2, 3, 0, 1)]);
    farm.fails(1, 2).wants(&[]);
    // Now there is: the tile waits for worker 2, and worker 1 for another tile.
    farm.stores_tile(2, 3, 0, 1);
    let effects = farm.never_mind();
    assert_eq!(effects.last(), Some(&lease_of(2, 4, 0, 0, &[], Span(1))));
}

#[test]
fn a_tile_that_waits_for_another_worker_is_taken_back_when_that_one_leaves() {
    let mut farm = farm();
    farm.job(1).worker(1, 1).worker(2, 1).never_mind();
    farm.fails(1, 1).wants(&[]);
    farm.wants_tiles(2, 0).wants(&[lease(1, 3, 0, 0)]);
}

#[test]
fn a_tile_that_fails_everywhere_fails_its_image_and_blames_nobody() {
    let mut farm = Farm::new(Config {
        faults_max: 1,
        ..Config::new(EPOCH)
    });
    farm.job(2);
    for id in [3, 1, 2] {
        farm.worker(id, 1);
    }
    let is_first = |farm: &Farm, id| {
        let (_, image, index, _) = holds(farm, id);
        (image, index) == (0, 0)
    };
    let mut left = vec![1, 2, 3];
    let mut effects = Vec::new();
    while let Some(id) = left.pop() {
        // Somebody who has not failed it finishes what he has, and gets it.
        if !is_first(&farm, id) {
            let (number, image, index, _) = holds(&farm, id);
            farm.stores_tile(id, number, image, index);
        }
        assert!(is_first(&farm, id));
        let (number, ..) = holds(&farm, id);
        farm.never_mind();
        farm.fails(id, number);
        effects = farm.never_mind();
    }
    assert!(
        effects
            .iter()
            .any(|effect| matches!(effect, Effect::GiveUp { .. }))
    );
    assert_eq!(farm.sched.job(JobId(1)).unwrap().images.failed, 1);
    for id in 1..=3 {
        assert_eq!(farm.sched.worker(worker(id)).unwrap().aside, None);
    }
}

#[test]
fn no_more_than_half_of_the_workers_are_set_aside() {
    let mut farm = Farm::new(Config {
        faults_max: 1,
        ..Config::new(EPOCH)
    });
    farm.worker(1, 0).worker(2, 0).worker(3, 0);
    submits(&mut farm, 1);
    // Of three, only one: first worker 1, then worker 3 would be.
    for id in [1, 3] {
        farm.wants_tiles(2, 0).wants_tiles(id, 1);
        let (number, image, index, _) = holds(&farm, id);
        farm.wants_tiles(id, 0).fails(id, number).wants_tiles(2, 1);
        let (number, ..) = holds(&farm, 2);
        farm.wants_tiles(2, 0).stores_tile(2, number, image, index);
    }
    farm.wants_tiles(1, 1).wants_tiles(3, 1);
    assert_eq!([1, 3].map(|id| held(&farm, id)), [0, 1]);
}
