//! How far a straight ray stays outside of blobs: walked piece by piece.
//!
//! Over each piece a polynomial bounds the field from below ([`super::piece`]). Its first root is not before
//! the place where the hull of its Bernstein coefficients meets 0: the part before that is clear, and what is left
//! of the polynomial is looked at again, which closes in on the root like Newton's method (Bézier clipping,
//! Nishita, Sederberg and Kakimoto 1990). So one walk reaches the root itself, or the ray's end.

use fearless_simd::Simd;

use super::Blobs;
use super::lanes::hull_of;
use super::piece::{Pieces, Row, least, most};
use crate::interval::Interval;
use crate::lanes::Lanes;
use crate::shape::kernel::Kernel;
use crate::shape::lanes::WIDTH;

/// Lengths are shortened by this share, for the roundings of their own few operations.
const CAUTION: f64 = 1.0 - 1e-9;

/// Most pieces of one walk.
const PIECES_MAX: u32 = 64;

/// A piece is at first no longer than this share of the least radius: longer ones are bounded badly.
const FIRST: f64 = 0.5;

/// How often a polynomial is clipped.
const CLIPS: u32 = 3;

/// A piece of which less than this share is clear was much too long.
const SHORT: f64 = 1.0 / 8.0;

/// A piece of which less than this share is clear begins at the root.
const ROOT: f64 = 1e-5;

/// Pieces that are shorter than this share of the first are not tried.
const SHORTEST: f64 = 1.0 / 64.0;

/// What is beyond all numbers of a polynomial that means anything.
const MOST: f64 = 1e100;

/// Where some rays stand, and what is wanted of them.
#[derive(Clone, Copy)]
pub(crate) struct Walk<'a> {
    pub(crate) place: [&'a Lanes; 3],
    /// The places move so along the rays, always.
    pub(crate) direction: [&'a Lanes; 3],
    /// The values there, as they were computed.
    pub(crate) value: &'a Lanes,
    /// What the values may be wrong by.
    pub(crate) offset: &'a [f64],
    /// How far anything is worth knowing.
    pub(crate) limit: &'a [f64],
    /// The places in the world, whose roundings are those of the blobs' places too.
    pub(crate) world: [&'a Lanes; 3],
}

impl Blobs {
    /// Whether walking costs less than it saves: exponentials for every point and piece cost more.
    pub(crate) fn is_walked(&self) -> bool {
        self.rules.kernel != Kernel::Blinn
    }

    /// How far ahead of every place the field is positive; `ahead` is how long a piece might be at first, and is replaced.
    #[inline(always)]
    pub(crate) fn walk<S: Simd>(&self, simd: S, walk: Walk<'_>, ahead: &mut [f64]) {
        macro_rules! kernels {
            ($($kernel:ident)+) => {
                match self.rules.kernel {
                    $(Kernel::$kernel => simd.vectorize(
                        #[inline(always)]
                        || {
                            for (chunk, ahead) in ahead.chunks_mut(WIDTH).enumerate() {
                                self.walk_some(Kernel::$kernel, &walk, chunk * WIDTH, ahead);
                            }
                        },
                    ),)+
                }
            };
        }
        kernels!(Blinn Metaballs Wyvill Murakami Hart Cauchy);
    }

    #[inline(always)]
    fn walk_some(&self, kernel: Kernel, walk: &Walk<'_>, start: usize, ahead: &mut [f64]) {
        let mut walkers = Walkers::new(walk, start, ahead, FIRST * self.least_radius);
        for _ in 0..PIECES_MAX {
            let Some(parts) = walkers.next() else {
                break;
            };
            let [x, y, z] = &parts;
            let size = most(x.magnitude(), most(y.magnitude(), z.magnitude()));
            let size = most(size, walkers.size);
            let pieces = &mut walkers.pieces;
            self.supports.over(
                &parts,
                #[inline(always)]
                |i| pieces.add(kernel, &self.points[i], size),
            );
            walkers.advance(self.rules.threshold);
        }
        ahead.copy_from_slice(&walkers.clear[..ahead.len()]);
    }
}

/// Rays on their way, lane by lane.
struct Walkers {
    pieces: Pieces,
    start: [Row; 3],
    offset: Row,
    limit: Row,
    /// How far each is clear.
    clear: Row,
    /// A piece that is shorter ends the walk.
    shortest: Row,
    /// The greatest coordinate that their places were computed from.
    size: f64,
}

impl Walkers {
    #[inline(always)]
    fn new(walk: &Walk<'_>, start: usize, ahead: &[f64], longest: f64) -> Self {
        let mut walkers = Self {
            pieces: Pieces::new(),
            start: [[0.0; WIDTH]; 3],
            offset: [0.0; WIDTH],
            limit: [0.0; WIDTH],
            clear: [0.0; WIDTH],
            shortest: [0.0; WIDTH],
            size: 0.0,
        };
        let pieces = &mut walkers.pieces;
        for k in 0..3 {
            for i in 0..WIDTH {
                walkers.start[k][i] = walk.place[k][start + i];
                pieces.direction[k][i] = walk.direction[k][start + i];
            }
        }
        let mut sizes = [0.0; WIDTH];
        for i in 0..WIDTH {
            let [x, y, z] = &walk.world;
            let [dx, dy, dz] = &pieces.direction;
            let place = x[start + i].abs() + y[start + i].abs() + z[start + i].abs();
            sizes[i] = place * (dx[i].abs() + dy[i].abs() + dz[i].abs());
            let square = dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i];
            pieces.square[i] = square;
            pieces.inverse[i] = if square > 0.0 { 1.0 / square } else { 0.0 };
        }
        walkers.size = hull_of(&sizes, &sizes).high;
        for (i, ahead) in ahead.iter().enumerate() {
            let proves = walk.value[start + i].is_finite();
            walkers.offset[i] = walk.offset[start + i];
            walkers.limit[i] = walk.limit[start + i];
            let longest = longest * pieces.inverse[i].sqrt();
            let first = least(least(*ahead, longest), walk.limit[start + i]);
            // Lanes without a length have ended.
            pieces.length[i] = if proves & (first > 0.0) { first } else { 0.0 };
            walkers.shortest[i] = SHORTEST * first;
        }
        walkers
    }

    /// Goes to where the next pieces begin; gives the box that holds them, or `None` if all rays have ended.
    #[inline(always)]
    fn next(&mut self) -> Option<[Interval; 3]> {
        let pieces = &mut self.pieces;
        pieces.clear();
        if hull_of(&pieces.length, &pieces.length).high == 0.0 {
            return None;
        }
        let Self { start, clear, .. } = self;
        let mut parts = [Interval::ALL; 3];
        for (k, part) in parts.iter_mut().enumerate() {
            let (start, way, at) = (&start[k], &pieces.direction[k], &mut pieces.at[k]);
            let (mut low, mut high) = ([0.0; WIDTH], [0.0; WIDTH]);
            for i in 0..WIDTH {
                let near = start[i] + way[i] * clear[i];
                let far = near + way[i] * pieces.length[i];
                at[i] = near;
                let walks = pieces.length[i] > 0.0;
                low[i] = if walks {
                    least(near, far)
                } else {
                    f64::INFINITY
                };
                high[i] = if walks {
                    most(near, far)
                } else {
                    f64::NEG_INFINITY
                };
            }
            *part = hull_of(&low, &high).widen();
        }
        Some(parts)
    }

    /// Takes as much of every piece as its polynomial proves to be clear, and chooses the next one's length.
    #[inline(always)]
    fn advance(&mut self, threshold: f64) {
        let shares = clipped(self.pieces.below(threshold, &self.offset));
        let lengths = &mut self.pieces.length;
        for i in 0..WIDTH {
            let (length, share) = (lengths[i], shares[i]);
            let is_whole = share >= 1.0;
            self.clear[i] += length * share * CAUTION;
            let rest = self.limit[i] - self.clear[i];
            let longer = least(2.0 * length, rest);
            // There the polynomial is 0, which the field need not be.
            let shorter = if share < SHORT { 0.25 } else { 0.5 } * length;
            let shorter = if share < ROOT {
                0.0
            } else {
                least(shorter, rest)
            };
            let next = if is_whole { longer } else { shorter };
            let ends = (next < self.shortest[i]) | (length == 0.0);
            lengths[i] = if ends { 0.0 } else { next };
        }
    }
}

/// The shares of pieces before the first roots of polynomials, by their Bernstein coefficients there: no more than that.
#[inline(always)]
fn clipped(c: [Row; 5]) -> Row {
    let [mut c0, mut c1, mut c2, mut c3, c4] = c;
    let mut left = [1.0; WIDTH];
    for i in 0..WIDTH {
        let sum = c0[i] + c1[i] + c2[i] + c3[i] + c4[i];
        // Else nothing is clear.
        let is_known = sum.abs() < MOST;
        c0[i] = if is_known { c0[i] } else { 0.0 };
    }
    for _ in 0..CLIPS {
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
            left[i] *= 1.0 - share;
            // De Casteljau's: what remains are the coefficients of the part behind.
            let mix = |from: f64, to: f64| from + (to - from) * share;
            let (a, b, c, d) = (mix(a, b), mix(b, c), mix(c, d), mix(d, e));
            let (a, b, c) = (mix(a, b), mix(b, c), mix(c, d));
            let (a, b) = (mix(a, b), mix(b, c));
            (c0[i], c1[i], c2[i], c3[i]) = (mix(a, b), b, c, d);
        }
    }
    let mut shares = [0.0; WIDTH];
    for i in 0..WIDTH {
        shares[i] = 1.0 - left[i];
    }
    shares
}
