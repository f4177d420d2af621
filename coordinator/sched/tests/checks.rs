//! Checks that wait for a worker: how they are cut, given up and passed on, and what becomes of whoever lied.

mod situation;

use model::{Digest, ImageNumber, JobId, Rect, Span, SubmissionId, WorkerId};
use sched::{
    Command, Config, Effect, Event, ImageState, Limits, LinkId, Offer, TileShape, Verdict,
    WhyImage, WhyJob, WhyWorker,
};
use situation::*;

const WAIT: Span = Span::from_secs(300);

/// Time passes while workers give signs of life.
fn waits_with(farm: &mut Farm, span: Span, ids: &[u64]) {
    let end = farm.now + span;
    while farm.now < end {
        for &id in ids {
            farm.heartbeat(id, &[]);
        }
        farm.waits(Span::from_secs(1).min(end - farm.now));
    }
}

/// One image of two tiles, both rendered by worker 1; worker 2 is there and wants no tile.
fn nobody_checks() -> Farm {
    let mut farm = suspicious();
    farm.job(1).worker(1, 2).worker(2, 0);
    makes(&mut farm, (1, 1), 0, 0, 7);
    makes(&mut farm, (1, 2), 0, 1, 7);
    assert_eq!(state(&farm, 0), ImageState::Rendering);
    farm.never_mind();
    farm
}

#[test]
fn a_check_that_nobody_does_is_given_up_after_a_while() {
    let mut farm = nobody_checks();
    waits_with(&mut farm, Span(WAIT.0 - 1), &[1, 2]);
    farm.wants(&[]);
    waits_with(&mut farm, Span(1), &[1, 2]);
    farm.wants(&[unverified(0, 2), encode(0)]);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().unverified, 2);
}

#[test]
fn a_check_waits_on_for_who_is_busy() {
    let mut farm = suspicious();
    let mut first = submission(2, 1);
    first.priority = 1;
    farm.job(1).worker(1, 2).never_mind();
    // Worker 2 is busy with a job that comes first.
    farm.is_told(Event::Submit(first)).worker(2, 1);
    farm.never_mind();
    makes(&mut farm, (1, 1), 0, 0, 7);
    makes(&mut farm, (1, 2), 0, 1, 7);
    let is_encoded = |effects: &[Effect]| effects.contains(&encode(0));
    for _ in 0..3 * WAIT.0 / 1_000_000 {
        farm.heartbeat(1, &[]);
        // It makes progress, slowly.
        farm.heartbeat(2, &[(3, 0)]);
        farm.waits(Span::from_secs(1));
    }
    assert!(!is_encoded(&farm.never_mind()));
    farm.wants_tiles(2, 8);
    assert!(!leased(&mut farm).is_empty());
}

#[test]
fn time_in_which_a_job_is_paused_does_not_count() {
    let mut farm = nobody_checks();
    farm.command(Command::Pause).never_mind();
    waits_with(&mut farm, WAIT.times(2), &[1, 2]);
    farm.command(Command::Resume).wants(&[commanded()]);
    farm.wants_tiles(2, 2);
    assert_eq!(leased(&mut farm), [(2, 3, 0), (2, 4, 1)]);
}

#[test]
fn a_check_is_given_up_at_once_when_the_last_who_could_do_it_leaves() {
    let mut farm = nobody_checks();
    let left = Effect::Forget { worker: worker(2) };
    farm.is_told(Event::Goodbye { worker: worker(2) })
        .wants(&[left, unverified(0, 2), encode(0)]);
}

#[test]
fn a_check_that_fails_goes_to_another_worker_and_is_given_up_after_a_few() {
    let mut farm = nobody_checks();
    farm.worker(3, 0).worker(4, 0).wants_tiles(2, 1);
    assert_eq!(leased(&mut farm), [(2, 3, 0)]);
    farm.fails(2, 3);
    // The other tile's check, which it did not fail.
    assert_eq!(leased(&mut farm), [(2, 4, 1)]);
    for id in 3..5 {
        farm.wants_tiles(id, 1);
        assert_eq!(leased(&mut farm), [(id, id + 2, 0)]);
        farm.fails(id, id + 2).wants_tiles(id, 0);
    }
    makes(&mut farm, (2, 4), 0, 1, 7);
    let effects = farm.never_mind();
    assert!(
        effects.ends_with(&[unverified(0, 1), encode(0)]),
        "{effects:?}"
    );
}

/// A job of one image of four squares, cut by time.
fn by_time() -> Farm {
    let mut farm = Farm::new(Config {
        verify: 1_000_000,
        min_tile_pixels: 10_000,
        ..Config::new(EPOCH)
    });
    let mut timed = submission(1, 1);
    timed.tiles = TileShape::Time {
        aim: Some(Span::from_secs(100)),
    };
    farm.is_told(Event::Submit(timed));
    farm
}

/// Blocks arrive that took ten seconds each.
fn takes_ten_seconds_each(farm: &mut Farm, (id, number): (u64, u64), blocks: &[Rect]) {
    for &rect in blocks {
        for _ in 0..10 {
            farm.heartbeat(id, &[(number, 0)]);
            for other in (1..4).filter(|&other| other != id) {
                farm.heartbeat(other, &[]);
            }
            farm.waits(Span::from_secs(1));
        }
        let reference = block_ref(number, 0, rect);
        let verdict = farm.sched.accepts(worker(id), reference);
        assert!(!matches!(verdict, Verdict::Refuse(_)), "{verdict:?}");
        farm.is_told(Event::BlockStored {
            worker: worker(id),
            block: reference,
            elapsed: Span::from_secs(10),
            pixels: Digest([7; 32]),
        });
    }
}

/// A worker joins that must be gone after a while.
fn joins_for(farm: &mut Farm, id: u64, time_left: Option<Span>) {
    farm.is_told(Event::WorkerJoined {
        worker: worker(id),
        link: LinkId(100 + id),
        offer: Offer {
            time_left,
            queue: None,
            ..offer()
        },
        held: vec![],
        begun: vec![],
    })
    .wants_tiles(id, 1);
}

#[test]
fn a_check_is_cut_down_to_what_a_worker_has_time_for_and_goes_on_where_one_ended() {
    let mut farm = by_time();
    farm.worker(1, 1).joins(2, &[]);
    let all = leased_blocks(&mut farm).remove(0).2;
    assert_eq!(all.len(), 4);
    takes_ten_seconds_each(&mut farm, (1, 1), &all);
    assert_eq!(state(&farm, 0), ImageState::Rendering);
    // All of it would take forty seconds.
    joins_for(&mut farm, 2, Some(Span::from_secs(30)));
    let (id, number, half) = leased_blocks(&mut farm).remove(0);
    assert_eq!((id, half.len()), (2, 2));
    takes_ten_seconds_each(&mut farm, (id, number), &half[..1]);
    farm.joins(3, &[]);
    farm.is_told(Event::Goodbye { worker: worker(2) });
    // What was found right is not rendered a third time.
    farm.wants_tiles(3, 2);
    let leases = leased_blocks(&mut farm);
    let mut left: Vec<Rect> = all;
    left.retain(|&block| block != half[0]);
    let mut again: Vec<Rect> = leases
        .iter()
        .flat_map(|(_, _, blocks)| blocks.clone())
        .collect();
    again.sort_by_key(|block| (block.y0, block.x0));
    assert_eq!(again, left);
    for (id, number, blocks) in leases {
        takes_ten_seconds_each(&mut farm, (id, number), &blocks);
    }
    assert_eq!(farm.never_mind().last(), Some(&encode(0)));
    assert_eq!(farm.sched.job(JobId(1)).unwrap().unverified, 0);
}

#[test]
fn a_doubt_outlives_the_worker_whose_pixels_are_durable() {
    let mut farm = suspicious();
    farm.job(1).worker(1, 1).worker(3, 1);
    assert_eq!(leased(&mut farm), [(1, 1, 0), (3, 2, 1)]);
    // Its link closes, and another one begins the same tile.
    farm.is_told(Event::LinkClosed {
        worker: worker(1),
        link: LinkId(1),
    })
    .worker(2, 1);
    assert_eq!(leased(&mut farm), [(2, 3, 0)]);
    let stores = |farm: &mut Farm, (id, number), index, pixels| {
        farm.is_told(Event::BlockStored {
            worker: worker(id),
            block: block_ref(number, 0, block(index)),
            elapsed: Span::from_millis(1),
            pixels: Digest([pixels; 32]),
        });
    };
    stores(&mut farm, (1, 1), 0, 66);
    stores(&mut farm, (2, 3), 0, 7);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().incidents, 1);
    // The first is lost; what it left out is rendered by the third, which then decides about the rest.
    waits_with(&mut farm, Span::from_secs(5), &[2, 3]);
    assert!(farm.sched.worker(worker(1)).is_none());
    makes(&mut farm, (3, 2), 0, 1, 7);
    assert_eq!(leased(&mut farm), [(3, 4, 0)]);
    stores(&mut farm, (3, 4), 1, 7);
    assert_eq!(leased(&mut farm), [(3, 5, 0)]);
    stores(&mut farm, (3, 5), 0, 7);
    let again = Effect::RenderAgain {
        image: image_ref(0),
        worker: worker(1),
    };
    let effects = farm.never_mind();
    assert!(effects.contains(&again), "{effects:?}");
}

fn is_aside(farm: &Farm, id: u64) -> bool {
    let view = farm.sched.worker(worker(id));
    view.is_some_and(|view| view.aside.is_some())
}

/// Worker 1 is found to have made wrong pixels of image 0, by workers 2 and 3.
fn convicts(farm: &mut Farm) {
    farm.job(2).worker(1, 1).worker(2, 1).worker(3, 1);
    makes(farm, (1, 1), 0, 0, 66);
    makes(farm, (2, 2), 0, 1, 7);
    makes(farm, (2, 5), 0, 0, 7);
    makes(farm, (3, 3), 1, 0, 7);
    makes(farm, (3, 6), 0, 1, 7);
    makes(farm, (3, 7), 0, 0, 7);
    assert!(is_aside(farm, 1));
}

#[test]
fn it_is_said_what_is_verified_and_who_was_expelled() {
    let farm = nobody_checks();
    let why = farm.sched.why_job(JobId(1));
    assert_eq!(why, Some(WhyJob::Verifying { checks: 2 }));
    let why = farm.sched.why_image(image_ref(0));
    let verifying = WhyImage::Verifying {
        attempts: 0,
        checks: 2,
    };
    assert_eq!(why, Some(verifying));
    assert_eq!(farm.sched.why_worker(worker(1)), Some(WhyWorker::OwnWork));
    let mut farm = suspicious();
    convicts(&mut farm);
    let why = farm.sched.why_worker(worker(1));
    assert!(matches!(why, Some(WhyWorker::Expelled { .. })), "{why:?}");
    let sentence = why.map(|why| why.to_string()).unwrap_or_default();
    assert!(sentence.contains("its pixels were wrong"), "{sentence}");
}

#[test]
fn what_differed_is_undecided_until_a_third_has_decided() {
    let undecided = |farm: &Farm| {
        let view = farm.sched.job(JobId(1)).expect("it is known");
        (view.incidents, view.undecided)
    };
    let mut farm = suspicious();
    convicts(&mut farm);
    farm.command(Command::Again(ImageNumber(0)));
    assert_eq!(undecided(&farm), (2, 0));
    // Where nobody else is there, nobody decides.
    let mut farm = suspicious();
    farm.job(1).worker(1, 2).worker(2, 0);
    makes(&mut farm, (1, 1), 0, 0, 7);
    makes(&mut farm, (1, 2), 0, 1, 7);
    farm.never_mind();
    farm.wants_tiles(2, 1);
    let (id, number, index) = leased(&mut farm).remove(0);
    makes(&mut farm, (id, number), 0, index, 66);
    while let Some((_, _, rect)) = farm.sched.attempt(attempt(number + 1)) {
        makes(&mut farm, (2, number + 1), 0, rect.y0 / 32, 7);
    }
    while let Some((id, number, index)) = leased(&mut farm).pop() {
        makes(&mut farm, (id, number), 0, index, 7);
    }
    assert_eq!(state(&farm, 0), ImageState::Encoding);
    assert_eq!(undecided(&farm), (1, 1));
}

#[test]
fn whoever_was_expelled_stays_so_however_it_comes_back() {
    let mut farm = suspicious();
    convicts(&mut farm);
    farm.command(Command::Again(ImageNumber(0))).never_mind();
    farm.is_told(Event::Goodbye { worker: worker(1) });
    farm.worker(1, 1);
    assert!(leased(&mut farm).iter().all(|&(id, ..)| id != 1));
    assert!(farm.sched.worker(worker(1)).unwrap().aside.is_some());
    // Its process is started again.
    let anew = WorkerId {
        id: 1,
        incarnation: 2,
    };
    farm.is_told(Event::WorkerJoined {
        worker: anew,
        link: LinkId(77),
        offer: offer(),
        held: vec![],
        begun: vec![],
    })
    .is_told(Event::Credit {
        worker: anew,
        credit: 1,
    });
    assert!(leased(&mut farm).iter().all(|&(id, ..)| id != 1));
    // It is let back in the end.
    let hour = Span::from_secs(3_600);
    let end = farm.now + hour;
    while farm.now < end {
        farm.is_told(Event::Heartbeat {
            worker: anew,
            running: vec![],
        });
        farm.waits(Span::from_secs(1));
    }
    assert_eq!(farm.sched.worker(anew).unwrap().aside, None);
}

#[test]
fn the_first_to_be_expelled_is_forgotten_where_there_are_too_many() {
    let mut farm = Farm::new(Config {
        verify: 1_000_000,
        limits: Limits {
            expelled_max: 0,
            ..Limits::default()
        },
        ..Config::new(EPOCH)
    });
    farm.job(1).worker(1, 1).worker(2, 1).worker(3, 1);
    farm.never_mind();
    makes(&mut farm, (1, 1), 0, 0, 66);
    makes(&mut farm, (2, 2), 0, 1, 7);
    while let Some((id, number, index)) = leased(&mut farm).pop() {
        makes(&mut farm, (id, number), 0, index, 7);
    }
    farm.is_told(Event::Goodbye { worker: worker(1) });
    farm.worker(1, 1);
    assert_eq!(farm.sched.worker(worker(1)).unwrap().aside, None);
}

#[test]
fn whoever_is_set_aside_for_a_job_and_away_is_missed_once() {
    let mut farm = suspicious();
    farm.job(3).worker(1, 1).worker(2, 1);
    farm.worker(3, 0).worker(4, 0).never_mind();
    makes(&mut farm, (1, 1), 0, 0, 66);
    makes(&mut farm, (2, 2), 0, 1, 7);
    // One of the first two checks the other's tile, and both get no more of the job.
    farm.wants_tiles(1, 0);
    while let Some((id, number, index)) = leased(&mut farm).pop() {
        let image = farm
            .sched
            .attempt(attempt(number))
            .map_or(0, |(_, image, _)| image.image.0);
        makes(
            &mut farm,
            (id, number),
            image,
            index,
            if id == 1 { 66 } else { 7 },
        );
    }
    assert_eq!(farm.sched.job(JobId(1)).unwrap().incidents, 1);
    // Both are away; there are two others, and a tile that failed on one goes to the other.
    for (id, link) in [(1, 1), (2, 2)] {
        farm.is_told(Event::LinkClosed {
            worker: worker(id),
            link: LinkId(link),
        });
    }
    farm.wants_tiles(3, 1);
    let (id, number, index) = leased(&mut farm).pop().unwrap();
    let (_, image, rect) = farm.sched.attempt(attempt(number)).unwrap();
    farm.fails(id, number);
    farm.wants_tiles(3, 2);
    let again = |farm: &Farm, number| {
        let lease = farm.sched.attempt(attempt(number));
        lease.is_some_and(|(_, of, tile)| (of, tile) == (image, rect))
    };
    for (_, number, _) in leased(&mut farm) {
        assert!(!again(&farm, number), "tile {index} failed on it");
    }
    farm.wants_tiles(4, 8);
    let leases = leased(&mut farm);
    assert!(
        leases.iter().any(|&(_, number, _)| again(&farm, number)),
        "{leases:?}"
    );
}

#[test]
fn whoever_is_set_aside_for_fewer_jobs_is_found_behind_those_that_are_for_more() {
    let mut farm = Farm::new(Config {
        faults_max: 1,
        jobs_aside_max: 3,
        ..Config::new(EPOCH)
    });
    // Twenty workers, of which nine fail a tile of the first job, and eight of those one of the second.
    for id in 1..=20 {
        farm.worker(id, 0);
    }
    farm.job(9);
    farm.is_told(Event::Submit(submission(2, 9)));
    let pauses = |farm: &mut Farm, job, command| {
        farm.command_of(job, command);
    };
    for (job, failing) in [(1, 9), (2, 8)] {
        pauses(&mut farm, 3 - job, Command::Pause);
        for id in 1..=failing {
            farm.never_mind();
            farm.wants_tiles(id, 1);
            let (_, number, index) = leased(&mut farm).pop().unwrap();
            farm.wants_tiles(id, 0).fails(id, number).wants_tiles(20, 1);
            let (_, number, of) = leased(&mut farm).pop().unwrap();
            assert_eq!(index, of);
            let (_, image, rect) = farm.sched.attempt(attempt(number)).unwrap();
            farm.wants_tiles(20, 0);
            for rect in rect.blocks() {
                farm.is_told(Event::BlockStored {
                    worker: worker(20),
                    block: sched::BlockRef {
                        attempt: attempt(number),
                        image,
                        rect,
                    },
                    elapsed: Span::from_millis(1),
                    pixels: Digest([1; 32]),
                });
            }
        }
        pauses(&mut farm, 3 - job, Command::Resume);
    }
    pauses(&mut farm, 2, Command::Pause);
    farm.never_mind();
    for id in 1..=9 {
        farm.wants_tiles(id, 1);
    }
    assert_eq!(leased(&mut farm), []);
    pauses(&mut farm, 2, Command::Resume);
    let leases = leased(&mut farm);
    assert!(matches!(leases[..], [(9, ..)]), "{leases:?}");
}

#[test]
fn while_a_check_waits_whoever_is_free_helps_with_what_takes_long() {
    let mut farm = suspicious();
    farm.job(1).worker(1, 1).worker(2, 1);
    farm.heartbeat(1, &[(1, 0)]);
    // The second does its tile in twenty seconds; the first, who is to check it, is at its own for long.
    for index in [2, 3] {
        for _ in 0..10 {
            farm.heartbeat(1, &[(1, 0)]).heartbeat(2, &[(2, 0)]);
            farm.waits(Span::from_secs(1));
        }
        farm.is_told(Event::BlockStored {
            worker: worker(2),
            block: block_ref(2, 0, block(index)),
            elapsed: Span::from_secs(10),
            pixels: Digest([7; 32]),
        });
    }
    assert_eq!(leased(&mut farm), [(1, 1, 0), (2, 2, 1), (2, 3, 0)]);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().seconds, 1);
}

/// Worker 1 makes all of so many images and worker 2 one, in which it is then found that the first lied in another.
fn convicted_of(farm: &mut Farm, images: u32) -> Vec<Effect> {
    farm.job(images).worker(1, 2);
    for image in 0..images {
        makes(farm, (1, u64::from(2 * image) + 1), image, 0, 66);
        makes(farm, (1, u64::from(2 * image) + 2), image, 1, 66);
        farm.encoded(image);
    }
    farm.never_mind();
    // Nobody was there to notice. Another job is verified by two others.
    farm.is_told(Event::Submit(submission(2, 1)));
    farm.wants_tiles(1, 1).worker(2, 0).worker(3, 0);
    let first = 2 * u64::from(images) + 1;
    let made = |farm: &mut Farm, id, number, index: u32, pixels| {
        for rect in tile(index).blocks() {
            let Some((_, image, _)) = farm.sched.attempt(attempt(number)) else {
                return;
            };
            farm.is_told(Event::BlockStored {
                worker: worker(id),
                block: sched::BlockRef {
                    attempt: attempt(number),
                    image,
                    rect,
                },
                elapsed: Span::from_millis(1),
                pixels: Digest([pixels; 32]),
            });
        }
    };
    farm.wants_tiles(1, 0);
    made(farm, 1, first, 0, 66);
    farm.wants_tiles(2, 1);
    farm.never_mind();
    // The second has the other tile, then what the first made, and the third decides.
    made(farm, 2, first + 1, 1, 7);
    farm.wants_tiles(3, 1);
    farm.never_mind();
    let mut said = Vec::new();
    for _ in 0..10 {
        let live: Vec<_> = (first..first + 20)
            .filter_map(|number| {
                let (worker, _, rect) = farm.sched.attempt(attempt(number))?;
                Some((worker.id, number, rect.y0 / 32))
            })
            .collect();
        for (id, number, index) in live {
            made(farm, id, number, index, 7);
        }
        said.extend(farm.never_mind());
    }
    assert!(is_aside(farm, 1));
    said
}

fn asked_again(effects: &[Effect]) -> Vec<model::ImageRef> {
    let asked = effects.iter().filter_map(|effect| match effect {
        Effect::RenderAgain { image, .. } => Some(*image),
        _ => None,
    });
    asked.collect()
}

#[test]
fn of_many_images_with_wrong_pixels_a_few_are_asked_for_at_a_time_and_none_is_lost() {
    let mut farm = suspicious();
    let said = convicted_of(&mut farm, 50);
    let mut asked = asked_again(&said);
    assert_eq!(asked.len(), 16);
    let mut answered = 0;
    while let Some(&image) = asked.get(answered) {
        answered += 1;
        farm.command_of(image.job.0, Command::Again(image.image));
        let more = asked_again(&farm.never_mind());
        assert!(more.len() <= 1, "{more:?}");
        asked.extend(more);
    }
    asked.sort_unstable();
    asked.dedup();
    // All that it made of the first job, and the one where it was found out.
    assert_eq!(asked.len(), 51);
}

#[test]
fn images_with_wrong_pixels_of_a_job_that_is_over_wait_until_it_may_go_on() {
    let mut farm = Farm::new(Config {
        verify: 1_000_000,
        limits: Limits {
            jobs_max: 1,
            ..Limits::default()
        },
        ..Config::new(EPOCH)
    });
    let said = convicted_of(&mut farm, 3);
    let of_second = model::ImageRef {
        job: JobId(2),
        image: ImageNumber(0),
    };
    assert_eq!(asked_again(&said), [of_second]);
    farm.command_of(2, Command::Cancel);
    let asked = asked_again(&farm.never_mind());
    assert_eq!(asked, [0, 1, 2].map(image_ref));
    // It is refused where another job was submitted in between, and asked for again later.
    farm.is_told(Event::Submit(sched::Submission {
        submission: SubmissionId(3),
        ..submission(3, 1)
    }));
    for image in asked {
        farm.command_of(1, Command::Again(image.image));
    }
    assert_eq!(asked_again(&farm.never_mind()), []);
    farm.command_of(3, Command::Cancel);
    assert_eq!(asked_again(&farm.never_mind()), [0, 1, 2].map(image_ref));
    farm.command_of(1, Command::Again(ImageNumber(0)));
    assert_eq!(farm.sched.image(image_ref(0)).unwrap().pixels_done, 0);
}
