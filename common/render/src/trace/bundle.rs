//! Rays that stay close to each other are followed together as far as one answer serves all of them.
//!
//! A bundle is a path along the middle of its rays and a radius r(t) that holds every ray's place
//! at t. One value in the middle, or one value and its gradient, proves a stretch of space free of roots for all of them, thesis §7.2.
//! Where the radius no longer matters little, the bundle splits in four; single rays go on from
//! there ([`super::search`]). Bundles only say what need not be looked at: no pixel depends on them.

use core::ops::Range;

use field::{BATCH, Scratch};
use glam::DVec3;
use scene::description::Bound;

use super::batch::{Batch, Lanes, Paths};
use super::bound;
use super::clearance::{CAUTION, FLAT, Known, widened};
use super::coarse;
use super::cone::Cone;
use super::means::Means;
use super::surface::Surface;
use super::tracer::Ray;
use crate::counts::Counts;

/// Cones in the next larger one, and rays in the smallest.
const PARTS: usize = 4;

/// Rays of the bundles.
const SIZES: [usize; 3] = [PARTS, PARTS * PARTS, PARTS * PARTS * PARTS];

/// A bundle splits where it may step no farther than this share of its radius: sooner where single rays see more.
fn least_share(means: Means) -> f64 {
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
    /// Around neighbouring rays, as many as each size says.
    cones: [Vec<Cone>; SIZES.len()],
    /// Bundles to follow, the next one last.
    waiting: Vec<Bundle>,
}

/// Where the bundles stand, and how wide they are: `radius` + `spread` · t.
#[repr(align(64))]
struct Rows {
    t: Lanes,
    radius: Lanes,
    spread: Lanes,
    /// How far rays are from the middle along it: `lean` + `leaning` · t at most.
    lean: Lanes,
    leaning: Lanes,
    offset: Lanes,
    slope: Lanes,
    tangent_offset: Lanes,
    tangent_slope: Lanes,
    curvature: Lanes,
    gradient: [Lanes; 3],
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
            lean: [0.0; BATCH],
            leaning: [0.0; BATCH],
            offset: [0.0; BATCH],
            slope: [0.0; BATCH],
            tangent_offset: [f64::INFINITY; BATCH],
            tangent_slope: [0.0; BATCH],
            curvature: [1.0; BATCH],
            gradient: [[0.0; BATCH]; 3],
            reach: [0.0; BATCH],
            value: [0.0; BATCH],
            growth: [0.0; BATCH],
            ahead: [0.0; BATCH],
        }
    }
}

/// Which bundle.
#[derive(Clone, Copy)]
struct Bundle {
    /// Its size's place among all.
    size: usize,
    /// Its place among those of its size.
    index: usize,
}

impl Bundle {
    /// Its rays among so many spans.
    fn rays(self, spans: usize) -> Range<usize> {
        let size = SIZES[self.size];
        let first = self.index * size;
        first..spans.min(first + size)
    }
}

/// A bundle on its way.
#[derive(Clone, Copy)]
struct Lane {
    bundle: Bundle,
    end: f64,
    steps: u32,
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
        self.surround(rays, spans);
        if let Some(coarse) = &surface.coarse {
            self.follow(coarse, rays, spans, scratch, counts);
        }
        self.follow(surface, rays, spans, scratch, counts);
    }

    /// Puts cones of every size around the rays of neighbouring spans.
    fn surround(&mut self, rays: &[Ray], spans: &[Span]) {
        let around_rays = |spans: &[Span]| {
            let rays = spans.iter().map(|span| Cone::from(&rays[span.ray]));
            Cone::around(rays)
        };
        let around = |cones: &[Cone]| Cone::around(cones.iter().copied());
        let [small, middle, large] = &mut self.cones;
        small.clear();
        small.extend(spans.chunks(PARTS).filter_map(around_rays));
        middle.clear();
        middle.extend(small.chunks(PARTS).filter_map(around));
        large.clear();
        large.extend(middle.chunks(PARTS).filter_map(around));
    }

    /// Follows all bundles, the largest first: where one ends, its parts begin, so that there are as many under way as there can be.
    fn follow(
        &mut self,
        surface: &Surface,
        rays: &[Ray],
        spans: &mut [Span],
        scratch: &mut Scratch,
        counts: &mut Counts,
    ) {
        let bound = widened(&surface.bound);
        let largest = SIZES.len() - 1;
        let all = 0..self.cones[largest].len();
        self.waiting.clear();
        self.waiting.extend(all.rev().map(|index| Bundle {
            size: largest,
            index,
        }));
        loop {
            while self.lanes.len() < BATCH {
                let Some(bundle) = self.waiting.pop() else {
                    break;
                };
                self.start(surface, &bound, rays, spans, bundle);
            }
            if self.lanes.is_empty() {
                break;
            }
            self.step(surface, spans, scratch, counts);
        }
    }

    /// Begins to follow a bundle, or its parts where bounds do not hold for all of it.
    fn start(
        &mut self,
        surface: &Surface,
        bound: &Bound,
        rays: &[Ray],
        spans: &[Span],
        bundle: Bundle,
    ) {
        let spans = &spans[bundle.rays(spans.len())];
        let (mut clear, mut end) = (f64::INFINITY, 0.0f64);
        for span in spans {
            clear = if span.clear < clear {
                span.clear
            } else {
                clear
            };
            end = if span.end > end { span.end } else { end };
        }
        if spans.len() < 2 || clear > end {
            return;
        }
        let cone = &self.cones[bundle.size][bundle.index];
        let is_of_one_time = |span: &Span| rays[span.ray].time == cone.time;
        let is_one = !surface.moves || spans.iter().all(is_of_one_time);
        // Bounds hold within the widened bound: the middle has to stay there.
        let within = bound::clip(bound, cone.origin, cone.direction);
        let holds = within.is_some_and(|(near, far)| near <= clear && end <= far);
        if !is_one || !holds || cone.direction == DVec3::ZERO {
            self.split(bundle);
            return;
        }
        let lane = self.lanes.len();
        self.paths
            .set(lane, cone.origin, cone.direction, cone.from_eye, cone.time);
        self.at.t[lane] = clear;
        self.at.radius[lane] = cone.radius;
        self.at.spread[lane] = cone.spread;
        self.at.lean[lane] = cone.lean;
        self.at.leaning[lane] = cone.leaning;
        self.lanes.push(Lane {
            bundle,
            end,
            steps: 0,
        });
    }

    /// Follows a bundle's parts next.
    fn split(&mut self, bundle: Bundle) {
        let Some(size) = bundle.size.checked_sub(1) else {
            return;
        };
        let first = bundle.index * PARTS;
        let parts = first..self.cones[size].len().min(first + PARTS);
        self.waiting
            .extend(parts.rev().map(|index| Bundle { size, index }));
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
            paths, batch, at, ..
        } = self;
        surface.level.vectorize(
            #[inline(always)]
            || batch.go(surface, n, paths, &at.t),
        );
        if surface.gradients {
            batch.evaluate_gradient(surface, n, paths, scratch);
        } else {
            batch.evaluate(surface, n, paths, scratch);
        }
        counts.evaluations += n as u64;
        counts.cone_steps += n as u64;
        for i in 0..n {
            let clearance = surface.clearances.at(batch.distance[i]);
            let pick = clearance.pick(batch.value[i]);
            (at.offset[i], at.slope[i]) = (pick.offset, pick.slope);
            at.reach[i] = clearance.reach;
            if surface.gradients {
                let tangent = &clearance.tangent;
                at.tangent_offset[i] = tangent.offset;
                at.tangent_slope[i] = tangent.slope;
                at.curvature[i] = tangent.curvature;
            }
        }
        let known = surface.clearances.known;
        surface.level.vectorize(
            #[inline(always)]
            || {
                at.advance(n, known, paths, batch);
                if surface.gradients {
                    at.advance_by_tangents(n, paths, batch);
                }
            },
        );
        let share = least_share(surface.means);
        for i in (0..n).rev() {
            let lane = &mut self.lanes[i];
            let at = &mut self.at;
            let radius = at.radius[i] + at.spread[i] * at.t[i];
            let ahead = at.ahead[i];
            lane.steps += 1;
            at.t[i] += ahead;
            let is_near = surface.is_coarse() && !coarse::is_far(surface, &self.batch, i);
            let is_through = at.t[i] > lane.end;
            if !is_near && ahead > share * radius && !is_through && lane.steps < STEPS_MAX {
                continue;
            }
            counts.subdivisions += u64::from(!is_through);
            let bundle = lane.bundle;
            let count = spans.len();
            for span in &mut spans[bundle.rays(count)] {
                if at.t[i] > span.clear {
                    span.clear = at.t[i];
                }
            }
            self.lanes.swap_remove(i);
            let last = self.lanes.len();
            if i < last {
                self.paths.copy(last, i);
                for row in [
                    &mut at.t,
                    &mut at.radius,
                    &mut at.spread,
                    &mut at.lean,
                    &mut at.leaning,
                ] {
                    row[i] = row[last];
                }
            }
            // From near a coarse surface the whole one goes on.
            if !is_through && !is_near {
                self.split(bundle);
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

    /// The same by the tangent in the middle, where that reaches farther.
    ///
    /// A ray's place a ahead is h = a d + w from where the value and its gradient g are known, with w no longer than the
    /// radius there, and h's square no more than a² + w² + 2 a times what w has along d. By Taylor's theorem the
    /// field is no less there than value + g h − offset − slope |h| − ½ curvature h².
    #[inline(always)]
    fn advance_by_tangents(&mut self, n: usize, paths: &Paths, batch: &Batch) {
        assert!(n <= BATCH);
        self.gradient = batch.gradient;
        let [x, y, z] = &self.gradient;
        let [dx, dy, dz] = &paths.direction;
        for i in 0..n {
            let value = self.value[i];
            let value = if value < f64::INFINITY { value } else { 0.0 };
            let along = x[i] * dx[i] + y[i] * dy[i] + z[i] * dz[i];
            let square = x[i] * x[i] + y[i] * y[i] + z[i] * z[i] - along * along;
            let across = if square > 0.0 { square.sqrt() } else { 0.0 };
            let (radius, spread) = (self.radius[i] + self.spread[i] * self.t[i], self.spread[i]);
            let (lean, leaning) = (self.lean[i] + self.leaning[i] * self.t[i], self.leaning[i]);
            let (slope, curvature) = (self.tangent_slope[i], self.curvature[i]);
            let size = if along > 0.0 { along } else { -along };
            let across = across * (1.0 + 1e-9) + slope;
            let rest = value
                - self.tangent_offset[i]
                - across * radius
                - size * lean
                - 0.5 * curvature * radius * radius;
            let growth = along
                - slope
                - across * spread
                - size * leaning
                - curvature * (radius * spread + lean);
            let bend = curvature * (1.0 + spread * spread + 2.0 * leaning);
            let rest = rest * CAUTION;
            let root = (growth * growth + 2.0 * bend * rest).sqrt();
            let near = 2.0 * rest / (root - growth);
            let far = (root + growth) * CAUTION / if bend > FLAT { bend } else { FLAT };
            let ahead = if growth > 0.0 { far } else { near };
            let most = self.reach[i] - radius;
            let ahead = if ahead < most { ahead } else { most };
            let proves = (rest > 0.0) & (ahead > self.ahead[i]);
            self.ahead[i] = if proves { ahead } else { self.ahead[i] };
        }
    }
}
