//! The thread that commits to the store what the writer has prepared, in order.
//!
//! It works beside the writer: while one batch is committed the pixels of the next are written and synced.

use std::sync::mpsc::{Receiver, RecvError, Sender, TryRecvError};

use store::{Entry, Store};

use super::disk::Disk;
use super::{Stored, Ticket, chain};
use crate::input::News;

/// Most batches that are handed over and not committed. What comes while one is committed is committed
/// together, so that more would make nothing faster.
pub(super) const AHEAD_MAX: usize = 4;

/// What is committed together, and who is told. Pixels of its blocks are durable.
#[derive(Default)]
pub(super) struct Batch {
    pub(super) entries: Vec<Entry>,
    pub(super) stored: Vec<Stored>,
    pub(super) ticket: Option<Ticket>,
}

/// What became of so many batches.
struct Committed {
    batches: usize,
    /// Or nothing later may be done.
    is_done: bool,
}

/// The committer's end.
pub(super) struct Committer {
    store: Box<dyn Store>,
    disk: Disk,
    batches: Receiver<Batch>,
    committed: Sender<Committed>,
}

/// The writer's end.
pub(super) struct Commits {
    batches: Sender<Batch>,
    committed: Receiver<Committed>,
    ahead: usize,
    is_over: bool,
}

/// Both ends.
pub(super) fn committer(store: Box<dyn Store>, disk: Disk) -> (Commits, Committer) {
    let (batches, handed_over) = std::sync::mpsc::channel();
    let (said, committed) = std::sync::mpsc::channel();
    let commits = Commits {
        batches,
        committed,
        ahead: 0,
        is_over: false,
    };
    let committer = Committer {
        store,
        disk,
        batches: handed_over,
        committed: said,
    };
    (commits, committer)
}

impl Commits {
    /// Has a batch committed after all that were handed over before; waits where too many are on their way.
    pub(super) fn hand_over(&mut self, batch: Batch) {
        self.wait(AHEAD_MAX - 1);
        self.ahead += 1;
        self.is_over |= self.batches.send(batch).is_err();
    }

    /// Whether something was handed over of which nothing is known yet.
    pub(super) fn are_ahead(&self) -> bool {
        self.ahead > 0
    }

    /// Waits until everything that was handed over is committed, or will never be.
    pub(super) fn settle(&mut self) {
        self.wait(0);
    }

    /// Whether a commit was given up: then nothing that was ordered later may be done.
    pub(super) fn is_over(&self) -> bool {
        self.is_over
    }

    fn wait(&mut self, most_ahead: usize) {
        while self.ahead > most_ahead && !self.is_over {
            match self.committed.recv() {
                Ok(Committed { batches, is_done }) => {
                    self.ahead -= batches;
                    self.is_over |= !is_done;
                }
                Err(RecvError) => self.is_over = true,
            }
        }
    }
}

impl Committer {
    /// Commits until the writer ends, or a commit has to be given up.
    pub(super) fn run(mut self) {
        while let Ok(first) = self.batches.recv() {
            let (batch, batches) = self.with_what_waits(first);
            let is_done = self.commit(batch);
            // The writer may have ended: nobody waits for an answer.
            let _ = self.committed.send(Committed { batches, is_done });
            if !is_done {
                return;
            }
        }
    }

    /// A batch with those that were handed over after it, and how many that are.
    fn with_what_waits(&self, mut batch: Batch) -> (Batch, usize) {
        let mut batches = 1;
        loop {
            match self.batches.try_recv() {
                Ok(next) => {
                    batch.entries.extend(next.entries);
                    batch.stored.extend(next.stored);
                    batch.ticket = next.ticket.or(batch.ticket);
                    batches += 1;
                }
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return (batch, batches),
            }
        }
    }

    /// Makes a batch durable and says so. Whether it is.
    fn commit(&mut self, batch: Batch) -> bool {
        let store = &mut self.store;
        let commit = || match store.commit(&batch.entries) {
            Ok(()) => Ok(Ok(())),
            Err(error) if error.is_transient() => Err(chain(&error)),
            Err(error) => Ok(Err(chain(&error))),
        };
        match self.disk.insist(|| true, commit) {
            Some(Ok(())) => {}
            Some(Err(sentence)) => {
                self.disk.say(News::Broken(sentence));
                return false;
            }
            None => return false,
        }
        if !batch.stored.is_empty() {
            self.disk.say(News::Stored(batch.stored));
        }
        if let Some(ticket) = batch.ticket {
            self.disk.say(News::Committed(ticket));
        }
        true
    }
}
