//! What a session is told.

use alloc::string::String;
use alloc::vec::Vec;

use model::{AttemptId, Epoch, Lease, Rect, Span};

/// Something that happened.
///
/// Link events are those of the newest link: after [`Event::LinkLost`] or
/// [`crate::Effect::CloseLink`] the shell feeds nothing more that came on the old one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Event {
    /// The program is up; sent once, first.
    Started,
    /// A dial reached the coordinator. Answered by [`crate::Effect::SendHello`].
    Dialled,
    /// The coordinator took the hello.
    Connected(Welcome),
    /// The link broke, or the dial failed.
    LinkLost {
        /// Why, a sentence; kept for the day the session gives up.
        reason: String,
    },
    /// The coordinator, or its door, refused the worker.
    Refused {
        /// Why, the coordinator's sentence.
        reason: String,
        /// Whether to try again.
        retry: Retry,
    },
    /// A tile was leased.
    Leased(Lease),
    /// An attempt is dead.
    Revoked {
        /// The attempt.
        attempt: AttemptId,
    },
    /// A thread rendered a block; the shell keeps its bytes until [`crate::Effect::DropBlock`].
    BlockRendered {
        /// The attempt it was rendered for.
        attempt: AttemptId,
        /// Its pixels.
        rect: Rect,
    },
    /// A thread rendered the last block of a tile.
    TileRendered {
        /// The attempt.
        attempt: AttemptId,
    },
    /// A thread could not render a tile.
    RenderFailed {
        /// The attempt.
        attempt: AttemptId,
        /// Why, a sentence for the user.
        reason: String,
    },
    /// The coordinator has a block, durably.
    Acked {
        /// The attempt.
        attempt: AttemptId,
        /// The block.
        rect: Rect,
    },
    /// The coordinator did not take a block.
    BlockRefused {
        /// The attempt.
        attempt: AttemptId,
        /// The block.
        rect: Rect,
        /// What that means.
        verdict: BlockVerdict,
    },
    /// The coordinator or the operator lets the worker go: finish what runs, take nothing new.
    DrainAsked,
    /// The worker must go soon (Ctrl-C, SIGTERM): finish no tile, give back, say goodbye. Asked twice: at once.
    StopAsked,
    /// Time has passed; worth sending at [`crate::Session::next_deadline`].
    Tick,
}

/// The coordinator's answer to a hello.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Welcome {
    /// Its epoch; attempts are numbered anew in each.
    pub epoch: Epoch,
    /// How often it wants to hear of the worker.
    pub heartbeat_interval: Span,
    /// After how long of silence it gives the worker up.
    pub liveness_limit: Span,
    /// Of the attempts that the hello named, those that are live.
    pub live: Vec<AttemptId>,
}

/// Whether something that was refused is worth trying again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Retry {
    /// Later, perhaps.
    Later,
    /// Never: the answer will be the same.
    Never,
}

/// Why a block was not taken.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum BlockVerdict {
    /// For a passing reason (damaged on the way, the disk is full): send it again later.
    Later,
    /// The attempt is dead: forget all of it.
    AttemptDead,
    /// It will never be taken: the attempt has failed.
    Never {
        /// Why, the coordinator's sentence.
        reason: String,
    },
}
