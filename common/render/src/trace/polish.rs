//! Rays whose first point inside is known: what remains is the root between it and the point before.

use field::BATCH;

use super::batch::{Batch, Lanes, Paths};
use super::bound;
use super::bracket::{Bracket, End};
use super::grid::Steps;
use super::surface::Surface;
use super::tracer::{Hit, Ray, Results, Wanted};

/// A ray that has found its first point inside.
#[derive(Clone, Copy)]
pub(crate) struct Found {
    /// Which ray.
    pub(crate) ray: usize,
    pub(crate) steps: Steps,
    /// The point and its value.
    pub(crate) inside: End,
    /// The last point known to be outside, and its value.
    pub(crate) outside: End,
}

impl Found {
    /// The same where the value outside is not known.
    pub(crate) fn without_outside(self) -> Self {
        let outside = End {
            t: f64::NEG_INFINITY,
            value: 0.0,
        };
        Self { outside, ..self }
    }
}

/// Memory in which roots are polished.
#[derive(Default)]
pub(crate) struct Polish {
    found: Vec<Found>,
    paths: Paths,
    batch: Batch,
    lanes: Vec<Lane>,
    t: Box<Row>,
}

#[repr(align(64))]
struct Row(Lanes);

impl Default for Row {
    fn default() -> Self {
        Self([0.0; BATCH])
    }
}

struct Lane {
    ray: usize,
    inside: End,
    before: f64,
    /// `None` while the value at the point before is wanted.
    bracket: Option<Bracket>,
}

impl Polish {
    /// Takes a ray; says whether so many wait that they should be polished now.
    pub(crate) fn push(&mut self, found: Found) -> bool {
        self.found.push(found);
        self.found.len() >= 2 * BATCH
    }

    /// Polishes all that wait.
    pub(crate) fn run(
        &mut self,
        Wanted { surface, rays, .. }: Wanted<'_>,
        Results {
            scratch,
            counts,
            hits,
        }: Results<'_>,
    ) {
        loop {
            while self.lanes.len() < BATCH {
                let Some(found) = self.found.pop() else {
                    break;
                };
                self.start(found, surface, rays, hits);
            }
            let n = self.lanes.len();
            if n == 0 {
                return;
            }
            let Self {
                paths, batch, t, ..
            } = self;
            surface.level.vectorize(
                #[inline(always)]
                || batch.go(surface, n, paths, &t.0),
            );
            batch.evaluate(surface, n, paths, scratch);
            counts.evaluations += n as u64;
            for i in (0..n).rev() {
                self.step(i, hits);
            }
        }
    }

    fn start(&mut self, found: Found, surface: &Surface, rays: &[Ray], hits: &mut [Hit]) {
        let Found {
            ray: index,
            steps,
            inside,
            outside,
        } = found;
        let ray = &rays[index];
        if steps.is_first(inside.t) {
            hits[index] = Hit::Surface(inside.t);
            return;
        }
        let before = steps.before(inside.t);
        if !bound::contains(&surface.bound, ray.origin + ray.direction * before) {
            hits[index] = Hit::Face(inside.t);
            return;
        }
        let lane = self.lanes.len();
        let mut bracket = None;
        self.t.0[lane] = before;
        if outside.t == before {
            let Some(known) = enclosed(before, outside.value, inside) else {
                hits[index] = Hit::Surface(inside.t);
                return;
            };
            self.t.0[lane] = known.middle;
            bracket = Some(known);
        }
        self.paths
            .set(lane, ray.origin, ray.direction, ray.from_eye, ray.time);
        self.lanes.push(Lane {
            ray: index,
            inside,
            before,
            bracket,
        });
    }

    /// Takes the value that was wanted.
    fn step(&mut self, i: usize, hits: &mut [Hit]) {
        let (value, footprint) = (self.batch.value[i], self.batch.footprint[i]);
        let lane = &mut self.lanes[i];
        let root = match &mut lane.bracket {
            Some(bracket) => {
                let root = bracket.narrow(value, footprint);
                self.t.0[i] = bracket.middle;
                root
            }
            None => {
                lane.bracket = enclosed(lane.before, value, lane.inside);
                match &lane.bracket {
                    Some(bracket) => {
                        self.t.0[i] = bracket.middle;
                        None
                    }
                    None => Some(lane.inside.t),
                }
            }
        };
        if let Some(root) = root {
            hits[lane.ray] = Hit::Surface(root);
            self.lanes.swap_remove(i);
            let last = self.lanes.len();
            if i < last {
                self.paths.copy(last, i);
                self.t.0[i] = self.t.0[last];
                // The moved lane has had its turn: its values are not looked at again.
            }
        }
    }
}

/// The root between the point before, with that value, and the point inside.
fn enclosed(before: f64, value: f64, inside: End) -> Option<Bracket> {
    let outside = End { t: before, value };
    (value > 0.0 && value.is_finite()).then(|| Bracket::new(outside, inside))
}
