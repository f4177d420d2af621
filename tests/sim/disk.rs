//! A disk that keeps what was synced, and of the rest whatever it likes.

use std::collections::BTreeMap;

use model::{Digest, ImageRef, Rect};

use crate::random::Random;

pub(crate) const WIDTH: u32 = 200;
pub(crate) const HEIGHT: u32 = 150;

/// Whether a worker rendered what it should have.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Pixels {
    Right,
    Wrong,
}

const MISSING: u8 = 0;
const WRONG: u8 = 255;

/// Scratch files, frames, and whether there is room.
#[derive(Debug, Default)]
pub(crate) struct Disk {
    files: BTreeMap<ImageRef, File>,
    /// Removed files that a crash may bring back: nobody synced their folder.
    removed: BTreeMap<ImageRef, File>,
    /// Frames in their place, by image.
    pub(crate) frames: BTreeMap<ImageRef, Vec<u8>>,
    pub(crate) is_full: bool,
}

#[derive(Clone, Debug)]
struct File {
    /// What a reader sees.
    now: Vec<u8>,
    /// What is certain to be there after a crash.
    synced: Vec<u8>,
    unsynced: Vec<Rect>,
}

/// The pixel that belongs there.
fn right(image: ImageRef, x: u32, y: u32) -> u8 {
    let of_image = (image.job.0 * 31 + u64::from(image.image.0) * 7) % 250;
    let of_image = u32::try_from(of_image).expect("it is small");
    let mixed = (of_image + x / 4 + y / 4 * 5) % 250;
    1 + u8::try_from(mixed).expect("it is small")
}

fn index(x: u32, y: u32) -> usize {
    (y * WIDTH + x) as usize
}

impl Pixels {
    pub(crate) fn digest(self) -> Digest {
        Digest([if self == Self::Right { 1 } else { 2 }; 32])
    }
}

impl Disk {
    pub(crate) fn write(&mut self, image: ImageRef, rect: Rect, pixels: Pixels) {
        let empty = || vec![MISSING; (WIDTH * HEIGHT) as usize];
        let file = self.files.entry(image).or_insert_with(|| File {
            now: empty(),
            synced: empty(),
            unsynced: Vec::new(),
        });
        for y in rect.y0..rect.y1 {
            let row = &mut file.now[index(rect.x0, y)..];
            for (x, pixel) in (rect.x0..rect.x1).zip(row) {
                *pixel = match pixels {
                    Pixels::Right => right(image, x, y),
                    Pixels::Wrong => WRONG,
                };
            }
        }
        file.unsynced.push(rect);
    }

    pub(crate) fn sync(&mut self, image: ImageRef) {
        if let Some(file) = self.files.get_mut(&image) {
            for rect in std::mem::take(&mut file.unsynced) {
                file.keep_rows(rect, rect.y1);
            }
        }
    }

    pub(crate) fn remove(&mut self, image: ImageRef) {
        if let Some(file) = self.files.remove(&image) {
            self.removed.insert(image, file);
        }
    }

    /// The file's pixels as they are; those of a file that is not there are missing.
    pub(crate) fn read(&self, image: ImageRef) -> Vec<u8> {
        let file = self.files.get(&image);
        file.map_or_else(
            || vec![MISSING; (WIDTH * HEIGHT) as usize],
            |file| file.now.clone(),
        )
    }

    /// Whether a block is there, with these pixels.
    pub(crate) fn holds(&self, image: ImageRef, rect: Rect, digest: Digest) -> bool {
        let Some(file) = self.files.get(&image) else {
            return false;
        };
        let is_there = |x, y| {
            let pixel = file.now[index(x, y)];
            match digest == Pixels::Right.digest() {
                true => pixel == right(image, x, y),
                false => pixel == WRONG,
            }
        };
        (rect.y0..rect.y1).all(|y| (rect.x0..rect.x1).all(|x| is_there(x, y)))
    }

    /// The images that have scratch files.
    pub(crate) fn images(&self) -> Vec<ImageRef> {
        self.files.keys().copied().collect()
    }

    /// The power is gone: each write that was not synced is there, not there or there in part, in no
    /// order, and each removal may not have happened.
    pub(crate) fn crash(&mut self, random: &mut Random) {
        for (image, file) in std::mem::take(&mut self.removed) {
            if random.below(2) == 0 {
                self.files.entry(image).or_insert(file);
            }
        }
        for file in self.files.values_mut() {
            for rect in std::mem::take(&mut file.unsynced) {
                let rows = match random.below(3) {
                    0 => 0,
                    1 => rect.height(),
                    _ => {
                        u32::try_from(random.below(u64::from(rect.height()))).expect("it is small")
                    }
                };
                file.keep_rows(rect, rect.y0 + rows);
            }
            file.now.clone_from(&file.synced);
        }
    }
}

impl File {
    /// Makes the rows of a block above row `end` certain.
    fn keep_rows(&mut self, rect: Rect, end: u32) {
        for y in rect.y0..end {
            let row = index(rect.x0, y)..index(rect.x1 - 1, y) + 1;
            self.synced[row.clone()].copy_from_slice(&self.now[row]);
        }
    }
}

/// How many of a frame's pixels are missing, and how many are wrong.
pub(crate) fn flaws(image: ImageRef, frame: &[u8]) -> (usize, usize) {
    let (mut missing, mut wrong) = (0, 0);
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            match frame[index(x, y)] {
                MISSING => missing += 1,
                pixel if pixel != right(image, x, y) => wrong += 1,
                _ => {}
            }
        }
    }
    (missing, wrong)
}
