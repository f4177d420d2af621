//! A film known in closed form, and the tilings that deliver it.

use image::{FrameMetadata, FrameRequest, Scratch, ScratchIdentity, ViewTransform};
use model::film::{CHANNEL_COUNT, CHANNELS};
use model::{Digest, ImageNumber, Rect, Resolution};

pub(crate) const RESOLUTION: Resolution = Resolution {
    width: 150,
    height: 101,
};

/// A crop that no side of the grid falls on.
pub(crate) const CROP: Rect = Rect {
    x0: 21,
    y0: 13,
    x1: 130,
    y1: 99,
};

pub(crate) fn identity() -> ScratchIdentity {
    ScratchIdentity {
        scene: Digest([1; 32]),
        revision: 1,
        image: ImageNumber(7),
        resolution: RESOLUTION,
    }
}

/// The film's value: smooth light with a highlight beyond half's range, distances beyond it too,
/// zeros of both signs.
pub(crate) fn value(channel: usize, x: u32, y: u32) -> f32 {
    let (x, y) = (x as f32, y as f32);
    match CHANNELS[channel].name {
        "R" if x == 60.0 && y == 50.0 => 1e9,
        "R" => x / 100.0,
        "G" => (x + y) / 300.0,
        "B" => y * y / 5000.0,
        "A" => f32::from(u8::from(y > 40.0)),
        "Z" => 6_371_000.0 + x * 3.7 + y,
        "N.X" if y <= 40.0 => -0.0,
        _ => (x - y) / 200.0,
    }
}

pub(crate) fn payload(block: Rect) -> Vec<u8> {
    let mut bytes = Vec::new();
    for channel in 0..CHANNEL_COUNT {
        for y in block.y0..block.y1 {
            for x in block.x0..block.x1 {
                bytes.extend(value(channel, x, y).to_le_bytes());
            }
        }
    }
    bytes
}

/// The blocks of `window` cut into tiles of this size, anchored at the window's corner.
pub(crate) fn blocks(window: Rect, width: u32, height: u32) -> Vec<Rect> {
    let mut blocks = Vec::new();
    for y0 in (window.y0..window.y1).step_by(height as usize) {
        for x0 in (window.x0..window.x1).step_by(width as usize) {
            let tile = Rect {
                x0,
                y0,
                x1: x0 + width,
                y1: y0 + height,
            };
            blocks.extend(tile.intersection(window).unwrap().blocks());
        }
    }
    blocks
}

pub(crate) fn write_all(scratch: &Scratch, blocks: &[Rect]) {
    for block in blocks {
        scratch.write_block(*block, &payload(*block)).unwrap();
    }
}

/// A finished scratch file of `window`.
pub(crate) fn finished(folder: &std::path::Path, window: Rect) -> Scratch {
    let scratch = Scratch::create(folder.join("scratch"), identity(), window).unwrap();
    write_all(&scratch, &blocks(window, 64, 64));
    scratch
}

pub(crate) fn request(folder: &std::path::Path, formats: &str) -> FrameRequest {
    FrameRequest {
        folder: folder.to_owned(),
        stem: "flyby".into(),
        number: ImageNumber(7),
        formats: formats.parse().unwrap(),
        metadata: FrameMetadata {
            scene_digest: Digest([1; 32]),
            revision: 1,
            settings: r#"{"rays":"10x10","where":"Höhe"}"#.into(),
            statistics: r#"{"rays":123456}"#.into(),
            software: "flyby 0.1.0".into(),
            frames_per_second: 25.0,
            comments: "made by a test".into(),
        },
        view: ViewTransform::default(),
        threads: 1,
    }
}

pub(crate) fn names(folder: &std::path::Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}
