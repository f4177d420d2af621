//! How far straight rays stay outside of blobs: walked piece by piece to their first roots.
//!
//! Along a ray every ball matters between two places ([`super::near`]). Rays that meet none, or too few for the threshold, are
//! clear to their ends; the others begin where the first support does, and no piece of their way crosses where one begins or
//! ends. Over each piece a polynomial bounds the field from below ([`super::piece`]). Its first root is not before the place
//! where the hull of its Bernstein coefficients meets 0: the part before that is clear, and what is left of the polynomial is
//! looked at again, which closes in on the root like Newton's method (Bézier clipping, Nishita, Sederberg and Kakimoto 1990).

use fearless_simd::Simd;

use super::Blobs;
use super::near::{Near, Rays, least_of, most_of};
use super::piece::{Pieces, ROUNDINGS, Row, least, most};
use crate::lanes::Lanes;
use crate::shape::kernel::Kernel;
use crate::shape::lanes::WIDTH;
use crate::shape::supports::Tube;

/// Lengths are shortened by this share, for the roundings of their own few operations.
const CAUTION: f64 = 1.0 - 1e-9;

/// Most pieces of one walk.
const PIECES_MAX: u32 = 64;

/// A piece over which a polynomial is but a bound is at first no longer than this share of the least radius: longer ones are
/// bounded badly.
const FIRST: f64 = 0.5;

/// How often a polynomial is clipped that is but a bound, and one that is the field.
const CLIPS: [u32; 2] = [3, 8];

/// A piece of which less than this share is clear was much too long.
const SHORT: f64 = 1.0 / 8.0;

/// A piece of which less than this share is clear begins at the root.
const ROOT: f64 = 1e-6;

/// Pieces that are shorter than this share of the first are not tried.
const SHORTEST: f64 = 1.0 / 64.0;

/// So many balls are added to every polynomial, whether the pieces are within them or not: more are looked at before.
const FEW: usize = 6;

/// What is beyond all numbers of a polynomial that means anything.
const MOST: f64 = 1e100;

/// How much larger than 1 the square of what roundings are counted for can be within a support.
const SIZE: f64 = 16.0;

/// Where some rays begin, and what is wanted of them.
#[derive(Clone, Copy)]
pub(crate) struct Walk<'a> {
    pub(crate) place: [&'a Lanes; 3],
    /// The places move so along the rays, always.
    pub(crate) direction: [&'a Lanes; 3],
    /// What the field's values may be wrong by.
    pub(crate) offset: &'a [f64],
    /// How far anything is worth knowing.
    pub(crate) limit: &'a [f64],
    /// The places in the world, whose roundings are those of the blobs' places too.
    pub(crate) world: [&'a Lanes; 3],
}

/// Memory of walks.
#[derive(Default, Debug)]
pub(crate) struct Met(Vec<Near>);

impl Blobs {
    /// Whether walking costs less than it saves: exponentials for every point and piece cost more.
    pub(crate) fn is_walked(&self) -> bool {
        self.rules.kernel != Kernel::Blinn
    }

    /// How far ahead of every place the field is positive.
    #[inline(always)]
    pub(crate) fn walk<S: Simd>(&self, simd: S, walk: Walk<'_>, met: &mut Met, clear: &mut [f64]) {
        macro_rules! kernels {
            ($($kernel:ident)+) => {
                match self.rules.kernel {
                    $(Kernel::$kernel => simd.vectorize(
                        #[inline(always)]
                        || {
                            for (chunk, clear) in clear.chunks_mut(WIDTH).enumerate() {
                                self.walk_some(Kernel::$kernel, &walk, chunk * WIDTH, met, clear);
                            }
                        },
                    ),)+
                }
            };
        }
        kernels!(Blinn Metaballs Wyvill Murakami Hart Cauchy);
    }

    #[inline(always)]
    fn walk_some(
        &self,
        kernel: Kernel,
        walk: &Walk<'_>,
        start: usize,
        Met(met): &mut Met,
        clear: &mut [f64],
    ) {
        let rays = walk.rays(start, clear.len());
        let size = walk.size(&rays, start);
        let (mut count, mut room, mut share) = (0, 0.0, 1.0);
        let mut sums = [0.0; WIDTH];
        self.supports.along(
            &rays.tube(ROUNDINGS * size),
            #[inline(always)]
            |i| {
                let point = &self.points[i];
                // Within a ball no coordinate is larger than all of these together.
                let [x, y, z] = point.centre.map(f64::abs);
                let size = 1.0 + (size + x + y + z) / point.radius;
                room += SIZE * ROUNDINGS * point.weight.abs() * size;
                share = most(size, share);
                if met.len() == count {
                    met.push(Near::NONE);
                }
                if rays.meet(kernel, point, &mut met[count]) {
                    met[count].add_most(kernel, &mut sums);
                    count += 1;
                }
            },
        );
        let met = &mut met[..count];
        if count > FEW {
            met.iter_mut().for_each(Near::hull);
        }
        let mut rest = [0.0; WIDTH];
        for (i, offset) in walk.offset[start..start + clear.len()].iter().enumerate() {
            let threshold = self.rules.threshold;
            let sizes = threshold.abs() + offset.abs();
            rest[i] = threshold - offset - (room + ROUNDINGS * sizes);
        }
        let lengths = if kernel.is_parabola() {
            [ROOT, f64::INFINITY]
        } else {
            [SHORTEST * FIRST, FIRST]
        };
        let lengths = lengths.map(|length| length * self.least_radius);
        let mut walkers = Walkers::new(&rays, met, &rest, &sums, lengths);
        for _ in 0..PIECES_MAX {
            if !walkers.next(&rays, met) {
                break;
            }
            let part = (count > FEW).then(|| walkers.part());
            let pieces = &mut walkers.pieces;
            pieces.clear(kernel);
            for near in &*met {
                let counts = |[low, high]: [f64; 2]| near.first < high && near.last > low;
                if part.is_none_or(counts) {
                    pieces.add(kernel, near, &rays.square);
                }
            }
            let polynomial = pieces.below(kernel, &rest, share);
            walkers.advance(kernel, polynomial);
        }
        clear.copy_from_slice(&walkers.pieces.begin[..clear.len()]);
    }
}

impl Walk<'_> {
    /// The rays of some lanes from `start` on.
    #[inline(always)]
    fn rays(&self, start: usize, n: usize) -> Rays {
        let mut rays = Rays::NONE;
        for k in 0..3 {
            for i in 0..WIDTH {
                rays.start[k][i] = self.place[k][start + i];
                rays.direction[k][i] = self.direction[k][start + i];
            }
        }
        let [dx, dy, dz] = &rays.direction;
        for i in 0..WIDTH {
            let square = dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i];
            rays.square[i] = square;
            rays.inverse[i] = if square > 0.0 { 1.0 / square } else { 0.0 };
        }
        for (i, limit) in self.limit[start..start + n].iter().enumerate() {
            let is_ray = (rays.square[i] > 0.0) & (*limit > 0.0);
            rays.limit[i] = if is_ray { *limit } else { 0.0 };
        }
        rays
    }

    /// The greatest coordinate that the rays' starts were computed from.
    #[inline(always)]
    fn size(&self, rays: &Rays, start: usize) -> f64 {
        let ([wx, wy, wz], [x, y, z]) = (&self.world, &rays.start);
        let [dx, dy, dz] = &rays.direction;
        let mut sizes = [0.0; WIDTH];
        for i in 0..WIDTH {
            let at = start + i;
            let world = wx[at].abs() + wy[at].abs() + wz[at].abs();
            let scale = dx[i].abs() + dy[i].abs() + dz[i].abs();
            sizes[i] = world * scale + (x[i].abs() + y[i].abs() + z[i].abs());
        }
        most_of(&sizes)
    }
}

impl Rays {
    /// What holds them, about the first one.
    #[inline(always)]
    fn tube(&self, room: f64) -> Tube {
        let ([x, y, z], [dx, dy, dz]) = (&self.start, &self.direction);
        let (mut apart, mut spread) = ([0.0; WIDTH], [0.0; WIDTH]);
        for i in 0..WIDTH {
            let (x, y, z) = (x[i] - x[0], y[i] - y[0], z[i] - z[0]);
            apart[i] = x * x + y * y + z * z;
            let (x, y, z) = (dx[i] - dx[0], dy[i] - dy[0], dz[i] - dz[0]);
            spread[i] = x * x + y * y + z * z;
        }
        Tube {
            start: [x[0], y[0], z[0]],
            direction: [dx[0], dy[0], dz[0]],
            inverse: self.inverse[0],
            radius: most_of(&apart).sqrt() + room,
            spread: most_of(&spread).sqrt(),
            slowness: most_of(&self.inverse).sqrt(),
        }
    }
}

/// Rays on their way, lane by lane.
struct Walkers {
    /// Before which they are clear, and what is looked at next.
    pieces: Pieces,
    /// No piece is longer; 0 for rays that have ended.
    longest: Row,
    /// A piece that is shorter, and only a part of which is clear, ends the walk.
    shortest: Row,
}

impl Walkers {
    /// Rays where they first meet a ball, or at their ends if what `sums` to at most is not the `rest`.
    #[inline(always)]
    fn new(
        rays: &Rays,
        met: &[Near],
        rest: &Row,
        sums: &Row,
        [shortest, longest]: [f64; 2],
    ) -> Self {
        let mut walkers = Self {
            pieces: Pieces::new(),
            longest: [0.0; WIDTH],
            shortest: [0.0; WIDTH],
        };
        let mut first = rays.limit;
        for near in met {
            for (first, entry) in first.iter_mut().zip(&near.entry) {
                *first = least(*entry, *first);
            }
        }
        for i in 0..WIDTH {
            let slowness = rays.inverse[i].sqrt();
            let is_clear = (rest[i] > 0.0) & (sums[i] < rest[i] * CAUTION);
            let begin = if is_clear {
                rays.limit[i]
            } else {
                most(first[i], 0.0)
            };
            let begin = if rest[i] > 0.0 { begin } else { 0.0 };
            let goes_on = (rest[i] > 0.0) & (begin < rays.limit[i]);
            walkers.pieces.begin[i] = begin;
            walkers.longest[i] = if goes_on { longest * slowness } else { 0.0 };
            walkers.shortest[i] = shortest * slowness;
        }
        walkers
    }

    /// Chooses the next pieces: no ball begins or ends within one. Says whether there is any.
    #[inline(always)]
    fn next(&mut self, rays: &Rays, met: &[Near]) -> bool {
        let Pieces { begin, end, .. } = &mut self.pieces;
        for i in 0..WIDTH {
            end[i] = least(rays.limit[i], begin[i] + self.longest[i]);
        }
        for near in met {
            *end = near.ends(begin, end);
        }
        let mut any = false;
        for i in 0..WIDTH {
            any |= end[i] > begin[i];
        }
        any
    }

    /// What holds the pieces of all rays that go on.
    #[inline(always)]
    fn part(&self) -> [f64; 2] {
        let Pieces { begin, end, .. } = &self.pieces;
        let (mut low, mut high) = ([0.0; WIDTH], [0.0; WIDTH]);
        for i in 0..WIDTH {
            let walks = end[i] > begin[i];
            low[i] = if walks { begin[i] } else { f64::INFINITY };
            high[i] = if walks { end[i] } else { f64::NEG_INFINITY };
        }
        [least_of(&low), most_of(&high)]
    }

    /// Takes as much of every piece as its polynomial proves to be clear, and chooses how long the next one may be.
    #[inline(always)]
    fn advance(&mut self, kernel: Kernel, polynomial: [Row; 5]) {
        let Pieces { begin, end, .. } = &mut self.pieces;
        let mut lengths = [0.0; WIDTH];
        for i in 0..WIDTH {
            lengths[i] = end[i] - begin[i];
        }
        let is_field = kernel.is_parabola();
        let clips = CLIPS[usize::from(is_field)];
        let (shares, steps) = clipped(polynomial, &lengths, clips);
        for i in 0..WIDTH {
            let (length, share) = (lengths[i], shares[i]);
            let is_whole = share >= 1.0;
            begin[i] = if is_whole {
                end[i]
            } else {
                begin[i] + length * share * CAUTION
            };
            // Of a bound no root says that the field has one.
            let is_root = if is_field { steps[i] } else { share } < ROOT;
            let shorter = if share < SHORT { 0.25 } else { 0.5 } * length;
            let is_short = is_root | (shorter < self.shortest[i]);
            let shorter = if is_short { 0.0 } else { shorter };
            let longer = most(self.longest[i], 2.0 * length);
            let longest = if is_whole { longer } else { shorter };
            self.longest[i] = if length > 0.0 { longest } else { 0.0 };
        }
    }
}

/// The shares of pieces before the first roots of polynomials, by their Bernstein coefficients there, and the last part of each
/// that was found: no more than that. Nothing is clear where there is no piece.
#[inline(always)]
fn clipped(c: [Row; 5], lengths: &Row, clips: u32) -> (Row, Row) {
    let [mut c0, mut c1, mut c2, mut c3, mut c4] = c;
    let (mut left, mut steps) = ([1.0; WIDTH], [0.0; WIDTH]);
    for i in 0..WIDTH {
        let sum = c0[i] + c1[i] + c2[i] + c3[i] + c4[i];
        let is_known = (sum.abs() < MOST) & (lengths[i] > 0.0);
        c0[i] = if is_known { c0[i] } else { 0.0 };
        c4[i] = if is_known { c4[i] } else { 0.0 };
    }
    for _ in 0..clips {
        for i in 0..WIDTH {
            let (a, b, c, d, e) = (c0[i], c1[i], c2[i], c3[i], c4[i]);
            // No coefficient is below the steepest way down from the first to any.
            let (near, far) = (
                most((a - b) * 4.0, (a - c) * 2.0),
                most((a - d) * (4.0 / 3.0), a - e),
            );
            let share = a / most(near, far);
            let is_clear = (b > 0.0) & (c > 0.0) & (d > 0.0) & (e > 0.0);
            let share = if is_clear { 1.0 } else { share };
            let share = if a > 0.0 { share } else { 0.0 };
            let rest = left[i] * (1.0 - share);
            steps[i] = left[i] - rest;
            left[i] = rest;
            // De Casteljau's: what remains are the coefficients of the part behind.
            let mix = |from: f64, to: f64| from + (to - from) * share;
            let (a, b, c, d) = (mix(a, b), mix(b, c), mix(c, d), mix(d, e));
            let (a, b, c) = (mix(a, b), mix(b, c), mix(c, d));
            let (a, b) = (mix(a, b), mix(b, c));
            (c0[i], c1[i], c2[i], c3[i]) = (mix(a, b), b, c, d);
        }
        let mut goes_on = false;
        for step in &steps {
            goes_on |= *step >= ROOT;
        }
        if !goes_on {
            break;
        }
    }
    let mut shares = [0.0; WIDTH];
    for i in 0..WIDTH {
        shares[i] = 1.0 - left[i];
    }
    (shares, steps)
}
