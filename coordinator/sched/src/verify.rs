//! Verification: some tiles are rendered once more by another worker, and compared to the bit.
//!
//! Where two differ nobody knows who is right: both get no more of the job until a third has rendered the tile too. Whoever is
//! alone with its pixels is expelled, and every image that it had a part in is rendered again ([`crate::wrong`]). What is
//! drawn is drawn by image and place alone. A restart forgets checks that were not done, and who was expelled.
//!
//! An image is encoded when all checks of its tiles are done or given up. A check is given up at once where nobody is
//! known who could ever do it, and after [`crate::Config::verify_wait`] where nobody can do it then: such workers may be away,
//! or have too little time left. Time in which its job is held up does not count. Like any lease it is cut down to what fits
//! into the time that a worker has left, and what was found right is not rendered a third time.

use alloc::boxed::Box;
use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use model::{ImageRef, JobId, Rect, Timestamp, WorkerId};

use crate::check::{Check, Evidence, Waiting};
use crate::job::Job;
use crate::region::Region;
use crate::tile::Tile;
use crate::timers::Timer;
use crate::work::Work;
use crate::worker::Worker;
use crate::{Effect, RevokeReason, Sched};

/// Tiles of which [`crate::Config::verify`] are rendered once more.
const OF: u64 = 1_000_000;

/// Makers of rendered images of one job that are remembered, of all images together; those of the first are forgotten.
const MAKERS_REMEMBERED: usize = 1 << 16;

/// Whether a tile is one of those that are rendered once more.
pub(crate) fn is_drawn(share: u32, image: ImageRef, region: Region) -> bool {
    if share == 0 {
        return false;
    }
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

/// What is to be rendered once more of pixels that are all durable, if anything is.
pub(crate) fn to_check(
    share: u32,
    image: ImageRef,
    (region, rect): (Region, Rect),
    evidence: &mut Evidence,
) -> Option<Box<Check>> {
    let is_known = evidence.firsts().len() == rect.blocks().count();
    let is_doubted = share > 0 && !evidence.dissents().is_empty();
    let is_wanted = is_doubted || (is_known && is_drawn(share, image, region));
    is_wanted.then(|| Box::new(Check::of(core::mem::take(evidence))))
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

    /// A worker's pixels of an image were written: whatever it made is rendered again should it be found to lie, or was before.
    pub(crate) fn has_part(&mut self, worker: WorkerId, live: Option<u64>, image: ImageRef) {
        // Nobody is found to lie where nothing is verified, and what is rendered once more is not written.
        if self.config.verify == 0 || live.is_some_and(|number| self.is_check(number)) {
            return;
        }
        let is_expelled = self.is_expelled(worker);
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        match job.work.get_mut(&place) {
            Some(work) => {
                work.makers.insert(worker);
                work.given_up |= is_expelled;
            }
            None => job.remember_maker(place, worker),
        }
        if is_expelled {
            self.wrong.add(image, worker);
        }
    }

    /// A worker has delivered all that it was to render once more.
    pub(crate) fn check_ends(&mut self, number: u64, by: WorkerId, out: &mut Vec<Effect>) {
        let tile = self.checked_tile(number);
        let check = tile.and_then(|tile| tile.check.as_deref());
        match check.is_some_and(|check| check.suits(by)) {
            // What it delivered was something else.
            true => self.check_fails(number, by, out),
            // What of it is its own work waits for somebody else.
            false => {
                self.end_attempt(number);
            }
        }
    }

    /// Ends an attempt that could not render something once more, if it is one: another worker may.
    pub(crate) fn lets_check_be(&mut self, number: u64, out: &mut Vec<Effect>) -> bool {
        let is_check = self.is_check(number);
        if is_check {
            let by = self.workers[self.attempts[number].worker].id;
            self.check_fails(number, by, out);
        }
        is_check
    }

    fn check_fails(&mut self, number: u64, by: WorkerId, out: &mut Vec<Effect>) {
        let max = self.config.tile_failures_max;
        let image = self.attempts[number].image;
        let mut given_up = None;
        if let Some(tile) = self.checked_tile(number)
            && let Some(mut check) = tile.check.take()
        {
            let is_alone = tile.live_count() == 1;
            match check.fails(by) >= max && is_alone {
                true => given_up = Some(*check),
                false => tile.check = Some(check),
            }
        }
        self.end_attempt(number);
        if let Some(check) = given_up {
            self.stays_unverified(image, &[check]);
            self.finish_image(image, out);
        }
    }

    /// A worker's pixels were wrong: nothing that it made is believed.
    pub(crate) fn convict(&mut self, worker: WorkerId, out: &mut Vec<Effect>) {
        self.expel(worker, out);
        let place = self.workers.place(worker);
        let live = place.map_or_else(Vec::new, |place| self.workers[place].live.clone());
        for number in live {
            self.revoke(number, RevokeReason::Differs, out);
        }
        for job in self.jobs.values_mut() {
            let places: Vec<u32> = job.images_made_by(worker).collect();
            for place in places {
                if let Some(work) = job.work.get_mut(&place) {
                    work.given_up = true;
                }
                self.wrong.add(job.image_ref(place), worker);
            }
            self.changed.push(job.id);
        }
        self.changed.sort_unstable();
        self.changed.dedup();
    }

    /// A check of an image begins to wait.
    pub(crate) fn check_waits(&mut self, image: ImageRef) {
        if let Some(job) = self.jobs.get_mut(&image.job) {
            let due = self.now + self.config.verify_wait;
            let due = job.unverified.due().map_or(due, |before| before.min(due));
            self.timers
                .set(Timer::Unverified(image.job), &mut job.unverified, Some(due));
        }
        self.unlooked.push(image);
    }

    /// Fewer workers can do checks than before.
    pub(crate) fn look_at_all_checks(&mut self) {
        if self.config.verify == 0 {
            return;
        }
        for job in self.jobs.values() {
            let waits = job.work.iter();
            let waits = waits.filter(|(_, work)| !work.checks.is_empty());
            self.unlooked
                .extend(waits.map(|(&place, _)| job.image_ref(place)));
        }
    }

    /// Gives up those checks, of images where that may have changed, that nobody who is known could ever do.
    pub(crate) fn give_up_lonely_checks(&mut self, out: &mut Vec<Effect>) {
        while let Some(image) = self.unlooked.pop() {
            let Some(job) = self.jobs.get(&image.job) else {
                continue;
            };
            let work = job
                .place(image.image)
                .and_then(|place| job.work.get(&place));
            let is_lonely = |waiting: &Waiting| {
                let mut workers = self.workers.iter();
                !workers.any(|(_, worker)| could_ever(worker, job, &waiting.check))
            };
            let lonely: Vec<bool> = work
                .into_iter()
                .flat_map(|work| work.checks.iter().map(is_lonely))
                .collect();
            if lonely.contains(&true) {
                self.give_up_checks(image, &lonely, out);
            }
        }
    }

    /// The time of some checks of a job is over: those that nobody can do now are given up.
    pub(crate) fn checks_overdue(&mut self, id: JobId, out: &mut Vec<Effect>) {
        let Some(job) = self.jobs.get(&id) else {
            return;
        };
        let overdue = |waiting: &Waiting| waiting.since + self.config.verify_wait <= self.now;
        let mut given_up: Vec<(u32, Vec<bool>)> = Vec::new();
        for (&place, work) in &job.work {
            let is_vain = |waiting: &Waiting| {
                overdue(waiting) && job.goes_on() && !self.may_do(job, work, waiting)
            };
            given_up.push((place, work.checks.iter().map(is_vain).collect()));
        }
        let now = self.now;
        let wait = self.config.verify_wait;
        let Some(job) = self.jobs.get_mut(&id) else {
            return;
        };
        let mut next: Option<Timestamp> = None;
        for (place, vain) in &given_up {
            let checks = job.work.get_mut(place).map(|work| &mut work.checks);
            let waiting = checks.into_iter().flatten().zip(vain);
            for (waiting, _) in waiting.filter(|&(_, &vain)| !vain) {
                if waiting.since + wait <= now {
                    waiting.since = now;
                }
                let due = waiting.since + wait;
                next = Some(next.map_or(due, |next| next.min(due)));
            }
        }
        self.timers
            .set(Timer::Unverified(id), &mut job.unverified, next);
        given_up.retain(|(_, vain)| vain.contains(&true));
        let images: Vec<_> = given_up
            .into_iter()
            .map(|(place, vain)| (job.image_ref(place), vain))
            .collect();
        for (image, vain) in images {
            self.give_up_checks(image, &vain, out);
        }
    }

    /// Whether some worker would do a check if nothing else were to do.
    fn may_do(&self, job: &Job, work: &Work, waiting: &Waiting) -> bool {
        let mut workers = self.workers.iter();
        workers.any(|(_, worker)| {
            checks_now(worker, job)
                && waiting.check.suits(worker.id)
                && self
                    .ask(worker, job)
                    .is_some_and(|ask| work.check_fits(waiting, &ask))
        })
    }

    /// Gives up those waiting checks of an image that are marked.
    fn give_up_checks(&mut self, image: ImageRef, marked: &[bool], out: &mut Vec<Effect>) {
        let Some((job, place)) = self.job_and_place(image) else {
            return;
        };
        let Some(work) = job.work.get_mut(&place) else {
            return;
        };
        let mut given_up = Vec::new();
        let checks = core::mem::take(&mut work.checks);
        for (waiting, &is_given_up) in checks.into_iter().zip(marked) {
            match is_given_up {
                true => given_up.push(waiting.check),
                false => work.checks.push_back(waiting),
            }
        }
        self.stays_unverified(image, &given_up);
        self.finish_image(image, out);
    }

    /// What is durable stays as it is, and nobody will ever know better.
    fn stays_unverified(&mut self, image: ImageRef, checks: &[Check]) {
        if let Some((job, place)) = self.job_and_place(image) {
            job.tally.unverified += checks.len() as u64;
            if let Some(work) = job.work.get_mut(&place) {
                work.unverified = work
                    .unverified
                    .saturating_add(u32::try_from(checks.len()).unwrap_or(u32::MAX));
            }
        }
        for worker in checks.iter().flat_map(Check::doubted) {
            self.acquit(worker, image.job);
        }
        self.job_changed(image.job);
    }
}

/// Whether a worker renders something of a job once more where that is asked at this moment.
pub(crate) fn checks_now(worker: &Worker, job: &Job) -> bool {
    checks(worker, job) && worker.is_able() && worker.aside.job(job.id).is_none()
}

/// Whether a worker may do a check some time, if it is not lost before.
fn could_ever(worker: &Worker, job: &Job, check: &Check) -> bool {
    checks(worker, job) && worker.aside.expelled().is_none() && check.suits(worker.id)
}

/// Whether a worker is of those that do checks of a job: a queue takes whole images.
fn checks(worker: &Worker, job: &Job) -> bool {
    worker.kinds.contains(job.kind) && worker.offer.queue.is_none()
}

impl Job {
    /// Whether something waits to be rendered once more.
    pub(crate) fn has_checks(&self) -> bool {
        self.work.values().any(|work| !work.checks.is_empty())
    }

    /// Remembers who rendered an image.
    pub(crate) fn remember_makers(&mut self, place: u32, makers: BTreeSet<WorkerId>) {
        self.forget_makers(place);
        self.makers_count += makers.len();
        if !makers.is_empty() {
            self.makers.insert(place, makers.into_iter().collect());
        }
        while self.makers_count > MAKERS_REMEMBERED
            && let Some((_, forgotten)) = self.makers.pop_first()
        {
            self.makers_count -= forgotten.len();
        }
    }

    /// Remembers of one more that it rendered some of an image.
    fn remember_maker(&mut self, place: u32, worker: WorkerId) {
        let mut makers: BTreeSet<WorkerId> = self
            .makers
            .get(&place)
            .into_iter()
            .flatten()
            .copied()
            .collect();
        if makers.insert(worker) {
            self.remember_makers(place, makers);
        }
    }

    /// Forgets who rendered an image.
    pub(crate) fn forget_makers(&mut self, place: u32) {
        let forgotten = self.makers.remove(&place);
        self.makers_count -= forgotten.map_or(0, |makers| makers.len());
    }

    /// The places of images that a worker had a part in, as far as that is remembered.
    fn images_made_by(&self, worker: WorkerId) -> impl Iterator<Item = u32> {
        let in_flight = self.work.iter();
        let in_flight = in_flight.filter(move |(_, work)| work.makers.contains(&worker));
        let rendered = self.makers.iter();
        let rendered = rendered.filter(move |(_, makers)| makers.contains(&worker));
        let wanted = self.outcome != Some(crate::JobOutcome::Cancelled);
        let places = in_flight.map(|(&place, _)| place);
        let places = places.chain(rendered.map(|(&place, _)| place));
        places.filter(move |_| wanted)
    }
}
