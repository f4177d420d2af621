//! Which images of an animation: half-open ranges, as users write them.

use core::fmt;
use core::str::FromStr;

use crate::ImageNumber;

/// Most images that one range may name.
pub const FRAMES_MAX: u32 = 10_000_000;

/// Image numbers `start`, `start + step`, … below `end`; never empty.
///
/// Written `7` (one image), `0..500` (half-open) or `0..500:10`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct FrameRange {
    start: u32,
    end: u32,
    step: u32,
}

impl FrameRange {
    /// The images from `start` up to and without `end`, every `step`-th.
    pub fn new(start: u32, end: u32, step: u32) -> Result<Self, BadFrameRange> {
        if step == 0 {
            return Err(BadFrameRange::NoStep);
        }
        if start >= end {
            return Err(BadFrameRange::Empty);
        }
        let range = Self { start, end, step };
        if range.count() > FRAMES_MAX {
            return Err(BadFrameRange::TooMany);
        }
        Ok(range)
    }

    /// How many images it names; at least 1.
    pub const fn count(self) -> u32 {
        (self.end - self.start).div_ceil(self.step)
    }

    /// First number named.
    pub const fn start(self) -> u32 {
        self.start
    }

    /// One past the last number that may be named.
    pub const fn end(self) -> u32 {
        self.end
    }

    /// Distance between two numbers named.
    pub const fn step(self) -> u32 {
        self.step
    }

    /// The images, in order.
    pub fn iter(self) -> impl ExactSizeIterator<Item = ImageNumber> {
        (self.start..self.end)
            .step_by(self.step as usize)
            .map(ImageNumber)
    }

    /// The `index`-th image, counting from 0.
    pub fn nth(self, index: u32) -> Option<ImageNumber> {
        (index < self.count()).then(|| ImageNumber(self.start + index * self.step))
    }

    /// Where `image` stands in the range, counting from 0.
    pub fn index_of(self, image: ImageNumber) -> Option<u32> {
        let inside = image.0 >= self.start && image.0 < self.end;
        (inside && (image.0 - self.start).is_multiple_of(self.step))
            .then(|| (image.0 - self.start) / self.step)
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.count(), self.step) {
            (1, _) => write!(f, "{}", self.start),
            (_, 1) => write!(f, "{}..{}", self.start, self.end),
            (_, step) => write!(f, "{}..{}:{step}", self.start, self.end),
        }
    }
}

/// Why a text or a triple of numbers is no range of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadFrameRange {
    /// The text has another form.
    Form,
    /// No image lies between the two ends.
    Empty,
    /// The step is 0.
    NoStep,
    /// More than [`FRAMES_MAX`] images.
    TooMany,
}

impl fmt::Display for BadFrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Form => f.write_str("frames are written as 7, 0..500 or 0..500:10"),
            Self::Empty => f.write_str(
                "the range holds no frame (the end is not included: 0..1 is frame 0 alone)",
            ),
            Self::NoStep => f.write_str("the step between frames is 0"),
            Self::TooMany => write!(f, "the range holds more than {FRAMES_MAX} frames"),
        }
    }
}

impl core::error::Error for BadFrameRange {}

impl FromStr for FrameRange {
    type Err = BadFrameRange;

    fn from_str(text: &str) -> Result<Self, BadFrameRange> {
        let number = |digits: &str| {
            digits
                .trim()
                .parse::<u32>()
                .map_err(|_| BadFrameRange::Form)
        };
        let (range, step) = match text.split_once(':') {
            Some((range, step)) => (range, number(step)?),
            None => (text, 1),
        };
        match range.split_once("..") {
            Some((start, end)) => Self::new(number(start)?, number(end)?, step),
            None if text.contains(':') => Err(BadFrameRange::Form),
            None => {
                let only = number(range)?;
                Self::new(only, only.checked_add(1).ok_or(BadFrameRange::Form)?, 1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;

    #[test]
    fn ranges_as_users_write_them() {
        let numbers = |text: &str| {
            text.parse::<FrameRange>()
                .map(|range| range.iter().map(|n| n.0).collect::<Vec<_>>())
        };
        assert_eq!(numbers("7"), Ok([7].into()));
        assert_eq!(numbers("0..3"), Ok([0, 1, 2].into()));
        assert_eq!(numbers("0..25:10"), Ok([0, 10, 20].into()));
        assert_eq!(numbers("3..3"), Err(BadFrameRange::Empty));
        assert_eq!(numbers("5..3"), Err(BadFrameRange::Empty));
        assert_eq!(numbers("0..3:0"), Err(BadFrameRange::NoStep));
        assert_eq!(numbers("0..4000000000"), Err(BadFrameRange::TooMany));
        assert_eq!(numbers("-1..3"), Err(BadFrameRange::Form));
        assert_eq!(numbers("7:2"), Err(BadFrameRange::Form));
    }

    #[test]
    fn places_and_numbers_agree() {
        let range: FrameRange = "4..30:7".parse().unwrap();
        assert_eq!(range.to_string(), "4..30:7");
        for (index, image) in range.iter().enumerate() {
            let index = u32::try_from(index).unwrap();
            assert_eq!(range.nth(index), Some(image));
            assert_eq!(range.index_of(image), Some(index));
        }
        assert_eq!(range.nth(range.count()), None);
        assert_eq!(range.index_of(ImageNumber(5)), None);
    }
}
