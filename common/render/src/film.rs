//! Samples become pixels.

use glam::DVec3;
use model::Rect;
use model::film::CHANNEL_COUNT;

use crate::counts::Counts;
use crate::sky::Colour;

/// What a sample saw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// Light that reached the eye.
    pub(crate) radiance: Colour,
    /// Distance and unit normal of the surface, if there was any.
    pub(crate) surface: Option<(f64, DVec3)>,
}

impl Seen {
    /// No light from nowhere.
    pub(crate) const NOTHING: Self = Self {
        radiance: [0.0; 3],
        surface: None,
    };
}

/// The pixels of a block, filled in any order.
pub(crate) struct Film<'a> {
    pixels: &'a mut Vec<f32>,
    block: Rect,
}

impl<'a> Film<'a> {
    /// An empty film in `pixels`, plane by plane.
    pub(crate) fn new(block: Rect, pixels: &'a mut Vec<f32>) -> Self {
        pixels.clear();
        pixels.resize(area(block) * CHANNEL_COUNT, 0.0);
        Self { pixels, block }
    }

    /// Fills the pixels of a part, each with the mean of its samples: summed in their order, each of the same weight. `seen` has
    /// those of every pixel one after the other, row by row.
    ///
    /// A sample that is not finite counts as black, and is counted.
    pub(crate) fn put(&mut self, part: Rect, seen: &[Seen], per_pixel: usize, counts: &mut Counts) {
        if part.is_empty() {
            return;
        }
        let (width, block) = (part.width() as usize, self.block);
        let mut planes = self.pixels.chunks_exact_mut(area(block));
        let mut planes: [&mut [f32]; CHANNEL_COUNT] =
            std::array::from_fn(|_| planes.next().unwrap_or_default());
        let rows = seen.chunks_exact(width * per_pixel);
        for (y, row) in (part.y0 - block.y0..).zip(rows) {
            let start = y as usize * block.width() as usize + (part.x0 - block.x0) as usize;
            let mut planes = planes
                .each_mut()
                .map(|plane| &mut plane[start..start + width]);
            for (x, samples) in row.chunks_exact(per_pixel).enumerate() {
                for (plane, value) in planes.iter_mut().zip(mean(samples, counts)) {
                    plane[x] = single(value);
                }
            }
        }
        counts.pixels += part.area();
    }
}

/// The mean of a pixel's samples, channel by channel.
#[inline]
fn mean(samples: &[Seen], counts: &mut Counts) -> [f64; CHANNEL_COUNT] {
    let mut light = [0.0; 3];
    let mut normal = DVec3::ZERO;
    let (mut met, mut way) = (0.0, 0.0);
    for seen in samples {
        if seen.radiance.iter().all(|c| c.is_finite()) {
            for (sum, radiance) in light.iter_mut().zip(seen.radiance) {
                *sum += radiance;
            }
        } else {
            counts.not_finite += 1;
        }
        if let Some((distance, towards)) = seen.surface {
            met += 1.0;
            way += distance;
            normal += towards;
        }
    }
    let weight = 1.0 / samples.len() as f64;
    [
        light[0] * weight,
        light[1] * weight,
        light[2] * weight,
        met * weight,
        if met > 0.0 { way / met } else { 0.0 },
        normal.x * weight,
        normal.y * weight,
        normal.z * weight,
    ]
}

/// The number of a block's pixels.
fn area(block: Rect) -> usize {
    block.width() as usize * block.height() as usize
}

/// The nearest `f32`, never infinite.
fn single(value: f64) -> f32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding to the film's precision is meant"
    )]
    let single = value as f32;
    single.clamp(f32::MIN, f32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXEL: Rect = Rect {
        x0: 3,
        y0: 4,
        x1: 4,
        y1: 5,
    };

    #[test]
    fn a_pixel_is_the_mean_of_its_samples() {
        let seen = |red: f64, surface| Seen {
            radiance: [red, 0.0, 1.0],
            surface,
        };
        let mut pixels = Vec::new();
        let mut counts = Counts::default();
        Film::new(PIXEL, &mut pixels).put(
            PIXEL,
            &[
                seen(1.0, Some((10.0, DVec3::Z))),
                seen(0.0, None),
                seen(3.0, Some((30.0, DVec3::X))),
                seen(0.0, None),
            ],
            4,
            &mut counts,
        );
        assert_eq!(pixels, [1.0, 0.0, 1.0, 0.5, 20.0, 0.25, 0.0, 0.25]);
        assert_eq!((counts.pixels, counts.not_finite), (1, 0));
    }

    #[test]
    fn nothing_that_is_not_finite_leaves() {
        let mut pixels = Vec::new();
        let mut counts = Counts::default();
        let seen = [f64::NAN, f64::INFINITY, 1e300, 2.0].map(|red| Seen {
            radiance: [red, 1.0, 1.0],
            surface: None,
        });
        Film::new(PIXEL, &mut pixels).put(PIXEL, &seen, 4, &mut counts);
        assert!(pixels.iter().all(|value| value.is_finite()));
        assert_eq!(counts.not_finite, 2);
    }
}
