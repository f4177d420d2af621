//! The state of the lanes of a search, and what a value at each does to it.
//!
//! Lanes are at different points of their searches, so that branches would be mispredicted: all of
//! it is computed for each, in loops over rows that become vectors.

use field::BATCH;

use crate::trace::batch::{Batch, Lanes, Paths};
use crate::trace::clearance::{CAUTION, FLAT, Known};
use crate::trace::grid::StepRows;

/// The share of the way to where both ends of a step would just meet, if the field went on as its
/// tangent does. Steps reach there: up to about twice as far as proven.
const FORESIGHT: f64 = 0.9;

/// From where on the way to the tangent's root counts as nearly proven: steps then go to the root itself.
const NEARLY: f64 = 0.6;

/// How many points of its grid a ray looks ahead at first.
const FIRST: f64 = 16.0;

/// By how much a ray looks farther ahead than it could the last time, where that does not follow from the field.
const FARTHER: f64 = 1.3;

/// Lanes are computed in multiples of this, so that vector loops have no scalar rest.
const STEP: usize = 8;

/// The state of the lanes: distances along the rays, all of them points of the rays' grids.
#[repr(align(64))]
pub(super) struct Rows {
    /// The grids of the rays.
    pub(super) steps: StepRows,
    /// The last point worth looking at.
    pub(super) end: Lanes,
    /// All points before this one are known to be outside.
    pub(super) clear: Lanes,
    /// The point whose value is wanted.
    pub(super) at: Lanes,
    /// A point known to be inside, or infinity.
    pub(super) inside: Lanes,
    pub(super) inside_value: Lanes,
    /// The last point evaluated and found outside, with all before it.
    pub(super) outside: Lanes,
    pub(super) outside_value: Lanes,
    /// Evaluations so far.
    pub(super) count: Lanes,
    /// 1 where a step was taken back.
    pub(super) back: Lanes,
    /// 1 where the surface cannot be, 0 elsewhere.
    pub(super) cut: Lanes,
    pub(super) offset: Lanes,
    pub(super) slope: Lanes,
    pub(super) tangent_offset: Lanes,
    pub(super) tangent_slope: Lanes,
    pub(super) curvature: Lanes,
    pub(super) reach: Lanes,
    /// The value at the point, and its derivative along the ray.
    value: Lanes,
    derivative: Lanes,
    /// How fast the known part of the field grows there.
    growth: Lanes,
    /// What values and derivatives may be wrong by.
    pub(super) error: Lanes,
    pub(super) slope_error: Lanes,
    /// How far ahead it is worth looking.
    pub(super) limit: Lanes,
    /// How far to look at least and at most.
    pub(super) least: Lanes,
    pub(super) most: Lanes,
    /// How fast the derivative's range was seen to spread, 0 before the first look.
    pub(super) bend: Lanes,
    /// How far ahead the field is proven to be positive by its own ranges.
    pub(super) seen: Lanes,
    /// How far behind the point it is proven to be positive so.
    pub(super) looked_back: Lanes,
    /// How far ahead and back of the point no root can be.
    ahead: Lanes,
    behind: Lanes,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            steps: StepRows::default(),
            end: [0.0; BATCH],
            clear: [0.0; BATCH],
            at: [0.0; BATCH],
            inside: [0.0; BATCH],
            inside_value: [0.0; BATCH],
            outside: [0.0; BATCH],
            outside_value: [0.0; BATCH],
            count: [0.0; BATCH],
            back: [0.0; BATCH],
            cut: [0.0; BATCH],
            offset: [0.0; BATCH],
            slope: [0.0; BATCH],
            tangent_offset: [0.0; BATCH],
            tangent_slope: [0.0; BATCH],
            curvature: [0.0; BATCH],
            reach: [0.0; BATCH],
            value: [0.0; BATCH],
            derivative: [0.0; BATCH],
            growth: [0.0; BATCH],
            error: [0.0; BATCH],
            slope_error: [0.0; BATCH],
            limit: [0.0; BATCH],
            least: [0.0; BATCH],
            most: [0.0; BATCH],
            bend: [0.0; BATCH],
            seen: [0.0; BATCH],
            looked_back: [0.0; BATCH],
            ahead: [0.0; BATCH],
            behind: [0.0; BATCH],
        }
    }
}

impl Rows {
    /// Takes the way from the last point outside for the derivative: it proves nothing, and foresees well enough.
    pub(super) fn chords(&self, n: usize, batch: &mut Batch) {
        for i in 0..n {
            let way = self.at[i] - self.outside[i];
            let slope = (batch.value[i] - self.outside_value[i]) / way;
            batch.slope[i] = if slope.is_finite() { slope } else { 0.0 };
        }
    }

    /// How far to look: past the ray's end there is nothing to be seen. If the lanes' `bends` are used, between the next
    /// points and as far as bounds hold; else a little farther than the last time.
    pub(super) fn look(&mut self, n: usize, bends: bool) {
        for i in 0..n {
            let (at, end) = (self.at[i], self.end[i]);
            let steps = self.steps.at(i);
            let gap = steps.after(at) - at;
            self.limit[i] = steps.after(end) - at;
            let least = 2.0 * gap;
            let wanted = if self.count[i] == 0.0 {
                FIRST * gap
            } else if bends {
                self.reach[i]
            } else {
                let guess = FARTHER * self.seen[i];
                if guess > least { guess } else { least }
            };
            let most = if wanted < self.reach[i] {
                wanted
            } else {
                self.reach[i]
            };
            self.most[i] = most;
            self.least[i] = if least < most { least } else { most };
            self.bend[i] = if bends { self.bend[i] } else { 0.0 };
        }
    }

    /// What the values at the first `n` lanes' points prove, and where to look next: beyond that only if the next
    /// step `is_foreseen`.
    #[inline(always)]
    pub(super) fn advance(
        &mut self,
        n: usize,
        known: Known,
        paths: &Paths,
        batch: &Batch,
        is_foreseen: bool,
    ) {
        let n = n.next_multiple_of(STEP);
        assert!(n <= BATCH);
        // Copies, for all that follows to lie in one place: the compiler then sees that no row is another.
        self.value = batch.value;
        self.derivative = batch.slope;
        known.growths(n, &batch.place, &paths.direction, &mut self.growth);
        for i in 0..n {
            (self.ahead[i], self.behind[i]) = self.spans(i);
        }
        for i in 0..n {
            self.advance_one(i, is_foreseen);
        }
    }

    /// What the value at a lane's point proves, and where to look next.
    #[inline(always)]
    fn advance_one(&mut self, i: usize, is_foreseen: bool) {
        let steps = self.steps.at(i);
        let (at, clear) = (self.at[i], self.clear[i]);
        let (value, slope) = (self.value[i], self.derivative[i]);
        let (ahead, behind) = (self.ahead[i], self.behind[i]);
        let is_outside = (value > 0.0) | (self.cut[i] > 0.0);
        let proof = proof(value);
        let uncovered = clear <= at - behind;
        let gap = (at > clear) & uncovered;
        // Inside, or outside with a gap before it: back to the first point that is not proven.
        let passes = is_outside & !gap;
        let (inside, inside_value) = if is_outside {
            (self.inside[i], self.inside_value[i])
        } else {
            (at, value)
        };
        let next = steps.after(at);
        let proven = steps.from(at + ahead);
        let proven = if proven > next { proven } else { next };
        let new_clear = if passes { proven } else { clear };

        // Where this step and the next would just meet, with the value falling as the tangent does:
        // x = ahead + behind · (value + slope x)/value.
        let fall = -slope * behind / proof;
        let rate = 1.0 + if fall > -0.5 { fall } else { -0.5 };
        let meet = FORESIGHT * (ahead + behind) / rate;
        let root = proof / -slope;
        // Nothing proven, nothing foreseen: then it may not be a number.
        let meet = if is_foreseen & (meet > ahead) {
            meet
        } else {
            ahead
        };
        // The last point within reach: one beyond would not be covered. Past the root it need not be.
        let target = if is_foreseen & (slope < 0.0) & (ahead > NEARLY * root) {
            steps.from(at + root)
        } else {
            steps.before(steps.from(at + meet))
        };
        let most = if inside < f64::INFINITY {
            steps.before(inside)
        } else {
            self.end[i]
        };
        let target = if target < most { target } else { most };
        let target = if target > new_clear {
            target
        } else {
            new_clear
        };

        self.back[i] = if !passes & (at > clear) { 1.0 } else { 0.0 };
        self.at[i] = if passes { target } else { clear };
        self.outside[i] = if passes { at } else { self.outside[i] };
        self.outside_value[i] = if passes { value } else { self.outside_value[i] };
        self.inside[i] = inside;
        self.inside_value[i] = inside_value;
        self.clear[i] = new_clear;
        self.count[i] += 1.0;
    }

    /// How far ahead and back of a lane's point no root can be.
    #[inline(always)]
    fn spans(&self, i: usize) -> (f64, f64) {
        let (value, growth, slope) = (proof(self.value[i]), self.growth[i], self.derivative[i]);
        let most = |a: f64, b: f64| if a > b { a } else { b };
        // By the change: it falls by no more than slope − growth per metre ahead, slope + growth back.
        let rest = (value - self.offset[i]) * CAUTION;
        let (fall, rise) = (self.slope[i] - growth, self.slope[i] + growth);
        let (fall, rise) = (most(fall, FLAT), most(rise, FLAT));
        // With one division.
        let share = rest / (fall * rise);
        let (ahead, behind) = (share * rise, share * fall);
        // By the tangent: where value + h s − ½ c s² meets zero, from the root of the larger size.
        let rest = most(value - self.tangent_offset[i], 0.0) * CAUTION;
        let c = self.curvature[i];
        let solve = |h: f64| {
            let size = (h * h + 2.0 * c * rest).sqrt();
            let near = 2.0 * rest / (size - h);
            let far = (size + h) * CAUTION / most(c, FLAT);
            if h > 0.0 { far } else { near }
        };
        let limit = self.tangent_slope[i];
        let (tangent_ahead, tangent_behind) = (solve(slope - limit), solve(-slope - limit));
        let proves = rest > 0.0;
        let cut = |a: f64, b: f64| {
            let b = if proves { b } else { 0.0 };
            let span = most(most(a, b), 0.0);
            if span < self.reach[i] {
                span
            } else {
                self.reach[i]
            }
        };
        // What has been seen needs no table, and holds as far as it goes.
        (
            most(cut(ahead, tangent_ahead), self.seen[i]),
            most(cut(behind, tangent_behind), self.looked_back[i]),
        )
    }
}

/// The value, if it proves anything about its surroundings, else 0: one that is not finite does not.
#[inline(always)]
fn proof(value: f64) -> f64 {
    if (value > 0.0) & (value < f64::INFINITY) {
        value
    } else {
        0.0
    }
}
