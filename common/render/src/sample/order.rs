//! In which order samples are followed: neighbours in the image and in time one after another.
//!
//! Rays next to each other share what they can (`trace::bundle`); nothing that they see depends on the order.

use model::Rect;

use super::Sample;

/// Cells along a pixel's side.
const CELLS: f64 = 4.0;

/// Cells to the left of the first and above it: filters reach beyond their pixels.
const BEFORE: f64 = 1024.0;

/// Bits that tell samples apart, beside 16 of the slice and 32 of the curve.
const INDEX_BITS: u32 = 16;

/// Puts samples in order, in memory that it keeps.
#[derive(Default)]
pub(crate) struct Order {
    /// One number for each sample: its slice, its place along the curve, where it stood.
    keys: Vec<u64>,
    sorted: Vec<u64>,
    /// The samples as they stood.
    before: Vec<Sample>,
}

impl Order {
    /// Puts the samples of a part's pixels, one for each, along a Morton curve about the first pixel; tells from which place each
    /// one comes.
    pub(crate) fn along_curve(
        &mut self,
        part: Rect,
        samples: &mut Vec<Sample>,
        from: &mut Vec<u32>,
    ) {
        from.clear();
        visit_along_curve(part, |place| from.push(place));
        self.take(samples, from);
    }

    /// Puts samples in order and tells from which place each one comes.
    ///
    /// They are sorted by one of `slices` equal parts of the shutter, then along a Morton curve over
    /// the image about `corner`, the least pixel of all.
    pub(crate) fn arrange(
        &mut self,
        samples: &mut Vec<Sample>,
        corner: [u32; 2],
        slices: u32,
        from: &mut Vec<u32>,
    ) {
        assert!(samples.len() <= 1 << INDEX_BITS);
        let corner = corner.map(|part| f64::from(part) - BEFORE / CELLS);
        let key = |(index, sample): (u64, &Sample)| {
            let [x, y] = [0, 1].map(|axis| whole((sample.place[axis] - corner[axis]) * CELLS));
            let slice = whole(sample.instant * f64::from(slices));
            let curve = u64::from(spread(x) | spread(y) << 1);
            (u64::from(slice) << 32 | curve) << INDEX_BITS | index
        };
        self.keys.clear();
        self.keys.extend((0..).zip(&*samples).map(key));
        sort(&mut self.keys, &mut self.sorted);
        from.clear();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the low bits alone are wanted"
        )]
        from.extend(
            self.keys
                .iter()
                .map(|key| *key as u32 & ((1 << INDEX_BITS) - 1)),
        );
        self.take(samples, from);
    }

    /// Takes the samples in the order of these places.
    fn take(&mut self, samples: &mut Vec<Sample>, from: &[u32]) {
        std::mem::swap(samples, &mut self.before);
        samples.clear();
        samples.extend(from.iter().map(|&place| self.before[place as usize]));
    }
}

/// Calls `visit` with every pixel of a part along a Morton curve about its first one: with its place row by row.
fn visit_along_curve(part: Rect, mut visit: impl FnMut(u32)) {
    let longer = part.width().max(part.height());
    square(part, [0, 0], longer.next_power_of_two(), &mut visit);
}

/// The pixels of a square that begins so far from the part's first one.
fn square(part: Rect, [x, y]: [u32; 2], side: u32, visit: &mut impl FnMut(u32)) {
    if x >= part.width() || y >= part.height() {
        return;
    }
    if side == 1 {
        visit(y * part.width() + x);
        return;
    }
    let half = side / 2;
    for [right, down] in [[0, 0], [half, 0], [0, half], [half, half]] {
        square(part, [x + right, y + down], half, visit);
    }
}

/// Sorts by all bits above the index, whose order stays: by one byte after the other, the least first, where they differ at
/// all; `sorted` is memory for it. Of a block's places few do, which makes it several times as fast as comparing.
fn sort(keys: &mut Vec<u64>, sorted: &mut Vec<u64>) {
    const BYTE: u32 = 8;
    let first = keys.first().copied().unwrap_or_default();
    let differ = keys.iter().fold(0, |bits, key| bits | (key ^ first));
    sorted.clear();
    sorted.resize(keys.len(), 0);
    for shift in (INDEX_BITS..u64::BITS).step_by(BYTE as usize) {
        let byte = |key: u64| usize::from((key >> shift).to_le_bytes()[0]);
        if byte(differ) == 0 {
            continue;
        }
        let mut next = [0; 1 << BYTE];
        for &key in &*keys {
            next[byte(key)] += 1;
        }
        let mut before = 0;
        for next in &mut next {
            before += std::mem::replace(next, before);
        }
        for &key in &*keys {
            let place = &mut next[byte(key)];
            sorted[*place] = key;
            *place += 1;
        }
        std::mem::swap(keys, sorted);
    }
}

/// The whole part, between 0 and 2¹⁶ − 1.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates at both ends"
)]
fn whole(value: f64) -> u32 {
    u32::from(value as u16)
}

/// The sixteen low bits, each with a zero before it.
fn spread(bits: u32) -> u32 {
    let mut x = bits & 0xffff;
    x = (x | x << 8) & 0x00ff_00ff;
    x = (x | x << 4) & 0x0f0f_0f0f;
    x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_sorted_as_by_comparing() {
        for mask in [0, u64::MAX, 0xff_0000, 0x00f0_3c00_1234_ffff, 0xffff << 48] {
            let mut keys: Vec<u64> = (0..3000u32)
                .map(|i| {
                    let random = u64::from(field::hash::hash(&[i, 0])) << 32;
                    let key = (random | u64::from(field::hash::hash(&[i, 1]))) & mask;
                    key >> INDEX_BITS << INDEX_BITS | u64::from(i)
                })
                .collect();
            let mut compared = keys.clone();
            compared.sort_unstable();
            sort(&mut keys, &mut Vec::new());
            assert_eq!(keys, compared, "{mask:x}");
        }
        sort(&mut Vec::new(), &mut Vec::new());
    }

    #[test]
    fn pixels_of_any_part_are_visited_once_along_the_curve() {
        for (width, height) in [(1, 1), (8, 8), (5, 7), (1, 9), (300, 2)] {
            let part = Rect {
                x0: 64,
                y0: 32,
                x1: 64 + width,
                y1: 32 + height,
            };
            let (mut seen, mut codes) = (Vec::new(), Vec::new());
            visit_along_curve(part, |place| {
                seen.push(place);
                codes.push(spread(place % width) | spread(place / width) << 1);
            });
            assert!(codes.is_sorted());
            seen.sort_unstable();
            assert_eq!(seen, (0..width * height).collect::<Vec<_>>());
        }
    }

    #[test]
    fn neighbours_follow_each_other_and_nothing_is_lost() {
        let mut samples: Vec<Sample> = (0..4096u32)
            .map(|i| Sample {
                place: [f64::from(i % 32) + 640.5, f64::from(i / 32 % 32) + 320.5],
                instant: f64::from(i / 1024) / 4.0 + 0.1,
            })
            .collect();
        let before = samples.clone();
        let mut from = Vec::new();
        Order::default().arrange(&mut samples, [640, 320], 4, &mut from);
        let mut seen = vec![false; before.len()];
        for (sample, &index) in samples.iter().zip(&from) {
            assert_eq!(*sample, before[index as usize]);
            seen[index as usize] = true;
        }
        assert!(seen.iter().all(|seen| *seen));
        for patch in samples.chunks(64) {
            for axis in 0..2 {
                let along = patch.iter().map(|sample| sample.place[axis]);
                let (low, high) = along.fold((f64::INFINITY, 0.0f64), |(low, high), x| {
                    (low.min(x), high.max(x))
                });
                assert_eq!(high - low, 7.0, "{patch:?}");
            }
            assert!(
                patch
                    .iter()
                    .all(|sample| sample.instant == patch[0].instant)
            );
        }
    }
}
