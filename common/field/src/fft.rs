//! The discrete Fourier transform over lengths that are powers of two: the same bits on every machine.
//!
//! Radix 2, decimation in time, one order of operations, its roots of unity from `libm`.
//! Libraries take their roots from the machine's own sine, and their order from its
//! vector width; a terrain that is synthesised by a transform must depend on neither.

use std::f64::consts::TAU;

/// Greatest length of a transform.
pub const LENGTH_MAX: usize = 1 << 22;

/// A complex number.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct Complex {
    /// The real part.
    pub re: f64,
    /// The imaginary part.
    pub im: f64,
}

impl Complex {
    /// re + i im.
    pub const fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }

    /// |z|².
    pub fn power(self) -> f64 {
        self.re * self.re + self.im * self.im
    }

    fn plus(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }

    fn minus(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }

    fn times(self, other: Self) -> Self {
        Self::new(
            self.re * other.re - self.im * other.im,
            self.re * other.im + self.im * other.re,
        )
    }
}

/// The sign of the exponent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    /// Σ fⱼ e^{−2πijk/N}, from samples to the spectrum.
    Forward,
    /// Σ fₖ e^{+2πijk/N}, from the spectrum to samples, as thesis eq. (3.27): not divided by N.
    Inverse,
}

/// A transform of one length.
#[derive(Clone, Debug)]
pub struct Fft {
    length: usize,
    /// e^{−2πij/N}, j below N/2.
    roots: Vec<Complex>,
}

impl Fft {
    /// A transform of that length; `None` if it is no power of two up to [`LENGTH_MAX`].
    pub fn new(length: usize) -> Option<Self> {
        if !length.is_power_of_two() || length > LENGTH_MAX {
            return None;
        }
        let step = TAU / whole(length);
        let roots = (0..length / 2)
            .map(|j| {
                let (sine, cosine) = libm::sincos(step * whole(j));
                Complex::new(cosine, -sine)
            })
            .collect();
        Some(Self { length, roots })
    }

    /// Its length.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Transforms `samples` in place.
    ///
    /// # Panics
    /// If they are not as many as the transform's length.
    pub fn run(&self, direction: Direction, samples: &mut [Complex]) {
        assert_eq!(samples.len(), self.length, "a transform has one length");
        reverse_bits(samples);
        let mut half = 1;
        while half < self.length {
            let stride = self.length / (2 * half);
            for block in samples.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (j, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let mut root = self.roots[j * stride];
                    if direction == Direction::Inverse {
                        root.im = -root.im;
                    }
                    let turned = b.times(root);
                    (*a, *b) = (a.plus(turned), a.minus(turned));
                }
            }
            half *= 2;
        }
    }

    /// Transforms along every axis of a square or cube in place; the first axis is that of neighbours.
    ///
    /// # Panics
    /// If the samples are not the length to the power of `axes`.
    pub fn run_axes(&self, direction: Direction, axes: u32, samples: &mut [Complex]) {
        assert_eq!(
            samples.len(),
            self.length.pow(axes),
            "every axis has the transform's length"
        );
        let mut line = vec![Complex::default(); self.length];
        for axis in 0..axes {
            let stride = self.length.pow(axis);
            for start in 0..samples.len() {
                if !(start / stride).is_multiple_of(self.length) {
                    continue;
                }
                for (i, sample) in line.iter_mut().enumerate() {
                    *sample = samples[start + i * stride];
                }
                self.run(direction, &mut line);
                for (i, sample) in line.iter().enumerate() {
                    samples[start + i * stride] = *sample;
                }
            }
        }
    }
}

/// Moves every sample to the place whose number has its bits in reverse.
fn reverse_bits(samples: &mut [Complex]) {
    let bits = samples.len().trailing_zeros();
    if bits == 0 {
        return;
    }
    for i in 0..samples.len() {
        let j = i.reverse_bits() >> (usize::BITS - bits);
        if i < j {
            samples.swap(i, j);
        }
    }
}

/// A length as a number: far below 2⁵³.
#[expect(
    clippy::cast_precision_loss,
    reason = "lengths are at most LENGTH_MAX, which a double holds"
)]
fn whole(length: usize) -> f64 {
    length as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::{hash, unit};

    fn random(n: usize) -> Vec<Complex> {
        let number =
            |i: usize, part: u32| unit(hash(&[u32::try_from(i).expect("few samples"), part])) - 0.5;
        (0..n)
            .map(|i| Complex::new(number(i, 0), number(i, 1)))
            .collect()
    }

    /// The sum as it is defined.
    fn by_definition(samples: &[Complex], sign: f64) -> Vec<Complex> {
        let n = samples.len();
        (0..n)
            .map(|k| {
                let mut sum = Complex::default();
                for (j, sample) in samples.iter().enumerate() {
                    let (sine, cosine) = libm::sincos(sign * TAU * whole(j * k % n) / whole(n));
                    sum = sum.plus(sample.times(Complex::new(cosine, sine)));
                }
                sum
            })
            .collect()
    }

    fn close(a: &[Complex], b: &[Complex]) -> bool {
        a.iter().zip(b).all(|(a, b)| a.minus(*b).power() < 1e-20)
    }

    #[test]
    fn it_is_the_sum_of_its_definition() {
        for n in [1, 2, 4, 8, 64, 256] {
            let samples = random(n);
            let fft = Fft::new(n).expect("a power of two");
            for (direction, sign) in [(Direction::Forward, -1.0), (Direction::Inverse, 1.0)] {
                let mut fast = samples.clone();
                fft.run(direction, &mut fast);
                assert!(close(&fast, &by_definition(&samples, sign)), "{n} {sign}");
            }
        }
        assert!(Fft::new(12).is_none() && Fft::new(0).is_none());
        assert!(Fft::new(2 * LENGTH_MAX).is_none());
    }

    #[test]
    fn there_and_back_along_every_axis() {
        for axes in 1..=3 {
            let n: usize = 16;
            let samples = random(n.pow(axes));
            let fft = Fft::new(n).expect("a power of two");
            let mut there = samples.clone();
            fft.run_axes(Direction::Forward, axes, &mut there);
            fft.run_axes(Direction::Inverse, axes, &mut there);
            let scale = 1.0 / whole(n.pow(axes));
            let back: Vec<_> = there
                .iter()
                .map(|z| Complex::new(z.re * scale, z.im * scale))
                .collect();
            assert!(close(&back, &samples), "{axes}");
        }
    }

    #[test]
    fn a_wave_along_one_axis_is_one_coefficient_there() {
        let n = 8;
        let fft = Fft::new(n).expect("a power of two");
        let mut samples: Vec<_> = (0..n * n)
            .map(|i| {
                let (sine, cosine) = libm::sincos(TAU * 3.0 * whole(i % n) / whole(n));
                Complex::new(cosine, sine)
            })
            .collect();
        fft.run_axes(Direction::Forward, 2, &mut samples);
        for (i, z) in samples.iter().enumerate() {
            let expected = if i == 3 { 64.0 } else { 0.0 };
            assert!((z.re - expected).abs() < 1e-12 && z.im.abs() < 1e-12, "{i}");
        }
    }
}
