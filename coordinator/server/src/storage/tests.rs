//! A store that refuses, and what must and must not follow.

use image::ScratchIdentity;
use model::{Digest, ImageNumber, JobId, Resolution, Span};
use store::Memory;

use super::*;

const IMAGE: ImageRef = ImageRef {
    job: JobId(1),
    image: ImageNumber(0),
};

fn line(text: &str) -> Entry {
    Entry::Line {
        job: JobId(1),
        unix_ms: 0,
        text: text.to_owned(),
    }
}

/// Storage over a store that refuses so many commits, and what it says.
fn refusing(commits: u32, open: Open) -> (Storage, mpsc::Receiver<News>) {
    let mut store = Memory::new();
    store.refuse(commits);
    let (news, heard) = mpsc::channel(64);
    let storage = Storage::start(news, Box::new(store), open).unwrap();
    (storage, heard)
}

#[test]
fn a_full_disk_is_told_and_waited_for() {
    let (storage, mut heard) = refusing(2, Open::new());
    storage.record(line("a"), Some(7));
    let full = heard.blocking_recv().unwrap();
    assert!(
        matches!(&full, News::Trouble(Hand::Committer, Some(why)) if why.contains("full")),
        "{full:?}"
    );
    let well = heard.blocking_recv().unwrap();
    assert!(
        matches!(well, News::Trouble(Hand::Committer, None)),
        "{well:?}"
    );
    let committed = heard.blocking_recv().unwrap();
    assert!(matches!(committed, News::Committed(7)), "{committed:?}");
    storage.finish();
    assert!(heard.blocking_recv().is_none());
}

#[test]
fn what_follows_from_a_commit_that_failed_is_not_done() {
    let folder = tempfile::tempdir().unwrap();
    let resolution = Resolution {
        width: 64,
        height: 32,
    };
    let identity = ScratchIdentity {
        scene: Digest([1; 32]),
        revision: 1,
        image: IMAGE.image,
        resolution,
    };
    let path = folder.path().join("0");
    let scratch = Scratch::create_bare(&path, identity, resolution.rect()).unwrap();
    let open = Open::from([(IMAGE, Arc::new(scratch))]);
    let (storage, mut heard) = refusing(u32::MAX, open);
    storage.record(
        Entry::ImageEncoded {
            image: IMAGE,
            unix_ms: 0,
            film: Digest([2; 32]),
            blocks: 2,
            render_time: Span(1),
            about: String::new(),
        },
        Some(1),
    );
    storage.drop_scratch(IMAGE);
    let full = heard.blocking_recv().unwrap();
    assert!(matches!(full, News::Trouble(..)), "{full:?}");
    // The coordinator is stopped while the disk is full.
    storage.finish();
    while let Some(news) = heard.blocking_recv() {
        assert!(matches!(news, News::Trouble(..)), "{news:?}");
    }
    assert!(
        path.exists(),
        "the frame is not known, so its pixels are kept"
    );
}

#[test]
fn an_image_whose_pixels_are_gone_fails_and_is_not_waited_for() {
    let (storage, mut heard) = refusing(0, Open::new());
    let folder = tempfile::tempdir().unwrap();
    let plan = Plan::new(
        JobFolders::at(folder.path().to_owned()),
        &submission(),
        &about(),
        image::Formats::new([image::Format::Exr]),
    );
    storage.encode(Arc::new(plan), IMAGE, Counters::new(), 3);
    let news = heard.blocking_recv().unwrap();
    let News::Encoded(encoded) = news else {
        panic!("{news:?}");
    };
    assert_eq!((encoded.image, encoded.era), (IMAGE, 3));
    assert!(encoded.result.unwrap_err().contains("gone"));
    storage.finish();
}

#[test]
fn orders_that_wait_are_bounded() {
    let (storage, mut heard) = refusing(u32::MAX, Open::new());
    storage.record(line("first"), None);
    // It is in hand, and waits.
    let full = heard.blocking_recv().unwrap();
    assert!(matches!(full, News::Trouble(..)), "{full:?}");
    let mut given = 0;
    while !storage.is_full() {
        storage.record(line("more"), None);
        given += 1;
    }
    // Some more were taken to be committed after it.
    let taken = committer::AHEAD_MAX * writer::GROUP_MAX;
    assert!(
        (WAITING_MAX..=WAITING_MAX + taken).contains(&given),
        "{given}"
    );
    storage.finish();
}

fn submission() -> sched::Submission {
    sched::Submission {
        submission: model::SubmissionId(1),
        name: "flyby".into(),
        scene: Digest([1; 32]),
        revision: model::Revision(1),
        frames: "0..1".parse().unwrap(),
        window: model::Rect {
            x0: 0,
            y0: 0,
            x1: 64,
            y1: 32,
        },
        tiles: sched::TileShape::Time { aim: None },
        priority: 0,
        share: 1,
        needs: sched::Needs::default(),
        after: Vec::new(),
    }
}

fn about() -> crate::about::JobAbout {
    crate::about::JobAbout {
        stem: "flyby".into(),
        formats: vec!["exr".into()],
        settings: String::new(),
        resolution: (64, 32),
        frames_per_second: 25.0,
        exposure_stops: 0.0,
        software: String::new(),
        assets: Vec::new(),
    }
}
