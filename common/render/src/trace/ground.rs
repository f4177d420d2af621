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
    /// In the cell's middle, half as high as the bound.
    value: f64,
    /// Per metre.
    slope: DVec3,
}

/// Cells of one size around the eye, row by row; empty until some ray comes there.
#[derive(Debug)]
struct Level {
    side: f64,
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
    /// How far the first level reaches, by the larger of x and y.
    reach: f64,
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
            reach,
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
        for span in spans {
            if cancel.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            span.clear = self.clear(field, &rays[span.ray], span.clear, span.end);
        }
        Ok(())
    }

    /// How far a ray meets nothing, if it meets nothing before `t`: at most `end`.
    fn clear(&self, field: &Program, ray: &Ray, mut t: f64, end: f64) -> f64 {
        let way = Way::new(ray, self.eye, end);
        let last = self.levels.len() - 1;
        let mut level = last;
        let mut finest = 0;
        for _ in 0..TRIES_MAX {
            let place = way.at(t);
            let far = larger(place.x.abs(), place.y.abs());
            while far
                >= (1.0 - 1.0 / HALF[1]) * self.reach * self.levels[finest].side
                    / self.levels[0].side
            {
                if finest == last {
                    return t;
                }
                finest += 1;
            }
            // Rays come nearer, too, but then what is coarser there serves them.
            level = level.clamp(finest, last.min(finest + DEPTH - 1));
            let Some(over) = self.over(field, level, &way, t) else {
                return t;
            };
            if over.exit <= t {
                return t;
            }
            t = over.clear;
            if t >= end {
                return end;
            }
            if over.clear == over.exit {
                level += 1;
            } else if level == finest {
                return t;
            } else {
                level -= 1;
            }
        }
        t
    }

    /// What the cell that a ray goes over from `t` on says; `None` where the level has none.
    fn over(&self, field: &Program, level: usize, way: &Way, t: f64) -> Option<Over> {
        let Level { side, cells } = &self.levels[level];
        let count = 2 * self.half;
        let cells = cells.get_or_init(|| {
            let mut cells = Vec::new();
            cells.resize_with(count * count, OnceLock::new);
            cells.into_boxed_slice()
        });
        let ahead = way.at(t + NUDGE * side * way.per_metre);
        let corner = [(ahead.x / side).floor(), (ahead.y / side).floor()];
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
        let middle = corner.map(|cell| cell + 0.5);
        let below = cells[index].get_or_init(|| self.below(field, *side, middle));
        let exit = way.leaves(*side, corner);
        let centre = self.column(*side, middle).centre - self.eye;
        let at = |t: f64| below.value + below.slope.dot(way.at(t) - centre);
        let (near, far) = (at(t), at(exit));
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
    fn below(&self, field: &Program, side: f64, middle: [f64; 2]) -> Below {
        let Column { cell, half, .. } = self.column(side, middle);
        let form = field.over_cell(&cell);
        let slope = DVec3::from(form.along) / half;
        let size = form.centre.abs() + form.radius();
        let rounding = size * CAUTION + slope.abs().element_sum() * self.size() * ROUNDING;
        Below {
            value: form.centre - form.error - rounding,
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
            let (origin, direction) = (self.origin[axis], self.direction[axis]);
            if direction == 0.0 {
                continue;
            }
            let edge = if direction > 0.0 { low + 1.0 } else { low };
            let t = (edge * side - origin) / direction;
            exit = if t < exit { t } else { exit };
        }
        exit
    }
}

fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
