//! Tiles that workers had begun before the coordinator was started again.

mod situation;

use model::{AttemptId, Begun, Digest, Epoch, Rect, Span, WorkerId};
use sched::{BlockRef, Command, Effect, Event, LinkId, Offer, Submission, TileShape, Verdict};
use situation::{
    EPOCH, Farm, REVISION, ack, block, done, encode, farm, image_ref, lease, offer, revoke,
    submission, tile, worker,
};

/// An attempt of the epoch before.
fn old(number: u64) -> AttemptId {
    AttemptId {
        epoch: Epoch(EPOCH.0 - 1),
        number,
    }
}

fn begun(number: u64, image: u32, tile: Rect) -> Begun {
    Begun {
        attempt: old(number),
        image: image_ref(image),
        tile,
    }
}

/// A worker comes back with tiles that it had begun.
fn comes_back(farm: &mut Farm, id: u64, link: u64, begun: &[Begun]) {
    comes_back_with(farm, id, link, begun, offer());
}

fn comes_back_with(farm: &mut Farm, id: u64, link: u64, begun: &[Begun], offer: Offer) {
    farm.is_told(Event::WorkerJoined {
        worker: worker(id),
        link: LinkId(link),
        offer,
        held: begun.iter().map(|begun| begun.attempt).collect(),
        begun: begun.to_vec(),
    });
}

fn welcome(id: u64, live: &[AttemptId]) -> Effect {
    Effect::Welcome {
        worker: worker(id),
        live: live.to_vec(),
    }
}

fn adopted(id: u64, number: u64, image: u32) -> Effect {
    Effect::Adopted {
        worker: worker(id),
        attempt: old(number),
        image: image_ref(image),
    }
}

fn stores(farm: &mut Farm, id: u64, number: u64, rect: Rect) {
    let (worker, block) = (
        worker(id),
        BlockRef {
            attempt: old(number),
            image: image_ref(0),
            rect,
        },
    );
    let verdict = farm.sched.accepts(worker, block);
    assert!(!matches!(verdict, Verdict::Refuse(_)), "{verdict:?}");
    is_stored(farm, worker, block);
}

fn is_stored(farm: &mut Farm, worker: WorkerId, block: BlockRef) {
    farm.is_told(Event::BlockStored {
        worker,
        block,
        elapsed: Span::from_millis(1),
        pixels: Digest([1; 32]),
    });
}

/// A store tells of a block.
fn recalls(farm: &mut Farm, rect: Rect) {
    let nobody = WorkerId {
        id: 0,
        incarnation: 0,
    };
    let block = BlockRef {
        attempt: AttemptId {
            epoch: Epoch(0),
            number: 0,
        },
        image: image_ref(0),
        rect,
    };
    is_stored(farm, nobody, block);
}

#[test]
fn a_worker_goes_on_with_its_tile_under_the_name_that_it_had() {
    let mut farm = farm();
    farm.job(1).never_mind();
    comes_back(&mut farm, 1, 1, &[begun(9, 0, tile(1))]);
    farm.wants(&[welcome(1, &[old(9)]), adopted(1, 9, 0)]);
    // The tile is taken: another worker gets the other one, and no third is there.
    farm.worker(2, 2);
    farm.wants(&[situation::welcome(2, &[]), lease(2, 2, 0, 0)]);
    for index in [2, 3] {
        stores(&mut farm, 1, 9, block(index));
    }
    let view = farm.sched.job(model::JobId(1)).unwrap();
    assert_eq!(
        (view.blocks_done, view.blocks_again, view.attempts_live),
        (2, 0, 1)
    );
    farm.never_mind();
    farm.stores_tile(2, 2, 0, 0);
    farm.wants(&[ack(2, 2, block(0)), ack(2, 2, block(1)), encode(0)]);
    farm.encoded(0);
    farm.wants(&[done(sched::JobOutcome::Finished)]);
}

#[test]
fn what_was_acknowledged_before_and_comes_again_is_no_work_done_twice() {
    let mut farm = farm();
    farm.job(1);
    recalls(&mut farm, block(0));
    comes_back(&mut farm, 1, 1, &[begun(9, 0, tile(0))]);
    // The acknowledgement was lost with the coordinator.
    stores(&mut farm, 1, 9, block(0));
    stores(&mut farm, 1, 9, block(1));
    let view = farm.sched.job(model::JobId(1)).unwrap();
    assert_eq!(
        (view.blocks_done, view.blocks_again, view.pixels_again),
        (2, 0, 0)
    );
    assert_eq!(view.attempts_live, 0);
}

#[test]
fn a_tile_that_somebody_else_has_not_begun_is_given_to_who_has() {
    let mut farm = farm();
    farm.job(1).worker(2, 2).never_mind();
    farm.heartbeat(2, &[(1, 0)]);
    // The first is begun, the second is held ahead.
    comes_back(
        &mut farm,
        1,
        9,
        &[begun(7, 0, tile(0)), begun(8, 0, tile(1))],
    );
    farm.wants(&[
        revoke(2, 2, sched::RevokeReason::CalledBack),
        welcome(1, &[old(8)]),
        adopted(1, 8, 0),
    ]);
}

#[test]
fn what_may_not_be_taken_up_is_dead() {
    let mut farm = farm();
    farm.job(1);
    for rect in [block(0), block(1)] {
        recalls(&mut farm, rect);
    }
    farm.never_mind();
    let whole = submission(1, 1).window;
    let half = Rect { x1: 32, ..whole };
    let outside = Rect { y1: 96, ..whole };
    let in_future = Begun {
        attempt: AttemptId {
            epoch: Epoch(EPOCH.0 + 1),
            number: 1,
        },
        ..begun(1, 0, tile(1))
    };
    let of_now = Begun {
        attempt: situation::attempt(1),
        ..begun(1, 0, tile(1))
    };
    // Durable, no tile of this image, no image of this job, no attempt of before.
    let none = [
        begun(1, 0, tile(0)),
        begun(2, 0, half),
        begun(3, 0, outside),
        begun(4, 1, tile(1)),
        in_future,
        of_now,
    ];
    comes_back(&mut farm, 1, 1, &none);
    farm.wants(&[welcome(1, &[])]);
    // Once, whoever says so, and only by a worker that may render it.
    let twice = [
        begun(5, 0, tile(1)),
        begun(5, 0, tile(1)),
        begun(6, 0, tile(1)),
    ];
    comes_back(&mut farm, 1, 2, &twice);
    farm.wants(&[welcome(1, &[old(5)]), adopted(1, 5, 0)]);
    comes_back(&mut farm, 2, 3, &[begun(5, 0, tile(1))]);
    farm.wants(&[welcome(2, &[])]);
    farm.command(Command::Cancel).never_mind();
    comes_back(&mut farm, 1, 4, &[begun(5, 0, tile(1))]);
    farm.wants(&[welcome(1, &[])]);
}

#[test]
fn a_worker_of_another_kind_takes_nothing_up() {
    let mut farm = farm();
    let mut picky = submission(1, 1);
    picky.needs.threads = 2;
    farm.is_told(Event::Submit(picky)).never_mind();
    comes_back(&mut farm, 1, 1, &[begun(9, 0, tile(1))]);
    farm.wants(&[welcome(1, &[])]);
    let wide = Offer {
        threads: 2,
        revision: REVISION,
        ..offer()
    };
    comes_back_with(&mut farm, 2, 2, &[begun(9, 0, tile(1))], wide);
    farm.wants(&[welcome(2, &[old(9)]), adopted(2, 9, 0)]);
}

#[test]
fn a_tile_that_is_taken_up_has_limits_like_any_other() {
    let mut farm = farm();
    farm.job(1).never_mind();
    comes_back(&mut farm, 1, 1, &[begun(9, 0, tile(1))]);
    farm.never_mind();
    farm.waits_with_heartbeats(Span::from_secs(301), 1, &[]);
    let view = farm.sched.job(model::JobId(1)).unwrap();
    assert_eq!((view.attempts_live, view.attempts_failed), (0, 1));
    assert!(farm.sched.attempt(old(9)).is_none());
    comes_back(&mut farm, 1, 2, &[begun(9, 0, tile(1))]);
    farm.waits(Span::from_secs(5));
    assert_eq!(
        farm.sched.workers().count(),
        0,
        "it was silent for too long"
    );
}

/// Tiles cut by time are nodes of a tree of halves; one anywhere in it is taken out of what waits.
#[test]
fn a_tile_is_taken_out_of_the_middle_of_an_image() {
    let mut farm = farm();
    farm.is_told(Event::Submit(Submission {
        window: model::Resolution {
            width: 256,
            height: 128,
        }
        .rect(),
        tiles: TileShape::Time { aim: None },
        ..submission(1, 1)
    }));
    let inner = Rect {
        x0: 64,
        y0: 64,
        x1: 128,
        y1: 128,
    };
    comes_back(&mut farm, 1, 1, &[begun(9, 0, inner)]);
    assert_eq!(
        farm.sched.attempt(old(9)).map(|(_, _, rect)| rect),
        Some(inner)
    );
    farm.worker(2, 100).never_mind();
    let view = farm.sched.job(model::JobId(1)).unwrap();
    // All else is leased in single squares, since nothing is known of their cost.
    assert!(view.attempts_live > 8, "{view:?}");
    for rect in inner.blocks() {
        stores(&mut farm, 1, 9, rect);
    }
    assert!(farm.sched.attempt(old(9)).is_none());
}
