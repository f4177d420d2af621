//! What the shell must now do.

use alloc::string::String;
use alloc::vec::Vec;

use model::{AttemptId, Begun, Lease, Rect, Running};

/// Something to do. Effects are performed in order; each may be repeated without harm.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Effect {
    /// Dial the coordinator; say [`crate::Event::Dialled`] or [`crate::Event::LinkLost`].
    Connect,
    /// Close the link, and feed nothing more of it: it took too long.
    CloseLink,
    /// Say hello on the new link, with the attempts that are still held.
    SendHello {
        /// In the order in which they were leased.
        held: Vec<AttemptId>,
        /// The tiles among them that were begun.
        begun: Vec<Begun>,
    },
    /// Say how many tiles the worker wants to hold in all.
    SendCredit {
        /// The number.
        credit: u32,
    },
    /// Say that the worker is alive.
    SendHeartbeat {
        /// What it renders, in the order in which it was started.
        running: Vec<Running>,
    },
    /// Render a tile: its [`Lease::blocks`] in order, each reported by [`crate::Event::BlockRendered`],
    /// then [`crate::Event::TileRendered`], or [`crate::Event::RenderFailed`] at any point.
    ///
    /// A thread that is still busy with a cancelled tile takes it up after that one.
    StartTile {
        /// The tile.
        lease: Lease,
    },
    /// Stop rendering a tile at the next chance. Nothing need be said about it any more.
    CancelTile {
        /// The attempt.
        attempt: AttemptId,
    },
    /// Before its next block, every render thread waits.
    PauseRendering,
    /// Render threads may go on.
    ResumeRendering,
    /// Send a block. Its bytes are kept: it may have to be sent again.
    SendBlock {
        /// The attempt.
        attempt: AttemptId,
        /// The block.
        rect: Rect,
    },
    /// Free a block's bytes, if there are any.
    DropBlock {
        /// The attempt.
        attempt: AttemptId,
        /// The block.
        rect: Rect,
    },
    /// Say that these will not be rendered.
    GiveBack {
        /// The attempts.
        attempts: Vec<AttemptId>,
    },
    /// Say that a tile cannot be rendered.
    SendFailed {
        /// The attempt.
        attempt: AttemptId,
        /// Why.
        reason: String,
    },
    /// Say goodbye, see that it leaves, and close the link.
    SendGoodbye,
    /// End the program. Nothing follows.
    Exit {
        /// Why.
        reason: ExitReason,
    },
}

/// Why a session ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ExitReason {
    /// It was let go and has finished.
    Drained,
    /// It was asked to stop.
    Stopped,
    /// It had nothing to do for as long as it may.
    Idle,
    /// It was refused for good.
    Refused {
        /// The coordinator's sentence.
        reason: String,
    },
    /// It could not reach a coordinator for too long.
    GaveUp {
        /// What was wrong last.
        reason: String,
    },
}
