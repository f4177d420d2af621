//! What the scheduler is told.

use alloc::string::String;
use alloc::vec::Vec;

use model::{
    AttemptId, Begun, Digest, FrameRange, ImageRef, JobId, Rect, Revision, Running, Span,
    SubmissionId, WorkerId,
};

use crate::{Command, Needs, Offer};

/// Something that happened.
///
/// Those that [`Event::is_durable`] are what a journal holds: the shell commits them before it
/// performs their effects. The others are volatile. The durable ones alone, told again in
/// order to a scheduler of a later epoch, bring back every job, image and acknowledged
/// block (`tests/histories.rs`); what is lost is who renders what, and how fast.
///
/// A store need not keep what later events made superfluous: the number of a job that was forgotten, the blocks of
/// an image that is encoded. [`Event::JobsRecalled`] and [`Event::ImageRecalled`] stand for those, and
/// [`Event::BlocksRecalled`] for all that is left of an image's blocks (`tests/recall.rs`).
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
        /// A digest of its pixels: those of one block are equal to the bit, whoever renders it.
        pixels: Digest,
    },
    /// An image is encoded, synced and in its place.
    ImageEncoded {
        /// The image.
        image: ImageRef,
        /// Its film digest.
        film: Digest,
    },
    /// Jobs are numbered after this one from now on: told by a store, before each job that it
    /// kept and after the last.
    JobsRecalled {
        /// The largest number given so far.
        last: JobId,
    },
    /// An image was encoded in an earlier epoch: told by a store in place of its blocks.
    ImageRecalled {
        /// The image.
        image: ImageRef,
        /// Its film digest.
        film: Digest,
        /// How many blocks it was made of.
        blocks: u32,
        /// How long they took, each on one thread.
        render_time: Span,
    },
    /// Blocks of an image that is not over were durable in an earlier epoch: told by a store in place of what stored them.
    BlocksRecalled {
        /// The image.
        image: ImageRef,
        /// Each block, and how long one thread took to render it.
        blocks: Vec<(Rect, Span)>,
    },
    /// An image could not be stored or encoded, or [`crate::Effect::GiveUp`] was heard; the job goes on without it.
    ImageFailed {
        /// The image.
        image: ImageRef,
        /// Why, a sentence for the user.
        reason: String,
    },
    /// A user wants something of a job. Answered by [`crate::Effect::Commanded`] or
    /// [`crate::Effect::CommandRefused`].
    Command {
        /// The job.
        job: JobId,
        /// What is wanted.
        command: Command,
    },
    /// A worker said hello on a new link, for the first time or again.
    ///
    /// Answered by [`crate::Effect::Welcome`] or [`crate::Effect::WorkerRefused`].
    WorkerJoined {
        /// Which process it is.
        worker: WorkerId,
        /// The link it came on; replaces any older link of the same worker.
        link: LinkId,
        /// What it offers; replaces what it offered before.
        offer: Offer,
        /// The attempts that it still has from before a broken link.
        held: Vec<AttemptId>,
        /// Of those of earlier epochs, the tiles that it has begun: they are taken up where nobody else has them.
        begun: Vec<Begun>,
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
    /// A worker could not render a tile. The attempt ends, and the tile is tried elsewhere.
    TileFailed {
        /// The worker that says so; it must be the attempt's.
        worker: WorkerId,
        /// The attempt.
        attempt: AttemptId,
        /// Why, a sentence for the user.
        reason: String,
    },
    /// A worker will not render these tiles. It gets no others before its next [`Event::Credit`] or [`Event::Heartbeat`],
    /// but where it stands for a queue.
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

impl Event {
    /// Whether a journal must hold it before its effects are performed.
    pub fn is_durable(&self) -> bool {
        match self {
            Self::Submit(_)
            | Self::BlockStored { .. }
            | Self::ImageEncoded { .. }
            | Self::JobsRecalled { .. }
            | Self::ImageRecalled { .. }
            | Self::BlocksRecalled { .. }
            | Self::ImageFailed { .. }
            | Self::Command { .. } => true,
            Self::WorkerJoined { .. }
            | Self::Credit { .. }
            | Self::Heartbeat { .. }
            | Self::TileFailed { .. }
            | Self::GivenBack { .. }
            | Self::LinkClosed { .. }
            | Self::Goodbye { .. }
            | Self::Tick => false,
        }
    }
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
    /// Jobs of higher priority are served first; usually 0.
    pub priority: i32,
    /// Its part of the farm against the other jobs of its priority, at least 1: one of share 2 holds
    /// twice as many tiles at a time as one of share 1.
    pub share: u32,
    /// What it asks of its workers.
    pub needs: Needs,
    /// Jobs that must be finished before it begins.
    pub after: Vec<JobId>,
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
    /// Whole grid squares, as many as one thread is expected to render in some time, by what the
    /// squares of the image before took. Smaller ones towards the end of the job.
    Time {
        /// How long a tile should take; the scheduler's own where absent.
        aim: Option<Span>,
    },
}
