//! Tiles that are rendered once more by another worker, and what follows where they differ.

mod situation;

use model::JobId;
use sched::{Command, Config, Effect, Event, ImageState, JobState, RevokeReason};
use situation::*;

#[test]
fn a_tile_is_rendered_once_more_by_somebody_else_before_its_image_is_encoded() {
    let mut farm = suspicious();
    farm.job(1).worker(1, 1).worker(2, 1);
    assert_eq!(leased(&mut farm), [(1, 1, 0), (2, 2, 1)]);
    makes(&mut farm, (1, 1), 0, 0, 7);
    // Nothing else waits, and it may not check its own.
    assert_eq!(leased(&mut farm), []);
    makes(&mut farm, (2, 2), 0, 1, 7);
    // Each gets what the other did.
    assert_eq!(leased(&mut farm), [(2, 3, 0), (1, 4, 1)]);
    assert_eq!(state(&farm, 0), ImageState::Rendering);
    makes(&mut farm, (2, 3), 0, 0, 7);
    assert_eq!(leased(&mut farm), []);
    makes(&mut farm, (1, 4), 0, 1, 7);
    let effects = farm.never_mind();
    assert_eq!(effects.last(), Some(&encode(0)));
    let job = farm.sched.job(JobId(1)).unwrap();
    let counted = (job.blocks_done, job.blocks_again, job.blocks_twice);
    assert_eq!((counted, job.incidents), ((4, 0, 4), 0));
}

#[test]
fn where_nobody_else_is_there_nothing_is_verified() {
    let mut farm = suspicious();
    farm.job(1).worker(1, 2).never_mind();
    makes(&mut farm, (1, 1), 0, 0, 7);
    makes(&mut farm, (1, 2), 0, 1, 7);
    let effects = farm.never_mind();
    assert!(
        effects.ends_with(&[unverified(0, 2), encode(0)]),
        "{effects:?}"
    );
    assert_eq!(farm.sched.job(JobId(1)).unwrap().unverified, 2);
}

#[test]
fn a_check_is_let_be_when_everybody_else_has_left() {
    let mut farm = suspicious();
    farm.job(1).worker(1, 2);
    farm.worker(2, 0).wants_tiles(2, 1).never_mind();
    makes(&mut farm, (1, 1), 0, 0, 7);
    assert_eq!(leased(&mut farm), [(2, 3, 0)]);
    makes(&mut farm, (1, 2), 0, 1, 7);
    assert_eq!(state(&farm, 0), ImageState::Rendering);
    farm.is_told(Event::Goodbye { worker: worker(2) });
    assert_eq!(farm.never_mind().last(), Some(&encode(0)));
}

#[test]
fn a_third_decides_against_the_first_and_all_that_it_made_is_rendered_again() {
    let mut farm = Farm::new(Config {
        verify: 1_000_000,
        ..Config::new(EPOCH)
    });
    farm.job(2).worker(1, 1).worker(2, 1).worker(3, 1);
    assert_eq!(leased(&mut farm), [(1, 1, 0), (2, 2, 1), (3, 3, 0)]);
    // The first lies. Its next is of the second image.
    makes(&mut farm, (1, 1), 0, 0, 66);
    assert_eq!(leased(&mut farm), [(1, 4, 1)]);
    makes(&mut farm, (2, 2), 0, 1, 7);
    assert_eq!(leased(&mut farm), [(2, 5, 0)]);
    makes(&mut farm, (2, 5), 0, 0, 7);
    let effects = farm.never_mind();
    assert!(effects.contains(&Effect::Incident {
        block: block_ref(5, 0, block(0)),
        worker: worker(2),
        other: Some(worker(1)),
    }));
    assert!(effects.contains(&revoke(2, 5, RevokeReason::Differs)));
    // Neither gets more of it; the third, which is at work, decides when it is done.
    let rest = effects
        .iter()
        .filter(|effect| matches!(effect, Effect::Lease { .. }));
    assert_eq!(rest.count(), 0);
    makes(&mut farm, (3, 3), 1, 0, 7);
    // It checks what the second made, then what they differ about.
    assert_eq!(leased(&mut farm), [(3, 6, 1)]);
    makes(&mut farm, (3, 6), 0, 1, 7);
    assert_eq!(leased(&mut farm), [(3, 7, 0)]);
    makes(&mut farm, (3, 7), 0, 0, 7);
    let effects = farm.never_mind();
    let again = |image| Effect::RenderAgain {
        image: image_ref(image),
        worker: worker(1),
    };
    assert!(effects.contains(&again(0)), "{effects:?}");
    assert!(farm.sched.worker(worker(1)).unwrap().aside.is_some());
    assert!(farm.sched.worker(worker(2)).unwrap().aside.is_none());

    farm.command(Command::Again(model::ImageNumber(0)));
    assert!(farm.never_mind().contains(&drop_scratch(0)));
    assert_eq!(farm.sched.image(image_ref(0)).unwrap().pixels_done, 0);
    // The others finish it, and nothing that the first made is in it.
    let mut rounds = 0;
    while farm.sched.job(JobId(1)).unwrap().state == JobState::Running {
        rounds += 1;
        assert!(rounds < 100);
        let live: Vec<_> = (1..100)
            .filter_map(|number| {
                let (worker, image, rect) = farm.sched.attempt(attempt(number))?;
                Some((worker.id, number, image.image.0, rect.y0 / 32))
            })
            .collect();
        for (id, number, image, index) in live {
            makes(&mut farm, (id, number), image, index, 7);
        }
        for image in 0..2 {
            if state(&farm, image) == ImageState::Encoding {
                farm.encoded(image);
            }
        }
    }
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.images.encoded, job.incidents), (2, 2));
}

#[test]
fn a_third_decides_against_who_differed() {
    let mut farm = suspicious();
    farm.job(1).worker(1, 2).never_mind();
    makes(&mut farm, (1, 1), 0, 0, 7);
    farm.never_mind();
    // Alone it was not verified; now two come, and its second tile is.
    farm.worker(2, 0)
        .worker(3, 0)
        .wants_tiles(2, 1)
        .wants_tiles(2, 0);
    farm.wants_tiles(2, 1).never_mind();
    makes(&mut farm, (1, 2), 0, 1, 7);
    assert_eq!(leased(&mut farm), [(2, 3, 1)]);
    farm.wants_tiles(3, 1).never_mind();
    makes(&mut farm, (2, 3), 0, 1, 66);
    assert_eq!(leased(&mut farm), [(3, 4, 1)]);
    makes(&mut farm, (3, 4), 0, 1, 7);
    let effects = farm.never_mind();
    assert_eq!(effects.last(), Some(&encode(0)), "{effects:?}");
    assert!(farm.sched.worker(worker(2)).unwrap().aside.is_some());
    assert!(farm.sched.worker(worker(1)).unwrap().aside.is_none());
    let again = effects
        .iter()
        .filter(|effect| matches!(effect, Effect::RenderAgain { .. }));
    assert_eq!(again.count(), 0, "it had made nothing that counts");
}

#[test]
fn where_three_differ_the_image_fails_with_the_reason() {
    let mut farm = suspicious();
    farm.job(1).worker(1, 2);
    farm.worker(2, 0)
        .worker(3, 0)
        .wants_tiles(2, 1)
        .never_mind();
    makes(&mut farm, (1, 1), 0, 0, 1);
    assert_eq!(leased(&mut farm), [(2, 3, 0)]);
    farm.wants_tiles(3, 1).never_mind();
    makes(&mut farm, (2, 3), 0, 0, 2);
    assert_eq!(leased(&mut farm), [(3, 4, 0)]);
    makes(&mut farm, (3, 4), 0, 0, 3);
    let failed = farm.sched.failures(JobId(1));
    assert!(
        failed[0].reason.contains("three different pixels"),
        "{failed:?}"
    );
    assert_eq!(state(&farm, 0), ImageState::Failed);
}

#[test]
fn a_share_of_the_tiles_is_drawn_and_always_the_same() {
    let count = |share| {
        let mut farm = Farm::new(Config {
            verify: share,
            ..Config::new(EPOCH)
        });
        farm.job(500).worker(1, 1).worker(2, 1);
        for _ in 0..5_000 {
            let live = (1..3_000).rev().find_map(|number| {
                let (worker, image, rect) = farm.sched.attempt(attempt(number))?;
                Some((worker.id, number, image.image.0, rect.y0 / 32))
            });
            let Some((id, number, image, index)) = live else {
                break;
            };
            makes(&mut farm, (id, number), image, index, 7);
            if state(&farm, image) == ImageState::Encoding {
                farm.is_told(Event::ImageEncoded {
                    image: image_ref(image),
                    film: film(1),
                });
            }
        }
        let job = farm.sched.job(JobId(1)).unwrap();
        assert_eq!(job.images.encoded, 500);
        job.blocks_twice / 2
    };
    assert_eq!(count(0), 0);
    let tenth = count(100_000);
    assert!((60..140).contains(&tenth), "{tenth} of 1,000 tiles");
    assert_eq!(count(100_000), tenth);
}
