//! What the scheduler is told.

use alloc::string::String;
use alloc::vec::Vec;

use model::{
    AttemptId, Digest, FrameRange, ImageRef, JobId, Rect, Revision, Running, Span, SubmissionId,
    WorkerId,
};

/// Something that happened.
///
/// Durable events (those above [`Event::WorkerJoined`]) are what a journal
/// holds: the shell commits them before it performs their effects. The others
/// are volatile: losing them loses no acknowledged block.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Event {
    /// A user submitted a job. Answered by [`crate::Effect::Submitted`] or
    /// [`crate::Effect::SubmitRefused`].
    Submit(Submission),
    /// A block is written at its place and durable, or was so already.
    ///
    /// The shell asks [`crate::Sched::accepts`] first, and writes where it says
    /// [`crate::Verdict::Accept`], nothing where it says [`crate::Verdict::AlreadyDone`].
    /// What is durable counts, even if the attempt ended while it was written;
    /// the fence against dead attempts is the question before. Answered by [`crate::Effect::Ack`],
    /// or [`crate::Effect::RefuseBlock`] where its image is no longer wanted.
    BlockStored {
        /// The worker it came from.
        worker: WorkerId,
        /// Which block.
        block: BlockRef,
        /// How long one thread took to render it.
        elapsed: Span,
    },
    /// A worker could not render a tile. The attempt ends.
    TileFailed {
        /// The worker that says so; it must be the attempt's.
        worker: WorkerId,
        /// The attempt.
        attempt: AttemptId,
        /// Why, a sentence for the user.
        reason: String,
    },
    /// An image is encoded, synced and in its place.
    ImageEncoded {
        /// The image.
        image: ImageRef,
        /// Its film digest.
        film: Digest,
    },
    /// An image could not be stored or encoded; the job goes on without it.
    ImageFailed {
        /// The image.
        image: ImageRef,
        /// Why, a sentence for the user.
        reason: String,
    },
    /// A user ends a job. Nothing happens where it is over already.
    Cancel {
        /// The job.
        job: JobId,
    },
    /// A worker said hello on a new link, for the first time or again.
    ///
    /// Answered by [`crate::Effect::Welcome`] or [`crate::Effect::WorkerRefused`].
    WorkerJoined {
        /// Which process it is.
        worker: WorkerId,
        /// The link it came on; replaces any older link of the same worker.
        link: LinkId,
        /// Its renderer's revision.
        revision: Revision,
        /// Its render threads, at least 1.
        threads: u32,
        /// The attempts that it still has from before a broken link.
        held: Vec<AttemptId>,
    },
    /// How many tiles a worker wants to hold in all, running and ahead (thesis C.3.5).
    Credit {
        /// The worker.
        worker: WorkerId,
        /// The number; at most [`crate::Limits::credit_max`] counts.
        credit: u32,
    },
    /// A worker is alive, and at work on these.
    Heartbeat {
        /// The worker.
        worker: WorkerId,
        /// What it has started, and how far it is: those that it renders, and those
        /// of which blocks are still to be delivered. An attempt held ahead is not named.
        running: Vec<Running>,
    },
    /// A worker will not render these tiles.
    GivenBack {
        /// The worker.
        worker: WorkerId,
        /// The attempts; they end, without blame.
        attempts: Vec<AttemptId>,
    },
    /// A link broke or ended without a goodbye. Ignored where the worker has a newer one.
    LinkClosed {
        /// The worker.
        worker: WorkerId,
        /// The link that is gone.
        link: LinkId,
    },
    /// A worker leaves for good. What it still held ends, without blame.
    Goodbye {
        /// The worker.
        worker: WorkerId,
    },
    /// Time has passed; worth sending at [`crate::Sched::next_deadline`].
    ///
    /// Only this ends anything by a limit. A shell that was held up feeds what had
    /// already arrived before it, so that nobody is blamed for the coordinator's own pause.
    Tick,
}

/// One link of a worker, numbered by the shell; a newer link has a larger number.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct LinkId(pub u64);

/// One block as a worker sends it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BlockRef {
    /// The attempt it was rendered in.
    pub attempt: AttemptId,
    /// Its image.
    pub image: ImageRef,
    /// Its pixels.
    pub rect: Rect,
}

/// A job as a user asks for it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Submission {
    /// Drawn by the client; submitting twice under one is submitting once.
    pub submission: SubmissionId,
    /// What the user calls it.
    pub name: String,
    /// Digest of the scene description. The shell keeps the bytes.
    pub scene: Digest,
    /// The renderer revision that the job is pinned to.
    pub revision: Revision,
    /// Which images.
    pub frames: FrameRange,
    /// The pixels of each image that are rendered: the crop, or all.
    pub window: Rect,
    /// How images are cut.
    pub tiles: TileShape,
}

/// How an image's window is cut into tiles.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TileShape {
    /// By the rule of thesis C.3.2.
    Rule {
        /// Fewest pixels of a tile, the thesis's Min_tsize; the scheduler's own where absent.
        min_tile_pixels: Option<u64>,
    },
    /// Tiles of this size; a last column and row of smaller ones where it does not divide the window.
    Size {
        /// Columns, at least 1.
        width: u32,
        /// Rows, at least 1.
        height: u32,
    },
}
