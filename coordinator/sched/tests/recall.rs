//! What a store that forgot superfluous events tells a new epoch.

mod situation;

use model::{ImageNumber, ImageRef, JobId, Rect, Span, SubmissionId};
use sched::{
    Command, Config, Effect, Event, ImageState, JobOutcome, JobState, Submission, SubmitRefusal,
};
use situation::{EPOCH, Farm, film, submission, tile};

fn image(job: u64, image: u32) -> ImageRef {
    ImageRef {
        job: JobId(job),
        image: ImageNumber(image),
    }
}

fn recalled(job: u64, number: u32) -> Event {
    Event::ImageRecalled {
        image: image(job, number),
        film: film(number),
        blocks: 4,
        render_time: Span::from_secs(7),
    }
}

fn farm() -> Farm {
    Farm::new(Config::new(EPOCH))
}

#[test]
fn jobs_keep_their_numbers() {
    let mut farm = farm();
    farm.is_told(Event::JobsRecalled { last: JobId(6) })
        .is_told(Event::Submit(submission(1, 1)))
        .is_told(Event::JobsRecalled { last: JobId(9) })
        .is_told(Event::JobsRecalled { last: JobId(2) })
        .is_told(Event::Submit(submission(2, 1)));
    let numbers: Vec<_> = farm.sched.jobs().map(|view| view.job.0).collect();
    assert_eq!(numbers, [7, 10]);
}

#[test]
fn an_image_that_is_recalled_is_done_and_counted() {
    let mut farm = farm();
    farm.job(2).is_told(recalled(1, 0)).is_told(recalled(1, 0));
    let view = farm.sched.job(JobId(1)).unwrap();
    assert_eq!(view.images.encoded, 1);
    assert_eq!(view.pixels_done * 2, view.pixels);
    assert_eq!(
        (view.blocks_done, view.render_time),
        (4, Span::from_secs(7))
    );
    assert_eq!(view.state, JobState::Running);
    farm.is_told(recalled(1, 1));
    let view = farm.sched.job(JobId(1)).unwrap();
    assert_eq!(view.state, JobState::Over(JobOutcome::Finished));
    assert_eq!(view.pixels_done, view.pixels);
}

#[test]
fn a_worker_is_leased_only_what_is_not_recalled() {
    let mut farm = farm();
    farm.job(3).is_told(recalled(1, 1));
    let block = tile(0).blocks().next().unwrap();
    let none = Rect {
        x0: 0,
        y0: 0,
        x1: 1_000_000,
        y1: 1,
    };
    // Told twice it counts once, and what is no block counts for nothing.
    let took = Span::from_millis(300);
    farm.is_told(Event::BlocksRecalled {
        image: image(1, 0),
        blocks: vec![(block, took), (none, took), (block, took)],
    });
    let view = farm.sched.job(JobId(1)).unwrap();
    assert_eq!(view.render_time, Span::from_millis(7_300));
    farm.joins(1, &[]).is_told(Event::Credit {
        worker: situation::worker(1),
        credit: 100,
    });
    let leases: Vec<_> = farm
        .never_mind()
        .into_iter()
        .filter_map(|effect| match effect {
            Effect::Lease { lease, .. } => Some(lease),
            _ => None,
        })
        .collect();
    assert!(leases.iter().all(|lease| lease.image != image(1, 1)));
    let blocks: usize = leases.iter().map(|lease| lease.blocks().count()).sum();
    assert_eq!(blocks, 4 + 3, "two images but one block");
}

#[test]
fn an_image_all_of_whose_blocks_are_recalled_is_encoded() {
    let mut farm = farm();
    farm.job(1).worker(1, 2).never_mind();
    let blocks = (0..2).flat_map(|index| tile(index).blocks());
    farm.is_told(Event::BlocksRecalled {
        image: image(1, 0),
        blocks: blocks.map(|block| (block, Span::from_millis(1))).collect(),
    });
    let effects = farm.never_mind();
    assert!(effects.contains(&Effect::Encode { image: image(1, 0) }));
    // Whoever was at work on it is told, told again or not.
    let revoked = |effect: &&Effect| matches!(effect, Effect::Revoke { .. });
    assert_eq!(effects.iter().filter(revoked).count(), 2);
    let view = farm.sched.job(JobId(1)).unwrap();
    assert_eq!((view.pixels_done, view.blocks_done), (view.pixels, 4));
}

#[test]
fn what_became_of_a_recalled_image_is_like_of_any() {
    let mut farm = farm();
    farm.job(1).is_told(recalled(1, 0));
    farm.command(Command::Again(ImageNumber(0)));
    let again = farm.sched.image(image(1, 0)).unwrap();
    assert_eq!(again.state, ImageState::Waiting);
    assert_eq!(farm.sched.job(JobId(1)).unwrap().pixels_done, 0);
}

#[test]
fn the_store_forgets_nothing_that_was_not_told() {
    let mut farm = farm();
    farm.is_told(recalled(1, 0));
    assert_eq!(farm.sched.jobs().count(), 0);
    farm.job(1).command(Command::Cancel).is_told(recalled(1, 0));
    let view = farm.sched.job(JobId(1)).unwrap();
    assert_eq!(view.images.encoded, 0);
}

#[test]
fn a_job_that_waited_for_one_that_was_finished_is_known_when_it_is_submitted_again() {
    let mut farm = farm();
    // The first job was finished and is kept, one before it was forgotten; the store says neither of the second.
    farm.is_told(Event::JobsRecalled { last: JobId(6) })
        .is_told(Event::Submit(submission(1, 1)))
        .is_told(recalled(7, 0))
        .is_told(Event::Submit(submission(2, 1)))
        .is_told(Event::Submit(submission(3, 1)))
        .never_mind();
    let again = |after: &[u64]| {
        Event::Submit(Submission {
            after: after.iter().copied().map(JobId).collect(),
            ..submission(2, 1)
        })
    };
    let submission = SubmissionId(2);
    for after in [&[][..], &[7], &[3, 7]] {
        let job = JobId(8);
        farm.is_told(again(after))
            .wants(&[Effect::Submitted { submission, job }]);
    }
    // That would be another job.
    for after in [&[9][..], &[10]] {
        let refusal = SubmitRefusal::SubmissionReused;
        let refused = Effect::SubmitRefused {
            submission,
            refusal,
        };
        farm.is_told(again(after)).wants(&[refused]);
    }
}
