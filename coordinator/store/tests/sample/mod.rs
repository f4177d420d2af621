//! Entries that tests need.
#![allow(dead_code, reason = "each test binary uses some of these")]

use model::{Digest, FrameRange, ImageNumber, ImageRef, JobId, Rect, Revision, Span, SubmissionId};
use sched::{Command, Needs, Submission, TileShape};
use store::Entry;

pub(crate) fn digest(number: u32) -> Digest {
    let mut digest = Digest([0xd0; 32]);
    digest.0[..4].copy_from_slice(&number.to_be_bytes());
    digest
}

/// A block in the first row of the grid.
pub(crate) fn rect(column: u32) -> Rect {
    Rect {
        x0: column * 32,
        y0: 0,
        x1: column * 32 + 32,
        y1: 20,
    }
}

pub(crate) fn image(job: u64, number: u32) -> ImageRef {
    ImageRef {
        job: JobId(job),
        image: ImageNumber(number),
    }
}

pub(crate) fn submission(number: u64) -> Submission {
    Submission {
        submission: SubmissionId((u128::from(number) << 64) | 1),
        name: format!("flight {number}"),
        scene: digest(7),
        revision: Revision(12),
        frames: FrameRange::new(3, 9, 1).expect("there are some"),
        window: Rect {
            x0: 0,
            y0: 0,
            x1: 128,
            y1: 20,
        },
        tiles: TileShape::Time { aim: None },
        priority: -2,
        share: 3,
        needs: Needs {
            labels: ["fast".to_owned(), "a \"label\"".to_owned()].into(),
            threads: 2,
            memory_bytes: 1 << 30,
        },
        after: Vec::new(),
    }
}

pub(crate) fn submitted(job: u64) -> Entry {
    submitted_as(job, submission(job))
}

pub(crate) fn submitted_as(job: u64, submission: Submission) -> Entry {
    Entry::Submitted {
        job: JobId(job),
        unix_ms: 1_000,
        submission,
        about: "{\"stem\":\"flight\"}".into(),
    }
}

pub(crate) fn block(job: u64, number: u32, column: u32) -> Entry {
    Entry::Block {
        image: image(job, number),
        rect: rect(column),
        elapsed: Span(10),
        pixels: digest(column),
        about: vec![1, 1],
    }
}

pub(crate) fn encoded(job: u64, number: u32) -> Entry {
    Entry::ImageEncoded {
        image: image(job, number),
        unix_ms: 2_000,
        film: digest(number),
        blocks: 12,
        render_time: Span(77),
        about: "{}".into(),
    }
}

pub(crate) fn failed(job: u64, number: u32) -> Entry {
    Entry::ImageFailed {
        image: image(job, number),
        unix_ms: 3_000,
        reason: "no memory".into(),
    }
}

pub(crate) fn wants(job: u64, command: Command) -> Entry {
    Entry::Command {
        job: JobId(job),
        unix_ms: 4_000,
        command,
    }
}

pub(crate) fn line(job: u64, text: &str) -> Entry {
    Entry::Line {
        job: JobId(job),
        unix_ms: 5_000,
        text: text.to_owned(),
    }
}

/// What `tests/samples/v1.sqlite` holds; `store-other sample FILE` writes one of the newest schema.
pub(crate) fn sampled() -> Vec<Entry> {
    let mut waits = submission(3);
    waits.after = vec![JobId(2), JobId(1)];
    vec![
        submitted(1),
        submitted(2),
        submitted_as(3, waits),
        encoded(1, 3),
        failed(1, 4),
        block(1, 5, 0),
        block(1, 5, 3),
        line(1, "image 3 is in its place"),
        wants(1, Command::Pause),
        wants(1, Command::Focus(Some(rect(1)))),
        block(2, 3, 0),
        wants(2, Command::Cancel),
        submitted(9),
        Entry::Forgotten { job: JobId(9) },
    ]
}

/// Blocks in a `group`.
pub(crate) const GROUP: usize = 50;

/// The `number`-th of many commits of blocks, all of them different.
pub(crate) fn group(number: usize) -> Vec<Entry> {
    let columns = (number * GROUP..).take(GROUP);
    columns
        .map(|column| {
            let column = u32::try_from(column).expect("a test has not so many");
            Entry::Block {
                image: image(1, 3),
                rect: Rect {
                    x0: column,
                    y0: 0,
                    x1: column + 1,
                    y1: 1,
                },
                elapsed: Span(1),
                pixels: digest(column),
                about: vec![0; 20],
            }
        })
        .collect()
}
