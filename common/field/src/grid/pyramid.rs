//! Least and greatest coefficients and differences over blocks of a grid, coarser level by level.
//!
//! A B-spline lies within the range of the coefficients that count, and its derivative along an axis within that
//! of their differences along it; so boxes of coefficients bound the surface and its slopes over boxes of places.

use super::surface::Edges;

/// Samples along a side of the finest blocks.
const BLOCK: usize = 4;

/// Blocks that a query may touch along an axis before it goes to a coarser level.
const ACROSS: usize = 4;

/// Least and greatest of some numbers.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Extent {
    pub(super) low: f32,
    pub(super) high: f32,
}

impl Extent {
    const NONE: Self = Self {
        low: f32::INFINITY,
        high: f32::NEG_INFINITY,
    };

    fn add(&mut self, other: Self) {
        self.low = if other.low < self.low {
            other.low
        } else {
            self.low
        };
        self.high = if other.high > self.high {
            other.high
        } else {
            self.high
        };
    }

    /// A double rounded outward.
    fn of(value: f64) -> Self {
        let near = super::stored(value);
        Self {
            low: if f64::from(near) > value {
                near.next_down()
            } else {
                near
            },
            high: if f64::from(near) < value {
                near.next_up()
            } else {
                near
            },
        }
    }
}

/// What is known of a block: its coefficients, and their differences to the next along each axis.
pub(super) type Known = [Extent; 4];

/// Knows nothing yet.
const NOTHING: Known = [Extent::NONE; 4];

#[derive(Clone, PartialEq, Debug)]
struct Level {
    /// Samples along a side of a block.
    block: usize,
    sides: [usize; 3],
    blocks: Vec<Known>,
}

/// The levels of one grid, finest first.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
}

impl Pyramid {
    pub(super) fn new(edges: Edges, sides: [usize; 3], values: &[f32]) -> Self {
        let blocks = sides.map(|side| side.div_ceil(BLOCK));
        let mut finest = Level {
            block: BLOCK,
            sides: blocks,
            blocks: vec![NOTHING; blocks.iter().product()],
        };
        let [nx, ny, _] = sides;
        let strides = [1, nx, nx * ny];
        for (i, &value) in values.iter().enumerate() {
            let at = [i % nx, i / nx % ny, i / (nx * ny)];
            let known = &mut finest.blocks[index(blocks, at.map(|k| k / BLOCK))];
            known[0].add(Extent {
                low: value,
                high: value,
            });
            for axis in 0..3 {
                let next = if at[axis] + 1 < sides[axis] {
                    i + strides[axis]
                } else {
                    match edges {
                        Edges::Hold => i,
                        Edges::Repeat => i - at[axis] * strides[axis],
                    }
                };
                let difference = f64::from(values[next]) - f64::from(value);
                known[axis + 1].add(Extent::of(difference));
            }
        }
        let mut levels = vec![finest];
        while let Some(next) = levels.last().and_then(coarser) {
            levels.push(next);
        }
        Self { levels }
    }

    /// What is known of the samples from `from` to `to`, both included and within the grid.
    pub(super) fn over(&self, from: [usize; 3], to: [usize; 3]) -> Known {
        let touched =
            |level: &&Level| (0..3).all(|k| to[k] / level.block - from[k] / level.block < ACROSS);
        let level = self.levels.iter().find(touched);
        let level = level.unwrap_or_else(|| self.levels.last().expect("there is a finest level"));
        let [a, b] = [from, to].map(|corner| corner.map(|k| k / level.block));
        let mut known = NOTHING;
        for z in a[2]..=b[2] {
            for y in a[1]..=b[1] {
                for x in a[0]..=b[0] {
                    merge(&mut known, &level.blocks[index(level.sides, [x, y, z])]);
                }
            }
        }
        known
    }
}

fn index(sides: [usize; 3], [x, y, z]: [usize; 3]) -> usize {
    (z * sides[1] + y) * sides[0] + x
}

fn merge(known: &mut Known, other: &Known) {
    for (known, other) in known.iter_mut().zip(other) {
        known.add(*other);
    }
}

/// The level of blocks twice as large; `None` above the one of a single block.
fn coarser(level: &Level) -> Option<Level> {
    if level.blocks.len() == 1 {
        return None;
    }
    let sides = level.sides.map(|side| side.div_ceil(2));
    let mut blocks = vec![NOTHING; sides.iter().product()];
    let [nx, ny, _] = level.sides;
    for (i, known) in level.blocks.iter().enumerate() {
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        merge(&mut blocks[index(sides, at.map(|k| k / 2))], known);
    }
    Some(Level {
        block: 2 * level.block,
        sides,
        blocks,
    })
}
