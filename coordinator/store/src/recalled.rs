//! What a store kept.

use model::{Digest, ImageNumber, JobId, Rect, Span};
use sched::Submission;

/// Everything that is kept.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Recalled {
    /// The largest number that a job was ever given, those that are forgotten included; 0 where there was none.
    pub last_job: JobId,
    /// The jobs that are there, by number.
    pub jobs: Vec<RecalledJob>,
}

/// A job, as it stands.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RecalledJob {
    /// Its number.
    pub job: JobId,
    /// When it was submitted.
    pub unix_ms: u64,
    /// As it was submitted.
    pub submission: Submission,
    /// What its keeper said of it.
    pub about: String,
    /// Its priority of now.
    pub priority: i32,
    /// Its share of now.
    pub share: u32,
    /// Whether it is paused.
    pub paused: bool,
    /// Its region of interest.
    pub focus: Option<Rect>,
    /// When it was cancelled, if it was.
    pub cancelled_unix_ms: Option<u64>,
    /// Its images that are over, by number.
    pub images: Vec<RecalledImage>,
    /// The durable blocks of the others, by image, then row by row from the top left.
    pub blocks: Vec<RecalledBlock>,
    /// The last lines of its log, with when they were written; the oldest first.
    pub log: Vec<(u64, String)>,
    /// How many lines came before those.
    pub log_dropped: u64,
}

/// An image that is over.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum RecalledImage {
    /// It is in its place.
    Encoded {
        /// Which image.
        image: ImageNumber,
        /// When it was encoded.
        unix_ms: u64,
        /// Its film digest.
        film: Digest,
        /// How many blocks it was made of.
        blocks: u32,
        /// How long one thread would have taken to render it.
        render_time: Span,
        /// What its keeper said of it.
        about: String,
    },
    /// It was given up.
    Failed {
        /// Which image.
        image: ImageNumber,
        /// When it was given up.
        unix_ms: u64,
        /// Why.
        reason: String,
    },
}

/// A block whose pixels were synced at their place.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RecalledBlock {
    /// Its image.
    pub image: ImageNumber,
    /// Its pixels.
    pub rect: Rect,
    /// How long one thread took to render it.
    pub elapsed: Span,
    /// The digest of its pixels.
    pub pixels: Digest,
    /// What its keeper said of it.
    pub about: Vec<u8>,
}

impl RecalledImage {
    /// Which image it is.
    pub fn image(&self) -> ImageNumber {
        match *self {
            Self::Encoded { image, .. } | Self::Failed { image, .. } => image,
        }
    }
}
