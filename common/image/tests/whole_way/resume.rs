//! Going on after an interruption: what is believed, what is rendered again.

use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use image::{ImageError, Opened, Scratch};
use model::Rect;

use crate::film::{CROP, blocks, finished, identity, names, payload, write_all};

/// Half of the blocks written, then dropped as by a crash of the process.
fn interrupted(folder: &Path) -> (PathBuf, Vec<Rect>) {
    let path = folder.join("half");
    let all = blocks(CROP, 40, 60);
    let half = all.len() / 2;
    let scratch = Scratch::create(&path, identity(), CROP).unwrap();
    write_all(&scratch, &all[..half]);
    (path, all)
}

fn journal(path: &Path) -> PathBuf {
    PathBuf::from(format!("{}.journal", path.display()))
}

fn area(blocks: &[Rect]) -> u64 {
    blocks.iter().map(|block| block.area()).sum()
}

/// Renders what `remaining` says, nothing else, and expects the film of an undisturbed render.
fn go_on(folder: &Path, scratch: &Scratch) {
    let expected = finished(folder, CROP).film_digest().unwrap();
    let rest = scratch.remaining();
    assert_eq!(area(&rest), CROP.area() - scratch.pixels_done());
    write_all(scratch, &rest);
    assert_eq!(scratch.film_digest().unwrap(), expected);
}

#[test]
fn what_was_written_is_not_rendered_again() {
    let folder = tempfile::tempdir().unwrap();
    let (path, all) = interrupted(folder.path());
    let (scratch, opened) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
    let pixels_done = area(&all[..all.len() / 2]);
    assert_eq!(
        opened,
        Opened::Resumed {
            pixels_done,
            blocks_lost: 0
        }
    );
    scratch.sync().unwrap();
    go_on(folder.path(), &scratch);
    scratch.discard().unwrap();
    assert_eq!(names(folder.path()), ["scratch", "scratch.journal"]);
}

#[test]
fn a_torn_tail_costs_its_block_alone() {
    for cut in [1, 17, 63] {
        let folder = tempfile::tempdir().unwrap();
        let (path, all) = interrupted(folder.path());
        let file = std::fs::File::options()
            .write(true)
            .open(journal(&path))
            .unwrap();
        let length = file.metadata().unwrap().len();
        file.set_len(length - cut).unwrap();
        for _ in 0..2 {
            let (_, opened) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
            let pixels_done = area(&all[..all.len() / 2 - 1]);
            assert_eq!(
                opened,
                Opened::Resumed {
                    pixels_done,
                    blocks_lost: 0
                }
            );
        }
        assert_eq!(
            std::fs::metadata(journal(&path)).unwrap().len(),
            length - 64
        );
        let (scratch, _) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
        go_on(folder.path(), &scratch);
    }
}

#[test]
fn a_damaged_record_ends_the_journal() {
    let folder = tempfile::tempdir().unwrap();
    let (path, all) = interrupted(folder.path());
    let file = std::fs::File::options()
        .write(true)
        .open(journal(&path))
        .unwrap();
    // The fifth record: its third corner.
    file.write_all_at(&[0xff], 64 * 5 + 8).unwrap();
    let (scratch, opened) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
    let pixels_done = area(&all[..4]);
    assert_eq!(
        opened,
        Opened::Resumed {
            pixels_done,
            blocks_lost: 0
        }
    );
    go_on(folder.path(), &scratch);
}

#[test]
fn pixels_that_did_not_outlive_the_crash_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let (path, all) = interrupted(folder.path());
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    // The pixel of the first block that lies in the first slot, of the window's first square.
    let inside = (u64::from(CROP.y0 % 32) * 32 + u64::from(CROP.x0 % 32)) * 4;
    file.write_all_at(&[0x55], 4096 + inside).unwrap();
    let (scratch, opened) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
    let pixels_done = area(&all[1..all.len() / 2]);
    assert_eq!(
        opened,
        Opened::Resumed {
            pixels_done,
            blocks_lost: 1
        }
    );
    assert!(scratch.remaining().iter().any(|rest| rest.contains(all[0])));
    go_on(folder.path(), &scratch);
}

#[test]
fn a_truncated_scratch_file_loses_what_it_lost() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = interrupted(folder.path());
    std::fs::File::options()
        .write(true)
        .open(&path)
        .unwrap()
        .set_len(4096 + 32_768)
        .unwrap();
    let (scratch, opened) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
    assert!(matches!(opened, Opened::Resumed { blocks_lost, .. } if blocks_lost > 0));
    go_on(folder.path(), &scratch);
}

#[test]
fn without_its_journal_nothing_is_believed() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = interrupted(folder.path());
    std::fs::remove_file(journal(&path)).unwrap();
    let (scratch, opened) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
    assert_eq!((opened, scratch.pixels_done()), (Opened::New, 0));
    go_on(folder.path(), &scratch);
}

#[test]
fn another_image_begins_anew_and_says_so() {
    let other_scene = |id: &mut image::ScratchIdentity| id.scene.0[0] ^= 1;
    let other_revision = |id: &mut image::ScratchIdentity| id.revision += 1;
    let other_image = |id: &mut image::ScratchIdentity| id.image.0 += 1;
    let other_size = |id: &mut image::ScratchIdentity| id.resolution.width += 1;
    let changes: [&dyn Fn(&mut image::ScratchIdentity); 4] =
        [&other_scene, &other_revision, &other_image, &other_size];
    for change in changes {
        let folder = tempfile::tempdir().unwrap();
        let (path, _) = interrupted(folder.path());
        let mut other = identity();
        change(&mut other);
        let (scratch, opened) = Scratch::open_or_create(&path, other, CROP).unwrap();
        assert_eq!((opened, scratch.pixels_done()), (Opened::StartedAnew, 0));
        drop(scratch);
        let (_, opened) = Scratch::open_or_create(&path, other, CROP).unwrap();
        assert_eq!(
            opened,
            Opened::Resumed {
                pixels_done: 0,
                blocks_lost: 0
            }
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = interrupted(folder.path());
    let window = Rect {
        x1: CROP.x1 - 1,
        ..CROP
    };
    let (_, opened) = Scratch::open_or_create(&path, identity(), window).unwrap();
    assert_eq!(opened, Opened::StartedAnew);
}

#[test]
fn creating_forgets_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = interrupted(folder.path());
    let scratch = Scratch::create(&path, identity(), CROP).unwrap();
    assert_eq!(scratch.pixels_done(), 0);
    drop(scratch);
    let (scratch, _) = Scratch::open_or_create(&path, identity(), CROP).unwrap();
    assert_eq!(scratch.pixels_done(), 0);
}

#[test]
fn one_process_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let error = Scratch::open_or_create(scratch.path(), identity(), CROP).unwrap_err();
    assert!(matches!(error, ImageError::Busy { .. }), "{error}");
    assert!(scratch.is_complete() && scratch.film_digest().is_ok());
}

#[test]
fn a_stranger_s_file_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("letters");
    std::fs::write(&path, "dear diary").unwrap();
    for result in [
        Scratch::create(&path, identity(), CROP),
        Scratch::open_or_create(&path, identity(), CROP).map(|(scratch, _)| scratch),
    ] {
        assert!(matches!(result, Err(ImageError::NotAScratch { .. })));
    }
    assert_eq!(std::fs::read(&path).unwrap(), b"dear diary");
}

#[test]
fn a_folder_that_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nowhere/scratch");
    let error = Scratch::create(&path, identity(), CROP).unwrap_err();
    assert!(error.to_string().contains("nowhere/scratch"), "{error}");
}

#[test]
fn a_block_done_already_adds_nothing_to_the_journal() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let journal = journal(scratch.path());
    let before = std::fs::metadata(&journal).unwrap().len();
    write_all(&scratch, &blocks(CROP, 7, 7));
    assert_eq!(std::fs::metadata(&journal).unwrap().len(), before);
    let block = blocks(CROP, 7, 7)[0];
    assert!(scratch.write_block(block, &payload(block)).is_ok());
}

#[test]
fn without_a_journal_its_caller_says_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bare");
    let all = blocks(CROP, 40, 60);
    let half = all.len() / 2;
    let scratch = Scratch::create_bare(&path, identity(), CROP).unwrap();
    write_all(&scratch, &all[..half]);
    scratch.sync().unwrap();
    drop(scratch);
    assert!(!journal(&path).exists());

    let digest = |block: &Rect| model::Digest(*blake3::hash(&payload(*block)).as_bytes());
    let noted = || all[..half].iter().map(|block| (*block, digest(block)));
    let (scratch, lost) = Scratch::reopen_bare(&path, identity(), CROP, noted()).unwrap();
    assert_eq!(lost, []);
    assert_eq!(scratch.pixels_done(), area(&all[..half]));
    drop(scratch);

    // A block that was noted and is another one on the disk is given back.
    let wrong = noted().chain([(all[half], digest(&all[0]))]);
    let (scratch, lost) = Scratch::reopen_bare(&path, identity(), CROP, wrong).unwrap();
    assert_eq!(lost, [all[half]]);
    go_on(folder.path(), &scratch);
    scratch.discard().unwrap();
    assert!(!path.exists());
    drop(scratch);

    // Where the file is gone, so are they all.
    let (scratch, lost) = Scratch::reopen_bare(&path, identity(), CROP, noted()).unwrap();
    let corner = |block: &Rect| (block.y0, block.x0);
    let sorted = |blocks: &[Rect]| {
        let mut blocks = blocks.to_vec();
        blocks.sort_by_key(corner);
        blocks
    };
    assert_eq!(sorted(&lost), sorted(&all[..half]));
    assert_eq!(scratch.pixels_done(), 0);
}
