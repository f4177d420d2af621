//! Node points scattered over the cells of a lattice, as sparse convolution, spot and cellular noise use them.

use super::gradient::Lattice;
use crate::hash;

/// The hash's state after a cell.
#[inline(always)]
pub(crate) fn cell_state(lattice: Lattice, [x, y, z]: [u32; 3]) -> u32 {
    hash::absorb(hash::absorb(hash::absorb(lattice.start(), x), y), z)
}

/// The cell `step` cells away.
#[inline(always)]
pub(crate) fn neighbour(cell: [u32; 3], step: [i8; 3]) -> [u32; 3] {
    [0, 1, 2].map(
        #[inline(always)]
        |k| cell[k].wrapping_add_signed(i32::from(step[k])),
    )
}

/// A random number of the node `index` of a cell: its coordinates are the first three.
#[inline(always)]
pub(crate) fn draw(state: u32, index: u32, which: u32) -> u32 {
    let mixed = hash::finish_high(hash::absorb(hash::absorb(state, index), which));
    mixed ^ (mixed >> 15)
}

/// A hash as a number in [0, 1), a multiple of 2⁻²⁴.
#[inline(always)]
#[expect(
    clippy::cast_precision_loss,
    reason = "24 bits are what an f32 holds exactly"
)]
pub(crate) fn fraction(hash: u32) -> f32 {
    (hash >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// How far a place is from the cell `step` cells away, along each axis; it lies at `offset` in its own.
#[inline(always)]
pub(crate) fn gap(offset: [f32; 3], step: [i8; 3]) -> [f32; 3] {
    [0, 1, 2].map(
        #[inline(always)]
        |k| {
            let from = f32::from(step[k]);
            if from > 0.0 {
                from - offset[k]
            } else if from < 0.0 {
                offset[k] - (from + 1.0)
            } else {
                0.0
            }
        },
    )
}

/// The steps to the cells within `reach`, nearest first.
///
/// `N` is (2·reach + 1)³.
pub(crate) const fn steps<const N: usize>(reach: i8) -> [[i8; 3]; N] {
    let mut list = [[0i8; 3]; N];
    let mut count = 0;
    let mut distance = 0;
    // By the greatest coordinate, then by the squared distance of the cells' centres.
    while count < N {
        let (ring, square) = (distance / 64, distance % 64);
        let mut z = -reach;
        while z <= reach {
            let mut y = -reach;
            while y <= reach {
                let mut x = -reach;
                while x <= reach {
                    let far = max(abs(x), max(abs(y), abs(z)));
                    if far as i32 == ring && (x * x + y * y + z * z) as i32 == square {
                        list[count] = [x, y, z];
                        count += 1;
                    }
                    x += 1;
                }
                y += 1;
            }
            z += 1;
        }
        distance += 1;
    }
    list
}

const fn abs(a: i8) -> i8 {
    if a < 0 { -a } else { a }
}

const fn max(a: i8, b: i8) -> i8 {
    if a > b { a } else { b }
}

/// A cell and those around it.
pub(crate) const NEAR: [[i8; 3]; 27] = steps(1);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_outward_and_are_complete() {
        let far: [[i8; 3]; 125] = steps(2);
        assert_eq!((far[0], NEAR[0]), ([0; 3], [0; 3]));
        assert_eq!(&far[..27], &NEAR);
        let unique: std::collections::BTreeSet<_> = far.into_iter().collect();
        assert_eq!(unique.len(), 125);
        assert!(far[27..].iter().all(|s| s.iter().any(|k| k.abs() == 2)));
    }

    #[test]
    fn gaps_are_the_distances_to_cells() {
        assert_eq!(gap([0.25, 0.5, 0.75], [0, 0, 0]), [0.0; 3]);
        assert_eq!(gap([0.25, 0.5, 0.75], [1, -1, 2]), [0.75, 0.5, 1.25]);
        assert_eq!(gap([0.25, 0.5, 0.75], [-2, 0, 0]), [1.25, 0.0, 0.0]);
    }
}
