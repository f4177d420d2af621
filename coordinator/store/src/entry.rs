//! What a store is told.

use model::{Digest, ImageRef, JobId, Rect, Span};
use sched::{Command, Submission};

/// Something to keep, or to keep no longer.
///
/// Telling one again does no harm. One about a job that is not known is ignored, and so are a
/// block and a command for a job that was cancelled, but for its removal, and a block of an image that is over.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Entry {
    /// A job was taken. Of those that it waits for, the ones that are finished by now need not be kept.
    Submitted {
        /// Its number. One that is known already stays what it is.
        job: JobId,
        /// When, by the coordinator's calendar.
        unix_ms: u64,
        /// As it was taken.
        submission: Submission,
        /// What else its keeper needs to know of it.
        about: String,
    },
    /// A block is synced at its place in its image's scratch file.
    Block {
        /// Its image.
        image: ImageRef,
        /// Its pixels. One that is known already stays what it is.
        rect: Rect,
        /// How long one thread took to render it.
        elapsed: Span,
        /// The digest of its pixels.
        pixels: Digest,
        /// What else its keeper needs to know of it.
        about: Vec<u8>,
    },
    /// The pixels of these blocks are not where they should be: they are forgotten.
    BlocksLost {
        /// Their image.
        image: ImageRef,
        /// Which.
        rects: Vec<Rect>,
    },
    /// An image is synced and in its place. Its blocks are no longer needed. Where it was the last of its job, nobody waits
    /// for that any more, whatever is rendered again of it later.
    ///
    /// Whether an image is encoded or failed is said by whatever was told first, until a
    /// [`Command::Retry`] or [`Command::Again`] makes it nothing again.
    ImageEncoded {
        /// The image.
        image: ImageRef,
        /// When.
        unix_ms: u64,
        /// Its film digest.
        film: Digest,
        /// How many blocks it was made of.
        blocks: u32,
        /// How long one thread would have taken to render it.
        render_time: Span,
        /// What else its keeper needs to know of it.
        about: String,
    },
    /// An image is given up. Its blocks are no longer needed.
    ImageFailed {
        /// The image.
        image: ImageRef,
        /// When.
        unix_ms: u64,
        /// Why.
        reason: String,
    },
    /// A user wanted something of a job, and got it: a command that was refused is not told.
    ///
    /// As in the scheduler, [`Command::Cancel`] changes nothing where every image is over, so that
    /// those that failed can be retried afterwards.
    Command {
        /// The job.
        job: JobId,
        /// When.
        unix_ms: u64,
        /// What.
        command: Command,
    },
    /// A job is no longer in the queries: nothing of it is kept, but that its number is taken.
    Forgotten {
        /// The job.
        job: JobId,
    },
    /// A line of a job's log, of which the last [`crate::LOG_LINES_MAX`] are kept.
    Line {
        /// The job.
        job: JobId,
        /// When.
        unix_ms: u64,
        /// The line.
        text: String,
    },
}
