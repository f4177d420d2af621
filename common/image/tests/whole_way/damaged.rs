//! Files that are damaged, lie about themselves, or are something else: an error each, no panic,
//! no memory that the file does not warrant.

use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use image::{ImageError, compare, file_digest, finish, info};

use model::Rect;

use crate::film::{CROP, finished, request};

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// All three readers refuse the file with the same sentence; it names the file.
fn refused(path: &Path) -> ImageError {
    let error = file_digest(path).unwrap_err();
    assert_eq!(info(path).unwrap_err().to_string(), error.to_string());
    assert_eq!(
        compare(path, path).unwrap_err().to_string(),
        error.to_string()
    );
    assert!(
        error.to_string().contains(path.to_str().unwrap()),
        "{error}"
    );
    error
}

fn frames(folder: &Path, window: Rect) -> Vec<Vec<u8>> {
    let scratch = finished(folder, window);
    let files = finish(&scratch, &request(folder, "exr,png,ppm"))
        .unwrap()
        .files;
    files
        .iter()
        .map(|file| std::fs::read(&file.path).unwrap())
        .collect()
}

#[test]
fn truncated_files_are_damaged() {
    let folder = tempfile::tempdir().unwrap();
    for bytes in frames(folder.path(), CROP) {
        for keep in [
            8,
            9,
            30,
            100,
            400,
            bytes.len() / 2,
            bytes.len() - 20,
            bytes.len() - 1,
        ] {
            let path = write(folder.path(), "cut", &bytes[..keep]);
            let error = refused(&path);
            assert!(
                matches!(error, ImageError::Damaged { .. }),
                "{keep}: {error:?}"
            );
        }
    }
}

#[test]
fn what_is_no_image_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    for bytes in [
        &b""[..],
        b"P",
        b"P6",
        b"P5\n1 1\n255\n",
        b"GIF89a....",
        b"\x89PNG.....",
    ] {
        let error = refused(&write(folder.path(), "file", bytes));
        assert!(matches!(error, ImageError::NotAnImage { .. }), "{error:?}");
    }
    let error = refused(&folder.path().join("missing"));
    assert!(matches!(error, ImageError::Io { .. }), "{error:?}");
    assert!(matches!(refused(folder.path()), ImageError::Io { .. }));
}

#[test]
fn claims_are_checked_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    for (header, part) in [
        ("P6 4000000000 2 255 ", "4000000000x2 pixels"),
        ("P6 65536 65536 65535 ", "bytes of memory"),
        ("P6 30000 30000 255 ", "instead of 2700000000"),
        ("P6 0 5 255 ", "no pixels"),
        ("P6 5 5 0 ", "largest code is 0"),
        ("P6 5 5 99999999999 ", "is not P6"),
        ("P6 5 x 255 ", "is not P6"),
        ("P6 # never ends", "is not P6"),
    ] {
        let error = refused(&write(folder.path(), "claim.ppm", header.as_bytes()));
        assert!(error.to_string().contains(part), "{error}");
    }

    // A PNG of 60,000 × 60,000 in a hundred bytes.
    let mut png = Vec::new();
    png::Encoder::new(&mut png, 60_000, 60_000)
        .write_header()
        .unwrap();
    let error = refused(&write(folder.path(), "claim.png", &png));
    assert!(
        matches!(
            error,
            ImageError::TooLarge { .. } | ImageError::Damaged { .. }
        ),
        "{error:?}"
    );

    // An EXR whose windows are made large where they stand.
    let exr = &frames(folder.path(), CROP)[0];
    let at = exr
        .windows(11)
        .position(|bytes| bytes == b"dataWindow\0")
        .unwrap()
        + 11
        + 6
        + 4;
    for (right, bottom) in [
        (60_000_i32, 60_000_i32),
        (i32::MAX - 1, 50),
        (-5, -5),
        (i32::MIN, i32::MIN),
    ] {
        let mut bytes = exr.clone();
        bytes[at + 8..at + 12].copy_from_slice(&right.to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&bottom.to_le_bytes());
        let error = refused(&write(folder.path(), "claim.exr", &bytes));
        assert!(
            matches!(
                error,
                ImageError::TooLarge { .. } | ImageError::Damaged { .. }
            ),
            "{error:?}"
        );
    }
}

/// The decoder of DWA believes the counts in its blocks: they are checked before it sees them.
#[test]
fn a_block_cannot_ask_for_memory() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let channels = SpecificChannels::build()
        .with_channel("R")
        .with_channel("U")
        .with_pixel_fn(|Vec2(x, y)| (f16::from_f32(x as f32), (x * y) as f32));
    let encoding = Encoding {
        compression: Compression::DWAA(None),
        ..Encoding::FAST_LOSSLESS
    };
    let path = folder.path().join("dwa.exr");
    let layer = Layer::new((60, 50), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(&path).unwrap();
    assert!(file_digest(&path).is_ok());
    let bytes = std::fs::read(&path).unwrap();
    // A block's head begins with its version, 2, in 64 bits.
    let version = 2_u64.to_le_bytes();
    let head = bytes
        .windows(8)
        .rposition(|bytes| bytes == version)
        .unwrap();
    for count in [1, 6, 7, 8, 9] {
        let mut bytes = bytes.clone();
        bytes[head + 8 * count + 5] = 0x10;
        let error = refused(&write(folder.path(), "dwa.exr", &bytes)).to_string();
        assert!(error.contains("more values than it can hold"), "{error}");
    }
}

/// One byte of each file after another takes other values: an answer, whichever, never a panic or
/// a hang. Whatever the digest takes for whole, the description takes for whole.
#[test]
fn any_byte_may_be_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let window = Rect {
        x0: 20,
        y0: 13,
        x1: 41,
        y1: 36,
    };
    for bytes in frames(folder.path(), window) {
        // Changed in place: a file system may sync one that is written anew.
        let path = write(folder.path(), "broken", &bytes);
        let file = std::fs::File::options().write(true).open(&path).unwrap();
        for at in (0..bytes.len().min(1200)).chain((1200..bytes.len()).step_by(197)) {
            for value in [0xff, bytes[at] ^ 0x01] {
                file.write_all_at(&[value], at as u64).unwrap();
                if file_digest(&path).is_ok() {
                    assert!(info(&path).is_ok(), "byte {at} = {value:#x}");
                }
            }
            file.write_all_at(&[bytes[at]], at as u64).unwrap();
        }
    }
}
