//! Blobs at many places together: term by term over the lanes, in the order in which one place adds them.

use fearless_simd::Simd;

use super::Blobs;
use crate::interval::{Interval, larger, smaller};
use crate::number::Number;
use crate::shape::kernel::Kernel;
use crate::shape::lanes::{Rows, WIDTH};
use crate::shape::local::{Local, dot, less};

impl Blobs {
    /// Its values at the first `n` lanes' places.
    #[inline(always)]
    pub(crate) fn values<S: Simd, R: Rows>(&self, simd: S, n: usize, at: [&R; 3], out: &mut R) {
        // One loop per kernel, so that none of them decides anything.
        macro_rules! kernels {
            ($($kernel:ident)+) => {
                match self.rules.kernel {
                    $(Kernel::$kernel => simd.vectorize(
                        #[inline(always)]
                        || self.of_kernel(Kernel::$kernel, n, at, out),
                    ),)+
                }
            };
        }
        kernels!(Blinn Metaballs Wyvill Murakami Hart Cauchy);
    }

    #[inline(always)]
    fn of_kernel<R: Rows>(&self, kernel: Kernel, n: usize, at: [&R; 3], out: &mut R) {
        for first in (0..n).step_by(WIDTH) {
            let nearest = self.sum(kernel, first, at, out);
            for lane in 0..WIDTH {
                let inside = R::Number::constant(self.rules.threshold).minus(out.at(first + lane));
                out.set(first + lane, inside);
            }
            if self.rules.far {
                self.add_beyond(first, at, &nearest, out);
            }
        }
    }

    /// Adds the far field of the lanes whose least (d/r)² says that no support holds them.
    #[inline(always)]
    fn add_beyond<R: Rows>(
        &self,
        first: usize,
        [x, y, z]: [&R; 3],
        nearest: &[f64; WIDTH],
        out: &mut R,
    ) {
        let mut any = false;
        for square in nearest {
            any |= *square >= 1.0;
        }
        if !any {
            return;
        }
        let mut least = [f64::INFINITY; WIDTH];
        let mut choice = [0; WIDTH];
        for (index, point) in self.points.iter().enumerate() {
            for lane in 0..WIDTH {
                let [x, y, z] = [x.at(first + lane), y.at(first + lane), z.at(first + lane)];
                let away = less([x.at(), y.at(), z.at()], point.centre);
                let distance = dot(away, away).sqrt() - point.radius;
                let is_nearer = (index == 0) | (distance < least[lane]);
                least[lane] = if is_nearer { distance } else { least[lane] };
                choice[lane] = if is_nearer { index } else { choice[lane] };
            }
        }
        for lane in 0..WIDTH {
            if nearest[lane] >= 1.0 && least[lane] > 0.0 {
                let at = [x.at(first + lane), y.at(first + lane), z.at(first + lane)];
                let beyond = self.points[choice[lane]].beyond(&at);
                out.set(first + lane, out.at(first + lane).plus(beyond));
            }
        }
    }

    /// The sums at some lanes' places from `first` on, and every lane's least (d/r)².
    #[inline(always)]
    fn sum<R: Rows>(
        &self,
        kernel: Kernel,
        first: usize,
        [x, y, z]: [&R; 3],
        out: &mut R,
    ) -> [f64; WIDTH] {
        let mut nearest = [f64::INFINITY; WIDTH];
        for lane in 0..WIDTH {
            out.set(first + lane, R::Number::constant(0.0));
        }
        let parts = [hull(first, x), hull(first, y), hull(first, z)];
        self.supports.over(
            &parts,
            #[inline(always)]
            |i| {
                let point = &self.points[i];
                for (lane, nearest) in nearest.iter_mut().enumerate() {
                    let lane = first + lane;
                    let u = self.square(point, &[x.at(lane), y.at(lane), z.at(lane)]);
                    let here = u.at();
                    let sum = out.at(lane);
                    let more = sum.plus(kernel.of(u).times(point.weight));
                    let counts = kernel.reaches(here);
                    out.set(lane, if counts { more } else { sum });
                    *nearest = if here < *nearest { here } else { *nearest };
                }
            },
        );
        nearest
    }
}

/// The least interval around the values of some lanes from `first` on that are numbers.
#[inline(always)]
fn hull<R: Rows>(first: usize, part: &R) -> Interval {
    let (mut low, mut high) = ([f64::INFINITY; WIDTH], [f64::NEG_INFINITY; WIDTH]);
    for lane in 0..WIDTH {
        let value = part.at(first + lane).at();
        low[lane] = smaller(value, low[lane]);
        high[lane] = larger(value, high[lane]);
    }
    hull_of(&low, &high)
}

/// The least interval from the least of some numbers to the greatest of others.
#[inline(always)]
fn hull_of(low: &[f64; WIDTH], high: &[f64; WIDTH]) -> Interval {
    let [mut low, mut high] = [*low, *high];
    // By halves: a chain of comparisons would wait for every one.
    for width in [8, 4, 2, 1] {
        for lane in 0..width {
            low[lane] = smaller(low[lane + width], low[lane]);
            high[lane] = larger(high[lane + width], high[lane]);
        }
    }
    Interval::new(low[0], high[0])
}

const _: () = assert!(WIDTH == 16, "lanes are halved four times");
