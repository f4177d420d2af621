//! What the shell must now do.

use alloc::string::String;
use alloc::vec::Vec;

use model::{AttemptId, ImageRef, JobId, Lease, Rect, SubmissionId, WorkerId};

use crate::{BlockRef, BlockRefusal, CommandRefusal, SubmitRefusal, WorkerRefusal};

/// Something to do. Effects are performed in order; each may be repeated without harm.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Effect {
    /// The submission is this job, taken now or before.
    Submitted {
        /// Which submission.
        submission: SubmissionId,
        /// The job's number.
        job: JobId,
    },
    /// The submission is refused and changed nothing.
    SubmitRefused {
        /// Which submission.
        submission: SubmissionId,
        /// Why.
        refusal: SubmitRefusal,
    },
    /// What a user wanted of a job is done.
    Commanded {
        /// The job.
        job: JobId,
    },
    /// What a user wanted of a job cannot be done, and changed nothing.
    CommandRefused {
        /// The job.
        job: JobId,
        /// Why.
        refusal: CommandRefusal,
    },
    /// Tell a worker that it is taken.
    Welcome {
        /// The worker.
        worker: WorkerId,
        /// Of the attempts that it said it holds, those that are live: it drops the others.
        live: Vec<AttemptId>,
    },
    /// A worker goes on with a tile that it had begun in an earlier epoch.
    Adopted {
        /// The worker.
        worker: WorkerId,
        /// The attempt, which keeps its name.
        attempt: AttemptId,
        /// Its image.
        image: ImageRef,
    },
    /// Tell a worker that it is not taken, and close the link.
    WorkerRefused {
        /// The worker.
        worker: WorkerId,
        /// Why.
        refusal: WorkerRefusal,
    },
    /// Send a tile to a worker.
    Lease {
        /// The worker.
        worker: WorkerId,
        /// The tile.
        lease: Lease,
    },
    /// Tell a worker, where it can be reached, to stop rendering a tile and to
    /// forget blocks of it that were not acknowledged.
    Revoke {
        /// The worker.
        worker: WorkerId,
        /// The attempt, which is dead already.
        attempt: AttemptId,
        /// Why.
        reason: RevokeReason,
    },
    /// Tell a worker, where it can be reached, that a block is durable.
    Ack {
        /// The worker.
        worker: WorkerId,
        /// The attempt it was sent under.
        attempt: AttemptId,
        /// The block.
        rect: Rect,
    },
    /// Tell a worker, where it can be reached, that a block counts for nothing.
    RefuseBlock {
        /// The worker.
        worker: WorkerId,
        /// The block.
        block: BlockRef,
        /// Why.
        refusal: BlockRefusal,
    },
    /// Every pixel of an image is durable: encode it, then say [`crate::Event::ImageEncoded`]
    /// or [`crate::Event::ImageFailed`].
    Encode {
        /// The image.
        image: ImageRef,
    },
    /// Some tiles of an image were to be rendered once more and compared, and were not: nobody else could. It is
    /// encoded as it is.
    Unverified {
        /// The image.
        image: ImageRef,
        /// How many tiles, or parts of some.
        tiles: u32,
    },
    /// An image cannot be rendered: commit and feed [`crate::Event::ImageFailed`]. No more of it is leased.
    GiveUp {
        /// The image.
        image: ImageRef,
        /// Why, a sentence for the user.
        reason: String,
    },
    /// Two renderings of one block differ. A renderer, a machine or a memory is at fault: an operator must look.
    Incident {
        /// The block whose pixels differ from those that were stored before.
        block: BlockRef,
        /// The worker that rendered it.
        worker: WorkerId,
        /// The worker of the other attempt, where that is still live.
        other: Option<WorkerId>,
    },
    /// A worker made wrong pixels, and some of this image is of its making: commit and feed [`crate::Command::Again`].
    /// A few are asked for at a time, the next ones when those are fed.
    RenderAgain {
        /// The image.
        image: ImageRef,
        /// The worker.
        worker: WorkerId,
    },
    /// Remove an image's scratch file and stop encoding it: nobody wants what is there.
    ///
    /// The image may be begun anew later. Of what was accepted for it before this, nothing is
    /// reported as stored or encoded any more.
    DropScratch {
        /// The image.
        image: ImageRef,
    },
    /// A job was cancelled: remove everything of it but its finished frames.
    DropJob {
        /// The job.
        job: JobId,
    },
    /// A job is over. Unless it was cancelled its scene description may be needed again: until
    /// [`Effect::ForgetJob`] its images can be retried.
    JobDone {
        /// The job.
        job: JobId,
        /// How it ended.
        outcome: JobOutcome,
    },
    /// A job that is over is no longer in the queries: free whatever is kept of it but its finished frames.
    ForgetJob {
        /// The job.
        job: JobId,
    },
    /// Something that a query of this job answers has changed. At most one per
    /// job and event; cheap enough to be passed on each time.
    JobChanged {
        /// The job.
        job: JobId,
    },
    /// A worker left or is lost: close its links and free what is kept of it.
    Forget {
        /// The worker.
        worker: WorkerId,
    },
}

/// How a job ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum JobOutcome {
    /// Every image is encoded.
    Finished,
    /// At least one image failed; the others are encoded.
    Failed,
    /// Its user cancelled it.
    Cancelled,
}

/// Why an attempt ended that its worker did not end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RevokeReason {
    /// Every pixel of the tile is durable.
    TileDone,
    /// The job was cancelled.
    Cancelled,
    /// The job pauses, and the tile was not started.
    Paused,
    /// The tile was not started, and goes to a worker that has nothing to do.
    CalledBack,
    /// Its pixels differ from those of another attempt.
    Differs,
    /// The image is rendered again from its first pixel.
    RenderedAgain,
    /// The image failed.
    ImageFailed,
    /// No block for longer than the progress limit.
    NoProgress,
    /// The attempt was dead before: its worker was away for too long, or it is of another epoch.
    NotLive,
}
