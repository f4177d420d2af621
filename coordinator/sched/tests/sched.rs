//! What a coordinator decides, situation by situation: exact effects, and nothing else.

mod situation;

use model::{Digest, Epoch, JobId, Rect, Resolution, Revision, Span, SubmissionId};
use sched::{
    BlockRefusal, Command, Config, Effect, Event, ImageState, JobOutcome, JobState, Limits, LinkId,
    Offer, RevokeReason, Submission, SubmitRefusal, TileShape, Verdict, WorkerRefusal,
};
use situation::*;

const LIVENESS: Span = Span::from_secs(4);

#[test]
fn a_job_goes_from_leases_to_frames() {
    let mut farm = farm();
    farm.job(1)
        .wants(&[Effect::Submitted {
            submission: SubmissionId(1),
            job: JobId(1),
        }])
        .joins(1, &[])
        .wants(&[welcome(1, &[])])
        .wants_tiles(1, 2)
        .wants(&[lease(1, 1, 0, 0), lease(1, 2, 0, 1)])
        .stores(1, 1, 0, block(0))
        .wants(&[ack(1, 1, block(0))])
        .stores(1, 1, 0, block(1))
        .wants(&[ack(1, 1, block(1))])
        .stores_tile(1, 2, 0, 1)
        .wants(&[ack(1, 2, block(2)), ack(1, 2, block(3)), encode(0)])
        .encoded(0)
        .wants(&[done(JobOutcome::Finished)]);
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!(job.state, JobState::Over(JobOutcome::Finished));
    assert_eq!((job.pixels_done, job.blocks_done), (64 * 64, 4));
    assert_eq!((job.blocks_again, job.attempts_live), (0, 0));
    let image = farm.sched.image(image_ref(0)).unwrap();
    assert_eq!(image.state, ImageState::Encoded { film: film(0) });
}

#[test]
fn a_worker_never_holds_more_than_its_credit_and_gets_the_next_as_one_ends() {
    farm()
        .job(2)
        .worker(1, 3)
        .wants(&[
            Effect::Submitted {
                submission: SubmissionId(1),
                job: JobId(1),
            },
            welcome(1, &[]),
            lease(1, 1, 0, 0),
            lease(1, 2, 0, 1),
            lease(1, 3, 1, 0),
        ])
        .wants_tiles(1, 2)
        .stores(1, 1, 0, block(0))
        .stores(1, 1, 0, block(1))
        .wants(&[ack(1, 1, block(0)), ack(1, 1, block(1))])
        .wants_tiles(1, 3)
        .wants(&[lease_of(1, 4, 1, 1, &[], Span(1))]);
}

#[test]
fn only_so_many_images_are_in_flight_and_they_begin_in_order() {
    let mut farm = Farm::new(Config {
        images_in_flight_max: 1,
        ..Config::new(EPOCH)
    });
    farm.job(2).worker(1, 4);
    assert_eq!(farm.never_mind().len(), 4);
    farm.stores_tile(1, 1, 0, 0).stores_tile(1, 2, 0, 1);
    assert_eq!(farm.never_mind().last(), Some(&encode(0)));
    farm.encoded(0)
        .wants(&[lease(1, 3, 1, 0), lease(1, 4, 1, 1)]);
}

#[test]
fn small_images_are_in_flight_in_large_numbers() {
    let config = Config::new(EPOCH);
    assert_eq!(config.images_in_flight(8192 * 8192), 8);
    assert_eq!(config.images_in_flight(2048 * 1024), 32);
    assert_eq!(config.images_in_flight(64 * 64), 256);
    // Each is one tile here, and forty workers have something to do.
    let mut farm = farm();
    for id in 1..=40 {
        farm.worker(id, 1);
    }
    farm.job(30).never_mind();
    assert!(farm.sched.workers().all(|worker| worker.attempts == 1));
}

#[test]
fn the_less_loaded_worker_gets_the_tile() {
    let mut farm = farm();
    farm.worker(1, 4).worker(2, 4).never_mind();
    farm.job(2).wants(&[
        Effect::Submitted {
            submission: SubmissionId(1),
            job: JobId(1),
        },
        lease(1, 1, 0, 0),
        lease(2, 2, 0, 1),
        lease(1, 3, 1, 0),
        lease(2, 4, 1, 1),
    ]);
}

#[test]
fn submitting_twice_is_submitting_once() {
    let again = Effect::Submitted {
        submission: SubmissionId(1),
        job: JobId(1),
    };
    farm()
        .job(1)
        .job(1)
        .wants(&[again.clone(), again])
        .job(2)
        .wants(&[Effect::SubmitRefused {
            submission: SubmissionId(1),
            refusal: SubmitRefusal::SubmissionReused,
        }]);
}

#[test]
fn what_cannot_be_done_is_refused_with_its_reason() {
    let refusal = |config: Config, change: fn(&mut Submission)| {
        let mut farm = Farm::new(config);
        let mut asked = submission(1, 1);
        change(&mut asked);
        farm.is_told(Event::Submit(asked));
        match farm.never_mind().as_slice() {
            [Effect::SubmitRefused { refusal, .. }] => *refusal,
            other => panic!("{other:?}"),
        }
    };
    let usual = || Config::new(EPOCH);
    assert_eq!(
        refusal(usual(), |asked| asked.window.x1 = 0),
        SubmitRefusal::EmptyWindow
    );
    assert_eq!(
        refusal(usual(), |asked| asked.window.x1 = u32::MAX),
        SubmitRefusal::WindowOutside { side_max: 65_536 }
    );
    assert_eq!(
        refusal(usual(), |asked| asked.window = Resolution {
            width: 60_000,
            height: 60_000
        }
        .rect()),
        SubmitRefusal::WindowTooLarge {
            pixels: 3_600_000_000,
            max: 1 << 28
        }
    );
    assert_eq!(
        refusal(usual(), |asked| asked.tiles = TileShape::Size {
            width: 0,
            height: 1
        }),
        SubmitRefusal::EmptyTile
    );
    assert_eq!(
        refusal(usual(), |asked| {
            asked.window.x1 = 6_400;
            asked.tiles = TileShape::Size {
                width: 1,
                height: 1,
            };
        }),
        SubmitRefusal::TooManyTiles {
            tiles: 409_600,
            max: 75_000
        }
    );
    assert_eq!(
        refusal(usual(), |asked| {
            (asked.window.x1, asked.window.y1) = (4_096, 4_096);
            (asked.tiles) = TileShape::Size {
                width: 4_096,
                height: 4_096,
            };
        }),
        SubmitRefusal::TileTooLarge {
            pixels: 1 << 24,
            max: 1 << 22
        }
    );
    assert_eq!(
        refusal(usual(), |asked| asked.name = "x".repeat(201)),
        SubmitRefusal::NameTooLong { bytes_max: 200 }
    );
    let full = Config {
        limits: Limits {
            jobs_max: 0,
            ..Limits::default()
        },
        ..usual()
    };
    assert_eq!(refusal(full, |_| ()), SubmitRefusal::TooManyJobs { max: 0 });
    let few = Config {
        limits: Limits {
            images_max: 5,
            ..Limits::default()
        },
        ..usual()
    };
    assert_eq!(
        refusal(few, |asked| asked.frames = "0..6".parse().unwrap()),
        SubmitRefusal::TooManyImages { asked: 6, left: 5 }
    );
}

#[test]
fn jobs_that_are_over_make_room() {
    let mut farm = Farm::new(Config {
        limits: Limits {
            images_max: 2,
            ..Limits::default()
        },
        ..Config::new(EPOCH)
    });
    farm.job(2).command(Command::Cancel);
    farm.never_mind();
    farm.is_told(Event::Submit(submission(2, 1))).wants(&[
        Effect::ForgetJob { job: JobId(1) },
        Effect::Submitted {
            submission: SubmissionId(2),
            job: JobId(2),
        },
    ]);
}

#[test]
fn leases_go_to_workers_of_the_pinned_revision() {
    let mut farm = farm();
    farm.job(1)
        .is_told(Event::WorkerJoined {
            worker: worker(1),
            link: LinkId(1),
            offer: Offer {
                revision: Revision(2),
                ..offer()
            },
            held: vec![],
            begun: vec![],
        })
        .wants_tiles(1, 5);
    assert_eq!(farm.never_mind().last(), Some(&welcome(1, &[])));
    farm.worker(2, 1)
        .wants(&[welcome(2, &[]), lease(2, 1, 0, 0)]);

    let mut upgraded = Farm::new(Config {
        revision: Some(Revision(2)),
        ..Config::new(EPOCH)
    });
    upgraded.joins(1, &[]).wants(&[Effect::WorkerRefused {
        worker: worker(1),
        refusal: WorkerRefusal::WrongRevision {
            theirs: REVISION,
            wanted: Revision(2),
        },
    }]);
    // A job of before the upgrade is finished by workers of then.
    upgraded.job(1).joins(1, &[]);
    assert_eq!(upgraded.never_mind().last(), Some(&welcome(1, &[])));
}

#[test]
fn a_closed_link_opens_its_tiles_at_once_and_its_worker_resumes_them() {
    let mut farm = farm();
    farm.job(1).worker(2, 0).worker(1, 1);
    farm.stores(1, 1, 0, block(0)).never_mind();
    // The second attempt starts at the first missing block.
    farm.newest_link_breaks(1)
        .wants(&[])
        .wants_tiles(2, 1)
        .wants(&[lease_of(2, 2, 0, 0, &[block(1)], Span(1))])
        .joins(1, &[1])
        .wants(&[welcome(1, &[1])])
        .stores(1, 1, 0, block(1))
        .wants(&[
            ack(1, 1, block(1)),
            revoke(2, 2, RevokeReason::TileDone),
            lease_of(2, 3, 0, 1, &[], Span(2)),
        ]);
    let again = block_ref(2, 0, block(1));
    assert_eq!(
        farm.sched.accepts(worker(2), again),
        Verdict::Refuse(BlockRefusal::AttemptDead)
    );
}

#[test]
fn a_tile_that_nobody_took_meanwhile_is_resumed_alone() {
    let mut farm = farm();
    farm.job(1).worker(1, 2).newest_link_breaks(1).never_mind();
    farm.joins(1, &[1, 2])
        .wants(&[welcome(1, &[1, 2])])
        .worker(2, 5)
        .wants(&[welcome(2, &[])]);
}

#[test]
fn a_lease_lost_on_the_way_is_leased_again() {
    let mut farm = farm();
    farm.job(1).worker(1, 2).newest_link_breaks(1).never_mind();
    farm.joins(1, &[1])
        .wants(&[welcome(1, &[1])])
        .wants_tiles(1, 2)
        .wants(&[lease(1, 3, 0, 1)]);
}

#[test]
fn a_late_word_of_an_old_link_changes_nothing() {
    let mut farm = farm();
    farm.job(1).worker(1, 2).joins(1, &[1, 2]).never_mind();
    farm.is_told(Event::LinkClosed {
        worker: worker(1),
        link: LinkId(1),
    })
    .worker(2, 2)
    .wants(&[welcome(2, &[])]);
    farm.is_told(Event::WorkerJoined {
        worker: worker(1),
        link: LinkId(1),
        offer: offer(),
        held: vec![],
        begun: vec![],
    })
    .wants(&[]);
}

#[test]
fn a_silent_worker_is_lost_after_its_limit_and_not_before() {
    let mut farm = farm();
    farm.job(1).worker(1, 1).never_mind();
    farm.waits(Span::from_secs(1))
        .heartbeat(1, &[(1, 0)])
        .stores(1, 1, 0, block(0))
        .never_mind();
    // It may be asked to look earlier, and then finds nothing to do.
    let due = farm.sched.next_deadline().unwrap();
    assert!(due <= farm.now + LIVENESS);
    farm.waits(Span(LIVENESS.0 - 1))
        .wants(&[])
        .waits(Span(1))
        .wants(&[forget(1)]);
    assert_eq!(
        farm.sched.accepts(worker(1), block_ref(1, 0, block(1))),
        Verdict::Refuse(BlockRefusal::AttemptDead)
    );
    // What it had stored stays; it comes back with nothing of its own.
    let wanted = [block(1)];
    let expected = Span(1_000);
    farm.joins(1, &[1])
        .wants(&[welcome(1, &[])])
        .wants_tiles(1, 1)
        .wants(&[lease_of(1, 2, 0, 0, &wanted, expected)]);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().attempts_lost, 1);
}

#[test]
fn an_attempt_without_progress_is_ended_and_the_next_one_has_more_patience() {
    let mut farm = farm();
    farm.job(1).worker(1, 1);
    farm.waits(Span::from_millis(1)).stores(1, 1, 0, block(0));
    farm.never_mind();
    let wanted = [block(1)];
    let next = lease_of(1, 2, 0, 0, &wanted, Span(1_000));
    farm.waits_with_heartbeats(Span::from_secs(29), 1, &[(1, 1)])
        .wants(&[])
        .waits_with_heartbeats(Span::from_secs(1), 1, &[(1, 1)])
        .wants(&[revoke(1, 1, RevokeReason::NoProgress), next]);
    farm.waits_with_heartbeats(Span::from_secs(59), 1, &[(2, 0)])
        .wants(&[])
        .waits_with_heartbeats(Span::from_secs(1), 1, &[(2, 0)]);
    let ended = revoke(1, 2, RevokeReason::NoProgress);
    assert_eq!(farm.never_mind().first(), Some(&ended));
    assert_eq!(farm.sched.job(JobId(1)).unwrap().attempts_failed, 2);
}

#[test]
fn rendered_blocks_are_progress_and_attempts_held_ahead_wait_with_them() {
    let mut farm = farm();
    farm.job(1).worker(1, 2);
    farm.waits(Span::from_millis(1)).stores(1, 1, 0, block(0));
    farm.never_mind();
    farm.waits_with_heartbeats(Span::from_secs(29), 1, &[(1, 1)])
        .heartbeat(1, &[(1, 2)])
        .waits_with_heartbeats(Span::from_secs(29), 1, &[(1, 2)])
        .wants(&[]);
}

#[test]
fn a_tile_that_fails_too_often_fails_its_image_and_the_job_goes_on() {
    let reason = "the tile of 64x32 pixels at column 0, row 0: failed 3 times, last: no memory";
    let mut farm = farm();
    farm.job(2).worker(1, 1).never_mind();
    farm.fails(1, 1)
        .wants(&[lease(1, 2, 0, 0)])
        .fails(1, 2)
        .wants(&[lease(1, 3, 0, 0)])
        .worker(2, 1)
        .wants(&[welcome(2, &[]), lease(2, 4, 0, 1)])
        .fails(1, 3)
        .wants(&[
            give_up(0, reason),
            lease(1, 5, 1, 0),
            revoke(2, 4, RevokeReason::ImageFailed),
            drop_scratch(0),
            lease(2, 6, 1, 1),
        ])
        .fails(1, 3)
        .wants(&[]);
    farm.stores_tile(1, 5, 1, 0).stores_tile(2, 6, 1, 1);
    farm.never_mind();
    farm.encoded(1).wants(&[done(JobOutcome::Failed)]);
    let [failure] = farm.sched.failures(JobId(1)) else {
        panic!("one image failed");
    };
    assert_eq!(failure.image, image_ref(0).image);
    assert_eq!(failure.reason, reason);
}

#[test]
fn a_tile_that_kills_its_workers_fails_its_image_in_the_end() {
    let mut farm = Farm::new(Config {
        tile_losses_max: 2,
        ..Config::new(EPOCH)
    });
    farm.job(1).never_mind();
    for number in 1..=2 {
        farm.worker(number, 1).heartbeat(number, &[(number, 0)]);
        farm.never_mind();
        farm.waits(LIVENESS);
    }
    let reason = "the tile of 64x32 pixels at column 0, row 0: 2 workers in a row were lost \
                  while rendering it, and no block arrived in between";
    farm.wants(&[
        give_up(0, reason),
        forget(2),
        drop_scratch(0),
        done(JobOutcome::Failed),
    ]);
}

#[test]
fn an_image_that_cannot_be_stored_fails_alone() {
    let mut farm = farm();
    farm.job(2).worker(1, 1).never_mind();
    farm.is_told(Event::ImageFailed {
        image: image_ref(0),
        reason: "no space left on device".into(),
    })
    .wants(&[
        revoke(1, 1, RevokeReason::ImageFailed),
        drop_scratch(0),
        lease(1, 2, 1, 0),
    ]);
}

#[test]
fn cancel_revokes_everything_and_leaves_nothing_behind() {
    let mut farm = farm();
    farm.job(3).worker(1, 4);
    farm.stores_tile(1, 1, 0, 0).stores_tile(1, 2, 0, 1);
    farm.never_mind();
    farm.command(Command::Cancel).wants(&[
        commanded(),
        revoke(1, 3, RevokeReason::Cancelled),
        revoke(1, 4, RevokeReason::Cancelled),
        drop_scratch(1),
        revoke(1, 5, RevokeReason::Cancelled),
        revoke(1, 6, RevokeReason::Cancelled),
        drop_scratch(2),
        drop_scratch(0),
        Effect::DropJob { job: JobId(1) },
        done(JobOutcome::Cancelled),
    ]);
    let stored = Event::BlockStored {
        worker: worker(1),
        block: block_ref(3, 1, block(0)),
        elapsed: Span(0),
        pixels: Digest([1; 32]),
    };
    farm.command(Command::Cancel)
        .wants(&[commanded()])
        .is_told(stored)
        .wants(&[Effect::RefuseBlock {
            worker: worker(1),
            block: block_ref(3, 1, block(0)),
            refusal: BlockRefusal::AttemptDead,
        }]);
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.images.dropped, job.attempts_live), (3, 0));
}

#[test]
fn a_frame_that_was_in_its_place_before_the_cancel_was_known_stays() {
    let mut farm = farm();
    farm.job(1).worker(1, 2);
    farm.stores_tile(1, 1, 0, 0).stores_tile(1, 2, 0, 1);
    farm.command(Command::Cancel).never_mind();
    farm.encoded(0).wants(&[]);
    let image = farm.sched.image(image_ref(0)).unwrap();
    assert_eq!(image.state, ImageState::Encoded { film: film(0) });
}

#[test]
fn what_is_given_back_goes_to_another() {
    let mut farm = farm();
    farm.job(1).worker(1, 2).worker(2, 1).never_mind();
    farm.wants_tiles(1, 0)
        .is_told(Event::GivenBack {
            worker: worker(1),
            attempts: vec![attempt(2)],
        })
        .wants(&[lease(2, 3, 0, 1)])
        .wants_tiles(2, 2)
        .is_told(Event::Goodbye { worker: worker(1) })
        .wants(&[forget(1), lease(2, 4, 0, 0)]);
    assert!(farm.sched.worker(worker(1)).is_none());
}

/// It would give the same back again and again, as fast as the link is.
#[test]
fn who_gives_back_is_leased_nothing_until_it_says_that_it_wants_more() {
    let mut farm = farm();
    farm.job(1).worker(1, 2).never_mind();
    let give_back = |number| Event::GivenBack {
        worker: worker(1),
        attempts: vec![attempt(number)],
    };
    farm.is_told(give_back(2)).wants(&[]);
    farm.wants_tiles(1, 2).wants(&[lease(1, 3, 0, 1)]);
    farm.is_told(give_back(3)).wants(&[]);
    let heartbeat = Event::Heartbeat {
        worker: worker(1),
        running: Vec::new(),
    };
    farm.is_told(heartbeat).wants(&[lease(1, 4, 0, 1)]);
}

#[test]
fn blocks_are_asked_for_before_they_are_written() {
    let mut farm = farm();
    farm.job(1).worker(1, 1).worker(2, 1);
    let ask = |farm: &Farm, id, reference| farm.sched.accepts(worker(id), reference);
    let refuse = Verdict::Refuse;
    assert_eq!(ask(&farm, 1, block_ref(1, 0, block(0))), Verdict::Accept);
    assert_eq!(
        ask(&farm, 2, block_ref(1, 0, block(0))),
        refuse(BlockRefusal::NotYours)
    );
    assert_eq!(
        ask(&farm, 1, block_ref(9, 0, block(0))),
        refuse(BlockRefusal::AttemptDead)
    );
    assert_eq!(
        ask(&farm, 1, block_ref(1, 1, block(0))),
        refuse(BlockRefusal::OtherImage)
    );
    let half = Rect { x1: 16, ..block(0) };
    for rect in [block(2), tile(0), half, Rect { x1: 0, ..block(0) }] {
        assert_eq!(
            ask(&farm, 1, block_ref(1, 0, rect)),
            refuse(BlockRefusal::NotABlock)
        );
    }
    let mut old = block_ref(1, 0, block(0));
    old.attempt.epoch = Epoch(2);
    assert_eq!(ask(&farm, 1, old), refuse(BlockRefusal::AttemptDead));
    farm.stores(1, 1, 0, block(0));
    assert_eq!(
        ask(&farm, 1, block_ref(1, 0, block(0))),
        Verdict::AlreadyDone
    );
}

#[test]
fn a_block_sent_again_is_not_one_rendered_again() {
    let mut farm = farm();
    farm.job(1).worker(1, 1);
    farm.stores(1, 1, 0, block(0)).stores(1, 1, 0, block(0));
    assert_eq!(farm.sched.job(JobId(1)).unwrap().blocks_again, 0);
    // Another attempt renders the same block: that is one again.
    farm.newest_link_breaks(1).worker(2, 1);
    farm.stores(2, 2, 0, block(1));
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.blocks_done, job.blocks_again), (2, 0));

    let mut farm = situation::farm();
    farm.job(1).worker(1, 1).newest_link_breaks(1).worker(2, 1);
    farm.stores(1, 1, 0, block(0)).stores(2, 2, 0, block(0));
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.blocks_done, job.blocks_again), (1, 1));
    assert_eq!(job.pixels_again, 1_024);
}

#[test]
fn at_most_two_attempts_live() {
    let mut farm = farm();
    farm.job(1).worker(1, 1).newest_link_breaks(1);
    farm.waits(Span::from_secs(1)).worker(2, 1);
    farm.newest_link_breaks(2).never_mind();
    // Both are away, so the tile waits for a limit; the other tile does not.
    farm.worker(3, 2)
        .wants(&[welcome(3, &[]), lease(3, 3, 0, 1)])
        .waits_with_heartbeats(LIVENESS, 3, &[])
        .wants(&[forget(1), lease(3, 4, 0, 0), forget(2)]);
}

#[test]
fn refusals_say_what_to_do() {
    let too_many = SubmitRefusal::TooManyTiles { tiles: 9, max: 8 };
    assert_eq!(
        too_many.to_string(),
        "an image would be cut into 9 tiles, at most 8 are taken; ask for larger tiles"
    );
    assert!(!too_many.is_retryable());
    assert!(SubmitRefusal::TooManyJobs { max: 1 }.is_retryable());
    assert!(WorkerRefusal::TooMany { max: 1 }.is_retryable());
}

#[test]
fn a_lost_worker_is_no_blame_where_a_block_arrived_in_between() {
    let mut farm = Farm::new(Config {
        tile_losses_max: 2,
        ..Config::new(EPOCH)
    });
    farm.job(1).worker(1, 1).heartbeat(1, &[(1, 0)]);
    farm.waits(LIVENESS).worker(2, 1);
    farm.stores(2, 2, 0, block(0)).waits(LIVENESS).never_mind();
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.state, job.attempts_lost), (JobState::Running, 2));
}

#[test]
fn nobody_claims_progress_beyond_the_tile() {
    let mut farm = farm();
    farm.job(1).worker(1, 1);
    farm.waits(Span::from_millis(1)).stores(1, 1, 0, block(0));
    farm.heartbeat(1, &[(1, 2)]).never_mind();
    for claimed in 3..33 {
        farm.heartbeat(1, &[(1, claimed)]).waits(Span::from_secs(1));
    }
    let ended = revoke(1, 1, RevokeReason::NoProgress);
    assert_eq!(farm.never_mind().first(), Some(&ended));
}

#[test]
fn credit_has_a_limit() {
    let mut farm = Farm::new(Config {
        limits: Limits {
            credit_max: 1,
            ..Limits::default()
        },
        ..Config::new(EPOCH)
    });
    farm.job(1).worker(1, 100);
    assert_eq!(farm.sched.worker(worker(1)).unwrap().attempts, 1);
}
