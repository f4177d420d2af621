//! Checks that take long near the end of a job: whoever has nothing to do and could have done them helps.

mod situation;

use model::{Digest, JobId, Rect, Span};
use sched::{Event, ImageState, RevokeReason};
use situation::*;

const BLOCK: Span = Span::from_secs(5);

/// A block arrives that took five seconds, while all others give signs of life.
fn takes_its_time(farm: &mut Farm, (id, number): (u64, u64), rect: Rect) {
    for _ in 0..BLOCK.0 / 1_000_000 {
        farm.heartbeat(id, &[(number, 0)]);
        for other in (1..5).filter(|&other| other != id) {
            farm.heartbeat(other, &[]);
        }
        farm.waits(Span::from_secs(1));
    }
    stores(farm, (id, number), rect);
}

fn stores(farm: &mut Farm, (id, number): (u64, u64), rect: Rect) {
    farm.is_told(Event::BlockStored {
        worker: worker(id),
        block: block_ref(number, 0, rect),
        elapsed: BLOCK,
        pixels: Digest([7; 32]),
    });
}

/// Worker 1 has made both tiles, worker 2 has begun to check the first, worker 3 has checked the second; both of them want more,
/// and so does worker 1.
fn farm_with_a_slow_check() -> Farm {
    let mut farm = suspicious();
    farm.job(1).worker(1, 2).worker(2, 0).worker(3, 0);
    farm.never_mind();
    for index in [0, 1] {
        for rect in tile(index).blocks() {
            takes_its_time(&mut farm, (1, 1 + u64::from(index)), rect);
        }
    }
    farm.wants_tiles(2, 1).heartbeat(2, &[(3, 0)]);
    farm.wants_tiles(3, 1).never_mind();
    for rect in tile(1).blocks() {
        takes_its_time(&mut farm, (3, 4), rect);
    }
    farm.heartbeat(2, &[(3, 0)]);
    farm
}

#[test]
fn a_slow_check_is_done_from_both_ends_and_the_first_result_wins() {
    let mut farm = farm_with_a_slow_check();
    // It is ten seconds late; nobody gives it up.
    farm.waits_with_heartbeats(Span::from_secs(3), 2, &[(3, 0)]);
    let blocks: Vec<Rect> = tile(0).blocks().collect();
    assert_eq!(
        leased_blocks(&mut farm),
        [(3, 5, vec![blocks[1], blocks[0]])]
    );
    stores(&mut farm, (3, 5), blocks[1]);
    assert_eq!(state(&farm, 0), ImageState::Rendering);
    stores(&mut farm, (2, 3), blocks[0]);
    let effects = farm.never_mind();
    for told in [(2, 3), (3, 5)] {
        let told = revoke(told.0, told.1, RevokeReason::TileDone);
        assert!(effects.contains(&told), "{effects:?}");
    }
    assert!(effects.contains(&encode(0)), "{effects:?}");
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.unverified, job.seconds), (0, 1));
    assert_eq!((job.blocks_twice, job.blocks_again), (4, 0));
}

#[test]
fn whoever_made_it_or_failed_it_helps_nobody_with_a_check() {
    let mut farm = farm_with_a_slow_check();
    farm.waits_with_heartbeats(Span::from_secs(3), 2, &[(3, 0)]);
    // Worker 1, which made it, has not been asked; where the helper fails, the first goes on alone.
    farm.fails(3, 5);
    assert!(leased_blocks(&mut farm).iter().all(|&(id, ..)| id == 3));
    farm.waits_with_heartbeats(Span::from_secs(20), 2, &[(3, 0)]);
    assert_eq!(leased_blocks(&mut farm), []);
    for rect in tile(0).blocks() {
        stores(&mut farm, (2, 3), rect);
    }
    assert_eq!(farm.never_mind().last(), Some(&encode(0)));
}

#[test]
fn two_that_fail_a_check_together_do_not_end_it() {
    let mut farm = farm_with_a_slow_check();
    farm.waits_with_heartbeats(Span::from_secs(3), 2, &[(3, 0)]);
    farm.worker(4, 0).fails(3, 5).fails(2, 3);
    farm.never_mind();
    assert_eq!(state(&farm, 0), ImageState::Rendering);
    farm.wants_tiles(4, 1);
    let (id, number, blocks) = leased_blocks(&mut farm).remove(0);
    assert_eq!(id, 4);
    for rect in blocks {
        stores(&mut farm, (4, number), rect);
    }
    assert_eq!(state(&farm, 0), ImageState::Encoding);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().unverified, 0);
}
