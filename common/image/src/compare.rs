//! Whether two frames store the same values, and where they do not.

use std::path::Path;

use crate::error::ImageError;
use crate::read::{self, Part, Picture, Window};

/// What comparing two frames found. Metadata and packing are not compared.
#[derive(Clone, PartialEq, Debug)]
pub struct Comparison {
    /// Pixels compared, of all parts.
    pub pixels: u64,
    /// Pixels that differ in any channel, bit by bit.
    pub differing_pixels: u64,
    /// The first difference, row by row from the top; `None` if the frames are equal.
    pub first: Option<Difference>,
    /// The largest absolute difference; infinite where one value is not a number and the other
    /// differs from it; 0 if the frames are equal.
    pub largest: f64,
    /// The smallest rectangle around all differences.
    pub bounds: Option<Window>,
}

/// One sample that differs.
#[derive(Clone, PartialEq, Debug)]
pub struct Difference {
    /// Column, in the coordinates of the file.
    pub x: i32,
    /// Row, in the coordinates of the file.
    pub y: i32,
    /// Name of the channel; in a multi-part file after the part's name and a colon.
    pub channel: String,
    /// The first frame's value.
    pub a: f64,
    /// The second frame's value.
    pub b: f64,
}

impl Comparison {
    /// Whether both frames store the same values.
    pub fn is_equal(&self) -> bool {
        self.differing_pixels == 0
    }
}

/// Compares two frames sample by sample, as they are stored.
///
/// Fails if one cannot be read, or if they differ in format, windows or channels, so that their
/// pixels do not correspond. See [`DECODED_BYTES_MAX`](crate::DECODED_BYTES_MAX) for the memory
/// that each may take.
pub fn compare(a: impl AsRef<Path>, b: impl AsRef<Path>) -> Result<Comparison, ImageError> {
    let (a_path, b_path) = (a.as_ref(), b.as_ref());
    let (a, b) = (read::picture(a_path)?, read::picture(b_path)?);
    if let Some(what) = obstacle(&a, &b) {
        return Err(ImageError::NotComparable {
            a: a_path.to_owned(),
            b: b_path.to_owned(),
            what,
        });
    }
    let mut found = Found::default();
    for (a, b) in a.parts.iter().zip(&b.parts) {
        found.compare(a, b);
    }
    Ok(found.comparison())
}

/// Why the pixels of two frames do not correspond.
fn obstacle(a: &Picture, b: &Picture) -> Option<String> {
    if a.kind != b.kind {
        return Some(format!("one is {}, the other {}", a.kind, b.kind));
    }
    if a.parts.len() != b.parts.len() {
        let (a, b) = (a.parts.len(), b.parts.len());
        return Some(format!("one has {a} parts, the other {b}"));
    }
    a.parts.iter().zip(&b.parts).find_map(|(a, b)| {
        if a.display_window != b.display_window {
            let (a, b) = (a.display_window, b.display_window);
            return Some(format!("the image is {a} in one, {b} in the other"));
        }
        if a.data_window != b.data_window {
            let (a, b) = (a.data_window, b.data_window);
            return Some(format!("one stores {a}, the other {b}"));
        }
        let (a, b) = (channels(a), channels(b));
        (a != b).then(|| format!("one has the channels {a}, the other {b}"))
    })
}

fn channels(part: &Part) -> String {
    let channels: Vec<_> = part
        .channels
        .iter()
        .map(|channel| format!("{} ({})", channel.name, channel.samples.kind()))
        .collect();
    channels.join(", ")
}

/// Differences, while they are gathered.
#[derive(Default)]
struct Found {
    pixels: u64,
    differing: u64,
    first: Option<Difference>,
    largest: f64,
    /// Columns and rows, both ends included.
    bounds: Option<[i64; 4]>,
}

impl Found {
    /// Takes in a part of the same windows and channels in both frames.
    fn compare(&mut self, a: &Part, b: &Part) {
        let window = a.data_window;
        let width = window.width as usize;
        for y in 0..window.height {
            let row = y as usize * width;
            for x in 0..window.width {
                let index = row + x as usize;
                if self.pixel(a, b, index, (i64::from(x), i64::from(y))) {
                    self.differing += 1;
                }
            }
        }
        self.pixels += u64::from(window.width) * u64::from(window.height);
    }

    /// Takes in one pixel; whether it differs.
    fn pixel(&mut self, a: &Part, b: &Part, index: usize, (x, y): (i64, i64)) -> bool {
        let mut differs = false;
        for (channel, other) in a.channels.iter().zip(&b.channels) {
            if channel.samples.bits(index) == other.samples.bits(index) {
                continue;
            }
            differs = true;
            let (value, other) = (channel.samples.value(index), other.samples.value(index));
            let distance = (value - other).abs();
            self.largest = self.largest.max(if distance.is_nan() {
                f64::INFINITY
            } else {
                distance
            });
            let (x, y) = (
                x + i64::from(a.data_window.x),
                y + i64::from(a.data_window.y),
            );
            let [left, right, top, bottom] = self.bounds.unwrap_or([x, x, y, y]);
            self.bounds = Some([left.min(x), right.max(x), top.min(y), bottom.max(y)]);
            self.first.get_or_insert_with(|| Difference {
                x: coordinate(x),
                y: coordinate(y),
                channel: match &a.name {
                    Some(part) => format!("{part}:{}", channel.name),
                    None => channel.name.clone(),
                },
                a: value,
                b: other,
            });
        }
        differs
    }

    fn comparison(self) -> Comparison {
        let side = |from: i64, to: i64| u32::try_from(to - from + 1).unwrap_or(u32::MAX);
        Comparison {
            pixels: self.pixels,
            differing_pixels: self.differing,
            first: self.first,
            largest: self.largest,
            bounds: self.bounds.map(|[left, right, top, bottom]| Window {
                x: coordinate(left),
                y: coordinate(top),
                width: side(left, right),
                height: side(top, bottom),
            }),
        }
    }
}

/// A place in a file's window, which the reader has checked to end within 32 bits.
fn coordinate(at: i64) -> i32 {
    i32::try_from(at).unwrap_or(i32::MAX)
}
