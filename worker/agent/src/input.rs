//! Everything that reaches the loop.

use std::sync::Arc;

use bytes::Bytes;
use model::{AttemptId, Lease, Rect};
use session::Welcome;
use wire::Failure;
use wire::link::Workers;
use wire::proto::{Counter, Delivery, control_down, deliver_down};

use crate::scenes::Scene;

/// Which link something came on; older ones count for nothing.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct LinkNumber(pub(crate) u64);

/// What the loop waits for.
pub(crate) enum Input {
    /// Both connections are open.
    Dialled(LinkNumber, Box<Clients>),
    /// The coordinator took the hello, and both streams are open.
    Connected(LinkNumber, Welcome),
    /// The coordinator said something on the control stream.
    Control(LinkNumber, control_down::Message),
    /// The coordinator said something on the delivery stream.
    Delivery(LinkNumber, deliver_down::Message),
    /// The link is gone.
    Lost(LinkNumber, Failure),
    /// A lease's scene is here.
    Ready(Box<Lease>, Arc<Scene>),
    /// A thread has something to say.
    Rendered(Rendered),
}

/// The two connections of a link.
pub(crate) struct Clients {
    pub(crate) control: Workers,
    pub(crate) delivery: Workers,
}

/// What a thread says.
pub(crate) enum Rendered {
    /// A block is rendered.
    Block(Box<Block>),
    /// The last block of a tile is rendered.
    Last(Box<Block>),
    /// A tile cannot be rendered.
    Failed(AttemptId, String),
}

/// A block, ready to be sent as often as needed.
pub(crate) struct Block {
    pub(crate) attempt: AttemptId,
    pub(crate) rect: Rect,
    pub(crate) delivery: Delivery,
}

impl Block {
    /// What travels for a block: its record, and beside it what it took.
    pub(crate) fn new(
        attempt: AttemptId,
        rect: Rect,
        record: Vec<u8>,
        render_us: u64,
        counters: Vec<(&'static str, u64)>,
    ) -> Self {
        let counters = counters.into_iter().map(|(name, value)| Counter {
            name: name.to_owned(),
            value,
        });
        Self {
            attempt,
            rect,
            delivery: Delivery {
                record: Bytes::from(record),
                render_us,
                counters: counters.collect(),
            },
        }
    }
}
