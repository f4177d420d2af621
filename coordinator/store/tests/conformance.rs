//! What a store must do, for every store; and random entries, which must give the same in all of them.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod sample;

use model::{ImageNumber, JobId, Rect, Span};
use proptest::prelude::*;
use sample::{block, digest, encoded, failed, image, line, rect, submission, submitted, wants};
use sched::{Command, TileShape};
use store::{Entry, LOG_LINES_MAX, Memory, Recalled, RecalledImage, RecalledJob, Sqlite, Store};
use tempfile::TempDir;

/// A store that can be killed.
trait Crash: Store + Sized {
    /// What a process finds that is started after this one was killed.
    fn crash(self) -> Self;
}

struct InFolder {
    // Closed before the folder goes.
    store: Option<Sqlite>,
    folder: TempDir,
}

const FILE: &str = "store.sqlite";

impl InFolder {
    fn new() -> Self {
        Self::open(tempfile::tempdir().unwrap())
    }

    fn open(folder: TempDir) -> Self {
        let store = Sqlite::open(&folder.path().join(FILE)).unwrap();
        Self {
            store: Some(store),
            folder,
        }
    }

    fn store(&mut self) -> &mut Sqlite {
        self.store.as_mut().unwrap()
    }
}

impl Store for InFolder {
    fn commit(&mut self, entries: &[Entry]) -> Result<(), store::StoreError> {
        self.store().commit(entries)
    }

    fn recall(&mut self) -> Result<Recalled, store::StoreError> {
        self.store().recall()
    }
}

impl Crash for InFolder {
    /// The files as they are at this moment, and nothing that closing might add.
    fn crash(mut self) -> Self {
        let after = tempfile::tempdir().unwrap();
        for name in [FILE, "store.sqlite-wal"] {
            std::fs::copy(self.folder.path().join(name), after.path().join(name)).unwrap();
        }
        drop(self.store.take());
        Self::open(after)
    }
}

impl Crash for Memory {
    fn crash(self) -> Self {
        self.crash()
    }
}

fn only(store: &mut impl Store) -> RecalledJob {
    let mut jobs = store.recall().unwrap().jobs;
    assert_eq!(jobs.len(), 1);
    jobs.remove(0)
}

/// The only job, as it comes back after these entries and a crash.
fn only_after(mut store: impl Crash, entries: &[Entry]) -> RecalledJob {
    store.commit(entries).unwrap();
    only(&mut store.crash())
}

/// The images and places of its blocks.
fn places(job: &RecalledJob) -> Vec<(u32, Rect)> {
    let blocks = job.blocks.iter();
    blocks.map(|block| (block.image.0, block.rect)).collect()
}

fn nothing_at_first(mut store: impl Crash) {
    let nothing = Recalled {
        last_job: JobId(0),
        jobs: Vec::new(),
    };
    assert_eq!(store.recall().unwrap(), nothing);
    store.commit(&[]).unwrap();
    assert_eq!(store.crash().recall().unwrap(), nothing);
}

fn a_submission_comes_back_whole(mut store: impl Crash) {
    let shapes = [
        TileShape::Rule {
            min_tile_pixels: None,
        },
        TileShape::Rule {
            min_tile_pixels: Some(u64::MAX),
        },
        TileShape::Size {
            width: 7,
            height: 9,
        },
        TileShape::Time { aim: None },
        TileShape::Time {
            aim: Some(Span(5_000_000)),
        },
    ];
    let mut jobs = Vec::new();
    for (number, tiles) in (1..).zip(shapes) {
        let mut submission = submission(number);
        submission.tiles = tiles;
        submission.needs.memory_bytes = u64::MAX - number;
        submission.after = (1..number).rev().map(JobId).collect();
        jobs.push((JobId(number), submission));
    }
    for (job, submission) in jobs.iter().rev() {
        let submission = submission.clone();
        let about = format!("{{\"of\":{job}}}");
        let (job, unix_ms) = (*job, 1_000 + job.0);
        store
            .commit(&[Entry::Submitted {
                job,
                unix_ms,
                submission,
                about,
            }])
            .unwrap();
    }
    let recalled = store.crash().recall().unwrap();
    assert_eq!(recalled.last_job, JobId(5));
    for (recalled, (job, submission)) in recalled.jobs.iter().zip(&jobs) {
        assert_eq!((recalled.job, &recalled.submission), (*job, submission));
        assert_eq!(recalled.unix_ms, 1_000 + job.0);
        assert_eq!(recalled.about, format!("{{\"of\":{job}}}"));
    }
}

fn a_job_that_is_known_stays_what_it_is(mut store: impl Crash) {
    let second = Entry::Submitted {
        job: JobId(1),
        unix_ms: 9,
        submission: submission(2),
        about: "other".into(),
    };
    store.commit(&[submitted(1)]).unwrap();
    let first = only(&mut store);
    assert_eq!(only_after(store, &[second]), first);
}

fn blocks_are_kept_once_and_in_order(store: impl Crash) {
    let twice = Entry::Block {
        image: image(1, 3),
        rect: rect(0),
        elapsed: Span(1),
        pixels: digest(99),
        about: Vec::new(),
    };
    let job = only_after(
        store,
        &[
            submitted(1),
            block(1, 4, 0),
            block(1, 3, 2),
            block(1, 3, 0),
            twice,
            block(1, 3, 1),
        ],
    );
    assert_eq!(
        places(&job),
        [(3, rect(0)), (3, rect(1)), (3, rect(2)), (4, rect(0))]
    );
    assert_eq!(job.blocks[0].pixels, digest(0));
    assert_eq!(job.blocks[0].elapsed, Span(10));
    assert_eq!(job.blocks[1].about, [1, 1]);
}

fn lost_blocks_can_come_again(mut store: impl Crash) {
    let lost = |rects| Entry::BlocksLost {
        image: image(1, 3),
        rects,
    };
    store
        .commit(&[
            submitted(1),
            block(1, 3, 0),
            block(1, 3, 1),
            block(1, 4, 0),
            lost(vec![rect(0), rect(2)]),
        ])
        .unwrap();
    assert_eq!(places(&only(&mut store)), [(3, rect(1)), (4, rect(0))]);
    let job = only_after(store, &[block(1, 3, 0)]);
    assert_eq!(places(&job), [(3, rect(0)), (3, rect(1)), (4, rect(0))]);
}

fn an_image_that_is_over_has_no_blocks(store: impl Crash) {
    let job = only_after(
        store,
        &[
            submitted(1),
            block(1, 3, 0),
            block(1, 4, 0),
            block(1, 5, 0),
            encoded(1, 3),
            failed(1, 4),
            // What was on its way comes too late, and who is over stays so.
            block(1, 3, 1),
            block(1, 4, 1),
            failed(1, 3),
            encoded(1, 4),
        ],
    );
    assert_eq!(job.blocks.len(), 1);
    assert_eq!(
        job.images,
        [
            RecalledImage::Encoded {
                image: ImageNumber(3),
                unix_ms: 2_000,
                film: digest(3),
                blocks: 12,
                render_time: Span(77),
                about: "{}".into(),
            },
            RecalledImage::Failed {
                image: ImageNumber(4),
                unix_ms: 3_000,
                reason: "no memory".into(),
            },
        ]
    );
}

fn retry_and_again_make_images_nothing(store: impl Crash) {
    let job = only_after(
        store,
        &[
            submitted(1),
            encoded(1, 3),
            encoded(1, 4),
            failed(1, 5),
            block(1, 6, 0),
            wants(1, Command::Retry),
            wants(1, Command::Again(ImageNumber(3))),
            wants(1, Command::Again(ImageNumber(6))),
            block(1, 3, 0),
            block(1, 5, 0),
        ],
    );
    let over: Vec<_> = job.images.iter().map(|image| image.image().0).collect();
    assert_eq!(over, [4]);
    let begun: Vec<_> = job.blocks.iter().map(|block| block.image.0).collect();
    assert_eq!(begun, [3, 5]);
}

fn a_job_that_was_finished_is_waited_for_no_more(mut store: impl Crash) {
    let waiting = |job: u64, after: &[u64]| {
        let mut submission = submission(job);
        submission.frames = "3..5".parse().unwrap();
        submission.after = after.iter().copied().map(JobId).collect();
        Entry::Submitted {
            job: JobId(job),
            unix_ms: 1_000,
            submission,
            about: String::new(),
        }
    };
    let entries = [
        waiting(1, &[]),
        waiting(2, &[]),
        waiting(3, &[2, 1]),
        encoded(1, 3),
        failed(2, 3),
        encoded(2, 4),
        encoded(1, 4),
        // Begun anew, which changes nothing for who waited.
        wants(1, Command::Again(ImageNumber(3))),
        waiting(4, &[1, 2]),
        encoded(1, 3),
        waiting(5, &[1, 2]),
        wants(1, Command::Again(ImageNumber(3))),
    ];
    store.commit(&entries).unwrap();
    let recalled = store.crash().recall().unwrap();
    let after = |job: usize| {
        let after = recalled.jobs[job - 1].submission.after.iter();
        after.map(|job| job.0).collect::<Vec<_>>()
    };
    assert_eq!((after(3), after(4), after(5)), (vec![2], vec![2], vec![2]));
}

fn commands_change_the_job(mut store: impl Crash) {
    store
        .commit(&[
            submitted(1),
            wants(1, Command::Pause),
            wants(1, Command::Priority(-7)),
            wants(1, Command::Share(9)),
            wants(1, Command::Focus(Some(rect(2)))),
        ])
        .unwrap();
    let mut store = store.crash();
    let job = only(&mut store);
    assert!(job.paused);
    assert_eq!((job.priority, job.share), (-7, 9));
    assert_eq!(job.submission, submission(1));
    assert_eq!(job.focus, Some(rect(2)));
    let resumed = [wants(1, Command::Resume), wants(1, Command::Focus(None))];
    let job = only_after(store, &resumed);
    assert!(!job.paused);
    assert_eq!(job.focus, None);
}

fn a_cancelled_job_keeps_its_frames_alone(store: impl Crash) {
    let job = only_after(
        store,
        &[
            submitted(1),
            encoded(1, 3),
            block(1, 4, 0),
            wants(1, Command::Cancel),
            block(1, 4, 1),
            wants(1, Command::Pause),
            wants(1, Command::Retry),
            // In its place before the encoder heard of it.
            encoded(1, 5),
            line(1, "cancelled"),
        ],
    );
    assert_eq!(job.cancelled_unix_ms, Some(4_000));
    assert!(job.blocks.is_empty() && !job.paused);
    assert_eq!(job.images.len(), 2);
    assert_eq!(job.log.len(), 1);
}

fn cancelling_a_job_that_is_over_changes_nothing(mut store: impl Crash) {
    let mut over: Vec<Entry> = vec![submitted(1), failed(1, 3)];
    over.extend((4..9).map(|number| encoded(1, number)));
    let retried = [
        wants(1, Command::Cancel),
        wants(1, Command::Retry),
        block(1, 3, 0),
    ];
    store.commit(&over).unwrap();
    let job = only_after(store, &retried);
    assert_eq!(job.cancelled_unix_ms, None);
    assert_eq!((job.images.len(), job.blocks.len()), (5, 1));
}

fn what_is_forgotten_is_gone_but_for_its_number(mut store: impl Crash) {
    for forget in [
        Entry::Forgotten { job: JobId(7) },
        wants(7, Command::Remove),
    ] {
        store
            .commit(&[
                submitted(7),
                submitted(2),
                encoded(7, 3),
                block(7, 4, 0),
                line(7, "begun"),
                forget,
                // All about a job that is not known.
                block(7, 4, 1),
                encoded(7, 4),
                failed(7, 5),
                line(7, "late"),
                wants(7, Command::Pause),
                Entry::BlocksLost {
                    image: image(7, 4),
                    rects: vec![rect(0)],
                },
            ])
            .unwrap();
        assert_eq!(only(&mut store).job, JobId(2));
    }
    store.commit(&[submitted(3)]).unwrap();
    let mut store = store.crash();
    assert_eq!(store.recall().unwrap().last_job, JobId(7));
    store.commit(&[submitted(7)]).unwrap();
    let recalled = store.recall().unwrap();
    let job = &recalled.jobs[2];
    assert!(job.images.is_empty() && job.blocks.is_empty() && job.log.is_empty());
    assert_eq!(job.submission, submission(7));
}

fn a_log_is_bounded(mut store: impl Crash) {
    store.commit(&[submitted(1), submitted(2)]).unwrap();
    let lines: Vec<Entry> = (0..LOG_LINES_MAX + 7)
        .map(|number| line(1, &number.to_string()))
        .collect();
    store.commit(&lines[..3]).unwrap();
    store.commit(&lines[3..]).unwrap();
    store.commit(&[line(2, "alone")]).unwrap();
    let recalled = store.crash().recall().unwrap();
    let (long, short) = (&recalled.jobs[0], &recalled.jobs[1]);
    assert_eq!((long.log.len(), long.log_dropped), (LOG_LINES_MAX, 7));
    assert_eq!(long.log[0], (5_000, "7".to_owned()));
    assert_eq!(long.log[LOG_LINES_MAX - 1].1, "1006");
    assert_eq!((short.log.len(), short.log_dropped), (1, 0));
}

macro_rules! for_every_store {
    ($($law:ident)*) => {
        mod sqlite { $(#[test] fn $law() { super::$law(super::InFolder::new()); })* }
        mod memory { $(#[test] fn $law() { super::$law(super::Memory::new()); })* }
    };
}

for_every_store! {
    nothing_at_first
    a_submission_comes_back_whole
    a_job_that_is_known_stays_what_it_is
    blocks_are_kept_once_and_in_order
    lost_blocks_can_come_again
    an_image_that_is_over_has_no_blocks
    retry_and_again_make_images_nothing
    a_job_that_was_finished_is_waited_for_no_more
    commands_change_the_job
    a_cancelled_job_keeps_its_frames_alone
    cancelling_a_job_that_is_over_changes_nothing
    what_is_forgotten_is_gone_but_for_its_number
    a_log_is_bounded
}

fn entry() -> impl Strategy<Value = Entry> {
    let (job, number, column) = (1..4_u64, 3..6_u32, 0..4_u32);
    let any_image = (job.clone(), number.clone());
    let command = prop_oneof![
        3 => Just(Command::Pause),
        3 => Just(Command::Resume),
        1 => Just(Command::Cancel),
        3 => Just(Command::Retry),
        1 => Just(Command::Remove),
        3 => number.prop_map(|number| Command::Again(ImageNumber(number))),
        2 => any::<i32>().prop_map(Command::Priority),
        2 => any::<u32>().prop_map(Command::Share),
        2 => prop::option::of(column.clone().prop_map(rect)).prop_map(Command::Focus),
    ];
    let several = prop::collection::vec(column.clone().prop_map(rect), 0..4);
    prop_oneof![
        4 => (job.clone(), any::<u64>(), ".{0,9}").prop_map(|(job, number, name)| {
            let mut submission = submission(number);
            submission.name = name;
            Entry::Submitted { job: JobId(job), unix_ms: number, submission, about: "{}".into() }
        }),
        20 => (any_image.clone(), column, any::<u64>(), any::<Vec<u8>>()).prop_map(
            |((job, number), column, elapsed, about)| Entry::Block {
                image: image(job, number),
                rect: rect(column),
                elapsed: Span(elapsed),
                pixels: digest(column),
                about,
            }
        ),
        4 => (any_image.clone(), several).prop_map(|((job, number), rects)| {
            Entry::BlocksLost { image: image(job, number), rects }
        }),
        4 => any_image.clone().prop_map(|(job, number)| encoded(job, number)),
        3 => any_image.prop_map(|(job, number)| failed(job, number)),
        6 => (job.clone(), command).prop_map(|(job, command)| wants(job, command)),
        1 => job.clone().prop_map(|job| Entry::Forgotten { job: JobId(job) }),
        4 => (job, "\\PC{0,9}").prop_map(|(job, text)| line(job, &text)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn all_stores_keep_the_same(groups in prop::collection::vec(prop::collection::vec(entry(), 0..20), 0..8)) {
        let (mut file, mut memory) = (InFolder::new(), Memory::new());
        for (index, group) in groups.iter().enumerate() {
            file.commit(group).unwrap();
            memory.commit(group).unwrap();
            if index % 3 == 2 {
                (file, memory) = (file.crash(), memory.crash());
            }
            prop_assert_eq!(file.recall().unwrap(), memory.recall().unwrap());
        }
        file.store().check().unwrap();
        // Told again, most entries change nothing that the first time did not.
        prop_assert_eq!(file.crash().recall().unwrap(), memory.crash().recall().unwrap());
    }
}

#[test]
fn a_full_memory_keeps_nothing_of_a_commit() {
    let mut store = Memory::new();
    store.commit(&[submitted(1)]).unwrap();
    store.refuse(2);
    for _ in 0..2 {
        let refused = store.commit(&[block(1, 3, 0)]).unwrap_err();
        assert!(refused.is_transient());
        assert!(only(&mut store).blocks.is_empty());
    }
    let job = only_after(store, &[block(1, 3, 0)]);
    assert_eq!(job.blocks.len(), 1);
}
