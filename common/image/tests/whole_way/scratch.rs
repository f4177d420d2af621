//! The scratch file: what it counts, what it names, what it refuses.

use image::{ImageError, Scratch};
use model::Rect;
use model::film::PIXEL_BYTES;
use proptest::prelude::*;

use crate::film::{CROP, RESOLUTION, blocks, finished, identity, payload, write_all};

#[test]
fn a_film_has_one_digest_whatever_the_tiling() {
    let folder = tempfile::tempdir().unwrap();
    let mut digests = Vec::new();
    for (width, height) in [(64, 64), (40, 60), (200, 25), (1, 101), (32, 32)] {
        let path = folder.path().join(format!("{width}x{height}"));
        let scratch = Scratch::create(path, identity(), CROP).unwrap();
        write_all(&scratch, &blocks(CROP, width, height));
        assert!(scratch.is_complete());
        assert_eq!(scratch.remaining(), []);
        digests.push(scratch.film_digest().unwrap());
    }
    digests.dedup();
    assert_eq!(digests.len(), 1);
}

/// The definition in the docstring, written out once more over the pixels themselves.
#[test]
fn the_digest_is_what_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let mut hasher = blake3::Hasher::new_derive_key("flyby film v1");
    for number in [1_u32, CROP.x0, CROP.y0, CROP.x1, CROP.y1, 8] {
        hasher.update(&number.to_le_bytes());
    }
    for name in ["R", "G", "B", "A", "Z", "N.X", "N.Y", "N.Z"] {
        hasher.update(&u32::try_from(name.len()).unwrap().to_le_bytes());
        hasher.update(name.as_bytes());
    }
    for y in CROP.y0..CROP.y1 {
        for channel in 0..8 {
            for x in CROP.x0..CROP.x1 {
                let value = crate::film::value(channel, x, y);
                let value = if value == 0.0 { 0.0 } else { value };
                hasher.update(&value.to_le_bytes());
            }
        }
    }
    assert_eq!(
        scratch.film_digest().unwrap().0,
        *hasher.finalize().as_bytes()
    );
}

#[test]
fn threads_may_write_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let window = RESOLUTION.rect();
    let alone = finished(folder.path(), window).film_digest().unwrap();
    let scratch = Scratch::create(folder.path().join("shared"), identity(), window).unwrap();
    // Narrow tiles put many blocks of one square into different hands, whole squares among them.
    let mut all = blocks(window, 7, 11);
    all.extend(blocks(window, 32, 32));
    std::thread::scope(|scope| {
        for share in 0..4 {
            let (all, scratch) = (&all, &scratch);
            scope.spawn(move || {
                let mine: Vec<_> = all.iter().copied().skip(share).step_by(4).collect();
                write_all(scratch, &mine);
            });
        }
    });
    assert_eq!(scratch.film_digest().unwrap(), alone);
}

#[test]
fn blocks_that_are_written_together_are_as_if_one_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = Scratch::create_bare(folder.path().join("together"), identity(), CROP).unwrap();
    let pixels: Vec<Rect> = blocks(CROP, 1, 1);
    let payloads: Vec<_> = pixels.iter().map(|block| payload(*block)).collect();
    let mut given: Vec<(Rect, &[u8])> = pixels
        .iter()
        .copied()
        .zip(payloads.iter().map(Vec::as_slice))
        .collect();
    // The first to come stays, and what is wrong with one block is that block's alone.
    let other = vec![0; payloads[0].len()];
    let nan = f32::NAN.to_le_bytes().repeat(other.len() / 4);
    given.insert(1, (pixels[0], &other));
    given.insert(5, (pixels[40], &nan));
    let verdicts = scratch.write_blocks(&given).unwrap();
    for (index, verdict) in verdicts.iter().enumerate() {
        assert_eq!(verdict.is_err(), index == 5, "{index}: {verdict:?}");
    }
    assert_eq!(scratch.pixels_done(), CROP.area());
    scratch.write_again(&given[..1]).unwrap();
    let expected = finished(folder.path(), CROP).film_digest().unwrap();
    assert_eq!(scratch.film_digest().unwrap(), expected);
}

#[test]
fn an_unfinished_film_has_no_digest() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = Scratch::create(folder.path().join("s"), identity(), CROP).unwrap();
    let all = blocks(CROP, 64, 64);
    write_all(&scratch, &all[1..]);
    assert_eq!(
        scratch.remaining().iter().map(|r| r.area()).sum::<u64>(),
        all[0].area()
    );
    let error = scratch.film_digest().unwrap_err();
    assert!(matches!(error, ImageError::Incomplete { missing, .. } if missing == all[0].area()));
}

#[test]
fn what_is_no_block_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = Scratch::create(folder.path().join("s"), identity(), CROP).unwrap();
    let outside = Rect {
        x0: 0,
        y0: 0,
        x1: 32,
        y1: 32,
    };
    let across = Rect {
        x0: 30,
        y0: 40,
        x1: 34,
        y1: 44,
    };
    let empty = Rect {
        x0: 40,
        y0: 40,
        x1: 40,
        y1: 44,
    };
    let inside_out = Rect {
        x0: 60,
        y0: 40,
        x1: 50,
        y1: 44,
    };
    for rect in [outside, across, empty, inside_out] {
        let error = scratch.write_block(rect, &payload(rect)).unwrap_err();
        assert!(matches!(error, ImageError::NotABlock { .. }), "{error}");
    }
    let block = Rect {
        x0: 32,
        y0: 32,
        x1: 64,
        y1: 64,
    };
    let error = scratch
        .write_block(block, &payload(block)[4..])
        .unwrap_err();
    assert!(
        matches!(error, ImageError::PayloadLength { found: 32_764, .. }),
        "{error}"
    );
    assert_eq!(scratch.pixels_done(), 0);
}

#[test]
fn a_nan_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = Scratch::create(folder.path().join("s"), identity(), CROP).unwrap();
    let block = Rect {
        x0: 40,
        y0: 70,
        x1: 50,
        y1: 80,
    };
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut bytes = payload(block);
        // Channel 4, row 3, column 2.
        let at = ((4 * 10 + 3) * 10 + 2) * 4;
        bytes[at..at + 4].copy_from_slice(&bad.to_le_bytes());
        let error = scratch.write_block(block, &bytes).unwrap_err();
        let text = error.to_string();
        assert!(
            text.starts_with("channel Z at pixel (42, 73) is "),
            "{text}"
        );
    }
    assert_eq!(scratch.pixels_done(), 0);
}

#[test]
fn windows_must_lie_in_the_image() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s");
    let too_wide = Rect { x1: 151, ..CROP };
    let empty = Rect {
        x1: CROP.x0,
        ..CROP
    };
    for window in [too_wide, empty] {
        let error = Scratch::create(&path, identity(), window).unwrap_err();
        assert!(matches!(error, ImageError::BadWindow { .. }), "{error}");
    }
    let mut huge = identity();
    huge.resolution.width = 1 << 20;
    assert!(Scratch::create(&path, huge, huge.resolution.rect()).is_err());
    assert!(!path.exists());
}

#[test]
fn the_file_is_sparse_until_it_is_written() {
    use std::os::unix::fs::MetadataExt;
    let folder = tempfile::tempdir().unwrap();
    let mut large = identity();
    large.resolution = model::Resolution {
        width: 16_384,
        height: 16_384,
    };
    let scratch = Scratch::create(folder.path().join("s"), large, large.resolution.rect()).unwrap();
    let metadata = std::fs::metadata(scratch.path()).unwrap();
    assert_eq!(metadata.len(), 4096 + 16_384 * 16_384 * PIXEL_BYTES as u64);
    assert!(metadata.blocks() * 512 < 1 << 20);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Blocks of two tilings in any order, with repetitions: the same digest, each pixel once.
    #[test]
    fn any_order_of_two_tilings_gives_the_same_film(
        first in (1_u32..80, 1_u32..80),
        second in (1_u32..80, 1_u32..80),
        key in any::<u64>(),
    ) {
        let window = Rect { x0: 21, y0: 13, x1: 100, y1: 70 };
        let folder = tempfile::tempdir().unwrap();
        let expected = finished(folder.path(), window).film_digest().unwrap();

        let mut order = blocks(window, first.0.max(5), first.1.max(5));
        order.extend(blocks(window, second.0.max(5), second.1.max(5)));
        // Any key gives some order; sorting by a keyed hash shuffles.
        order.sort_by_key(|block| {
            let mut hasher = blake3::Hasher::new();
            hasher.update(&key.to_le_bytes());
            for corner in [block.x0, block.y0, block.x1, block.y1] {
                hasher.update(&corner.to_le_bytes());
            }
            *hasher.finalize().as_bytes()
        });
        let scratch = Scratch::create(folder.path().join("two"), identity(), window).unwrap();
        let mut seen = std::collections::BTreeSet::new();
        for block in order {
            scratch.write_block(block, &payload(block)).unwrap();
            seen.extend((block.y0..block.y1).flat_map(|y| (block.x0..block.x1).map(move |x| (x, y))));
            prop_assert_eq!(scratch.pixels_done(), seen.len() as u64);
        }
        prop_assert_eq!(scratch.film_digest().unwrap(), expected);
    }
}
