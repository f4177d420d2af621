//! When a job will be over, by what its images took so far.

use model::{JobId, Span};

use crate::costs::scale;
use crate::job::Job;
use crate::pace::SPEED_USUAL;
use crate::spread::PARTS;
use crate::view::Estimate;
use crate::{ImageState, Sched};

impl Sched {
    /// How long a job will still take if the farm stays as it is; `None` where it does not go on, nothing of it was
    /// measured, or no worker is there for it. Costs a look at every worker and job.
    ///
    /// What comes first is taken into account: all of the jobs of higher priority, and of those of its own
    /// as much as their shares get meanwhile.
    pub fn time_left(&self, id: JobId) -> Option<Estimate> {
        let job = self.jobs.get(&id).filter(|job| job.goes_on())?;
        let own = self.cost_left(job)?;
        let speed: u64 = self
            .workers
            .iter()
            .filter(|(_, worker)| worker.kinds.contains(job.kind))
            .filter_map(|(_, worker)| worker.counts())
            .map(|counts| counts.capacity)
            .sum();
        if speed == 0 {
            return None;
        }
        let others = self
            .jobs
            .values()
            .filter(|other| other.id != id && other.goes_on() && other.priority >= job.priority);
        let before = others.map(|other| {
            let left = self.cost_left(other).unwrap_or(0);
            match other.priority > job.priority {
                true => left,
                false => left.min(scale(own, u64::from(other.share), u64::from(job.share))),
            }
        });
        let cost = before.fold(own, u64::saturating_add);
        let time = |cost: u64| Span(scale(cost, u64::from(SPEED_USUAL), speed));
        let left = job.images_left();
        let spread = scale(own, job.spread.of(left), PARTS);
        Some(Estimate {
            left: time(cost),
            early: time(cost.saturating_sub(spread)),
            late: time(cost.saturating_add(spread)),
        })
    }

    /// What is left of a job is expected to cost, that with workers and what waits to be verified included, if anything was measured.
    pub(crate) fn cost_left(&self, job: &Job) -> Option<u64> {
        let open = job.open_cost()?;
        let live = job.live().map(|number| {
            let attempt = &self.attempts[number];
            let wanted = u64::from(attempt.wanted().max(1));
            let left = wanted.saturating_sub(u64::from(attempt.done()));
            scale(attempt.cost, left, wanted)
        });
        let checks = job.work.values().flat_map(|work| &work.checks);
        let checks = checks.map(|waiting| {
            let cost = job.costs.of_blocks(waiting.check.blocks());
            cost.unwrap_or(0)
        });
        Some(live.chain(checks).fold(open, u64::saturating_add))
    }
}

impl Job {
    /// Images that are not all rendered.
    fn images_left(&self) -> u32 {
        let counts = self.view().images;
        counts.waiting + counts.rendering
    }

    /// All pixels of an image are there: notes what it cost.
    pub(crate) fn finish_rendering(&mut self, place: u32) {
        if let Some(work) = self.work.remove(&place) {
            self.spread.note(work.spent);
            self.remember_makers(place, work.makers);
        }
        self.set_state(place, ImageState::Encoding);
    }
}
