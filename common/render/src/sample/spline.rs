//! B-splines as densities: their distribution function and its inverse, for any order.
//!
//! Order m is degree m − 1 (ERRATA row 2117): 1 is the box, 2 the tent, 4 the cubic.

/// Highest order of a filter; it is then 64 pixels wide.
pub const FILTER_ORDER_MAX: u32 = 64;

/// Half the number of spans of the table from which Newton's method starts.
const SPANS: usize = 256;

/// Newton's method ends after a step that is shorter than this, in pixels: the next one would be about its square.
const STEP_MIN: f64 = 1e-8;

/// Steps that numbers side by side take together; few need more, and go on alone.
const STEPS_TOGETHER: usize = 2;

/// Most pieces of a B-spline up to its middle.
const PIECES: usize = FILTER_ORDER_MAX as usize / 2;

/// Most Newton steps: far tails of high orders gain only a factor of (m − 1)/m with each.
const STEPS_MAX: usize = 4096;

/// The uniform B-spline n_m, thesis eq. (6.9)–(6.11), as the density of a pixel's samples.
#[derive(Clone, Debug)]
pub(crate) struct BSpline {
    order: usize,
    last_piece: i32,
    /// N_m and n_m from each whole number on, up to the middle.
    distribution: Polynomials,
    density: Polynomials,
    /// The inverse at y = i / (2 · `SPANS`), from 0 to the middle.
    starts: Vec<f64>,
}

/// Polynomials of a number between 0 and 1: for each power, the highest first, the coefficients of all of them.
#[derive(Clone, Debug)]
struct Polynomials(Vec<[f64; PIECES]>);

impl Polynomials {
    /// Of polynomials with the constant first.
    fn new(polynomials: &[Vec<f64>]) -> Self {
        let powers = polynomials.first().map_or(0, Vec::len);
        let of = |power| {
            let mut coefficients = [0.0; PIECES];
            for (coefficient, polynomial) in coefficients.iter_mut().zip(polynomials) {
                *coefficient = polynomial[power];
            }
            coefficients
        };
        Self((0..powers).rev().map(of).collect())
    }

    /// Of each lane its polynomial's value.
    #[inline(always)]
    fn at<const N: usize>(&self, which: &[usize; N], s: &[f64; N]) -> [f64; N] {
        let mut value = [0.0; N];
        for coefficients in &self.0 {
            for i in 0..N {
                // Below it anyway, which lets the loop become gathers.
                value[i] = value[i] * s[i] + coefficients[which[i] % PIECES];
            }
        }
        value
    }
}

impl BSpline {
    /// The B-spline of an order from 1 to [`FILTER_ORDER_MAX`].
    pub(crate) fn new(order: u32) -> Self {
        let order = order.clamp(1, FILTER_ORDER_MAX) as usize;
        let (distribution, density): (Vec<_>, Vec<_>) = pieces(order).into_iter().unzip();
        let mut spline = Self {
            order,
            last_piece: i32::try_from(distribution.len()).map_or(0, |pieces| pieces - 1),
            distribution: Polynomials::new(&distribution),
            density: Polynomials::new(&density),
            starts: Vec::new(),
        };
        let middle = spline.width() / 2.0;
        // From the middle downwards: each knot starts from the one above it.
        let mut starts = vec![middle; SPANS + 1];
        for i in (0..SPANS).rev() {
            let y = i as f64 / (2 * SPANS) as f64;
            [starts[i]] = spline.solve(&[y], [starts[i + 1]]);
        }
        spline.starts = starts;
        spline
    }

    /// The width of its support in pixels, which is its order.
    fn width(&self) -> f64 {
        self.order as f64
    }

    /// N_m(x) and n_m(x), thesis eqs. (6.15c), (6.15d) and (6.16); `x` lies in 0 … m/2.
    #[inline(always)]
    fn distribution<const N: usize>(&self, x: &[f64; N]) -> ([f64; N], [f64; N]) {
        let (mut which, mut s) = ([0; N], [0.0; N]);
        for i in 0..N {
            #[expect(clippy::cast_possible_truncation, reason = "at most 32")]
            let number = (x[i] as i32).clamp(0, self.last_piece);
            #[expect(clippy::cast_sign_loss, reason = "at least 0")]
            let place = number as usize;
            which[i] = place;
            s[i] = x[i] - f64::from(number);
        }
        (
            self.distribution.at(&which, &s),
            self.density.at(&which, &s),
        )
    }

    /// The x with N_m(x) = y, y in 0 … ½, by Newton's method, thesis eq. (6.19) mended.
    ///
    /// There N_m is convex, so that the first step may pass the root, and every other one falls short of it.
    #[inline(always)]
    fn solve<const N: usize>(&self, y: &[f64; N], start: [f64; N]) -> [f64; N] {
        let (mut x, mut open) = (start, [0; N]);
        for i in 0..N {
            let has_root = y[i] > 0.0;
            x[i] = if has_root { x[i] } else { 0.0 };
            open[i] = u64::from(has_root);
        }
        self.newton(STEPS_TOGETHER, y, &mut x, &mut open);
        for i in 0..N {
            if open[i] > 0 {
                x[i] = self.finish(y[i], x[i]);
            }
        }
        x
    }

    /// The same for one number, from an earlier step.
    fn finish(&self, y: f64, x: f64) -> f64 {
        let mut x = [x];
        self.newton(STEPS_MAX, &[y], &mut x, &mut [1]);
        x[0]
    }

    /// So many steps, or fewer, of the lanes that are `open`; closes those that are done.
    #[inline(always)]
    fn newton<const N: usize>(
        &self,
        steps: usize,
        y: &[f64; N],
        x: &mut [f64; N],
        open: &mut [u64; N],
    ) {
        let half = self.width() / 2.0;
        for _ in 0..steps {
            let (value, slope) = self.distribution(x);
            let mut left = 0;
            for i in 0..N {
                let step = (value[i] - y[i]) / slope[i];
                let next = x[i] - step;
                let next = if next < 0.0 { 0.0 } else { next };
                let next = if next > half { half } else { next };
                let moves = open[i] & u64::from(slope[i] > 0.0);
                x[i] = if moves > 0 { next } else { x[i] };
                open[i] = moves & u64::from(step.abs() >= STEP_MIN);
                left |= open[i];
            }
            if left == 0 {
                break;
            }
        }
    }

    /// Where samples lie, in pixels from the filter's centre, for uniform `y` in [0, 1).
    #[inline(always)]
    pub(crate) fn inverse<const N: usize>(&self, y: &[f64; N]) -> [f64; N] {
        let half = self.width() / 2.0;
        let (mut tail, mut sign, mut start) = ([0.0; N], [0.0; N], [0.0; N]);
        for i in 0..N {
            // The tails are solved on the left alone, where y keeps its precision.
            let is_left = y[i] <= 0.5;
            tail[i] = if is_left { y[i] } else { 1.0 - y[i] };
            sign[i] = if is_left { 1.0 } else { -1.0 };
        }
        for i in 0..N {
            let place = tail[i] * (2 * SPANS) as f64;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between 0 and SPANS, from a tail between 0 and 1/2"
            )]
            let span = (place as usize).min(SPANS - 1);
            let part = place - span as f64;
            let (below, above) = (self.starts[span], self.starts[span + 1]);
            // On the chord, close below the root; in the outermost span, where N_m is flat, from above.
            start[i] = if span == 0 {
                above
            } else {
                below + (above - below) * part
            };
        }
        let mut x = self.solve(&tail, start);
        for i in 0..N {
            x[i] = (x[i] - half) * sign[i];
        }
        x
    }
}

/// The pieces of the B-spline of order m up to its middle, by the recursion n_q(x) = (x n_{q−1}(x) + (q − x) n_{q−1}(x − 1)) / (q − 1).
///
/// N_m and n_m, the constant first.
fn pieces(m: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
    let count = m.div_ceil(2);
    // densities[j] is n_q over j … j + 1.
    let mut densities = vec![vec![0.0; m]; count];
    densities[0][0] = 1.0;
    for q in 2..=m {
        for j in (0..count).rev() {
            let mut next = vec![0.0; m];
            let mut add = |of: &[f64], constant: f64, slope: f64| {
                for (k, value) in of.iter().enumerate().take(q - 1) {
                    next[k] += constant * value / (q - 1) as f64;
                    next[k + 1] += slope * value / (q - 1) as f64;
                }
            };
            add(&densities[j], j as f64, 1.0);
            if j > 0 {
                add(&densities[j - 1], (q - j) as f64, -1.0);
            }
            densities[j] = next;
        }
    }
    let mut below = 0.0;
    let integrated = |density: Vec<f64>| {
        let parts = density.iter().enumerate();
        let mut distribution = vec![below];
        distribution.extend(parts.map(|(k, value)| value / (k + 1) as f64));
        below = distribution.iter().sum();
        (distribution, density)
    };
    densities.into_iter().map(integrated).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// N_m(x) and n_m(x) by a triangle of differences, x in 0 … m.
    fn triangle(m: usize, x: f64) -> (f64, f64) {
        // row[k] is N_q(x − k), for growing q.
        let mut row: Vec<f64> = (0..=m).map(|k| (x - k as f64).clamp(0.0, 1.0)).collect();
        if m == 1 {
            return (row[0], if x < 1.0 { 1.0 } else { 0.0 });
        }
        for q in 2..m {
            for k in 0..=m - q {
                let share = (x - k as f64) / q as f64;
                row[k] = share * row[k] + (1.0 - share) * row[k + 1];
            }
        }
        let share = x / m as f64;
        (share * row[0] + (1.0 - share) * row[1], row[0] - row[1])
    }

    /// Evenly spread numbers in [0, 1), tails included.
    fn shares() -> impl Iterator<Item = f64> {
        let tails = [1e-12, 1e-8, 1e-6, 1e-4, 1.0 - 1e-9];
        (0..1000).map(|i| f64::from(i) / 1000.0).chain(tails)
    }

    #[test]
    fn the_inverse_inverts_at_every_order() {
        for order in [1, 2, 3, 4, 5, 8, 15, 20, 64] {
            let spline = BSpline::new(order);
            for y in shares() {
                let x = spline.inverse(&[y])[0] + f64::from(order) / 2.0;
                let (back, _) = triangle(order as usize, x);
                assert!((back - y).abs() < 1e-12, "order {order}: {y} gave {back}");
            }
        }
    }

    #[test]
    fn box_and_tent_have_their_closed_forms() {
        let (square, tent) = (BSpline::new(1), BSpline::new(2));
        for y in shares() {
            assert!((square.inverse(&[y])[0] - (y - 0.5)).abs() < 1e-12);
            let closed = if y < 0.5 {
                (2.0 * y).sqrt() - 1.0
            } else {
                1.0 - (2.0 * (1.0 - y)).sqrt()
            };
            assert!((tent.inverse(&[y])[0] - closed).abs() < 1e-7, "{y}");
        }
    }

    #[test]
    fn the_cubic_is_the_known_polynomial() {
        let cubic = BSpline::new(4);
        for i in 0..=200 {
            let x = f64::from(i) / 100.0;
            let s = (x - 2.0).abs();
            let density = if s < 1.0 {
                2.0 / 3.0 - s * s + s * s * s / 2.0
            } else {
                let t = 2.0 - s;
                t * t * t / 6.0
            };
            assert!((cubic.distribution(&[x]).1[0] - density).abs() < 1e-14);
        }
        // The first piece of its distribution is x⁴/24.
        let y: f64 = 1e-3;
        let x = (24.0 * y).sqrt().sqrt() - 2.0;
        assert!((cubic.inverse(&[y])[0] - x).abs() < 1e-12);
    }

    #[test]
    fn moments_are_those_of_a_sum_of_uniform_numbers() {
        // n_m is the density of the sum of m uniform numbers: mean 0 (centred), variance m/12,
        // fourth moment m/80 + m(m − 1)/48.
        const COUNT: u32 = 20_000;
        for order in [1, 2, 3, 4, 7] {
            let spline = BSpline::new(order);
            let m = f64::from(order);
            let mut moments = [0.0; 3];
            for i in 0..COUNT {
                let [x] = spline.inverse(&[(f64::from(i) + 0.5) / f64::from(COUNT)]);
                assert!(x.abs() <= m / 2.0);
                moments[0] += x / f64::from(COUNT);
                moments[1] += x * x / f64::from(COUNT);
                moments[2] += x * x * x * x / f64::from(COUNT);
            }
            assert!(moments[0].abs() < 1e-9);
            assert!((moments[1] - m / 12.0).abs() < 1e-4);
            assert!((moments[2] - (m / 80.0 + m * (m - 1.0) / 48.0)).abs() < 1e-3);
        }
    }

    #[test]
    fn samples_are_symmetric_and_rise() {
        let spline = BSpline::new(4);
        let mut last = f64::NEG_INFINITY;
        for i in 1..4096 {
            let y = f64::from(i) / 4096.0;
            let [x] = spline.inverse(&[y]);
            assert!(x > last);
            assert_eq!(x, -spline.inverse(&[1.0 - y])[0]);
            last = x;
        }
    }
}
