//! Clear heights: linear functions below the field over cells of the ground, built where a ray first asks for them.
//!
//! Over the column above a cell the field's affine form (thesis eq. (7.11)), less its own error, is a linear function of the
//! place that is nowhere above the field. Along a ray it is linear too: where it is positive at both ends of the ray's way
//! over the cell, nothing between them need be looked at. Cells are shared by all rays of the image, so that what a
//! cell costs is paid once. What has been built decides only what need not be looked at: no pixel depends on it.
//!
//! Cells grow with the distance from the eye, as footprints do: level k reaches 2ᵏ times as far as level 0, with cells as much
//! larger. A ray tries the coarse levels first, and ends where the finest cell does not let it pass.

use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::OnceLock;

use field::{Cell, Interval, Program};
use glam::DVec3;
use scene::description::Bound;

use super::bundle::Span;
use super::clearance::widened;
use super::tracer::Ray;
use crate::error::Cancelled;
use crate::view::Footprint;

/// Columns are wider than their cells by this share of half a side: for rounding, and for the steps from one to the next.
const ROOM: f64 = 1e-3;

/// The share of a side by which a ray goes over a border, to be in the next cell: less than the room there.
const NUDGE: f64 = 1e-4;

/// Relative room for the rounding of linear functions.
const CAUTION: f64 = 1e-9;

/// The same for coordinates far from the origin, beside the side of a cell.
const ROUNDING: f64 = 1e-14;

/// The least side of a cell, as a share of the eye's coordinates: places in it are then exact enough.
const SIDE_MIN: f64 = 1e-9;

/// Levels that are tried at a place.
const DEPTH: usize = 4;

/// Most levels: the last reaches half a million times as far as the first.
const LEVELS_MAX: usize = 20;

/// Rays that are led side by side.
const SIDE_BY_SIDE: usize = 32;

/// Most tries along one ray.
const TRIES_MAX: u32 = 512;

/// Cells from the eye to the edge of a level, at least and at most: 65,536 cells of 40 bytes a level, allocated where some ray comes there.
const HALF: [f64; 2] = [4.0, 128.0];

/// One such cell for each so many of the square root of the image's rays. A cell takes as long as a hundred steps of single rays.
const RAYS_PER_HALF: f64 = 14.0;

/// The first level reaches so many times the tables' nearest distance.
const REACH: f64 = 8.0;

/// What being led costs a ray, cells included, in evaluations of a value: as measured on terrains.
pub(crate) const COST: f64 = 10.0;

/// Where the error over a cell below the eye is more than this share of the bound's height, cells say too little.
const ERROR_MAX: f64 = 0.25;

/// A linear function that is nowhere above the field over a cell.
#[derive(Clone, Copy, Debug)]
struct Below {
    /// At the eye, as if the function went on there.
    value: f64,
    /// Per metre.
    slope: DVec3,
}

/// Cells of one size around the eye, row by row; empty until some ray comes there.
#[derive(Debug)]
struct Level {
    side: f64,
    /// One over it.
    inverse: f64,
    /// How far from the eye it serves rays, by the larger of x and y: not as far as its cells go, for rounding.
    reach: f64,
    cells: OnceLock<Box<[OnceLock<Below>]>>,
}

/// The ground around the eye of one image.
#[derive(Debug)]
pub(crate) struct Ground {
    eye: DVec3,
    travel: f64,
    footprint: Footprint,
    /// Between these heights every ray looks for the surface.
    heights: Interval,
    /// Cells from the eye to the edge of a level.
    half: usize,
    levels: Vec<Level>,
}

/// What the ground of an image is made for.
pub(crate) struct Site<'a> {
    /// The surface's field, which must not move.
    pub(crate) field: &'a Program,
    /// Where the surface can be.
    pub(crate) bound: &'a Bound,
    /// The law of footprints.
    pub(crate) footprint: Footprint,
    /// The eye when the shutter opens.
    pub(crate) eye: DVec3,
    /// How far it moves while the shutter is open.
    pub(crate) travel: f64,
    /// About how near the surface is: where cells begin to grow.
    pub(crate) nearest: f64,
    /// Camera rays of the image.
    pub(crate) rays: f64,
}

impl Ground {
    /// The ground, if cells of it say anything: below an eye with perspective, over a plane.
    pub(crate) fn new(site: &Site<'_>) -> Option<Self> {
        let eye = site.eye;
        let (low, high, farthest) = match widened(site.bound) {
            Bound::Shell { .. } => return None,
            Bound::Slab { low, high } => (low, high, f64::INFINITY),
            Bound::Box { min, max } => {
                let corners = [
                    min[0] - eye.x,
                    min[1] - eye.y,
                    max[0] - eye.x,
                    max[1] - eye.y,
                ];
                let farthest = corners.into_iter().map(f64::abs).fold(0.0, larger);
                (min[2], max[2], farthest)
            }
        };
        if site.footprint.angle <= 0.0 || !(low < high && (high - low).is_finite()) {
            return None;
        }
        let [least, most] = HALF;
        let half = (site.rays.sqrt() / RAYS_PER_HALF).clamp(least, most).ceil();
        let reach = site.nearest * REACH;
        if reach / half < eye.abs().max_element() * SIDE_MIN {
            return None;
        }
        let mut levels = Vec::new();
        let mut far = reach;
        while levels.len() < LEVELS_MAX {
            levels.push(Level {
                side: far / half,
                inverse: half / far,
                reach: (1.0 - 1.0 / HALF[1]) * far,
                cells: OnceLock::new(),
            });
            if far > farthest {
                break;
            }
            far *= 2.0;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small whole number"
        )]
        let ground = Self {
            eye,
            travel: site.travel,
            footprint: site.footprint,
            heights: Interval::new(low, high),
            half: half as usize,
            levels,
        };
        let column = ground.column(ground.levels[0].side, [0.5, 0.5]);
        let error = site.field.over_cell(&column.cell).error;
        (error < ERROR_MAX * (high - low)).then_some(ground)
    }

    /// Moves the start of every span to where the ground under its ray is no longer proven clear.
    pub(crate) fn lead(
        &self,
        field: &Program,
        rays: &[Ray],
        spans: &mut [Span],
        cancel: &AtomicBool,
    ) -> Result<(), Cancelled> {
        let mut waiting = spans.iter_mut();
        let mut leads: Vec<Lead<'_>> = Vec::with_capacity(SIDE_BY_SIDE);
        loop {
            while leads.len() < SIDE_BY_SIDE {
                let Some(span) = waiting.next() else {
                    break;
                };
                leads.push(Lead {
                    way: Way::new(&rays[span.ray], self.eye, span.end),
                    level: self.levels.len() - 1,
                    finest: 0,
                    was_clear: true,
                    tries: 0,
                    span,
                });
            }
            if leads.is_empty() {
                return Ok(());
            }
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            // A try waits for cells and divisions; those of other rays fill the time.
            for i in (0..leads.len()).rev() {
                if !self.goes_on(field, &mut leads[i]) {
                    leads.swap_remove(i);
                }
            }
        }
    }

    /// One try of a ray, which meets nothing before its span's start; says whether to try again.
    #[inline]
    fn goes_on(&self, field: &Program, lead: &mut Lead<'_>) -> bool {
        let Lead { way, span, .. } = lead;
        let last = self.levels.len() - 1;
        let place = way.at(span.clear);
        let far = larger(place.x.abs(), place.y.abs());
        while far >= self.levels[lead.finest].reach {
            if lead.finest == last {
                return false;
            }
            lead.finest += 1;
        }
        // Rays come nearer, too, but then what is coarser there serves them.
        let coarsest = last.min(lead.finest + DEPTH - 1);
        lead.level = lead.level.clamp(lead.finest, coarsest);
        let Some(over) = self.over(field, lead.level, way, span.clear) else {
            return false;
        };
        if over.exit <= span.clear {
            return false;
        }
        let is_clear = over.clear == over.exit;
        let is_done = over.clear >= span.end || (!is_clear && lead.level == lead.finest);
        span.clear = over.clear;
        lead.level = if !is_clear {
            lead.level.saturating_sub(1)
        } else if lead.was_clear {
            lead.level + 1
        } else {
            lead.level
        };
        lead.was_clear = is_clear;
        lead.tries += 1;
        !is_done && lead.tries < TRIES_MAX
    }

    /// What the cell that a ray goes over from `t` on says; `None` where the level has none.
    fn over(&self, field: &Program, level: usize, way: &Way, t: f64) -> Option<Over> {
        let Level {
            side,
            inverse,
            cells,
            ..
        } = &self.levels[level];
        let count = 2 * self.half;
        let cells = cells.get_or_init(|| {
            let mut cells = Vec::new();
            cells.resize_with(count * count, OnceLock::new);
            cells.into_boxed_slice()
        });
        let ahead = way.at(t + NUDGE * side * way.per_metre);
        let corner = [floor(ahead.x * inverse), floor(ahead.y * inverse)];
        let [column, row] = corner.map(|cell| cell + self.half as f64);
        if !(column >= 0.0 && row >= 0.0 && column < count as f64 && row < count as f64) {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole and in range"
        )]
        let index = row as usize * count + column as usize;
        let below = cells[index].get_or_init(|| self.below(field, *side, corner));
        let exit = way.leaves(*side, corner);
        // Along the ray it is a line.
        let first = below.value + below.slope.dot(way.origin);
        let rate = below.slope.dot(way.direction);
        let (near, far) = (first + rate * t, first + rate * exit);
        // Where it is not positive all the way, as far as it is.
        let clear = if near > 0.0 && far > 0.0 {
            exit
        } else if near > 0.0 {
            t + (exit - t) * (near / (near - far)) * (1.0 - CAUTION)
        } else {
            t
        };
        Some(Over { clear, exit })
    }

    /// The function below the field over a cell.
    fn below(&self, field: &Program, side: f64, corner: [f64; 2]) -> Below {
        let Column { cell, half, centre } = self.column(side, corner.map(|cell| cell + 0.5));
        let form = field.over_cell(&cell);
        let slope = DVec3::from(form.along) / half;
        let size = form.centre.abs() + form.radius();
        let rounding = size * CAUTION + slope.abs().element_sum() * self.size() * ROUNDING;
        Below {
            value: form.centre - form.error - rounding - slope.dot(centre - self.eye),
            slope,
        }
    }

    /// The column above a cell whose middle is so many sides from the eye.
    fn column(&self, side: f64, middle: [f64; 2]) -> Column {
        let Interval { low, high } = self.heights;
        let [x, y] = middle.map(|at| at * side);
        let wide = 0.5 * side * (1.0 + 2.0 * ROOM);
        let half = DVec3::new(wide, wide, 0.5 * (high - low) * (1.0 + ROOM));
        let centre = DVec3::new(self.eye.x + x, self.eye.y + y, 0.5 * (low + high));
        let [a, b, c] = half.to_array();
        let edges = [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]];
        let mut cell = Cell::of_edges(centre.to_array(), edges);
        let apart = (centre - self.eye).abs();
        let nearest = (apart - half).max(DVec3::ZERO).length() - self.travel;
        let farthest = (apart + half).length() + self.travel;
        cell.footprint = Interval::new(
            self.footprint.at(larger(nearest, 0.0)) * (1.0 - CAUTION),
            self.footprint.at(farthest) * (1.0 + CAUTION),
        );
        Column { cell, centre, half }
    }

    /// No coordinate of a place before the last level's edge is larger.
    fn size(&self) -> f64 {
        let Interval { low, high } = self.heights;
        self.eye.abs().max_element() + self.travel + low.abs() + high.abs()
    }
}

/// A ray that is led.
struct Lead<'a> {
    span: &'a mut Span,
    way: Way,
    /// The level to try next.
    level: usize,
    /// The finest level that reaches where the ray is.
    finest: usize,
    /// Whether its last cell was clear.
    was_clear: bool,
    tries: u32,
}

/// A column above a cell, in world metres.
struct Column {
    cell: Cell,
    centre: DVec3,
    half: DVec3,
}

/// What a cell says of a ray.
struct Over {
    /// The field is positive up to there,
    clear: f64,
    /// and there the ray leaves the cell, or ends.
    exit: f64,
}

/// A ray, as seen from the eye.
struct Way {
    origin: DVec3,
    direction: DVec3,
    end: f64,
    /// One over x and y of the direction.
    inverse: [f64; 2],
    /// By how much t grows for each metre along the larger of x and y.
    per_metre: f64,
}

impl Way {
    fn new(ray: &Ray, eye: DVec3, end: f64) -> Self {
        let direction = ray.direction;
        let across = larger(direction.x.abs(), direction.y.abs());
        Self {
            origin: ray.origin - eye,
            direction,
            end,
            inverse: [1.0 / direction.x, 1.0 / direction.y],
            per_metre: 1.0 / larger(across, f64::MIN_POSITIVE),
        }
    }

    fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// Where it leaves a cell, or ends.
    fn leaves(&self, side: f64, corner: [f64; 2]) -> f64 {
        let mut exit = self.end;
        for (axis, low) in corner.into_iter().enumerate() {
            let direction = self.direction[axis];
            if direction == 0.0 {
                continue;
            }
            let edge = if direction > 0.0 { low + 1.0 } else { low };
            let t = (edge * side - self.origin[axis]) * self.inverse[axis];
            exit = if t < exit { t } else { exit };
        }
        exit
    }
}

/// The whole number below one that cells are counted with; others are beyond all cells.
///
/// Without an instruction of its own, [`f64::floor`] is a call that takes as long as a cell's function.
#[expect(
    clippy::cast_possible_truncation,
    reason = "what is out of range stays beyond all cells"
)]
fn floor(a: f64) -> f64 {
    let whole = f64::from(a as i32);
    if whole > a { whole - 1.0 } else { whole }
}

fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
