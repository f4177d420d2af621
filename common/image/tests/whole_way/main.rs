//! From blocks to frames and back, through the public interface alone.

#![expect(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod film;

mod damaged;
mod frames;
mod full_disk;
mod resume;
mod scratch;
