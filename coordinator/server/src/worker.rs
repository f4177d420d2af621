//! What the loop knows of a worker beside what the scheduler knows.

use std::collections::{BTreeMap, VecDeque};

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
    /// Its blocks that are being written.
    pub(crate) storing: u64,
    /// Its link that closed meanwhile: told to the scheduler behind those blocks, lest others be asked for them.
    pub(crate) closing: Option<LinkId>,
}

/// Processes that are remembered after they were told to leave and were lost; those that were lost first are forgotten.
const LEAVING_MAX: usize = 1_000;

/// Processes that were told to leave, and were lost before it was known that they did.
#[derive(Debug, Default)]
pub(crate) struct Leaving(VecDeque<WorkerId>);

impl Leaving {
    pub(crate) fn add(&mut self, worker: WorkerId) {
        self.0.retain(|&known| known != worker);
        self.0.push_back(worker);
        while self.0.len() > LEAVING_MAX {
            self.0.pop_front();
        }
    }

    /// Whether one that comes back was told to leave; then it is known again, and remembered here no more.
    pub(crate) fn take(&mut self, worker: WorkerId) -> Draining {
        let place = self.0.iter().position(|&known| known == worker);
        match place.and_then(|place| self.0.remove(place)) {
            Some(_) => Draining::Yes,
            None => Draining::No,
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn worker(id: u64) -> WorkerId {
        WorkerId { id, incarnation: 1 }
    }

    #[test]
    fn who_was_told_to_leave_is_told_again_once_and_not_too_many_are_remembered() {
        let mut leaving = Leaving::default();
        leaving.add(worker(1));
        assert_eq!(leaving.take(worker(2)), Draining::No);
        assert_eq!(leaving.take(worker(1)), Draining::Yes);
        assert_eq!(leaving.take(worker(1)), Draining::No);
        for id in 0..=LEAVING_MAX as u64 {
            leaving.add(worker(id));
        }
        assert_eq!(leaving.take(worker(0)), Draining::No);
        assert_eq!(leaving.take(worker(1)), Draining::Yes);
    }
}
