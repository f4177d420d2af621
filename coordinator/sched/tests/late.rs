//! Blocks whose attempt ended while they were written: what was let in counts for all that it would have counted for.

mod situation;

use model::{AttemptId, Begun, Digest, Epoch, JobId, Rect, Span};
use sched::{Effect, Event, ImageState, LinkId, Offer, Queue, RevokeReason, Verdict};
use situation::*;

/// A block passes the fence.
fn passes(farm: &Farm, (id, number): (u64, u64), image: u32, index: u32) {
    let block = block_ref(number, image, block(index));
    assert_eq!(farm.sched.accepts(worker(id), block), Verdict::Accept);
}

/// It is written and durable, whatever became of its attempt.
fn is_stored(farm: &mut Farm, (id, number): (u64, u64), (image, index): (u32, u32), pixels: u8) {
    farm.is_told(Event::BlockStored {
        worker: worker(id),
        block: block_ref(number, image, block(index)),
        elapsed: Span::from_millis(1),
        pixels: Digest([pixels; 32]),
    });
}

fn has_left(farm: &mut Farm, id: u64) {
    farm.is_told(Event::Goodbye { worker: worker(id) });
}

#[test]
fn a_tile_whose_last_block_came_late_is_verified() {
    // Where nobody has its tile any more, and where somebody else has begun it again.
    for others in [0, 1] {
        let mut farm = suspicious();
        farm.job(1).worker(1, 1).worker(2, 1);
        farm.worker(3, others).never_mind();
        is_stored(&mut farm, (1, 1), (0, 0), 7);
        passes(&farm, (1, 1), 0, 1);
        has_left(&mut farm, 1);
        let begun = leased(&mut farm);
        assert_eq!(begun.len(), others as usize);
        is_stored(&mut farm, (1, 1), (0, 1), 7);
        let ended = revoke(3, 3, RevokeReason::TileDone);
        let effects = farm.never_mind();
        assert_eq!(effects.contains(&ended), others > 0, "{effects:?}");
        makes(&mut farm, (2, 2), 0, 1, 7);
        assert_eq!(state(&farm, 0), ImageState::Rendering);
        farm.wants_tiles(3, 2);
        while let Some((id, number, _)) = (3..20).rev().find_map(|number| {
            let (worker, _, rect) = farm.sched.attempt(attempt(number))?;
            Some((worker.id, number, rect))
        }) {
            let (_, _, rect) = farm.sched.attempt(attempt(number)).unwrap();
            makes(&mut farm, (id, number), 0, rect.y0 / 32, 7);
        }
        assert_eq!(state(&farm, 0), ImageState::Encoding);
        let job = farm.sched.job(JobId(1)).unwrap();
        assert_eq!((job.blocks_twice, job.unverified), (4, 0));
    }
}

/// Two attempts at the first tile, whose blocks are all on their way to the disk; those of the first worker are there and
/// have ended both attempts. The third worker has done the other tile, which is verified, and wants no more.
fn farm_with_a_late_twin() -> Farm {
    let mut farm = suspicious();
    farm.job(1).worker(1, 1).worker(3, 1);
    assert_eq!(leased(&mut farm), [(1, 1, 0), (3, 2, 1)]);
    farm.is_told(Event::LinkClosed {
        worker: worker(1),
        link: LinkId(1),
    })
    .worker(2, 1);
    assert_eq!(leased(&mut farm), [(2, 3, 0)]);
    makes(&mut farm, (3, 2), 0, 1, 7);
    farm.wants_tiles(3, 0).never_mind();
    for index in [0, 1] {
        passes(&farm, (1, 1), 0, index);
        passes(&farm, (2, 3), 0, index);
    }
    for index in [0, 1] {
        is_stored(&mut farm, (1, 1), (0, index), 7);
    }
    let effects = farm.never_mind();
    assert!(effects.contains(&revoke(2, 3, RevokeReason::TileDone)));
    assert!(farm.sched.attempt(attempt(3)).is_none());
    farm
}

/// The attempt of worker 2 that checks the other tile, and the one of worker 2 that checks the first, if those are there.
fn live(farm: &Farm) -> Vec<(u64, u64, u32)> {
    let all = (4..20).filter_map(|number| {
        let (worker, _, rect) = farm.sched.attempt(attempt(number))?;
        Some((worker.id, number, rect.y0 / 32))
    });
    all.collect()
}

#[test]
fn what_another_made_and_was_late_with_is_a_check() {
    let mut farm = farm_with_a_late_twin();
    for index in [0, 1] {
        is_stored(&mut farm, (2, 3), (0, index), 7);
    }
    // Only the other tile is rendered once more.
    while let Some((id, number, index)) = live(&farm).pop() {
        assert_eq!(index, 1);
        makes(&mut farm, (id, number), 0, index, 7);
    }
    assert_eq!(state(&farm, 0), ImageState::Encoding);
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.incidents, job.unverified), (0, 0));
}

#[test]
fn what_another_made_otherwise_and_was_late_with_is_a_doubt_and_a_third_decides() {
    let mut farm = farm_with_a_late_twin();
    is_stored(&mut farm, (2, 3), (0, 0), 66);
    let incident = Effect::Incident {
        block: block_ref(3, 0, block(0)),
        worker: worker(2),
        other: Some(worker(1)),
    };
    let effects = farm.never_mind();
    assert!(effects.contains(&incident), "{effects:?}");
    farm.wants_tiles(3, 2);
    while let Some((id, number, index)) = live(&farm).pop() {
        makes(&mut farm, (id, number), 0, index, 7);
    }
    // Its pixels are those that were written last.
    let again = Effect::RenderAgain {
        image: image_ref(0),
        worker: worker(2),
    };
    let effects = farm.never_mind();
    assert!(effects.contains(&again), "{effects:?}");
}

#[test]
fn what_was_on_its_way_when_its_worker_was_expelled_is_rendered_again() {
    let mut farm = suspicious();
    farm.job(2).worker(1, 1).worker(2, 1).worker(3, 1);
    makes(&mut farm, (1, 1), 0, 0, 66);
    makes(&mut farm, (2, 2), 0, 1, 7);
    makes(&mut farm, (2, 5), 0, 0, 7);
    makes(&mut farm, (3, 3), 1, 0, 7);
    makes(&mut farm, (3, 6), 0, 1, 7);
    passes(&farm, (1, 4), 1, 2);
    makes(&mut farm, (3, 7), 0, 0, 7);
    let again = |image| Effect::RenderAgain {
        image: image_ref(image),
        worker: worker(1),
    };
    let effects = farm.never_mind();
    assert!(effects.contains(&again(0)) && !effects.contains(&again(1)));
    is_stored(&mut farm, (1, 4), (1, 2), 66);
    assert!(farm.never_mind().contains(&again(1)));
}

#[test]
fn a_block_of_an_image_that_was_cut_anew_meanwhile_ends_all_tiles_that_it_fills() {
    let mut farm = farm();
    farm.job(1).worker(2, 1).never_mind();
    passes(&farm, (2, 1), 0, 1);
    has_left(&mut farm, 2);
    // A site takes up what it had begun for an earlier coordinator, and the rest with it, in tiles of 16x16.
    let begun = Begun {
        attempt: AttemptId {
            epoch: Epoch(EPOCH.0 - 1),
            number: 9,
        },
        image: image_ref(0),
        tile: Rect {
            x0: 0,
            y0: 0,
            x1: 16,
            y1: 16,
        },
    };
    farm.is_told(Event::WorkerJoined {
        worker: worker(1),
        link: LinkId(9),
        offer: Offer {
            queue: Some(Queue {
                min_tile_pixels: 256,
                max_array_size: 16,
                lag: Span::from_secs(60),
                patience: Span::from_secs(600),
            }),
            ..offer()
        },
        held: vec![begun.attempt],
        begun: vec![begun],
    })
    .wants_tiles(1, 1);
    assert_eq!(leased(&mut farm).len(), 15);
    is_stored(&mut farm, (2, 1), (0, 1), 7);
    let effects = farm.never_mind();
    let is_done = |effect: &&Effect| {
        let done = RevokeReason::TileDone;
        matches!(effect, Effect::Revoke { reason, .. } if *reason == done)
    };
    assert_eq!(effects.iter().filter(is_done).count(), 4);
    assert_eq!(farm.sched.image(image_ref(0)).unwrap().pixels_done, 1_024);
}
