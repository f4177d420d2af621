//! Reading a finished scratch file in strips of rows.

use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::sync::Mutex;

use model::Rect;
use model::film::CHANNEL_COUNT;
use model::rect::GRID_SQUARE;

use super::grid::SLOT_BYTES;
use super::{Scratch, lock};
use crate::error::ImageError;
use crate::share::in_sequence;

/// Rows of a strip; the last one of a window may have fewer.
pub(crate) const STRIP_ROWS: u32 = GRID_SQUARE;

/// Most bytes of strips that are read ahead at a time, or one strip's: what an image's encoding holds in memory is about
/// twice that for each format.
const AHEAD_BYTES: usize = 64 << 20;

/// Some rows of a window, every channel; −0 has become +0.
#[derive(Debug)]
pub(crate) struct Strip {
    /// The pixels, in the whole image.
    rect: Rect,
    /// `[channel][row][column]`.
    samples: Vec<f32>,
}

impl Strip {
    /// Its rows, in the whole image.
    pub(crate) fn rows(&self) -> Range<u32> {
        self.rect.y0..self.rect.y1
    }

    /// One row of one channel, from the window's left to its right.
    pub(crate) fn row(&self, channel: usize, y: u32) -> &[f32] {
        &self.samples[self.place(channel, y)]
    }

    fn place(&self, channel: usize, y: u32) -> Range<usize> {
        let (width, height) = (self.rect.width() as usize, self.rect.height() as usize);
        let from = (channel * height + (y - self.rect.y0) as usize) * width;
        from..from + width
    }
}

/// Memory in which strips are read. It goes from strip to strip: what is given back after each, the system takes and clears again
/// every time.
#[derive(Debug)]
pub(crate) struct StripMemory {
    slot: Vec<u8>,
    strip: Strip,
}

impl Default for StripMemory {
    fn default() -> Self {
        let [x0, y0, x1, y1] = [0; 4];
        Self {
            slot: vec![0; SLOT_BYTES],
            strip: Strip {
                rect: Rect { x0, y0, x1, y1 },
                samples: Vec::new(),
            },
        }
    }
}

impl Scratch {
    /// Hands what `of` makes of each strip of the window from `row` on to `each`, from the top on this thread, while `threads` − 1
    /// others go on with the next strips. What is made takes the place of what was made of an earlier strip.
    ///
    /// Fails if pixels are missing, if the system refuses, or with the first failure of `of` or `each`.
    pub(crate) fn for_each_strip<R: Default + Send>(
        &self,
        row: u32,
        threads: usize,
        of: impl Fn(&Strip, &mut R) -> Result<(), ImageError> + Sync,
        mut each: impl FnMut(&mut R) -> Result<(), ImageError>,
    ) -> Result<(), ImageError> {
        self.require_complete()?;
        let window = self.window();
        let strips = (row..window.y1).step_by(STRIP_ROWS as usize);
        let strips = strips.map(|row| strip_from(row, window));
        let bytes = CHANNEL_COUNT * 4 * window.width() as usize * STRIP_ROWS as usize;
        let ahead = (AHEAD_BYTES / bytes).clamp(1, 2 * threads.max(1));
        let threads = threads.min(ahead);
        let spare: Mutex<Vec<(StripMemory, R)>> = Mutex::default();
        let make = |rect| {
            let (mut memory, mut made) = lock(&spare).pop().unwrap_or_default();
            of(self.read(rect, &mut memory)?, &mut made)?;
            Ok((memory, made))
        };
        in_sequence(strips, threads, ahead, make, |made| {
            let (memory, mut made) = made?;
            each(&mut made)?;
            lock(&spare).push((memory, made));
            Ok(())
        })
    }

    /// The strip of the window that begins with `row`, if there is one and all of it is done.
    pub(crate) fn done_from(&self, row: u32) -> Option<Rect> {
        let rect = strip_from(row, self.window());
        let state = self.state();
        let is_done = rect.blocks().all(|block| state.coverage.contains(block));
        (!rect.is_empty() && is_done).then_some(rect)
    }

    /// Reads some rows of the window.
    pub(crate) fn read<'m>(
        &self,
        rect: Rect,
        memory: &'m mut StripMemory,
    ) -> Result<&'m Strip, ImageError> {
        let StripMemory { slot, strip } = memory;
        strip.rect = rect;
        let pixels = rect.width() as usize * rect.height() as usize;
        strip.samples.resize(CHANNEL_COUNT * pixels, 0.0);
        for block in rect.blocks() {
            self.fill(strip, block, slot)?;
        }
        Ok(strip)
    }

    /// Copies one block into its place in the strip.
    fn fill(&self, strip: &mut Strip, block: Rect, slot: &mut [u8]) -> Result<(), ImageError> {
        let square = self.grid.square_of(block);
        self.file
            .read_exact_at(slot, self.grid.slot_offset(square))
            .map_err(|source| ImageError::io("read a block of", &self.path, source))?;
        let side = GRID_SQUARE as usize;
        let in_strip = (block.x0 - strip.rect.x0) as usize;
        let in_slot = (block.x0 % GRID_SQUARE) as usize;
        let width = block.width() as usize;
        for channel in 0..CHANNEL_COUNT {
            for y in block.y0..block.y1 {
                let from = ((channel * side + (y % GRID_SQUARE) as usize) * side + in_slot) * 4;
                let row = strip.place(channel, y);
                let to = &mut strip.samples[row][in_strip..in_strip + width];
                let (words, _) = slot[from..].as_chunks();
                for (sample, bytes) in to.iter_mut().zip(words) {
                    // Of −0 this makes +0, and leaves every other number as it is.
                    *sample = f32::from_le_bytes(*bytes) + 0.0;
                }
            }
        }
        Ok(())
    }
}

/// The rows of a strip that begins with `row`.
fn strip_from(row: u32, window: Rect) -> Rect {
    Rect {
        y0: row,
        y1: window.y1.min(row.saturating_add(STRIP_ROWS)),
        ..window
    }
}

/// Appends samples, little-endian.
pub(crate) fn append_le_bytes(samples: &[f32], out: &mut Vec<u8>) {
    let from = out.len();
    out.resize(from + samples.len() * 4, 0);
    let (words, _) = out[from..].as_chunks_mut();
    for (bytes, sample) in words.iter_mut().zip(samples) {
        *bytes = sample.to_le_bytes();
    }
}
