//! How many blocks a second become durable in groups of some size, and how long 1,000,000 take to be recalled.
//!
//! On the disk of the folder in which it runs: `cargo bench -p store --bench blocks`
#![expect(clippy::print_stdout, reason = "a bench prints what it measured")]

use std::fs::File;
use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use model::{Digest, FrameRange, ImageNumber, ImageRef, JobId, Rect, Revision, Span, SubmissionId};
use sched::{Needs, Submission, TileShape};
use store::{Entry, Sqlite, Store as _};

const COLUMNS: u32 = 100;
const IMAGE: u32 = COLUMNS * COLUMNS;

fn submitted() -> Entry {
    Entry::Submitted {
        job: JobId(1),
        unix_ms: 0,
        submission: Submission {
            submission: SubmissionId(1),
            name: "bench".into(),
            scene: Digest([1; 32]),
            revision: Revision(1),
            frames: FrameRange::new(0, 1_000, 1).expect("there are some"),
            window: Rect {
                x0: 0,
                y0: 0,
                x1: COLUMNS * 32,
                y1: COLUMNS * 32,
            },
            tiles: TileShape::Time { aim: None },
            priority: 0,
            share: 1,
            needs: Needs::default(),
            after: Vec::new(),
        },
        about: String::new(),
    }
}

/// The `number`-th block: those of one image come in a scattered order, as from many workers.
fn block(number: u32) -> Entry {
    let place = (number % IMAGE) * 7_919 % IMAGE;
    let (x0, y0) = (place % COLUMNS * 32, place / COLUMNS * 32);
    let mut pixels = Digest([number.to_le_bytes()[0]; 32]);
    pixels.0[..4].copy_from_slice(&number.to_le_bytes());
    Entry::Block {
        image: ImageRef {
            job: JobId(1),
            image: ImageNumber(number / IMAGE),
        },
        rect: Rect {
            x0,
            y0,
            x1: x0 + 32,
            y1: y0 + 32,
        },
        elapsed: Span(123_456),
        pixels,
        about: vec![7; 24],
    }
}

/// Commits blocks from number `from` on in groups of `size` for as long as `span`; how many.
fn fill(store: &mut Sqlite, from: u32, size: u32, span: Duration) -> u32 {
    let begun = Instant::now();
    let mut next = from;
    while begun.elapsed() < span {
        let group: Vec<Entry> = (next..next + size).map(block).collect();
        store.commit(&group).expect("there is room");
        next += size;
    }
    next - from
}

/// How often a second this disk syncs 4 KiB.
fn syncs(folder: &Path) -> f64 {
    let mut file = File::create(folder.join("probe")).expect("the folder can be written");
    let begun = Instant::now();
    let mut count = 0;
    while begun.elapsed() < Duration::from_secs(1) {
        file.write_all(&[1; 4_096]).expect("there is room");
        file.sync_data().expect("the disk works");
        count += 1;
    }
    f64::from(count) / begun.elapsed().as_secs_f64()
}

fn main() {
    let folder = tempfile::tempdir_in(".").expect("the folder can be written");
    println!(
        "this disk: {:.0} syncs of 4 KiB a second",
        syncs(folder.path())
    );
    for size in [1, 10, 100, 256, 1_000] {
        let path = folder.path().join(format!("{size}.sqlite"));
        let mut store = Sqlite::open(&path).expect("the folder can be written");
        store.commit(&[submitted()]).expect("there is room");
        let begun = Instant::now();
        let blocks = fill(&mut store, 0, size, Duration::from_secs(3));
        let rate = f64::from(blocks) / begun.elapsed().as_secs_f64();
        println!("groups of {size}: {rate:.0} blocks/s");
    }

    let path = folder.path().join("million.sqlite");
    let mut store = Sqlite::open(&path).expect("the folder can be written");
    store.commit(&[submitted()]).expect("there is room");
    let begun = Instant::now();
    for group in 0..1_000 {
        let group: Vec<Entry> = (group * 1_000..(group + 1) * 1_000).map(block).collect();
        store.commit(&group).expect("there is room");
    }
    println!("1,000,000 blocks written in {:.2?}", begun.elapsed());
    drop(store);
    let size = std::fs::metadata(&path).expect("it is there").len();
    println!("in a file of {} MiB", size >> 20);
    let begun = Instant::now();
    let mut store = Sqlite::open(&path).expect("nobody else has it");
    let recalled = store.recall().expect("it is whole");
    println!(
        "{} of them recalled in {:.2?}",
        recalled.jobs[0].blocks.len(),
        begun.elapsed()
    );
    let begun = Instant::now();
    store
        .commit(&[Entry::Forgotten { job: JobId(1) }])
        .expect("there is room");
    println!("and forgotten in {:.2?}", begun.elapsed());
}
