//! Which samples a pixel takes: N × N strata in the image, N² in time, permuted.

use field::SimdLevel;
use field::hash::{hash, unit};
use model::Rect;

use super::spline::BSpline;

/// Most rays along each side of a pixel's N × N.
pub const RAYS_MAX: u32 = 128;

/// Numbers that are inverted side by side.
const LANES: usize = 64;

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
    /// Of every sample of a pixel its column's and its row's number.
    strata: [Vec<f64>; 2],
    key: u32,
    image: u32,
}

impl Strata {
    /// The samples of image `image`; `order` 0 takes the pixel centre and the shutter's middle.
    pub(crate) fn new(rays: u32, order: u32, key: u32, image: u32) -> Self {
        let columns = (0..rays).flat_map(|_| (0..rays).map(f64::from));
        let rows = (0..rays).flat_map(|v| (0..rays).map(move |_| f64::from(v)));
        Self {
            rays,
            filter: (order > 0).then(|| BSpline::new(order)),
            strata: [columns.collect(), rows.collect()],
            key,
            image,
        }
    }

    /// Samples of each pixel, N².
    pub(crate) fn per_pixel(&self) -> usize {
        (self.rays * self.rays) as usize
    }

    /// Appends the samples of the pixels of `part`, row by row; `draws` is memory for their random numbers.
    pub(crate) fn of_pixels(
        &self,
        level: SimdLevel,
        part: Rect,
        draws: &mut Draws,
        samples: &mut Vec<Sample>,
    ) {
        let places = (part.y0..part.y1).flat_map(|y| (part.x0..part.x1).map(move |x| (x, y)));
        let centre = |(x, y)| [f64::from(x) + 0.5, f64::from(y) + 0.5];
        let Some(filter) = &self.filter else {
            samples.extend(places.map(|pixel| Sample {
                place: centre(pixel),
                instant: 0.5,
            }));
            return;
        };
        let count = self.per_pixel();
        draws.clear();
        for pixel in places.clone() {
            level.vectorize(
                #[inline(always)]
                || self.draw(pixel, draws),
            );
            // Fisher and Yates: the instants change places, so that time says nothing about place.
            let first = draws.instant.len() - count;
            let (instants, partners) = (&mut draws.instant[first..], &draws.partner[first..]);
            for sample in (1..count).rev() {
                instants.swap(sample, partners[sample] as usize);
            }
        }
        for across in &mut draws.across {
            level.vectorize(
                #[inline(always)]
                || invert(filter, across),
            );
        }
        let [across, down] = &draws.across;
        let mut drawn = across.iter().zip(down).zip(&draws.instant);
        for pixel in places {
            let centre = centre(pixel);
            let drawn = drawn.by_ref().take(count);
            samples.extend(drawn.map(|((across, down), instant)| Sample {
                place: [centre[0] + across, centre[1] + down],
                instant: *instant,
            }));
        }
    }

    /// Appends the random numbers of a pixel.
    #[inline(always)]
    fn draw(&self, (x, y): (u32, u32), draws: &mut Draws) {
        let count = self.per_pixel();
        let first = draws.instant.len();
        let random = |sample: u32, dimension: Dimension| {
            hash(&[self.key, self.image, x, y, sample, dimension as u32])
        };
        let strata = f64::from(self.rays);
        let dimensions = [Dimension::Column, Dimension::Row];
        for ((across, strata_of), dimension) in
            draws.across.iter_mut().zip(&self.strata).zip(dimensions)
        {
            across.resize(first + count, 0.0);
            for ((across, stratum), sample) in across[first..].iter_mut().zip(strata_of).zip(0..) {
                *across = (stratum + unit(random(sample, dimension))) / strata;
            }
        }
        let instants = f64::from(self.rays * self.rays);
        draws.instant.resize(first + count, 0.0);
        for (instant, sample) in draws.instant[first..].iter_mut().zip(0..) {
            *instant = (f64::from(sample) + unit(random(sample, Dimension::Instant))) / instants;
        }
        draws.partner.resize(first + count, 0);
        for (partner, sample) in draws.partner[first..].iter_mut().zip(0..) {
            *partner = below(random(sample, Dimension::Shuffle), sample + 1);
        }
    }
}

/// Random numbers of the samples of some pixels.
#[derive(Default)]
pub(crate) struct Draws {
    /// Between 0 and 1 along the row and along the column; then pixels from the centre.
    across: [Vec<f64>; 2],
    /// Each in its part of the shutter.
    instant: Vec<f64>,
    /// With which sample before it a sample changes its instant.
    partner: Vec<u32>,
}

impl Draws {
    fn clear(&mut self) {
        for across in &mut self.across {
            across.clear();
        }
        self.instant.clear();
        self.partner.clear();
    }
}

/// A random number below `limit`.
#[inline(always)]
fn below(random: u32, limit: u32) -> u32 {
    ((u64::from(random) * u64::from(limit)) >> 32) as u32
}

/// Puts in place of uniform numbers where samples lie.
#[inline(always)]
fn invert(filter: &BSpline, numbers: &mut [f64]) {
    let (lanes, rest) = numbers.as_chunks_mut::<LANES>();
    for lanes in lanes {
        *lanes = filter.inverse(lanes);
    }
    let mut lanes = [0.5; LANES];
    lanes[..rest.len()].copy_from_slice(rest);
    rest.copy_from_slice(&filter.inverse(&lanes)[..rest.len()]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(strata: &Strata, x: u32, y: u32) -> Vec<Sample> {
        let mut samples = Vec::new();
        let pixel = Rect {
            x0: x,
            y0: y,
            x1: x + 1,
            y1: y + 1,
        };
        let draws = &mut Draws::default();
        strata.of_pixels(SimdLevel::best(), pixel, draws, &mut samples);
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
    fn every_level_and_every_part_gives_the_same_samples() {
        for (rays, order) in [(1, 4), (3, 4), (4, 1), (6, 9)] {
            let strata = Strata::new(rays, order, 5, 8);
            let (x0, y0) = (17, 40);
            let part = Rect {
                x0,
                y0,
                x1: x0 + 5,
                y1: y0 + 3,
            };
            let places = (y0..y0 + 3).flat_map(|y| (x0..x0 + 5).map(move |x| (x, y)));
            let one_by_one: Vec<Sample> = places.flat_map(|(x, y)| pixel(&strata, x, y)).collect();
            for level in SimdLevel::all_available() {
                let mut samples = Vec::new();
                strata.of_pixels(level, part, &mut Draws::default(), &mut samples);
                assert_eq!(samples, one_by_one, "{}", level.name());
            }
        }
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
