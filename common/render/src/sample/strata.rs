//! Which samples a pixel takes: N × N strata in the image, N² in time, permuted.

use field::hash::{hash, unit};

use super::spline::BSpline;

/// Most rays along each side of a pixel's N × N.
pub const RAYS_MAX: u32 = 128;

/// What a random number is for; numbers of different dimensions have nothing to do with each other.
#[derive(Clone, Copy)]
enum Dimension {
    Column = 0,
    Row = 1,
    Instant = 2,
    Shuffle = 3,
}

/// One sample of the image.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Sample {
    /// Place in the image in pixels: the centre of pixel (x, y) is (x + ½, y + ½).
    pub(crate) place: [f64; 2],
    /// When, as a share of the time that the shutter is open: 0 … 1.
    pub(crate) instant: f64,
}

/// The samples of every pixel of one image, thesis eqs. (6.8), (6.13), (6.20) mended.
///
/// All samples of a pixel weigh the same, 1/N²: their density is the filter. The
/// random numbers of a sample are keyed by scene, image, pixel, sample and dimension.
#[derive(Clone, Debug)]
pub(crate) struct Strata {
    /// N.
    rays: u32,
    /// `None` takes the centres of the strata of the pixel itself.
    filter: Option<BSpline>,
    key: u32,
    image: u32,
}

impl Strata {
    /// The samples of image `image`; `order` 0 takes the pixel centre and the shutter's middle.
    pub(crate) fn new(rays: u32, order: u32, key: u32, image: u32) -> Self {
        Self {
            rays,
            filter: (order > 0).then(|| BSpline::new(order)),
            key,
            image,
        }
    }

    /// Samples of each pixel, N².
    pub(crate) fn per_pixel(&self) -> usize {
        (self.rays * self.rays) as usize
    }

    /// Appends the samples of the pixel in column `x` and row `y`.
    pub(crate) fn of_pixel(&self, x: u32, y: u32, samples: &mut Vec<Sample>) {
        let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
        let Some(filter) = &self.filter else {
            samples.push(Sample {
                place: centre,
                instant: 0.5,
            });
            return;
        };
        let first = samples.len();
        let strata = f64::from(self.rays);
        let instants = f64::from(self.rays * self.rays);
        let pixel = [self.key, self.image, x, y];
        let random = |sample: u32, dimension: Dimension| {
            let [key, image, x, y] = pixel;
            hash(&[key, image, x, y, sample, dimension as u32])
        };
        for v in 0..self.rays {
            for u in 0..self.rays {
                let sample = v * self.rays + u;
                let across = |stratum: u32, dimension| {
                    filter.inverse((f64::from(stratum) + unit(random(sample, dimension))) / strata)
                };
                samples.push(Sample {
                    place: [
                        centre[0] + across(u, Dimension::Column),
                        centre[1] + across(v, Dimension::Row),
                    ],
                    instant: (f64::from(sample) + unit(random(sample, Dimension::Instant)))
                        / instants,
                });
            }
        }
        // Fisher and Yates: the instants change places, so that time says nothing about place.
        for sample in (1..self.rays * self.rays).rev() {
            let partner =
                (u64::from(random(sample, Dimension::Shuffle)) * u64::from(sample + 1)) >> 32;
            let (a, b) = (first + sample as usize, first + partner as usize);
            let instant = samples[a].instant;
            samples[a].instant = samples[b].instant;
            samples[b].instant = instant;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(strata: &Strata, x: u32, y: u32) -> Vec<Sample> {
        let mut samples = Vec::new();
        strata.of_pixel(x, y, &mut samples);
        samples
    }

    /// The whole part of a small number.
    fn index(value: f64) -> usize {
        (0..64).take_while(|&i| f64::from(i + 1) <= value).count()
    }

    #[test]
    fn every_stratum_of_place_and_time_holds_one_sample() {
        let strata = Strata::new(5, 1, 7, 3);
        let samples = pixel(&strata, 20, 30);
        let mut places = [false; 25];
        let mut instants = [false; 25];
        for sample in samples {
            let u = index((sample.place[0] - 20.0) * 5.0);
            let v = index((sample.place[1] - 30.0) * 5.0);
            assert!(!core::mem::replace(&mut places[v * 5 + u], true));
            let w = index(sample.instant * 25.0);
            assert!(!core::mem::replace(&mut instants[w], true));
        }
    }

    #[test]
    fn samples_belong_to_key_image_and_pixel() {
        let at = |key, image, x| pixel(&Strata::new(2, 4, key, image), x, 9);
        assert_eq!(at(1, 2, 3), at(1, 2, 3));
        assert_ne!(at(1, 2, 3), at(2, 2, 3));
        assert_ne!(at(1, 2, 3)[0].instant, at(1, 3, 3)[0].instant);
        let moved = |x: u32| at(1, 2, x)[0].place[0] - f64::from(x);
        assert_ne!(moved(3), moved(4));
    }

    #[test]
    fn time_is_independent_of_place() {
        // Correlation of instant and column over many pixels: 3 / √(9 · 4096) expected noise.
        let strata = Strata::new(3, 4, 11, 0);
        let mut product = 0.0;
        let mut count = 0.0;
        for y in 0..64 {
            for x in 0..64 {
                for sample in pixel(&strata, x, y) {
                    product += (sample.place[0] - f64::from(x) - 0.5) * (sample.instant - 0.5);
                    count += 1.0;
                }
            }
        }
        let correlation = product / count / ((4.0f64 / 12.0).sqrt() * (1.0f64 / 12.0).sqrt());
        assert!(correlation.abs() < 0.02, "{correlation}");
    }

    #[test]
    fn order_zero_is_the_pixel_centre() {
        let samples = pixel(&Strata::new(1, 0, 0, 0), 4, 5);
        assert_eq!(samples.len(), 1);
        assert_eq!(samples[0].place, [4.5, 5.5]);
    }
}
