//! How much of what waits and runs a worker of some kind could do: what a site's queue is asked for allocations by.

use model::Span;

use crate::{Needs, Offer, Sched};

/// What is left to do that some worker could do, whoever does it now.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Demand {
    /// Grid squares that are not durable, of 1,024 pixels each: no more threads than these can be of use.
    pub squares: u64,
    /// Of those, the squares of jobs of which nothing has been measured yet.
    pub unmeasured: u64,
    /// How long one thread of the usual speed would take over the others.
    pub time: Span,
    /// How long it took over the dearest grid square that was measured of any of these jobs.
    pub dearest: Span,
}

/// Pixels of a grid square.
const SQUARE_PIXELS: u64 = 1_024;

impl Sched {
    /// What a worker of this offer could do of all jobs that go on. Costs a look at every job.
    pub fn demand(&self, offer: &Offer) -> Demand {
        let meets = |needs: &Needs| needs.are_met_by(offer);
        let jobs = self.jobs.values().filter(|job| job.goes_on());
        let served =
            jobs.filter(|job| job.spec.revision == offer.revision && meets(&job.spec.needs));
        let mut demand = Demand::default();
        for job in served {
            let view = job.view();
            let left = view.pixels.saturating_sub(view.pixels_done);
            // What failed is over, whatever is missing of it.
            let open = view.images.waiting + view.images.rendering;
            if open == 0 || left == 0 {
                continue;
            }
            let squares = left.div_ceil(SQUARE_PIXELS);
            demand.squares = demand.squares.saturating_add(squares);
            demand.dearest = demand.dearest.max(Span(job.costs.dearest()));
            match self.cost_left(job) {
                Some(cost) => demand.time = demand.time + Span(cost),
                None => demand.unmeasured = demand.unmeasured.saturating_add(squares),
            }
        }
        demand
    }
}
