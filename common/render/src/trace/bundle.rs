//! Rays that stay close to each other are followed together as far as one answer serves all of them.
//!
//! A bundle is a path along the middle of its rays and a radius r(t) that holds every ray's place
//! at t. One value in the middle proves a stretch of space free of roots for all of them, thesis §7.2.
//! Where the radius no longer matters little, the bundle splits in four; single rays go on from
//! there ([`super::search`]). Bundles only say what need not be looked at: no pixel depends on them.

use field::{BATCH, Scratch};
use glam::DVec3;

use super::batch::{Batch, Lanes, Paths};
use super::bound;
use super::clearance::{CAUTION, FLAT, Known, widened};
use super::coarse;
use super::means::Means;
use super::surface::Surface;
use super::tracer::Ray;
use crate::counts::Counts;

/// Rays of the bundles, largest first; each size is that of the next four times over.
const SIZES: [usize; 3] = [64, 16, 4];

/// A bundle splits where it may step no farther than this share of its radius: sooner where single rays see more.
fn split(means: Means) -> f64 {
    match means {
        Means::Stretches => 1.0,
        Means::Tangents | Means::Values | Means::Ranges(_) => 0.25,
    }
}

/// Most steps of one bundle.
const STEPS_MAX: u32 = 256;

/// A ray that may meet the surface, with the distances between which it may.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    /// Which ray.
    pub(crate) ray: usize,
    /// No root is nearer.
    pub(crate) clear: f64,
    /// Nor beyond.
    pub(crate) end: f64,
    /// Evaluations along the ray so far.
    pub(crate) steps: f64,
}

/// Memory in which bundles are followed.
#[derive(Default)]
pub(crate) struct Bundles {
    paths: Paths,
    pub(crate) batch: Batch,
    lanes: Vec<Lane>,
    at: Box<Rows>,
}

/// Where the bundles stand, and how wide they are: `radius` + `spread` · t.
struct Rows {
    t: Lanes,
    radius: Lanes,
    spread: Lanes,
    offset: Lanes,
    slope: Lanes,
    reach: Lanes,
    value: Lanes,
    growth: Lanes,
    ahead: Lanes,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            t: [0.0; BATCH],
            radius: [0.0; BATCH],
            spread: [0.0; BATCH],
            offset: [0.0; BATCH],
            slope: [0.0; BATCH],
            reach: [0.0; BATCH],
            value: [0.0; BATCH],
            growth: [0.0; BATCH],
            ahead: [0.0; BATCH],
        }
    }
}

/// A bundle on its way.
#[derive(Clone, Copy)]
struct Lane {
    /// Its rays among the spans.
    first: usize,
    count: usize,
    end: f64,
    steps: u32,
}

/// A bundle before it starts.
struct Bundle {
    middle: Ray,
    radius: f64,
    spread: f64,
    clear: f64,
    end: f64,
}

impl Bundles {
    /// Moves the start of every span as far along as bundles of neighbouring spans can prove.
    pub(crate) fn approach(
        &mut self,
        surface: &Surface,
        rays: &[Ray],
        spans: &mut [Span],
        scratch: &mut Scratch,
        counts: &mut Counts,
    ) {
        for size in SIZES {
            if let Some(coarse) = &surface.coarse {
                self.follow(size, coarse, rays, spans, scratch, counts);
            }
            self.follow(size, surface, rays, spans, scratch, counts);
        }
    }

    /// Follows bundles of that many rays.
    fn follow(
        &mut self,
        size: usize,
        surface: &Surface,
        rays: &[Ray],
        spans: &mut [Span],
        scratch: &mut Scratch,
        counts: &mut Counts,
    ) {
        let mut first = 0;
        loop {
            while self.lanes.len() < BATCH && first < spans.len() {
                let count = size.min(spans.len() - first);
                self.start(surface, rays, &spans[first..first + count], first);
                first += count;
            }
            if self.lanes.is_empty() {
                break;
            }
            self.step(surface, spans, scratch, counts);
        }
    }

    fn start(&mut self, surface: &Surface, rays: &[Ray], spans: &[Span], first: usize) {
        let Some(bundle) = Bundle::around(surface, rays, spans) else {
            return;
        };
        let lane = self.lanes.len();
        let ray = &bundle.middle;
        self.paths
            .set(lane, ray.origin, ray.direction, ray.from_eye, ray.time);
        self.at.t[lane] = bundle.clear;
        self.at.radius[lane] = bundle.radius;
        self.at.spread[lane] = bundle.spread;
        self.lanes.push(Lane {
            first,
            count: spans.len(),
            end: bundle.end,
            steps: 0,
        });
    }

    /// One step of every bundle under way.
    fn step(
        &mut self,
        surface: &Surface,
        spans: &mut [Span],
        scratch: &mut Scratch,
        counts: &mut Counts,
    ) {
        let n = self.lanes.len();
        let Self {
            paths,
            batch,
            lanes,
            at,
        } = self;
        surface.level.vectorize(
            #[inline(always)]
            || batch.go(surface, n, paths, &at.t),
        );
        batch.evaluate(surface, n, paths, scratch);
        counts.evaluations += n as u64;
        counts.cone_steps += n as u64;
        for i in 0..n {
            let clearance = surface.clearances.at(batch.distance[i]);
            let pick = clearance.pick(batch.value[i]);
            (at.offset[i], at.slope[i]) = (pick.offset, pick.slope);
            at.reach[i] = clearance.reach;
        }
        let known = surface.clearances.known;
        surface.level.vectorize(
            #[inline(always)]
            || at.advance(n, known, paths, batch),
        );
        let split = split(surface.means);
        for i in (0..n).rev() {
            let lane = &mut lanes[i];
            let radius = at.radius[i] + at.spread[i] * at.t[i];
            let ahead = at.ahead[i];
            lane.steps += 1;
            at.t[i] += ahead;
            let is_near = surface.is_coarse() && !coarse::is_far(surface, batch, i);
            if !is_near && ahead > split * radius && at.t[i] <= lane.end && lane.steps < STEPS_MAX {
                continue;
            }
            counts.subdivisions += u64::from(at.t[i] <= lane.end);
            for span in &mut spans[lane.first..lane.first + lane.count] {
                if at.t[i] > span.clear {
                    span.clear = at.t[i];
                }
            }
            lanes.swap_remove(i);
            let last = lanes.len();
            if i < last {
                paths.copy(last, i);
                for row in [&mut at.t, &mut at.radius, &mut at.spread] {
                    row[i] = row[last];
                }
            }
        }
    }
}

impl Rows {
    /// How far ahead of its middle each bundle is free of roots.
    ///
    /// At a distance a ahead a ray's place is no farther from the middle's than the radius there, and so no
    /// farther than that and a from where the value is known; what is known of the field besides
    /// changes by `growth` along the middle, and across by no more than the way across.
    #[inline(always)]
    fn advance(&mut self, n: usize, known: Known, paths: &Paths, batch: &Batch) {
        assert!(n <= BATCH);
        let across = if known == Known::Nothing { 0.0 } else { 1.0 };
        self.value = batch.value;
        known.growths(n, &batch.place, &paths.direction, &mut self.growth);
        for i in 0..n {
            let (value, growth) = (self.value[i], self.growth[i]);
            let value = if value < f64::INFINITY { value } else { 0.0 };
            let slope = self.slope[i];
            let radius = self.radius[i] + self.spread[i] * self.t[i];
            let rest = value - self.offset[i] - (slope + across) * radius;
            let fall = slope - growth + (slope + across) * self.spread[i];
            let fall = if fall > FLAT { fall } else { FLAT };
            let ahead = rest * CAUTION / fall;
            let most = self.reach[i] - radius;
            let ahead = if ahead < most { ahead } else { most };
            self.ahead[i] = if ahead > 0.0 { ahead } else { 0.0 };
        }
    }
}

impl Bundle {
    /// The bundle of some rays; `None` if bounds do not hold for all of it.
    fn around(surface: &Surface, rays: &[Ray], spans: &[Span]) -> Option<Self> {
        if spans.len() < 2 {
            return None;
        }
        let chosen = || spans.iter().map(|span| &rays[span.ray]);
        let share = 1.0 / spans.len() as f64;
        let mut middle = *chosen().next()?;
        let time = middle.time;
        let (mut origin, mut direction, mut from_eye) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for ray in chosen() {
            if surface.moves && ray.time != time {
                return None;
            }
            origin += ray.origin - middle.origin;
            direction += ray.direction;
            from_eye += ray.from_eye;
        }
        middle.origin += origin * share;
        middle.direction = direction.normalize_or_zero();
        middle.from_eye = from_eye * share;
        let (mut radius, mut spread) = (0.0f64, 0.0f64);
        for ray in chosen() {
            // Footprints are measured from the eye: places as far from each other as their ways from it.
            let apart = [ray.origin - middle.origin, ray.from_eye - middle.from_eye];
            for apart in apart {
                let square = apart.dot(apart);
                radius = if square > radius { square } else { radius };
            }
            let apart = ray.direction - middle.direction;
            let square = apart.dot(apart);
            spread = if square > spread { square } else { spread };
        }
        let (mut clear, mut end) = (f64::INFINITY, 0.0f64);
        for span in spans {
            clear = if span.clear < clear {
                span.clear
            } else {
                clear
            };
            end = if span.end > end { span.end } else { end };
        }
        // Bounds hold within the widened bound: the middle has to stay there.
        let (near, far) = bound::clip(&widened(&surface.bound), middle.origin, middle.direction)?;
        (near <= clear && end <= far && middle.direction != DVec3::ZERO).then(|| Self {
            middle,
            radius: radius.sqrt() * (1.0 + 1e-12),
            spread: spread.sqrt() * (1.0 + 1e-12),
            clear,
            end,
        })
    }
}
