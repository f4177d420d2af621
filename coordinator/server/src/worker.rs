//! What the loop knows of a worker beside what the scheduler knows.

use std::collections::BTreeMap;

use model::{Timestamp, WorkerId};
use sched::LinkId;
use wire::proto;

use crate::input::{AboutWorker, Link};

/// Workers, by process.
pub(crate) type Workers = BTreeMap<WorkerId, Worker>;

/// One worker.
#[derive(Debug)]
pub(crate) struct Worker {
    pub(crate) about: AboutWorker,
    /// The protocol version spoken with it.
    pub(crate) protocol: u32,
    /// Its control stream, while that is open.
    pub(crate) control: Option<Link<proto::ControlDown>>,
    /// Its delivery stream, while that is open.
    pub(crate) delivery: Option<Link<proto::DeliverDown>>,
    /// Whether it was told to leave, or is to be told when it comes back.
    pub(crate) draining: Draining,
    /// Until when it may run.
    pub(crate) runs_until: Option<Timestamp>,
}

/// Whether a worker is to finish what it holds and leave.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Draining {
    No,
    Yes,
}

impl Worker {
    /// Whether this is its open control stream.
    pub(crate) fn is_control(&self, link: LinkId) -> bool {
        self.control.as_ref().is_some_and(|open| open.id == link)
    }

    /// Whether this is what it calls itself, or its id.
    pub(crate) fn is_called(&self, id: WorkerId, name: &str) -> bool {
        self.about.name == name || format!("{:016x}", id.id) == name
    }

    /// Tells it something. A worker that reads too slowly is cut off: it may come back.
    pub(crate) fn tell(&mut self, message: proto::control_down::Message) -> Told {
        let message = proto::ControlDown {
            message: Some(message),
        };
        tell(&mut self.control, message)
    }

    /// Answers a delivery, in the same way.
    pub(crate) fn answer(&mut self, message: proto::deliver_down::Message) -> Told {
        let message = proto::DeliverDown {
            message: Some(message),
        };
        tell(&mut self.delivery, message)
    }
}

/// Whether a worker was told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Told {
    /// The message waits on its stream.
    Yes,
    /// There is no stream; the worker learns what counts when it comes back.
    Away,
    /// The stream was full or broken, and is now cut.
    Cut,
}

fn tell<T>(link: &mut Option<Link<T>>, message: T) -> Told {
    let Some(open) = link else {
        return Told::Away;
    };
    match open.down.try_send(Ok(message)) {
        Ok(()) => Told::Yes,
        Err(_) => {
            *link = None;
            Told::Cut
        }
    }
}
