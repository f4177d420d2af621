//! What can be asked: snapshots, cheap and without effect.

use alloc::collections::BTreeSet;
use alloc::string::String;

use model::{
    Digest, FrameRange, ImageNumber, JobId, Rect, Revision, Span, SubmissionId, Timestamp, WorkerId,
};

use crate::{JobOutcome, Needs};

/// A job, as it stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct JobView<'a> {
    /// Its number.
    pub job: JobId,
    /// The submission it came from.
    pub submission: SubmissionId,
    /// What its user calls it.
    pub name: &'a str,
    /// Digest of its scene description.
    pub scene: Digest,
    /// The renderer revision it is pinned to.
    pub revision: Revision,
    /// Its images.
    pub frames: FrameRange,
    /// The pixels of each image that are rendered.
    pub window: Rect,
    /// Columns and rows of its tiles, of which the last column and row may be smaller, and how many
    /// each image has; absent where tiles are cut by time.
    pub tiles: Option<((u32, u32), u32)>,
    /// Its priority.
    pub priority: i32,
    /// Its share of the farm among the jobs of its priority.
    pub share: u32,
    /// What it asks of workers.
    pub needs: &'a Needs,
    /// Whether it is paused.
    pub paused: Paused,
    /// Its region of interest.
    pub focus: Option<Rect>,
    /// Jobs that must be finished before it begins, and are not.
    pub after: &'a BTreeSet<JobId>,
    /// Whether it is over, and how it ended.
    pub state: JobState,
    /// How many images are in which state.
    pub images: ImageCounts,
    /// Pixels that are durable, or in frames that are in their place.
    pub pixels_done: u64,
    /// Pixels of all its images.
    pub pixels: u64,
    /// Blocks that were made durable.
    pub blocks_done: u64,
    /// Blocks that arrived although another attempt's had made all their pixels durable.
    pub blocks_again: u64,
    /// Pixels that arrived although another attempt's were durable.
    pub pixels_again: u64,
    /// Blocks that arrived a second time because their tile was leased twice on purpose, near the end.
    pub blocks_twice: u64,
    /// Blocks of which two renderings differed.
    pub incidents: u64,
    /// Of those, the ones of which nobody knows who is right: no third worker has decided.
    pub undecided: u64,
    /// Tiles that were to be rendered once more, and were not, since nobody could.
    pub unverified: u64,
    /// Tiles that were leased a second time on purpose.
    pub seconds: u64,
    /// Leases that were called back before they were started.
    pub called_back: u64,
    /// Time that threads took over the blocks that are durable, all together.
    pub render_time: Span,
    /// Tiles leased at this moment, second attempts included.
    pub attempts_live: u32,
    /// Attempts that failed at their worker or made no progress.
    pub attempts_failed: u64,
    /// Attempts whose worker was lost.
    pub attempts_lost: u64,
    /// When it was submitted.
    pub submitted: Timestamp,
    /// When its first tile was leased.
    pub started: Option<Timestamp>,
    /// When it was over.
    pub ended: Option<Timestamp>,
}

/// How long a job will still take.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Estimate {
    /// As expected.
    pub left: Span,
    /// It may be over as early as this…
    pub early: Span,
    /// …or as late as this; in about one of seven jobs it is outside of both.
    pub late: Span,
}

/// Whether a job is over.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum JobState {
    /// Images are left to do.
    Running,
    /// It is over.
    Over(JobOutcome),
}

/// Whether a job is paused.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Paused {
    /// It goes on.
    No,
    /// Nothing of it is leased.
    Yes,
}

/// How many of a job's images are in which state.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ImageCounts {
    /// No tile has been leased yet.
    pub waiting: u32,
    /// Being rendered.
    pub rendering: u32,
    /// All pixels durable, being encoded.
    pub encoding: u32,
    /// In their place.
    pub encoded: u32,
    /// Given up.
    pub failed: u32,
    /// Not wanted any more: their job was cancelled before they were in their place.
    pub dropped: u32,
}

/// How far an image is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ImageState {
    /// No tile has been leased yet.
    Waiting,
    /// Tiles are being rendered.
    Rendering,
    /// All pixels are durable, and it is being encoded.
    Encoding,
    /// In its place.
    Encoded {
        /// Its film digest.
        film: Digest,
    },
    /// Given up; [`crate::Sched::failures`] says why.
    Failed,
    /// Not wanted any more: its job was cancelled before it was in its place.
    Dropped,
}

/// An image, as it stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ImageView {
    /// Which image.
    pub image: ImageNumber,
    /// How far it is.
    pub state: ImageState,
    /// Pixels that are durable.
    pub pixels_done: u64,
    /// Pixels it has.
    pub pixels: u64,
}

/// An image that failed.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ImageFailure {
    /// Which image.
    pub image: ImageNumber,
    /// Why.
    pub reason: String,
}

/// A worker, as it stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct WorkerView {
    /// Which process.
    pub worker: WorkerId,
    /// Its renderer's revision.
    pub revision: Revision,
    /// Its render threads.
    pub threads: u32,
    /// Whether it can be reached.
    pub link: Link,
    /// How many tiles it wants to hold.
    pub credit: u32,
    /// How many it holds.
    pub attempts: u32,
    /// How many of those it is known to be rendering.
    pub running: u32,
    /// How fast one of its threads is, of which 1,024 is the usual.
    pub speed: u32,
    /// Until when it is set aside for the whole farm, if it is.
    pub aside: Option<Timestamp>,
    /// Whether that is since its pixels were wrong.
    pub trust: Trust,
    /// When it was last heard of.
    pub heard: Timestamp,
    /// When it joined first.
    pub joined: Timestamp,
    /// Blocks of its that were made durable.
    pub blocks: u64,
    /// Pixels in them.
    pub pixels: u64,
    /// Time its threads took over them.
    pub render_time: Span,
}

/// What is known of a worker's pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Trust {
    /// Nothing is known against them.
    Usual,
    /// Two others agreed on others.
    Expelled,
}

/// Whether a worker can be reached.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Link {
    /// Its link is open.
    Open,
    /// Its link broke; it may come back until its liveness limit.
    Closed,
}
