//! Programs for the rays of a few pixels: without the bodies and details that are nowhere near them.
//!
//! Rays of neighbouring pixels fill a thin pyramid. It is cut across into cells, each somewhat farther than the one before, and
//! what the field cannot be anywhere in them is left out of the program ([`field::Program::simplified`]). Inside, what is left
//! has the same values, and outside it is outside: so the first point inside is the same, which is then polished with the whole program.

use field::{Cell, Interval, Program};
use glam::DVec3;

use super::bound;
use super::surface::Surface;
use super::techniques::Technique;
use super::tracer::Ray;

/// Most cells along the rays.
const CELLS_MAX: usize = 32;

/// How much nearer a cell begins than it ends: long ones say little about round bodies.
const SHARE: f64 = 0.8;

/// Rays that are traced together where their program may be simplified: a thin pyramid, and worth its cells' ranges.
pub(crate) const TOGETHER: usize = 1024;

/// Fewest rays for which it is worth them.
const RAYS_MIN: usize = 256;

/// Room around rays for the rounding of their own directions and places, relative.
const ROOM: f64 = 1e-9;

/// Whether there may be something to leave out.
pub(crate) fn has_choices(surface: &Surface) -> bool {
    let is_used = Technique::Choices.is_used(surface.without);
    is_used && surface.program.has_choices()
}

/// The surface with less of a program, if some of it does not matter to any of these rays.
pub(crate) fn for_rays(surface: &Surface, rays: &[Ray]) -> Option<Surface> {
    if rays.len() < RAYS_MIN {
        return None;
    }
    let program = surface.program.simplified(&cells(surface, rays)?)?;
    fits(surface, &program).then(|| Surface {
        program,
        is_partial: true,
        ..surface.clone()
    })
}

/// Whether a program can be searched by the same means.
fn fits(surface: &Surface, program: &Program) -> bool {
    let is_searched = |program: &Program| program.looks_ahead() || program.walks();
    is_searched(program) || !is_searched(&surface.program)
}

/// Cells that hold every place of the rays where the surface can be; `None` where rays are too far apart, or none meets the bound.
fn cells(surface: &Surface, rays: &[Ray]) -> Option<Vec<Cell>> {
    let sum: DVec3 = rays.iter().map(|ray| ray.direction).sum();
    let middle = sum.try_normalize()?;
    let across = middle.any_orthonormal_vector();
    let up = middle.cross(across);
    let mut origin = [Span::NONE; 3];
    let (mut u, mut v, mut s) = (Span::NONE, Span::NONE, Span::NONE);
    let (mut eye, mut time) = (Span::NONE, Span::NONE);
    let mut forward_least = 1.0;
    for ray in rays {
        let Some((clear, end)) = bound::clip(&surface.bound, ray.origin, ray.direction) else {
            continue;
        };
        // Searches end at the first point of the grid beyond, and begin at one that may be before.
        let from_eye = ray.from_eye.length();
        let gap = |t: f64| surface.footprint.at(from_eye + t);
        let (clear, end) = (clear - gap(clear), end + gap(end));
        eye.add(from_eye);
        time.add(ray.time);
        let forward = ray.direction.dot(middle);
        if forward < 0.5 {
            return None;
        }
        for (axis, span) in origin.iter_mut().enumerate() {
            span.add(ray.origin[axis]);
        }
        u.add(ray.direction.dot(across) / forward);
        v.add(ray.direction.dot(up) / forward);
        s.add(clear * forward);
        s.add(end * forward);
        if forward < forward_least {
            forward_least = forward;
        }
    }
    if s.low > s.high {
        return None;
    }
    let sizes = origin.iter().chain([&s]).map(|span| span.size());
    let size = sizes.fold(0.0, |most, size| if size > most { size } else { most });
    let room = ROOM * size;
    let origin = origin.map(|span| Interval::new(span.low - room, span.high + room));
    let (u, v) = (u.padded(ROOM), v.padded(ROOM));
    let direction = middle + across * u.middle() + up * v.middle();
    let edges = [direction, across * u.half(), up * v.half()].map(|edge| edge.to_array());
    let mut cells = Vec::new();
    let mut far = s.high;
    while cells.len() < CELLS_MAX {
        let is_last = cells.len() + 1 == CELLS_MAX || far <= 0.0;
        let near = if is_last || SHARE * far < s.low {
            s.low
        } else {
            SHARE * far
        };
        let (low, high) = (near - room, far + room);
        let mut cell = Cell::of_rays(origin, edges, Interval::new(low, high));
        // Along a ray it is farther than along the middle; from the eye, no nearer than the difference of both ways.
        let (t_low, t_high) = (low, high / forward_least);
        let nearest = [t_low - eye.high, eye.low - t_high];
        let nearest = nearest
            .into_iter()
            .fold(0.0, |most, d| if d > most { d } else { most });
        cell.footprint = Interval::new(
            surface.footprint.at(nearest) * (1.0 - ROOM),
            surface.footprint.at(eye.high + t_high) * (1.0 + ROOM),
        );
        cell.time = Interval::new(time.low, time.high);
        cells.push(cell);
        if near <= s.low {
            break;
        }
        far = near;
    }
    Some(cells)
}

/// The least and the greatest of some numbers.
#[derive(Clone, Copy)]
struct Span {
    low: f64,
    high: f64,
}

impl Span {
    const NONE: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

    fn add(&mut self, number: f64) {
        if number < self.low {
            self.low = number;
        }
        if number > self.high {
            self.high = number;
        }
    }

    fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    fn half(self) -> f64 {
        0.5 * (self.high - self.low)
    }

    fn size(self) -> f64 {
        let (low, high) = (self.low.abs(), self.high.abs());
        if low > high { low } else { high }
    }

    fn padded(self, room: f64) -> Self {
        Self {
            low: self.low - room,
            high: self.high + room,
        }
    }
}
