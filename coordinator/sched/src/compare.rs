//! Blocks of which there are two renderings: they are equal to the bit, or somebody is wrong.
//!
//! The fence against dead attempts is the question before a block is written ([`Sched::accepts`]). What passed it is written, and so
//! counts for its pixels and is held against what others made of them even where its attempt ended meanwhile: dropped here, it
//! would leave a drawn tile unverified, and pixels on the disk that nobody compared. What comes to the fence after its attempt ended
//! counts for nothing, doubt or no doubt: a third rendering decides those. `tests/late.rs` shows it.

use alloc::vec::Vec;

use model::{JobId, WorkerId};

use crate::blocks::Durable;
use crate::check::{Finding, Known, Made};
use crate::verify::{checks_now, is_drawn, to_check};
use crate::{BlockRef, Effect, RevokeReason, Sched};

impl Sched {
    /// Holds a block against what others made of it; `live` is its attempt, unless that ended while it was written.
    pub(crate) fn hold_against_others(
        &mut self,
        live: Option<u64>,
        block: BlockRef,
        (made, durable): (Made, Durable),
        out: &mut Vec<Effect>,
    ) {
        let verify = self.config.verify;
        let Some((job, place)) = self.job_and_place(block.image) else {
            return;
        };
        let work = job.work.get_mut(&place);
        match work.and_then(|work| work.known_of(made.rect)) {
            Some(Known::Check(check)) => {
                let finding = check.finds(made);
                let doubtful = match finding {
                    Finding::Doubt { .. } => check.makers(),
                    _ => Vec::new(),
                };
                self.checked(live, (block, made), (finding, &doubtful), out);
            }
            Some(Known::Evidence {
                evidence,
                region,
                live: others,
            }) => {
                let first = evidence.first(made.rect);
                // Only while two are at work on it can there be another one to compare it with, or later.
                let is_late = live.is_none() && verify > 0;
                let is_compared = others > 1 || is_late || is_drawn(verify, block.image, region);
                match first {
                    Some(first) if first.pixels != made.pixels => {
                        evidence.add_dissent(made);
                        self.differed(live, block, (made, first.by), out);
                    }
                    None if is_compared && durable == Durable::ByThis => evidence.add_first(made),
                    _ => {}
                }
            }
            None => {}
        }
        if live.is_none() && verify > 0 {
            self.piece_may_be_whole(block);
        }
    }

    /// Where a block that came late was the last of what waited with it, that waits no more, unless to be rendered once more.
    fn piece_may_be_whole(&mut self, block: BlockRef) {
        let (verify, now, image) = (self.config.verify, self.now, block.image);
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let Some(work) = job.work.get_mut(&place) else {
            return;
        };
        if let Some((region, rect, mut evidence)) = work.take_whole(block.rect)
            && let Some(check) = to_check(verify, image, (region, rect), &mut evidence)
        {
            work.put_check(region, *check, now);
            self.check_waits(image);
        }
    }

    /// A block arrived of what is rendered once more, which says something; `doubtful` are those who made some of it,
    /// where nobody knows who is right.
    fn checked(
        &mut self,
        live: Option<u64>,
        (block, made): (BlockRef, Made),
        (finding, doubtful): (Finding, &[WorkerId]),
        out: &mut Vec<Effect>,
    ) {
        let is_last = live.filter(|&number| self.attempts[number].is_delivered());
        let job = block.image.job;
        match finding {
            Finding::Nothing => {}
            Finding::DissenterWrong { dissenter, first } => {
                self.decided(job);
                self.acquit(first, job);
                self.convict(dissenter, out);
            }
            Finding::FirstWrong { dissenter, first } => {
                self.report_incident(block, made.by, first, out);
                self.decided(job);
                // Its image is rendered again, all of it.
                self.revoke_live(live, RevokeReason::RenderedAgain, out);
                self.acquit(dissenter, job);
                self.convict(first, out);
                return;
            }
            Finding::Doubt { first } => {
                self.report_incident(block, made.by, first, out);
                self.revoke_live(live, RevokeReason::Differs, out);
                if self.has_another(job, doubtful) {
                    self.doubt(first, job, out);
                    self.doubt(made.by, job, out);
                }
                return;
            }
            Finding::Everybody => {
                self.report_incident(block, made.by, made.by, out);
                let reason = "three workers made three different pixels of one block: a machine or a renderer is at fault";
                self.give_up(block.image, reason.into(), out);
                return;
            }
        }
        self.check_may_be_done(block, out);
        // One that delivered all of it has ended with it.
        if let Some(number) = is_last.filter(|&number| self.attempts.get(number).is_some()) {
            self.check_ends(number, made.by, out);
        }
    }

    fn revoke_live(&mut self, live: Option<u64>, reason: RevokeReason, out: &mut Vec<Effect>) {
        if let Some(number) = live {
            self.revoke(number, reason, out);
        }
    }

    /// Where a block was the last that was to be rendered once more, nobody does so any more.
    fn check_may_be_done(&mut self, block: BlockRef, out: &mut Vec<Effect>) {
        let Some((job, place)) = self.job_and_place(block.image) else {
            return;
        };
        let Some(work) = job.work.get_mut(&place) else {
            return;
        };
        let tile = work.tile_of(block.rect);
        let tile = tile.and_then(|tile| work.tiles.get(tile));
        match tile.and_then(|tile| Some((tile, tile.check.as_ref()?))) {
            Some((tile, check)) if check.is_done() => {
                let live = tile.attempts();
                self.end_all(live, out);
            }
            Some(_) => {}
            // It came late, and nobody had begun.
            None => work.checks.retain(|waiting| !waiting.check.is_done()),
        }
    }

    fn report_incident(
        &mut self,
        block: BlockRef,
        worker: WorkerId,
        other: WorkerId,
        out: &mut Vec<Effect>,
    ) {
        if let Some(job) = self.jobs.get_mut(&block.image.job) {
            job.tally.incidents += 1;
            job.tally.undecided += 1;
        }
        let other = Some(other).filter(|&other| other != worker);
        out.push(Effect::Incident {
            block,
            worker,
            other,
        });
    }

    /// It is known who was right about a block. What else is doubted of its image goes with that, where it is rendered again.
    fn decided(&mut self, job: JobId) {
        if let Some(job) = self.jobs.get_mut(&job) {
            job.tally.undecided = job.tally.undecided.saturating_sub(1);
        }
    }

    /// Two attempts at a tile made different pixels of a block: the later one ends, and a third decides where there is one.
    fn differed(
        &mut self,
        live: Option<u64>,
        block: BlockRef,
        (made, first): (Made, WorkerId),
        out: &mut Vec<Effect>,
    ) {
        let job = block.image.job;
        self.report_incident(block, made.by, first, out);
        self.revoke_live(live, RevokeReason::Differs, out);
        if let Some(place) = self.workers.place(made.by) {
            self.charge_fault(place, job, out);
        }
        if self.config.verify > 0 && self.has_another(job, &[made.by, first]) {
            self.doubt(first, job, out);
            self.doubt(made.by, job, out);
        }
    }

    /// Whether somebody else could render now what these did.
    fn has_another(&self, job: JobId, by: &[WorkerId]) -> bool {
        let Some(job) = self.jobs.get(&job) else {
            return false;
        };
        let mut workers = self.workers.iter();
        workers.any(|(_, worker)| checks_now(worker, job) && !by.contains(&worker.id))
    }
}
