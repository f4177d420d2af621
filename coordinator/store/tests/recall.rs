//! A scheduler that is told what a store recalls goes on where the one before it was.
//!
//! `tests/sim` does the same with whole farms that crash.

mod sample;

use model::{Digest, Epoch, ImageNumber, JobId, Timestamp};
use sample::{block, encoded, failed, image, submission, submitted, submitted_as, wants};
use sched::{
    Command, Config, Effect, Event, ImageState, JobOutcome, JobState, Paused, Sched, Submission,
};
use store::{Entry, Memory, Recalled, Store};

fn recalled(entries: &[Entry]) -> Recalled {
    let mut store = Memory::new();
    store.commit(entries).expect("it is not full");
    store.recall().expect("it is in memory")
}

fn told(recalled: &Recalled) -> (Sched, Vec<Effect>) {
    let (mut sched, mut effects) = (Sched::new(Config::new(Epoch(2))), Vec::new());
    for (_, event) in recalled.events() {
        sched.handle(Timestamp(1), event, &mut effects);
        sched.check_invariants();
    }
    (sched, effects)
}

fn state(sched: &Sched, number: u32) -> ImageState {
    sched.image(image(1, number)).expect("it is known").state
}

#[test]
fn images_blocks_and_commands_come_back() {
    let entries = [
        submitted(1),
        encoded(1, 3),
        failed(1, 4),
        block(1, 5, 0),
        block(1, 5, 1),
        wants(1, Command::Pause),
        wants(1, Command::Priority(4)),
        wants(1, Command::Focus(Some(sample::rect(1)))),
    ];
    let (sched, _) = told(&recalled(&entries));
    let job = sched.job(JobId(1)).expect("it is known");
    assert_eq!((job.paused, job.priority), (Paused::Yes, 4));
    assert_eq!(job.focus, Some(sample::rect(1)));
    assert_eq!(job.state, JobState::Running);
    let film: Digest = sample::digest(3);
    assert_eq!(state(&sched, 3), ImageState::Encoded { film });
    assert_eq!(state(&sched, 4), ImageState::Failed);
    assert_eq!(sched.failures(JobId(1))[0].reason, "no memory");
    let begun = sched.image(image(1, 5)).expect("it is known");
    assert_eq!(begun.pixels_done, 2 * 32 * 20);
    assert_eq!(state(&sched, 6), ImageState::Waiting);
}

#[test]
fn numbers_of_forgotten_jobs_are_not_given_again() {
    let mut after = submission(5);
    after.after = vec![JobId(2), JobId(3)];
    let entries = [
        submitted(2),
        submitted(3),
        submitted_as(5, after),
        submitted(8),
        Entry::Forgotten { job: JobId(2) },
        Entry::Forgotten { job: JobId(8) },
    ];
    let (mut sched, _) = told(&recalled(&entries));
    let jobs: Vec<u64> = sched.jobs().map(|job| job.job.0).collect();
    assert_eq!(jobs, [3, 5]);
    let waits = sched.job(JobId(5)).expect("it is known");
    assert_eq!(waits.after.iter().copied().collect::<Vec<_>>(), [JobId(3)]);
    let next = Submission {
        after: Vec::new(),
        ..submission(9)
    };
    let mut effects = Vec::new();
    sched.handle(Timestamp(2), Event::Submit(next), &mut effects);
    let given = effects
        .iter()
        .any(|effect| matches!(effect, Effect::Submitted { job: JobId(9), .. }));
    assert!(given, "{effects:?}");
}

#[test]
fn jobs_that_are_over_are_over() {
    let images = 3..9;
    let mut entries = vec![submitted(1), submitted(2), submitted(3)];
    entries.extend(images.clone().map(|number| encoded(1, number)));
    entries.extend(images.map(|number| match number {
        5 => failed(2, number),
        number => encoded(2, number),
    }));
    entries.extend([
        encoded(3, 3),
        block(3, 4, 0),
        wants(3, Command::Pause),
        wants(3, Command::Cancel),
    ]);
    let (sched, _) = told(&recalled(&entries));
    let outcomes: Vec<JobState> = sched.jobs().map(|job| job.state).collect();
    let expected = [
        JobOutcome::Finished,
        JobOutcome::Failed,
        JobOutcome::Cancelled,
    ];
    assert_eq!(outcomes, expected.map(JobState::Over));
}

#[test]
fn an_image_with_all_its_blocks_is_encoded_at_once() {
    let mut entries = vec![submitted(1)];
    entries.extend((0..4).map(|column| block(1, 3, column)));
    let (_, effects) = told(&recalled(&entries));
    let encode = Effect::Encode { image: image(1, 3) };
    assert_eq!(
        effects.iter().filter(|&effect| *effect == encode).count(),
        1
    );
    let again = wants(1, Command::Again(ImageNumber(3)));
    entries.extend([encoded(1, 3), again]);
    let (sched, effects) = told(&recalled(&entries));
    assert!(!effects.contains(&encode));
    assert_eq!(state(&sched, 3), ImageState::Waiting);
}

#[test]
fn submitting_again_after_a_crash_is_submitting_once() {
    let entries = [
        submitted(1),
        wants(1, Command::Priority(4)),
        wants(1, Command::Share(9)),
    ];
    let (mut sched, _) = told(&recalled(&entries));
    let mut effects = Vec::new();
    sched.handle(Timestamp(2), Event::Submit(submission(1)), &mut effects);
    let is_known = |effect: &Effect| matches!(effect, Effect::Submitted { job: JobId(1), .. });
    assert!(effects.iter().any(is_known), "{effects:?}");
    let job = sched.job(JobId(1)).expect("it is known");
    assert_eq!((job.priority, job.share), (4, 9));
}
