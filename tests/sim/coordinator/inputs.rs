//! What workers send: events for the scheduler, and blocks, which wait for the disk.

use std::collections::BTreeSet;

use model::{Span, Timestamp, WorkerId};
use sched::{BlockRef, Event, LinkId, Offer, Queue, Verdict};
use session::BlockVerdict;

use super::writer::{BLOCKS_MAX, Order};
use super::{Coordinator, REVISION, Wish};
use crate::disk::Pixels;
use crate::message::{Down, Up};
use crate::plan::Bug;

/// What whoever says hello offers.
pub(crate) fn offer(queue: Option<Queue>) -> Offer {
    Offer {
        revision: REVISION,
        threads: 1,
        memory_bytes: 0,
        labels: BTreeSet::new(),
        time_left: None,
        queue,
    }
}

impl Coordinator {
    pub(crate) fn hears(&mut self, now: Timestamp, worker: WorkerId, link: u64, message: Up) {
        self.witness.hears_of(worker, now);
        let event = match message {
            Up::Hello(held, begun) => Event::WorkerJoined {
                worker,
                link: LinkId(link),
                offer: offer(None),
                held,
                begun,
            },
            Up::Credit(credit) => Event::Credit { worker, credit },
            Up::Heartbeat(running) => Event::Heartbeat { worker, running },
            Up::Failed(attempt, reason) => Event::TileFailed {
                worker,
                attempt,
                reason,
            },
            Up::GiveBack(attempts) => Event::GivenBack { worker, attempts },
            Up::Goodbye => Event::Goodbye { worker },
            Up::Block(block, elapsed, pixels) => {
                return self.takes(now, worker, block, (elapsed, pixels));
            }
        };
        self.tell(now, event);
    }

    fn takes(
        &mut self,
        now: Timestamp,
        worker: WorkerId,
        block: BlockRef,
        (elapsed, pixels): (Span, Pixels),
    ) {
        let mut verdict = self.sched.accepts(worker, block);
        if self.plan.bug == Some(Bug::StaleAttempt) && matches!(verdict, Verdict::Refuse(_)) {
            verdict = Verdict::Accept;
        }
        match verdict {
            Verdict::Accept => {
                let waiting = self.blocks_waiting();
                if waiting >= BLOCKS_MAX && self.plan.bug != Some(Bug::UnboundedQueue) {
                    return self.refuse(worker, block, BlockVerdict::Later);
                }
                let attempt = self.sched.attempt(block.attempt);
                let is_live = attempt.is_some_and(|(of, image, tile)| {
                    (of, image) == (worker, block.image) && tile.contains(block.rect)
                });
                assert!(is_live, "a block of a dead attempt never counts");
                let era = self.era(block.image);
                self.order(Order::Block {
                    worker,
                    block,
                    elapsed,
                    pixels,
                    era,
                });
            }
            Verdict::AlreadyDone => self.tell(
                now,
                Event::BlockStored {
                    worker,
                    block,
                    elapsed,
                    pixels: pixels.digest(),
                },
            ),
            Verdict::Refuse(_) => self.refuse(worker, block, BlockVerdict::AttemptDead),
        }
    }

    pub(super) fn refuse(&mut self, worker: WorkerId, block: BlockRef, verdict: BlockVerdict) {
        let down = Down::BlockRefused(block.attempt, block.rect, verdict);
        self.wishes.push(Wish::Send(worker, down));
    }
}
