//! Places along many rays, and the field's values there: structure of arrays.

use field::{BATCH, Outlook, Points, Prospect, Scratch, Sides};
use glam::DVec3;

use super::surface::Surface;

/// One number per lane. What holds some is laid out so that each begins where a cache line does.
pub(crate) type Lanes = [f64; BATCH];

/// What of a ray decides where its places are and how wide a pixel is there.
#[repr(align(64))]
pub(crate) struct Paths {
    pub(crate) origin: [Lanes; 3],
    pub(crate) direction: [Lanes; 3],
    /// ‖from eye‖².
    pub(crate) eye_square: Lanes,
    /// 2 · from eye · direction.
    pub(crate) eye_along: Lanes,
    pub(crate) time: Lanes,
}

/// Places and values, lane by lane.
#[repr(C, align(64))]
pub(crate) struct Batch {
    pub(crate) place: [Lanes; 3],
    /// From the eye, metres.
    pub(crate) distance: Lanes,
    pub(crate) footprint: Lanes,
    pub(crate) value: Lanes,
    /// The value's derivative along the ray.
    pub(crate) slope: Lanes,
    /// The value's gradient, where that is evaluated.
    pub(crate) gradient: [Lanes; 3],
    /// How many evaluations were of coarse surfaces.
    pub(crate) coarse_evaluations: u64,
}

impl Default for Paths {
    fn default() -> Self {
        Self {
            origin: [[0.0; BATCH]; 3],
            direction: [[0.0; BATCH]; 3],
            eye_square: [0.0; BATCH],
            eye_along: [0.0; BATCH],
            time: [0.0; BATCH],
        }
    }
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            place: [[0.0; BATCH]; 3],
            distance: [0.0; BATCH],
            footprint: [0.0; BATCH],
            value: [0.0; BATCH],
            slope: [0.0; BATCH],
            gradient: [[0.0; BATCH]; 3],
            coarse_evaluations: 0,
        }
    }
}

impl Paths {
    /// Puts a ray into a lane.
    #[inline]
    pub(crate) fn set(
        &mut self,
        lane: usize,
        origin: DVec3,
        direction: DVec3,
        from_eye: DVec3,
        time: f64,
    ) {
        for axis in 0..3 {
            self.origin[axis][lane] = origin[axis];
            self.direction[axis][lane] = direction[axis];
        }
        self.eye_square[lane] = from_eye.dot(from_eye);
        self.eye_along[lane] = 2.0 * from_eye.dot(direction);
        self.time[lane] = time;
    }

    /// Moves one lane into another.
    #[inline]
    pub(crate) fn copy(&mut self, from: usize, to: usize) {
        for axis in 0..3 {
            self.origin[axis][to] = self.origin[axis][from];
            self.direction[axis][to] = self.direction[axis][from];
        }
        self.eye_square[to] = self.eye_square[from];
        self.eye_along[to] = self.eye_along[from];
        self.time[to] = self.time[from];
    }
}

/// The first `n` places.
fn points<'a>(
    n: usize,
    [x, y, z]: &'a [Lanes; 3],
    footprint: &'a Lanes,
    paths: &'a Paths,
) -> Points<'a> {
    Points {
        x: &x[..n],
        y: &y[..n],
        z: &z[..n],
        footprint: &footprint[..n],
        time: &paths.time[..n],
    }
}

impl Batch {
    /// The places at distances `t` along the first `n` paths.
    #[inline(always)]
    pub(crate) fn go(&mut self, surface: &Surface, n: usize, paths: &Paths, t: &Lanes) {
        assert!(n <= BATCH);
        let [x, y, z] = &mut self.place;
        let ([ox, oy, oz], [dx, dy, dz]) = (&paths.origin, &paths.direction);
        for i in 0..n {
            x[i] = ox[i] + dx[i] * t[i];
            y[i] = oy[i] + dy[i] * t[i];
            z[i] = oz[i] + dz[i] * t[i];
        }
        let footprint = surface.footprint;
        for (i, t) in t[..n].iter().copied().enumerate() {
            let square = paths.eye_square[i] + t * (paths.eye_along[i] + t);
            // From the eye itself the root is that of t², which is t.
            let distance = if paths.eye_square[i] > 0.0 {
                square.sqrt()
            } else {
                t
            };
            self.distance[i] = distance;
            self.footprint[i] = footprint.at(distance);
        }
    }

    /// Evaluates the field at the places.
    pub(crate) fn evaluate(
        &mut self,
        surface: &Surface,
        n: usize,
        paths: &Paths,
        scratch: &mut Scratch,
    ) {
        surface.program.evaluate(
            surface.level,
            &points(n, &self.place, &self.footprint, paths),
            scratch,
            &mut [&mut self.value[..n]],
        );
        if surface.is_coarse() {
            self.coarse_evaluations += n as u64;
            for i in 0..n {
                // One that is not finite says nothing about the surface's field.
                let (value, moved) = (self.value[i], surface.clearances.at(self.distance[i]).moved);
                self.value[i] = if value < f64::INFINITY {
                    value - moved
                } else {
                    0.0
                };
            }
        }
    }

    /// Evaluates the field at the places, and its derivative along the paths.
    pub(crate) fn evaluate_along(
        &mut self,
        surface: &Surface,
        n: usize,
        paths: &Paths,
        scratch: &mut Scratch,
    ) {
        let [x, y, z] = &paths.direction;
        surface.program.evaluate_along(
            surface.level,
            &points(n, &self.place, &self.footprint, paths),
            [&x[..n], &y[..n], &z[..n]],
            scratch,
            [&mut self.value[..n], &mut self.slope[..n]],
        );
    }

    /// Evaluates the field at the places, and its gradient.
    pub(crate) fn evaluate_gradient(
        &mut self,
        surface: &Surface,
        n: usize,
        paths: &Paths,
        scratch: &mut Scratch,
    ) {
        let [x, y, z] = &mut self.gradient;
        surface.program.evaluate_gradient(
            surface.level,
            &points(n, &self.place, &self.footprint, paths),
            scratch,
            &mut self.value[..n],
            [&mut x[..n], &mut y[..n], &mut z[..n]],
        );
    }

    /// How far along the paths the field of a surface that walks is clear from the places on.
    pub(crate) fn walk(
        &self,
        surface: &Surface,
        n: usize,
        paths: &Paths,
        prospect: Prospect<'_>,
        clear: &mut [f64],
        scratch: &mut Scratch,
    ) {
        let points = points(n, &self.place, &self.footprint, paths);
        let [x, y, z] = &paths.direction;
        let direction = [&x[..n], &y[..n], &z[..n]];
        let program = &surface.program;
        program.walk(surface.level, &points, direction, prospect, scratch, clear);
    }

    /// Evaluates the field at the places, its derivative along the paths, and how far ahead and behind it is positive, as
    /// far as `bend` lets it look. The field's errors, how far it is wanted and how far to look are in the other rows.
    pub(crate) fn evaluate_ahead(
        &mut self,
        surface: &Surface,
        n: usize,
        paths: &Paths,
        (sides, [offset, slope, limit, least, most]): (Sides, [&Lanes; 5]),
        [ahead, behind, bend]: [&mut Lanes; 3],
        scratch: &mut Scratch,
    ) {
        let [x, y, z] = &paths.direction;
        let outlook = Outlook {
            offset: &offset[..n],
            slope: &slope[..n],
            limit: &limit[..n],
            least: &least[..n],
            most: &most[..n],
            footprint_slope: surface.footprint.angle,
            sides,
        };
        surface.program.evaluate_ahead(
            surface.level,
            &points(n, &self.place, &self.footprint, paths),
            [&x[..n], &y[..n], &z[..n]],
            outlook,
            scratch,
            [
                &mut self.value[..n],
                &mut self.slope[..n],
                &mut ahead[..n],
                &mut behind[..n],
                &mut bend[..n],
            ],
        );
    }
}
