//! What passes between a worker and the coordinator.

use model::{AttemptId, Begun, Lease, Rect, Running, Span};
use sched::BlockRef;
use session::{BlockVerdict, Retry, Welcome};

use crate::disk::Pixels;

/// What workers send.
#[derive(Clone, Debug)]
pub(crate) enum Up {
    Hello(Vec<AttemptId>, Vec<Begun>),
    Credit(u32),
    Heartbeat(Vec<Running>),
    Failed(AttemptId, String),
    GiveBack(Vec<AttemptId>),
    Goodbye,
    Block(BlockRef, Span, Pixels),
}

/// What is sent to workers.
#[derive(Clone, Debug)]
pub(crate) enum Down {
    Welcome(Welcome),
    Refused(String, Retry),
    Lease(Lease),
    Revoke(AttemptId),
    Ack(AttemptId, Rect),
    BlockRefused(AttemptId, Rect, BlockVerdict),
}
