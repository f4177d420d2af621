//! The block record: finished pixels of one block, self-delimiting and checked.
//!
//! All numbers are little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 0..4 | `FLYB` |
//! | 4..8 | version of this layout, 1 |
//! | 8..12 | length of the payload in bytes |
//! | 12..20 | job |
//! | 20..24 | image number |
//! | 24..40 | rectangle: x0, y0, x1, y1 |
//! | 40..56 | attempt: epoch, number |
//! | 56.. | payload: for each channel of the film, each row, each column: `f32` |
//! | then 32 | BLAKE3 of everything before |

use model::film::{BLOCK_BYTES_MAX, PIXEL_BYTES};
use model::rect::SIDE_MAX;
use model::{AttemptId, Epoch, ImageNumber, ImageRef, JobId, Rect};

const MAGIC: [u8; 4] = *b"FLYB";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 56;
const CHECKSUM_BYTES: usize = 32;

/// Length of the largest record.
pub const RECORD_BYTES_MAX: usize = HEADER_BYTES + BLOCK_BYTES_MAX + CHECKSUM_BYTES;

/// Which pixels a record holds, and who made them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BlockHeader {
    /// The image.
    pub image: ImageRef,
    /// The block: inside one grid square.
    pub rect: Rect,
    /// The try at the tile that it belongs to.
    pub attempt: AttemptId,
}

/// A record that was read: its header and its pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BlockRecord<'a> {
    /// Which pixels.
    pub header: BlockHeader,
    /// Planar little-endian `f32`, [`PIXEL_BYTES`] for each pixel.
    pub payload: &'a [u8],
}

/// Why bytes are no block record.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum RecordError {
    /// The bytes end inside the record.
    #[error("the block record is cut off: {have} bytes of {need}")]
    Truncated {
        /// Bytes there are.
        have: usize,
        /// Bytes that the record needs.
        need: usize,
    },
    /// The bytes are something else.
    #[error("not a block record: it does not begin with FLYB")]
    Magic,
    /// The layout is another program's.
    #[error("block record of version {0}; this program reads version {VERSION}")]
    Version(u32),
    /// The rectangle is empty, leaves the limits or crosses the grid.
    #[error("a block record's rectangle must lie inside one grid square")]
    Rect,
    /// The payload's length does not fit the rectangle.
    #[error("the block has {have} bytes of pixels where its rectangle needs {need}")]
    Length {
        /// Bytes stated.
        have: usize,
        /// Bytes that the rectangle needs.
        need: usize,
    },
    /// The payload to be written does not fit the rectangle, or the bytes were changed on their way.
    #[error("the block's checksum does not fit its bytes: they were changed on their way")]
    Checksum,
}

impl BlockHeader {
    /// The record of these pixels; `payload` as [`BlockRecord::payload`].
    ///
    /// Fails with [`RecordError::Rect`] or [`RecordError::Length`] where the
    /// header is no block's or the payload another block's.
    pub fn record(&self, payload: &[u8]) -> Result<Vec<u8>, RecordError> {
        check(self.rect, payload.len())?;
        let mut bytes = Vec::with_capacity(HEADER_BYTES + payload.len() + CHECKSUM_BYTES);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        let length = u32::try_from(payload.len()).expect("a block is at most 32 KiB");
        bytes.extend(length.to_le_bytes());
        bytes.extend(self.image.job.0.to_le_bytes());
        bytes.extend(self.image.image.0.to_le_bytes());
        for edge in [self.rect.x0, self.rect.y0, self.rect.x1, self.rect.y1] {
            bytes.extend(edge.to_le_bytes());
        }
        bytes.extend(self.attempt.epoch.0.to_le_bytes());
        bytes.extend(self.attempt.number.to_le_bytes());
        bytes.extend(payload);
        let checksum = blake3::hash(&bytes);
        bytes.extend(checksum.as_bytes());
        Ok(bytes)
    }
}

impl<'a> BlockRecord<'a> {
    /// Reads one record from the front of `bytes`; answers it and what follows it.
    ///
    /// Every length is checked before it is used, and nothing is allocated.
    pub fn read(bytes: &'a [u8]) -> Result<(Self, &'a [u8]), RecordError> {
        let have = bytes.len();
        let truncated = |need| RecordError::Truncated { have, need };
        let Some((head, rest)) = bytes.split_first_chunk::<HEADER_BYTES>() else {
            return Err(truncated(HEADER_BYTES + CHECKSUM_BYTES));
        };
        if head[..4] != MAGIC {
            return Err(RecordError::Magic);
        }
        if word(head, 4) != VERSION {
            return Err(RecordError::Version(word(head, 4)));
        }
        let header = BlockHeader {
            image: ImageRef {
                job: JobId(long(head, 12)),
                image: ImageNumber(word(head, 20)),
            },
            rect: Rect {
                x0: word(head, 24),
                y0: word(head, 28),
                x1: word(head, 32),
                y1: word(head, 36),
            },
            attempt: AttemptId {
                epoch: Epoch(long(head, 40)),
                number: long(head, 48),
            },
        };
        let length = word(head, 8) as usize;
        check(header.rect, length)?;
        let need = HEADER_BYTES + length + CHECKSUM_BYTES;
        let Some((payload, rest)) = rest.split_at_checked(length) else {
            return Err(truncated(need));
        };
        let Some((checksum, rest)) = rest.split_first_chunk::<CHECKSUM_BYTES>() else {
            return Err(truncated(need));
        };
        if blake3::hash(&bytes[..HEADER_BYTES + length]) != *checksum {
            return Err(RecordError::Checksum);
        }
        Ok((Self { header, payload }, rest))
    }

    /// Reads bytes that are one record and nothing else.
    pub fn only(bytes: &'a [u8]) -> Result<Self, RecordError> {
        let (record, rest) = Self::read(bytes)?;
        if rest.is_empty() {
            Ok(record)
        } else {
            Err(RecordError::Length {
                have: record.payload.len() + rest.len(),
                need: record.payload.len(),
            })
        }
    }
}

/// Whether a rectangle is a block's, and a payload of this length its pixels.
fn check(rect: Rect, length: usize) -> Result<(), RecordError> {
    if !rect.is_block() || rect.x1 > SIDE_MAX || rect.y1 > SIDE_MAX {
        return Err(RecordError::Rect);
    }
    let pixels = usize::try_from(rect.area()).expect("a block has at most 1,024 pixels");
    let need = pixels * PIXEL_BYTES;
    if length == need {
        Ok(())
    } else {
        Err(RecordError::Length { have: length, need })
    }
}

fn word(head: &[u8; HEADER_BYTES], at: usize) -> u32 {
    let mut bytes = [0; 4];
    bytes.copy_from_slice(&head[at..at + 4]);
    u32::from_le_bytes(bytes)
}

fn long(head: &[u8; HEADER_BYTES], at: usize) -> u64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&head[at..at + 8]);
    u64::from_le_bytes(bytes)
}

/// Pixels as a record's payload; `payload` is emptied first.
pub fn payload_of(pixels: &[f32], payload: &mut Vec<u8>) {
    payload.clear();
    payload.reserve(pixels.len() * 4);
    for value in pixels {
        payload.extend_from_slice(&value.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn header(rect: Rect) -> BlockHeader {
        BlockHeader {
            image: ImageRef {
                job: JobId(7),
                image: ImageNumber(499),
            },
            rect,
            attempt: AttemptId {
                epoch: Epoch(3),
                number: u64::MAX,
            },
        }
    }

    fn sample() -> Vec<u8> {
        let rect = Rect {
            x0: 33,
            y0: 31,
            x1: 36,
            y1: 32,
        };
        let mut payload = Vec::new();
        let pixels: Vec<f32> = (0..24_u8).map(|value| f32::from(value) * 0.5).collect();
        payload_of(&pixels, &mut payload);
        header(rect).record(&payload).unwrap()
    }

    #[test]
    fn what_is_written_is_read() {
        let mut bytes = sample();
        let length = bytes.len();
        bytes.extend(*b"next");
        let (record, rest) = BlockRecord::read(&bytes).unwrap();
        assert_eq!(rest, b"next");
        assert_eq!(record.header.image.job, JobId(7));
        assert_eq!(record.header.attempt.number, u64::MAX);
        assert_eq!(record.payload[4..8], 0.5_f32.to_le_bytes());
        assert_eq!(
            record.header.record(record.payload).unwrap(),
            bytes[..length]
        );
        assert!(matches!(
            BlockRecord::only(&bytes),
            Err(RecordError::Length { .. })
        ));
    }

    #[test]
    fn the_layout_is_fixed() {
        let bytes = sample();
        assert_eq!(bytes.len(), 56 + 3 * 32 + 32);
        assert_eq!(bytes[..12], *b"FLYB\x01\0\0\0\x60\0\0\0");
        assert_eq!(
            blake3::hash(&bytes).to_hex().as_str(),
            "9a949343be858ba662efd1d8481ae5e467aa4e7c92bc73e38861cc31e947b732"
        );
    }

    #[test]
    fn every_cut_and_every_flipped_bit_is_seen() {
        let bytes = sample();
        for length in 0..bytes.len() {
            assert!(
                matches!(
                    BlockRecord::read(&bytes[..length]),
                    Err(RecordError::Truncated { .. })
                ),
                "cut to {length} bytes"
            );
        }
        for bit in 0..bytes.len() * 8 {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(BlockRecord::read(&changed).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn headers_that_are_no_blocks() {
        let rect = |x0, x1| Rect {
            x0,
            y0: 0,
            x1,
            y1: 1,
        };
        let payload = vec![0; PIXEL_BYTES * 2];
        for (rect, error) in [
            (rect(31, 33), RecordError::Rect),
            (rect(3, 3), RecordError::Rect),
            (rect(5, 3), RecordError::Rect),
            (rect(SIDE_MAX, SIDE_MAX + 2), RecordError::Rect),
            (rect(u32::MAX - 1, u32::MAX), RecordError::Rect),
            (rect(0, 1), RecordError::Length { have: 64, need: 32 }),
        ] {
            assert_eq!(header(rect).record(&payload), Err(error));
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = BlockRecord::read(&bytes);
            let mut named = b"FLYB\x01\0\0\0".to_vec();
            named.extend(bytes);
            let _ = BlockRecord::read(&named);
        }
    }
}
