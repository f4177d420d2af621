//! What users want of jobs that are there: pause, resume, retry, again, priority, share, remove.

mod situation;

use model::{ImageNumber, JobId, SubmissionId};
use sched::{
    Command, CommandRefusal, Config, Effect, Event, ImageState, JobOutcome, JobState, Limits,
    Paused, RevokeReason, Submission, SubmitRefusal,
};
use situation::*;

/// Submits a second job, of one image, with something about it changed.
fn second(farm: &mut Farm, images: u32, change: impl FnOnce(&mut Submission)) {
    let mut asked = submission(2, images);
    change(&mut asked);
    farm.is_told(Event::Submit(asked));
}

fn refused(job: u64, refusal: CommandRefusal) -> Effect {
    Effect::CommandRefused {
        job: JobId(job),
        refusal,
    }
}

/// The jobs of the tiles that were leased, in order.
fn leased_jobs(effects: &[Effect]) -> Vec<u64> {
    let job = |effect: &Effect| match effect {
        Effect::Lease { lease, .. } => Some(lease.image.job.0),
        _ => None,
    };
    effects.iter().filter_map(job).collect()
}

#[test]
fn a_paused_job_finishes_what_runs_and_calls_back_what_was_not_started() {
    let mut farm = farm();
    farm.job(2).worker(1, 3).heartbeat(1, &[(1, 0)]);
    farm.never_mind();
    farm.command(Command::Pause)
        .wants(&[
            commanded(),
            revoke(1, 2, RevokeReason::Paused),
            revoke(1, 3, RevokeReason::Paused),
        ])
        .stores_tile(1, 1, 0, 0);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().paused, Paused::Yes);
    farm.wants(&[ack(1, 1, block(0)), ack(1, 1, block(1))]);
    farm.command(Command::Resume);
    assert_eq!(farm.never_mind().len(), 1 + 3);
}

#[test]
fn a_pause_leaves_what_a_thread_may_have_begun() {
    // Nothing was said of the first one, but a thread starts what was leased first.
    let mut farm = farm();
    farm.job(1).worker(1, 2).never_mind();
    farm.command(Command::Pause)
        .wants(&[commanded(), revoke(1, 2, RevokeReason::Paused)]);
}

#[test]
fn higher_priority_goes_first_and_may_change_on_the_way() {
    let mut farm = farm();
    farm.job(2);
    second(&mut farm, 2, |asked| asked.priority = 1);
    farm.worker(1, 2);
    assert_eq!(leased_jobs(&farm.never_mind()), [2, 2]);
    farm.command(Command::Priority(2)).wants_tiles(1, 4);
    assert_eq!(leased_jobs(&farm.never_mind()), [1, 1]);
    farm.command_of(2, Command::Priority(3)).wants_tiles(1, 5);
    assert_eq!(leased_jobs(&farm.never_mind()), [2]);
}

#[test]
fn jobs_hold_the_farm_by_their_shares() {
    let mut farm = farm();
    farm.job(8);
    second(&mut farm, 8, |asked| asked.share = 3);
    farm.worker(1, 12);
    let jobs = leased_jobs(&farm.never_mind());
    assert_eq!(jobs.iter().filter(|&&job| job == 2).count(), 9, "{jobs:?}");
    // The new share holds for what is leased from now on.
    farm.command(Command::Share(9)).wants_tiles(1, 16);
    assert_eq!(leased_jobs(&farm.never_mind()), [1, 1, 1, 1]);
    let max = 1_000;
    let refusal = CommandRefusal::ShareOutside { max };
    farm.command(Command::Share(0))
        .wants(&[refused(1, refusal)]);
    second(&mut farm, 1, |asked| {
        asked.submission = SubmissionId(3);
        asked.share = 0;
    });
    farm.wants(&[Effect::SubmitRefused {
        submission: SubmissionId(3),
        refusal: SubmitRefusal::ShareOutside { max },
    }]);
}

/// A job of two images of which the first failed, and the second is in its place.
fn farm_with_a_failure() -> Farm {
    let mut farm = farm();
    farm.job(2).worker(1, 4);
    farm.stores(1, 1, 0, block(0));
    farm.stores_tile(1, 3, 1, 0).stores_tile(1, 4, 1, 1);
    farm.encoded(1).is_told(Event::ImageFailed {
        image: image_ref(0),
        reason: "no space".into(),
    });
    let job = farm.sched.job(JobId(1)).expect("it is known");
    assert_eq!(job.state, JobState::Over(JobOutcome::Failed));
    assert_eq!(job.pixels_done, 64 * 64, "those of a failed image are gone");
    farm.never_mind();
    farm
}

#[test]
fn failed_images_are_retried_and_the_job_ends_anew() {
    let mut farm = farm_with_a_failure();
    farm.command(Command::Retry);
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.state, job.ended), (JobState::Running, None));
    assert!(farm.sched.failures(JobId(1)).is_empty());
    // Everything of it: its scratch file was dropped.
    let effects = farm.never_mind();
    assert_eq!(effects[0], commanded());
    assert_eq!(leased_jobs(&effects), [1, 1]);
    farm.stores_tile(1, 5, 0, 0).stores_tile(1, 6, 0, 1);
    assert_eq!(farm.never_mind().last(), Some(&encode(0)));
    farm.encoded(0).wants(&[done(JobOutcome::Finished)]);
    let nothing = CommandRefusal::NothingFailed;
    farm.command(Command::Retry).wants(&[refused(1, nothing)]);
}

#[test]
fn one_image_is_rendered_again_whatever_became_of_it() {
    let mut farm = farm_with_a_failure();
    let again = |image| Command::Again(ImageNumber(image));
    farm.command(again(1));
    assert_eq!(leased_jobs(&farm.never_mind()), [1, 1]);
    // One that is begun begins anew.
    farm.command(again(1));
    let effects = farm.never_mind();
    assert!(effects.contains(&revoke(1, 5, RevokeReason::RenderedAgain)));
    assert!(effects.contains(&drop_scratch(1)));
    assert_eq!(leased_jobs(&effects), [1, 1]);
    let image = ImageNumber(2);
    farm.command(again(2))
        .wants(&[refused(1, CommandRefusal::UnknownImage { image })]);
    farm.stores_tile(1, 7, 1, 0).stores_tile(1, 8, 1, 1);
    farm.never_mind();
    // The other image is still failed.
    farm.encoded(1).wants(&[done(JobOutcome::Failed)]);
    let job = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((job.images.encoded, job.images.failed), (1, 1));
    assert_eq!(job.pixels_done, 64 * 64);
}

#[test]
fn a_cancelled_job_does_not_come_back() {
    let mut farm = farm();
    farm.job(1).command(Command::Cancel).never_mind();
    let refusal = CommandRefusal::JobCancelled;
    for command in [Command::Retry, Command::Again(ImageNumber(0))] {
        farm.command(command).wants(&[refused(1, refusal)]);
    }
    for command in [Command::Pause, Command::Resume, Command::Priority(1)] {
        farm.command(command)
            .wants(&[refused(1, CommandRefusal::JobOver)]);
    }
    farm.command_of(9, Command::Pause)
        .wants(&[refused(9, CommandRefusal::UnknownJob)]);
}

#[test]
fn a_job_is_removed_with_all_that_is_known_of_it() {
    let mut farm = farm();
    farm.job(1).worker(1, 1).never_mind();
    farm.command(Command::Remove).wants(&[
        commanded(),
        revoke(1, 1, RevokeReason::Cancelled),
        drop_scratch(0),
        Effect::DropJob { job: JobId(1) },
        done(JobOutcome::Cancelled),
        Effect::ForgetJob { job: JobId(1) },
    ]);
    assert!(farm.sched.job(JobId(1)).is_none());
    // The submission is no longer known either.
    farm.job(1);
    assert_eq!(leased_jobs(&farm.never_mind()), [2]);
}

#[test]
fn a_retry_needs_room_among_the_jobs() {
    let mut farm = Farm::new(Config {
        limits: Limits {
            jobs_max: 1,
            ..Limits::default()
        },
        ..Config::new(EPOCH)
    });
    farm.job(1).worker(1, 1).is_told(Event::ImageFailed {
        image: image_ref(0),
        reason: "no space".into(),
    });
    second(&mut farm, 1, |_| ());
    farm.never_mind();
    let refusal = CommandRefusal::TooManyJobs { max: 1 };
    farm.command(Command::Retry).wants(&[refused(1, refusal)]);
}

#[test]
fn a_job_begins_when_those_before_it_are_finished() {
    let mut farm = farm();
    farm.job(1);
    second(&mut farm, 1, |asked| asked.after = vec![JobId(1)]);
    farm.worker(1, 3);
    assert_eq!(leased_jobs(&farm.never_mind()), [1, 1]);
    farm.command(Command::Remove)
        .wants(&[refused(1, CommandRefusal::WaitedFor { by: JobId(2) })]);
    farm.stores_tile(1, 1, 0, 0).stores_tile(1, 2, 0, 1);
    farm.never_mind();
    farm.encoded(0);
    assert_eq!(leased_jobs(&farm.never_mind()), [2, 2]);
}

#[test]
fn a_job_waits_on_where_the_one_before_it_failed_until_that_is_retried() {
    let mut farm = farm_with_a_failure();
    second(&mut farm, 1, |asked| asked.after = vec![JobId(1)]);
    assert_eq!(leased_jobs(&farm.never_mind()), []);
    let job = farm.sched.job(JobId(2)).unwrap();
    assert_eq!(job.after.iter().copied().collect::<Vec<_>>(), [JobId(1)]);
    farm.command(Command::Retry);
    farm.stores_tile(1, 5, 0, 0)
        .stores_tile(1, 6, 0, 1)
        .encoded(0);
    assert_eq!(leased_jobs(&farm.never_mind()), [1, 1, 2, 2]);
}

#[test]
fn a_job_cannot_wait_for_one_that_is_not_known_or_for_too_many() {
    let mut farm = farm();
    let refusals = [
        (vec![JobId(7)], SubmitRefusal::UnknownJob { job: JobId(7) }),
        (vec![JobId(1); 17], SubmitRefusal::TooManyAfter { max: 16 }),
    ];
    for (after, refusal) in refusals {
        second(&mut farm, 1, |asked| asked.after = after);
        farm.wants(&[Effect::SubmitRefused {
            submission: SubmissionId(2),
            refusal,
        }]);
    }
}

#[test]
fn a_job_that_others_wait_for_is_not_forgotten() {
    let mut farm = Farm::new(Config {
        limits: Limits {
            jobs_kept_max: 0,
            ..Limits::default()
        },
        ..Config::new(EPOCH)
    });
    farm.job(1);
    second(&mut farm, 1, |asked| asked.after = vec![JobId(1)]);
    farm.command(Command::Cancel).never_mind();
    assert!(farm.sched.job(JobId(1)).is_some());
    farm.command_of(2, Command::Cancel).never_mind();
    assert_eq!(farm.sched.jobs().count(), 0);
}

#[test]
fn the_region_of_interest_goes_first() {
    let mut farm = farm();
    farm.job(2).command(Command::Focus(Some(tile(1))));
    farm.worker(1, 3).never_mind();
    let leased: Vec<_> = (1..=3)
        .map(|number| farm.sched.attempt(attempt(number)).unwrap())
        .collect();
    let places: Vec<_> = leased
        .iter()
        .map(|(_, image, rect)| (image.image.0, *rect))
        .collect();
    assert_eq!(places, [(0, tile(1)), (0, tile(0)), (1, tile(1))]);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().focus, Some(tile(1)));
}

#[test]
fn a_region_chosen_on_the_way_moves_to_the_front_in_every_image_that_is_begun() {
    let mut farm = farm();
    farm.job(2).worker(1, 2).never_mind();
    // Both tiles of the first image come back, and wait before those of the second.
    farm.wants_tiles(1, 0).is_told(Event::GivenBack {
        worker: worker(1),
        attempts: vec![attempt(1), attempt(2)],
    });
    farm.command(Command::Focus(Some(block(3))))
        .wants_tiles(1, 1);
    let (_, _, rect) = farm.sched.attempt(attempt(3)).unwrap();
    assert_eq!(rect, tile(1));
    assert_eq!(
        farm.sched.image(image_ref(1)).unwrap().state,
        ImageState::Waiting
    );
}
