//! Reading a finished scratch file in strips of rows.

use std::ops::Range;
use std::os::unix::fs::FileExt;

use model::Rect;
use model::film::CHANNEL_COUNT;
use model::rect::GRID_SQUARE;

use super::Scratch;
use super::grid::SLOT_BYTES;
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

impl Scratch {
    /// Hands what `of` makes of each strip of the window to `each`, from the top on this thread, while `threads` − 1 others
    /// go on with the next strips.
    ///
    /// Fails if pixels are missing, if the system refuses, or with the first failure of `of` or `each`.
    pub(crate) fn for_each_strip<R: Send>(
        &self,
        threads: usize,
        of: impl Fn(&Strip) -> Result<R, ImageError> + Sync,
        mut each: impl FnMut(R) -> Result<(), ImageError>,
    ) -> Result<(), ImageError> {
        self.require_complete()?;
        let window = self.window();
        let strips = (window.y0..window.y1)
            .step_by(STRIP_ROWS as usize)
            .map(|y0| Rect {
                y0,
                y1: window.y1.min(y0 + STRIP_ROWS),
                ..window
            });
        let bytes = CHANNEL_COUNT * 4 * window.width() as usize * STRIP_ROWS as usize;
        let ahead = (AHEAD_BYTES / bytes).clamp(1, 2 * threads.max(1));
        let threads = threads.min(ahead);
        let read = |rect| self.strip(rect).and_then(|strip| of(&strip));
        in_sequence(strips, threads, ahead, read, |made| each(made?))
    }

    /// Reads some rows of the window.
    fn strip(&self, rect: Rect) -> Result<Strip, ImageError> {
        let pixels = rect.width() as usize * rect.height() as usize;
        let mut strip = Strip {
            rect,
            samples: vec![0.0; CHANNEL_COUNT * pixels],
        };
        let mut slot = vec![0; SLOT_BYTES];
        for block in rect.blocks() {
            self.fill(&mut strip, block, &mut slot)?;
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

/// Appends samples, little-endian.
pub(crate) fn append_le_bytes(samples: &[f32], out: &mut Vec<u8>) {
    let from = out.len();
    out.resize(from + samples.len() * 4, 0);
    let (words, _) = out[from..].as_chunks_mut();
    for (bytes, sample) in words.iter_mut().zip(samples) {
        *bytes = sample.to_le_bytes();
    }
}
