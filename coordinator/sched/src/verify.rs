//! Verification: some tiles are rendered once more by another worker, and compared to the bit.
//!
//! Where two differ nobody knows who is right: both get no more of the job until a third has rendered the tile too. Whoever is
//! alone with its pixels is expelled, and every image that it had a part in is rendered again. An image is encoded when all
//! checks of its tiles are done. What is drawn is drawn by image and place alone. A restart forgets checks that were not done.

use alloc::vec::Vec;

use model::{ImageRef, JobId, Rect, WorkerId};

use crate::job::Job;
use crate::region::Region;
use crate::tile::{Made, Tile};
use crate::work::Work;
use crate::{BlockRef, Effect, RevokeReason, Sched};

/// Tiles of which [`crate::Config::verify`] are rendered once more.
const OF: u64 = 1_000_000;

/// Rendered images of a job whose makers are remembered; those that come first are forgotten.
const MAKERS_REMEMBERED: usize = 4_096;

/// A tile that is rendered once more, and what it is held against.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Check {
    /// As it is durable.
    first: Vec<Made>,
    /// What others made of it that differed.
    dissent: Vec<Made>,
    /// All of those.
    by: Vec<WorkerId>,
}

impl Check {
    /// Of blocks that are durable, and what others made of them.
    pub(crate) fn of(first: Vec<Made>, dissent: Vec<Made>) -> Self {
        let makers = first.iter().chain(&dissent).map(|made| made.by);
        let mut by: Vec<WorkerId> = makers.collect();
        by.sort_unstable();
        by.dedup();
        Self { first, dissent, by }
    }

    /// Whether a worker rendered some of it before.
    pub(crate) fn is_by(&self, worker: WorkerId) -> bool {
        self.by.contains(&worker)
    }

    /// Whether a worker should be given it, of `able` workers that there are. Where they are all of those that rendered it, any
    /// of them is, to let it be.
    pub(crate) fn suits(&self, worker: WorkerId, able: u32) -> bool {
        self.by.len() >= able as usize || !self.is_by(worker)
    }

    fn first(&self, rect: Rect) -> Option<Made> {
        self.first.iter().find(|made| made.rect == rect).copied()
    }
}

/// Whether a tile is one of those that are rendered once more.
pub(crate) fn is_drawn(share: u32, image: ImageRef, region: Region) -> bool {
    // The finaliser of splitmix64, over what names the tile.
    let mut hash = image.job.0.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for word in [u64::from(image.image.0), u64::from(region.node)] {
        hash = (hash ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        hash ^= hash >> 31;
    }
    hash % OF < u64::from(share)
}

/// What a block says about who is right.
enum Finding {
    /// It is as it is durable, and so nothing is known against anybody.
    Nothing,
    /// It is as it is durable, and this worker had made something else of it.
    DissenterWrong {
        dissenter: WorkerId,
        first: WorkerId,
    },
    /// It is as this dissenter made it: what is durable is wrong.
    FirstWrong {
        dissenter: WorkerId,
        first: WorkerId,
    },
    /// It is the first that differs.
    Doubt { first: WorkerId },
    /// Three differ.
    Everybody,
}

impl Sched {
    /// Whether an attempt renders something once more.
    pub(crate) fn is_check(&mut self, number: u64) -> bool {
        self.checked_tile(number)
            .is_some_and(|tile| tile.check.is_some())
    }

    fn checked_tile(&mut self, number: u64) -> Option<&mut Tile> {
        let attempt = self.attempts.get(number)?;
        let (image, tile) = (attempt.image, attempt.tile);
        let (job, place) = self.job_and_place(image)?;
        job.work.get_mut(&place)?.tiles.get_mut(tile)
    }

    /// A block arrived of what is rendered once more.
    pub(crate) fn checked(
        &mut self,
        number: u64,
        block: BlockRef,
        made: Made,
        out: &mut Vec<Effect>,
    ) {
        let is_last = self.attempts[number].is_delivered();
        let Some(check) = self
            .checked_tile(number)
            .and_then(|tile| tile.check.as_mut())
        else {
            return;
        };
        match check.finds(made) {
            Finding::Nothing => {}
            Finding::DissenterWrong { dissenter, first } => {
                self.acquit(first, block.image.job);
                self.convict(dissenter, out);
            }
            Finding::FirstWrong { dissenter, first } => {
                self.report_incident(block, made.by, first, out);
                // Its image is rendered again, all of it.
                self.revoke(number, RevokeReason::RenderedAgain, out);
                self.acquit(dissenter, block.image.job);
                self.convict(first, out);
                return;
            }
            Finding::Doubt { first } => {
                check.dissent.push(made);
                check.by.push(made.by);
                let by = check.by.clone();
                self.report_incident(block, made.by, first, out);
                self.revoke(number, RevokeReason::Differs, out);
                if self.has_another(block.image.job, &by) {
                    self.doubt(first, block.image.job, out);
                    self.doubt(made.by, block.image.job, out);
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
        if is_last {
            self.passes(number);
        }
    }

    /// Ends an attempt that could not render something once more, if it is one: what is durable stays as it is.
    pub(crate) fn lets_check_be(&mut self, number: u64, out: &mut Vec<Effect>) -> bool {
        let is_check = self.is_check(number);
        if is_check {
            let image = self.attempts[number].image;
            self.passes(number);
            self.finish_image(image, out);
        }
        is_check
    }

    /// All of it was as it is durable, or nobody can say.
    fn passes(&mut self, number: u64) {
        if let Some(tile) = self.checked_tile(number) {
            tile.check = None;
        }
        self.end_attempt(number);
    }

    pub(crate) fn report_incident(
        &mut self,
        block: BlockRef,
        worker: WorkerId,
        other: WorkerId,
        out: &mut Vec<Effect>,
    ) {
        if let Some(job) = self.jobs.get_mut(&block.image.job) {
            job.tally.incidents += 1;
        }
        let other = Some(other).filter(|&other| other != worker);
        out.push(Effect::Incident {
            block,
            worker,
            other,
        });
    }

    /// Two attempts at a tile made different pixels of a block: the later one ends, and a third decides where there is one.
    pub(crate) fn differed(
        &mut self,
        number: u64,
        block: BlockRef,
        made: Made,
        out: &mut Vec<Effect>,
    ) {
        let (place, job) = (self.attempts[number].worker, block.image.job);
        let tile = self.checked_tile(number);
        let seen = tile.as_ref().map(|tile| tile.seen.iter());
        let first = seen.and_then(|mut seen| seen.find(|seen| seen.rect == made.rect));
        let first = first.map_or(made.by, |first| first.by);
        if let Some(tile) = tile {
            tile.dissent.push(made);
        }
        self.report_incident(block, made.by, first, out);
        self.revoke(number, RevokeReason::Differs, out);
        self.charge_fault(place, job, out);
        if self.config.verify > 0 && self.has_another(job, &[made.by, first]) {
            self.doubt(first, job, out);
            self.doubt(made.by, job, out);
        }
    }

    /// Whether somebody else could render what these did.
    fn has_another(&self, job: JobId, by: &[WorkerId]) -> bool {
        let Some(job) = self.jobs.get(&job) else {
            return false;
        };
        self.workers.iter().any(|(_, worker)| {
            worker.is_able()
                && worker.kinds.contains(job.kind)
                && worker.aside.job(job.id).is_none()
                && !by.contains(&worker.id)
        })
    }

    /// A worker's pixels were wrong: nothing that it made is believed.
    fn convict(&mut self, worker: WorkerId, out: &mut Vec<Effect>) {
        self.expel(worker, out);
        let place = self.workers.place(worker);
        let live = place.map_or_else(Vec::new, |place| self.workers[place].live.clone());
        for number in live {
            self.revoke(number, RevokeReason::Differs, out);
        }
        let jobs = self.jobs.values();
        let images = jobs.flat_map(|job| job.images_made_by(worker));
        out.extend(images.map(|image| Effect::RenderAgain { image, worker }));
    }

    /// Has images encoded whose last check was let be.
    pub(crate) fn finish_what_is_not_checked(&mut self, id: JobId, out: &mut Vec<Effect>) {
        let Some(job) = self.jobs.get(&id) else {
            return;
        };
        let finished = job.work.iter().filter(|(_, work)| work.is_finished());
        let finished: Vec<ImageRef> = finished.map(|(&place, _)| job.image_ref(place)).collect();
        for image in finished {
            self.finish_image(image, out);
        }
    }
}

impl Check {
    fn finds(&self, made: Made) -> Finding {
        let Some(first) = self.first(made.rect) else {
            return Finding::Nothing;
        };
        let dissent = self
            .dissent
            .iter()
            .find(|dissent| dissent.rect == made.rect);
        match (made.pixels == first.pixels, dissent) {
            (true, None) => Finding::Nothing,
            (true, Some(dissent)) => Finding::DissenterWrong {
                dissenter: dissent.by,
                first: first.by,
            },
            (false, None) => Finding::Doubt { first: first.by },
            (false, Some(dissent)) if dissent.pixels == made.pixels => Finding::FirstWrong {
                dissenter: dissent.by,
                first: first.by,
            },
            (false, Some(_)) => Finding::Everybody,
        }
    }
}

impl Job {
    /// Remembers who rendered an image.
    pub(crate) fn remember_makers(&mut self, place: u32, makers: Vec<WorkerId>) {
        self.makers.insert(place, makers);
        if self.makers.len() > MAKERS_REMEMBERED {
            self.makers.pop_first();
        }
    }

    /// The images that a worker had a part in, as far as that is remembered.
    fn images_made_by(&self, worker: WorkerId) -> impl Iterator<Item = ImageRef> {
        let has_part = move |makers: &[WorkerId]| makers.contains(&worker);
        let in_flight = self.work.iter();
        let in_flight = in_flight.filter(move |(_, work): &(_, &Work)| has_part(&work.makers));
        let rendered = self.makers.iter();
        let rendered = rendered.filter(move |(_, makers)| has_part(makers));
        let wanted = self.outcome != Some(crate::JobOutcome::Cancelled);
        let places = in_flight.map(|(&place, _)| place);
        let places = places.chain(rendered.map(|(&place, _)| place));
        places
            .filter(move |_| wanted)
            .map(|place| self.image_ref(place))
    }
}
