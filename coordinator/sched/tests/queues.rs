//! Workers that stand for a cluster's queue: whole images, cut by the rule of thesis §C.3.2, and as many as they have credit for.

mod situation;

use std::collections::BTreeMap;

use model::{AttemptId, Begun, Digest, Epoch, Lease, Rect, Resolution, Span};
use sched::{
    BlockRef, Effect, Event, ImageState, LinkId, Offer, Queue, RevokeReason, Submission, TileShape,
    Verdict, WhyWorker,
};
use situation::{
    EPOCH, Farm, encode, farm, forget, image_ref, makes, offer, state, submission, suspicious,
    unverified, worker,
};

const SITE: u64 = 1;
const LOCAL: u64 = 2;

/// Snowdon of thesis table C.1: 48 tiles of an image of 800×600 pixels.
const SNOWDON: Queue = Queue {
    min_tile_pixels: 5_000,
    max_array_size: 75_000,
    lag: Span::from_secs(300),
    patience: Span::from_secs(3_600),
};

/// A job of so many images of 800×600 pixels, by time.
fn job(farm: &mut Farm, images: u32) {
    let resolution = Resolution {
        width: 800,
        height: 600,
    };
    farm.is_told(Event::Submit(Submission {
        window: resolution.rect(),
        tiles: TileShape::Time { aim: None },
        ..submission(1, images)
    }));
}

fn site(farm: &mut Farm, queue: Queue, images: u32) {
    comes(farm, queue, &[]);
    farm.wants_tiles(SITE, images);
}

fn comes(farm: &mut Farm, queue: Queue, begun: &[Begun]) {
    farm.is_told(Event::WorkerJoined {
        worker: worker(SITE),
        link: LinkId(1_000),
        offer: Offer {
            threads: 4,
            queue: Some(queue),
            ..offer()
        },
        held: begun.iter().map(|begun| begun.attempt).collect(),
        begun: begun.to_vec(),
    });
}

/// What was leased to a worker since somebody last looked, by image.
fn leases(farm: &mut Farm, id: u64) -> BTreeMap<u32, Vec<Lease>> {
    let mut images = BTreeMap::<_, Vec<_>>::new();
    for effect in farm.never_mind() {
        if let Effect::Lease { worker, lease } = effect
            && worker.id == id
        {
            images.entry(lease.image.image.0).or_default().push(lease);
        }
    }
    images
}

/// All blocks of a lease are stored; one of an attempt that was ended by the block before is passed over.
fn delivers(farm: &mut Farm, id: u64, lease: &Lease) {
    for rect in lease.tile.blocks() {
        store(farm, id, (lease.attempt, lease.image.image.0), rect);
    }
}

fn store(farm: &mut Farm, id: u64, (attempt, image): (AttemptId, u32), rect: Rect) {
    let block = BlockRef {
        attempt,
        image: image_ref(image),
        rect,
    };
    if farm.sched.accepts(worker(id), block) == Verdict::Accept {
        farm.is_told(Event::BlockStored {
            worker: worker(id),
            block,
            elapsed: Span::from_millis(10),
            pixels: Digest([1; 32]),
        });
    }
}

fn sizes(leases: &[Lease]) -> Vec<(u32, u32)> {
    let mut sizes: Vec<_> = leases
        .iter()
        .map(|lease| (lease.tile.width(), lease.tile.height()))
        .collect();
    sizes.dedup();
    sizes
}

#[test]
fn an_image_is_one_array_by_the_rule() {
    for (min_tile_pixels, tiles, size) in [
        (2_500, 192, (50, 50)),
        (1_600, 300, (40, 40)),
        (5_000, 48, (100, 100)),
    ] {
        let mut farm = farm();
        job(&mut farm, 3);
        let queue = Queue {
            min_tile_pixels,
            ..SNOWDON
        };
        site(&mut farm, queue, 1);
        let images = leases(&mut farm, SITE);
        assert_eq!(images.len(), 1);
        assert_eq!(images[&0].len(), tiles);
        assert_eq!(sizes(&images[&0]), [size]);
    }
}

#[test]
fn an_array_is_no_larger_than_the_queue_takes() {
    let mut farm = farm();
    job(&mut farm, 1);
    let queue = Queue {
        max_array_size: 10,
        ..SNOWDON
    };
    site(&mut farm, queue, 1);
    assert!(leases(&mut farm, SITE)[&0].len() <= 10);
}

#[test]
fn the_next_image_comes_when_one_is_done() {
    let mut farm = farm();
    job(&mut farm, 4);
    site(&mut farm, SNOWDON, 2);
    let images = leases(&mut farm, SITE);
    assert_eq!(images.keys().collect::<Vec<_>>(), [&0, &1]);
    for lease in &images[&0][1..] {
        delivers(&mut farm, SITE, lease);
    }
    assert!(leases(&mut farm, SITE).is_empty());
    delivers(&mut farm, SITE, &images[&0][0]);
    assert_eq!(state(&farm, 0), ImageState::Encoding);
    let next = leases(&mut farm, SITE);
    assert_eq!(next.keys().collect::<Vec<_>>(), [&2]);
    assert_eq!(next[&2].len(), 48);
}

#[test]
fn a_tile_that_failed_goes_to_the_queue_again() {
    let mut farm = farm();
    job(&mut farm, 2);
    site(&mut farm, SNOWDON, 1);
    let images = leases(&mut farm, SITE);
    let first = &images[&0][0];
    let block = first.tile.blocks().next().unwrap();
    store(&mut farm, SITE, (first.attempt, 0), block);
    farm.fails(SITE, first.attempt.number);
    let again = leases(&mut farm, SITE);
    assert_eq!(again.len(), 1);
    assert_eq!(again[&0].len(), 1);
    assert_eq!(again[&0][0].tile, first.tile);
    // The block that is durable is not asked for again.
    assert_eq!(again[&0][0].wanted.len(), first.tile.blocks().count() - 1);
}

#[test]
fn others_begin_their_own_images_and_the_queue_leaves_those_alone() {
    let mut farm = farm();
    job(&mut farm, 4);
    farm.worker(LOCAL, 2);
    let local = leases(&mut farm, LOCAL);
    assert_eq!(local.keys().collect::<Vec<_>>(), [&0]);
    site(&mut farm, SNOWDON, 1);
    let images = leases(&mut farm, SITE);
    assert_eq!(images.keys().collect::<Vec<_>>(), [&1]);
}

#[test]
fn the_queue_takes_over_what_nobody_else_is_there_for() {
    let mut farm = farm();
    job(&mut farm, 1);
    farm.worker(LOCAL, 2);
    let begun = leases(&mut farm, LOCAL)[&0].len();
    farm.is_told(Event::Goodbye {
        worker: worker(LOCAL),
    });
    site(&mut farm, SNOWDON, 1);
    let images = leases(&mut farm, SITE);
    assert_eq!(images.len(), 1);
    let pixels: u64 = images[&0].iter().map(|lease| lease.tile.area()).sum();
    assert_eq!(pixels, 800 * 600);
    assert!(begun > 0);
}

#[test]
fn what_waits_in_a_queue_waits_for_hours() {
    let mut farm = farm();
    job(&mut farm, 1);
    site(&mut farm, SNOWDON, 1);
    farm.never_mind();
    farm.waits_with_heartbeats(Span::from_secs(7_200), SITE, &[]);
    farm.wants(&[]);
}

#[test]
fn what_runs_there_is_given_the_time_until_it_is_heard_of() {
    let mut farm = farm();
    job(&mut farm, 1);
    site(&mut farm, SNOWDON, 1);
    let first = leases(&mut farm, SITE)[&0][0].attempt;
    // Nothing is measured: five minutes, and five until the next poll.
    let running = [(first.number, 0)];
    farm.waits_with_heartbeats(Span::from_secs(590), SITE, &running);
    farm.wants(&[]);
    farm.waits_with_heartbeats(Span::from_secs(20), SITE, &running);
    let revoked = farm
        .never_mind()
        .into_iter()
        .find_map(|effect| match effect {
            Effect::Revoke { reason, .. } => Some(reason),
            _ => None,
        });
    assert_eq!(revoked, Some(RevokeReason::NoProgress));
}

#[test]
fn a_queue_that_was_lost_leaves_its_image_to_others() {
    let mut farm = farm();
    job(&mut farm, 1);
    site(&mut farm, SNOWDON, 1);
    farm.never_mind();
    farm.worker(LOCAL, 2);
    // It is not heard of any more.
    farm.waits_with_heartbeats(Span::from_secs(5), LOCAL, &[]);
    assert_eq!(leases(&mut farm, LOCAL).keys().collect::<Vec<_>>(), [&0]);
}

#[test]
fn what_a_queue_renders_out_of_reach_counts_when_it_is_back_within_its_patience() {
    for (away, counts) in [(3_599, true), (3_601, false)] {
        let mut farm = farm();
        job(&mut farm, 1);
        site(&mut farm, SNOWDON, 1);
        let ours = leases(&mut farm, SITE)[&0].clone();
        let held: Vec<_> = ours.iter().map(|lease| lease.attempt).collect();
        farm.heartbeat(SITE, &[(held[0].number, 0)]);
        farm.is_told(Event::LinkClosed {
            worker: worker(SITE),
            link: LinkId(1_000),
        });
        // Whoever is there may have of it meanwhile.
        farm.worker(LOCAL, 1);
        let theirs = leases(&mut farm, LOCAL)[&0].clone();
        store(
            &mut farm,
            LOCAL,
            (theirs[0].attempt, 0),
            theirs[0].tile.blocks().next().unwrap(),
        );
        farm.is_told(Event::Goodbye {
            worker: worker(LOCAL),
        });
        farm.waits(Span::from_secs(away));
        let was_lost = |effect: &Effect| *effect == forget(SITE);
        assert_eq!(farm.never_mind().iter().any(was_lost), !counts);
        farm.is_told(Event::WorkerJoined {
            worker: worker(SITE),
            link: LinkId(1_001),
            offer: Offer {
                threads: 4,
                queue: Some(SNOWDON),
                ..offer()
            },
            held,
            begun: vec![],
        });
        // What it had begun, of which whoever was here meanwhile has left the rest.
        let kept = &ours[0];
        let missing = farm.sched.missing(worker(SITE), kept.attempt);
        assert_eq!(missing.is_some(), counts);
        let before = farm.sched.image(image_ref(0)).unwrap().pixels_done;
        for rect in missing.unwrap_or_default() {
            store(&mut farm, SITE, (kept.attempt, 0), rect);
        }
        let more = farm.sched.image(image_ref(0)).unwrap().pixels_done - before;
        assert_eq!(more > 0, counts);
    }
}

#[test]
fn its_tiles_outlive_the_coordinator() {
    let mut farm = farm();
    job(&mut farm, 2);
    let tile = |x: u32| Rect {
        x0: 100 * x,
        y0: 0,
        x1: 100 * (x + 1),
        y1: 100,
    };
    let old = |number: u64| AttemptId {
        epoch: Epoch(EPOCH.0 - 1),
        number,
    };
    let begun = |number: u64, x: u32| Begun {
        attempt: old(number),
        image: image_ref(0),
        tile: tile(x),
    };
    comes(&mut farm, SNOWDON, &[begun(7, 0), begun(8, 3)]);
    let adopted = |effect: &Effect| matches!(effect, Effect::Adopted { .. });
    assert_eq!(
        farm.never_mind()
            .iter()
            .filter(|effect| adopted(effect))
            .count(),
        2
    );
    farm.wants_tiles(SITE, 1);
    let images = leases(&mut farm, SITE);
    assert_eq!(images.keys().collect::<Vec<_>>(), [&0]);
    assert_eq!(images[&0].len(), 46);
    for rect in tile(0).blocks() {
        store(&mut farm, SITE, (old(7), 0), rect);
    }
    assert_eq!(farm.sched.image(image_ref(0)).unwrap().pixels_done, 10_000);
}

#[test]
fn who_wants_more_images_gets_them_at_once() {
    let mut farm = farm();
    job(&mut farm, 4);
    site(&mut farm, SNOWDON, 1);
    assert_eq!(leases(&mut farm, SITE).keys().collect::<Vec<_>>(), [&0]);
    farm.wants_tiles(SITE, 3);
    let more = leases(&mut farm, SITE);
    assert_eq!(more.keys().collect::<Vec<_>>(), [&1, &2]);
}

#[test]
fn what_failed_where_it_was_begun_does_not_wait_for_a_queue() {
    let mut farm = farm();
    farm.job(1).worker(LOCAL, 2);
    comes(&mut farm, SNOWDON, &[]);
    farm.wants_tiles(SITE, 1).never_mind();
    farm.fails(LOCAL, 1);
    // It was cut for nobody else, and who began it tries again once it says that it has room.
    let again = leases(&mut farm, LOCAL);
    assert_eq!(again[&0].len(), 1);
}

#[test]
fn nobody_waits_for_a_queue_to_check_anything() {
    let mut farm = suspicious();
    farm.job(1).worker(LOCAL, 2);
    comes(&mut farm, SNOWDON, &[]);
    farm.never_mind();
    makes(&mut farm, (LOCAL, 1), 0, 0, 7);
    makes(&mut farm, (LOCAL, 2), 0, 1, 7);
    let effects = farm.never_mind();
    assert!(
        effects.ends_with(&[unverified(0, 2), encode(0)]),
        "{effects:?}"
    );
}

#[test]
fn it_says_that_it_is_full() {
    let mut farm = farm();
    job(&mut farm, 4);
    site(&mut farm, SNOWDON, 2);
    let why = farm.sched.why_worker(worker(SITE));
    assert_eq!(why, Some(WhyWorker::Full { attempts: 96 }));
}
