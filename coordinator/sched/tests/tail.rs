//! The end of a job: leases are called back, tiles are leased twice, and what differs is told.

mod situation;

use model::{Digest, JobId, Rect, Span};
use sched::{Config, Effect, Event, RevokeReason, TailGain, Verdict};
use situation::*;

const TILE: Span = Span::from_secs(10);

/// A block arrives after its time, of some pixels.
fn stores_late(farm: &mut Farm, (id, number): (u64, u64), image: u32, rect: Rect, pixels: u8) {
    let reference = block_ref(number, image, rect);
    let verdict = farm.sched.accepts(worker(id), reference);
    assert!(!matches!(verdict, Verdict::Refuse(_)), "{verdict:?}");
    farm.is_told(Event::BlockStored {
        worker: worker(id),
        block: reference,
        elapsed: Span(TILE.0 / 2),
        pixels: Digest([pixels; 32]),
    });
}

/// Two images, four tiles. Worker 1 holds all; it has done the first, in ten seconds, and
/// begins the second.
fn farm_near_its_end(config: Config) -> Farm {
    let mut farm = Farm::new(config);
    farm.job(2).worker(1, 4);
    farm.waits_with_heartbeats(TILE, 1, &[(1, 0)]);
    for rect in tile(0).blocks() {
        stores_late(&mut farm, (1, 1), 0, rect, 1);
    }
    farm.heartbeat(1, &[(2, 0)]).never_mind();
    farm
}

fn with(call_back: Option<Span>, second: Option<Span>) -> Config {
    Config {
        tail_gain: TailGain { call_back, second },
        ..Config::new(EPOCH)
    }
}

const GAIN: Option<Span> = Some(Span::from_millis(500));

#[test]
fn what_was_not_started_goes_to_a_worker_that_has_nothing_to_do() {
    let mut farm = farm_near_its_end(with(GAIN, GAIN));
    let tile_again = |id, number, index| lease_of(id, number, 1, index, &[], TILE);
    farm.worker(2, 1).wants(&[
        welcome(2, &[]),
        revoke(1, 4, RevokeReason::CalledBack),
        tile_again(2, 5, 1),
    ]);
    farm.worker(3, 1).wants(&[
        welcome(3, &[]),
        revoke(1, 3, RevokeReason::CalledBack),
        tile_again(3, 6, 0),
    ]);
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.called_back, job.seconds), (2, 0));
}

#[test]
fn nothing_is_called_back_while_something_waits_or_where_that_is_not_wanted() {
    let mut farm = farm_near_its_end(with(None, None));
    farm.worker(2, 1).wants(&[welcome(2, &[])]);
    let mut farm = farm_near_its_end(with(GAIN, GAIN));
    let mut another = submission(2, 1);
    another.priority = -1;
    farm.is_told(Event::Submit(another)).never_mind();
    farm.worker(2, 1);
    let effects = farm.never_mind();
    assert!(
        matches!(effects[..], [_, Effect::Lease { .. }]),
        "a job of lower priority goes first: {effects:?}"
    );
}

#[test]
fn a_worker_that_is_as_busy_helps_nobody() {
    let mut farm = farm_near_its_end(with(GAIN, GAIN));
    farm.worker(2, 1).never_mind();
    // It wants more ahead, and has no thread free.
    farm.wants_tiles(2, 3).wants(&[]);
}

/// Only the last two tiles are left, on workers 1 and 2; worker 3 has nothing to do.
fn farm_with_a_second_lease() -> Farm {
    let mut farm = farm_near_its_end(with(GAIN, GAIN));
    for id in [2, 3] {
        farm.worker(id, 1);
    }
    farm.never_mind();
    farm.worker(4, 1);
    farm
}

/// Whose tile was leased a second time, under which number, and to whom.
fn second_lease(farm: &mut Farm) -> (u64, u32, Rect, Vec<Rect>) {
    let effects = farm.never_mind();
    match &effects[..] {
        [_, Effect::Lease { worker, lease }] => {
            assert_eq!(worker.id, 4);
            let number = lease.attempt.number;
            (
                number,
                lease.image.image.0,
                lease.tile,
                lease.wanted.clone(),
            )
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_last_tile_is_leased_twice_from_both_ends_and_the_first_result_wins() {
    let mut farm = farm_with_a_second_lease();
    let (number, image, rect, wanted) = second_lease(&mut farm);
    let blocks: Vec<Rect> = rect.blocks().collect();
    assert_eq!(wanted, [blocks[1], blocks[0]], "from the other end");
    let first = (1..number)
        .find(|&first| {
            let live = farm.sched.attempt(attempt(first));
            live.is_some_and(|(_, of, tile)| of.image.0 == image && tile == rect)
        })
        .unwrap();
    let (holder, ..) = farm.sched.attempt(attempt(first)).unwrap();
    farm.waits(Span::from_secs(1));
    stores_late(&mut farm, (4, number), image, blocks[1], 1);
    farm.never_mind();
    stores_late(&mut farm, (holder.id, first), image, blocks[0], 1);
    let effects = farm.never_mind();
    let told = revoke(holder.id, first, RevokeReason::TileDone);
    assert!(effects.contains(&told), "{effects:?}");
    assert!(effects.contains(&revoke(4, number, RevokeReason::TileDone)));
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.blocks_twice, job.blocks_again), (0, 0));
}

#[test]
fn a_tile_is_never_leased_a_third_time() {
    let mut farm = farm_with_a_second_lease();
    farm.never_mind();
    for id in 5..9 {
        farm.worker(id, 1);
    }
    let seconds = farm.sched.job(JobId(1)).unwrap().seconds;
    assert_eq!(seconds, 3, "each of the three tiles once");
}

#[test]
fn equal_pixels_are_counted_and_others_are_an_incident() {
    for pixels in [1, 2] {
        let mut farm = farm_with_a_second_lease();
        let (number, image, rect, _) = second_lease(&mut farm);
        let blocks: Vec<Rect> = rect.blocks().collect();
        let first = (1..number).find(|&first| {
            let live = farm.sched.attempt(attempt(first));
            live.is_some_and(|(_, of, tile)| of.image.0 == image && tile == rect)
        });
        let first = first.unwrap();
        let (holder, ..) = farm.sched.attempt(attempt(first)).unwrap();
        farm.waits(Span::from_secs(1));
        stores_late(&mut farm, (holder.id, first), image, blocks[0], 1);
        farm.never_mind();
        stores_late(&mut farm, (4, number), image, blocks[0], pixels);
        let effects = farm.never_mind();
        let job = farm.sched.job(JobId(1)).unwrap();
        assert_eq!(job.blocks_twice, 1);
        assert_eq!(job.incidents, u64::from(pixels == 2));
        if pixels == 1 {
            assert_eq!(effects, [ack(4, number, blocks[0])]);
            continue;
        }
        let incident = Effect::Incident {
            block: block_ref(number, image, blocks[0]),
            worker: worker(4),
            other: Some(holder),
        };
        let revoked = revoke(4, number, RevokeReason::Differs);
        assert_eq!(effects[..3], [ack(4, number, blocks[0]), incident, revoked]);
    }
}

#[test]
fn an_attempt_that_is_long_overdue_is_helped_whatever_was_expected_of_it() {
    let mut farm = farm_near_its_end(with(GAIN, GAIN));
    // The other tiles are done, and worker 2 idles beside the last one, which is nearly over.
    for (number, image, index) in [(3, 1, 0), (4, 1, 1)] {
        farm.stores_tile(1, number, image, index);
    }
    farm.never_mind();
    farm.waits_with_heartbeats(Span::from_secs(9), 1, &[(2, 0)]);
    farm.worker(2, 1);
    farm.waits_with_heartbeats(Span::from_secs(40), 1, &[(2, 0)]);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().seconds, 1);
}
