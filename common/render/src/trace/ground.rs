//! Clear heights: linear functions below the field over cells of the ground, built where a ray first asks for them.
//!
//! Over the column above a cell the field's affine form (thesis eq. (7.11)), less its own error, is a linear function of the
//! place that is nowhere above the field. Along a ray it is linear too: where it is positive at both ends of the ray's way
//! over the cell, nothing between them need be looked at. Cells are shared by all rays of the image, so that what a
//! cell costs is paid once. What has been built decides only what need not be looked at: no pixel depends on it.
//!
//! Cells grow with the distance from the eye, as footprints do: level k reaches 2ᵏ times as far as level 0, with cells as much
//! larger. A ray tries the coarse levels first, and ends where the finest cell does not let it pass.

mod frame;
mod lead;

use std::sync::OnceLock;

use field::{Boxes, Interval, Program, Reduced, Scratch, SimdLevel};
use glam::DVec3;
use once_cell::race::OnceBox;
use scene::description::Bound;

use super::clearance::widened;
use super::larger;
use crate::view::Footprint;
use frame::Frame;
use lead::single;

/// Columns reach over their cells by this share of a side: for rounding, and for the steps from one to the next.
const ROOM: f64 = 4e-3;

/// Relative room for the rounding of linear functions.
const CAUTION: f64 = 1e-9;

/// The same for coordinates far from the origin, beside the side of a cell.
const ROUNDING: f64 = 1e-14;

/// The least side of a cell, as a share of the eye's coordinates: places in it are then exact enough.
const SIDE_MIN: f64 = 1e-10;

/// Most levels: the last reaches half a million times as far as the first.
const LEVELS_MAX: usize = 20;

/// Cells along the side of a block, which are bounded together.
const SIDE: usize = 4;

/// Cells of a block.
const BLOCK: usize = SIDE * SIDE;

/// Blocks from the eye to the edge of a level, at least and at most: 65,536 pointers to blocks a level, and 256 bytes where some ray comes there.
const HALF: [f64; 2] = [4.0, 128.0];

/// One such block for each so many of the square root of the image's rays. A cell takes as long as two steps of single rays.
const RAYS_PER_HALF: f64 = 6.0;

/// The first level reaches so many times the tables' nearest distance.
const REACH: f64 = 8.0;

/// What being led costs a ray, cells included, in evaluations of a value: as measured on terrains.
pub(crate) const COST: f64 = 10.0;

/// Where the error over a cell below the eye is more than this share of the bound's height, cells say too little.
const ERROR_MAX: f64 = 0.25;

/// A linear function that is nowhere above the field over a cell, but for the rounding to 32 bits, which whoever asks counts.
#[derive(Clone, Copy, Debug)]
struct Below {
    /// At the eye, as if the function went on there.
    value: f32,
    /// Per metre along the frame's axes.
    slope: [f32; 3],
}

/// Cells that are bounded together, row by row.
type Block = [Below; BLOCK];

/// Cells of one size around the eye, in blocks row by row; empty until some ray comes there. Where two threads' rays come to one at
/// the same time both bound it, since waiting takes longer; the same comes of it.
#[derive(Debug)]
struct Level {
    side: f64,
    /// How far from the eye it serves rays, by the larger of x and y: not as far as its cells go, for rounding.
    reach: f64,
    blocks: OnceLock<Box<[OnceBox<Block>]>>,
}

/// The ground around the eye of one image.
#[derive(Debug)]
pub(crate) struct Ground {
    eye: DVec3,
    travel: f64,
    time: Interval,
    footprint: Footprint,
    frame: Frame,
    /// Blocks from the eye to the edge of a level.
    half: usize,
    levels: Vec<Level>,
}

/// What the ground of an image is made for.
pub(crate) struct Site<'a> {
    /// The surface's field.
    pub(crate) field: &'a Program,
    /// How it is evaluated.
    pub(crate) level: SimdLevel,
    /// The instants of the image.
    pub(crate) time: Interval,
    /// Where the surface can be.
    pub(crate) bound: &'a Bound,
    /// The law of footprints.
    pub(crate) footprint: Footprint,
    /// The eye when the shutter opens.
    pub(crate) eye: DVec3,
    /// How far it moves while the shutter is open.
    pub(crate) travel: f64,
    /// About how near the surface is: where cells begin to grow.
    pub(crate) nearest: f64,
    /// Camera rays of the image.
    pub(crate) rays: f64,
}

impl Ground {
    /// The ground, if cells of it say anything: below an eye with perspective, over a plane or close to a planet.
    pub(crate) fn new(site: &Site<'_>) -> Option<Self> {
        let eye = site.eye;
        let frame = Frame::new(&widened(site.bound), eye)?;
        let Interval { low, high } = frame.heights(0.0, 0.0);
        if site.footprint.angle <= 0.0 || !(low < high && (high - low).is_finite()) {
            return None;
        }
        let [least, most] = HALF;
        let half = (site.rays.sqrt() / RAYS_PER_HALF).clamp(least, most).ceil();
        let cells = half * SIDE as f64;
        let reach = site.nearest * REACH;
        if reach / cells < eye.abs().max_element() * SIDE_MIN {
            return None;
        }
        let mut levels = Vec::new();
        let mut far = reach;
        while levels.len() < LEVELS_MAX && far * std::f64::consts::SQRT_2 <= frame.limit {
            levels.push(Level {
                side: far / cells,
                reach: (1.0 - 1.0 / HALF[1]) * far,
                blocks: OnceLock::new(),
            });
            if far > frame.farthest {
                break;
            }
            far *= 2.0;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small whole number"
        )]
        let ground = Self {
            eye,
            travel: site.travel,
            time: site.time,
            footprint: site.footprint,
            frame,
            half: half as usize,
            levels,
        };
        let first = ground.levels.first()?;
        let mut forms = [Reduced::point(0.0); BLOCK];
        let mut bounds = Bounds {
            field: site.field,
            level: site.level,
            scratch: &mut Scratch::new(),
        };
        bounds.forms(&ground.columns(first.side, [0.0; 2]), &mut forms);
        (forms[0].error < ERROR_MAX * (high - low)).then_some(ground)
    }

    /// The functions over the cells of that block of the level whose cells are `scale` times as large as the first's.
    #[inline]
    fn block(&self, bounds: &mut Bounds<'_>, scale: f32, block: usize) -> &Block {
        let level = &self.levels[(scale.to_bits() >> 23) as usize - 127];
        let known = level.blocks.get().and_then(|blocks| blocks[block].get());
        known.unwrap_or_else(|| self.bounded(bounds, level, block))
    }

    /// The same of a block that no ray has come to yet.
    #[cold]
    #[inline(never)]
    fn bounded<'a>(&self, bounds: &mut Bounds<'_>, level: &'a Level, block: usize) -> &'a Block {
        let row = 2 * self.half;
        let blocks = level.blocks.get_or_init(|| {
            let mut blocks = Vec::new();
            blocks.resize_with(row * row, OnceBox::new);
            blocks.into_boxed_slice()
        });
        blocks[block].get_or_init(|| {
            let first = [block % row, block / row]
                .map(|blocks| (blocks * SIDE) as f64 - (self.half * SIDE) as f64);
            Box::new(self.bound(bounds, level.side, first))
        })
    }

    /// The functions below the field over the cells of a block, whose first corner is so many sides from the eye.
    fn bound(&self, bounds: &mut Bounds<'_>, side: f64, first: [f64; 2]) -> Block {
        let columns = self.columns(side, first);
        let mut forms = [Reduced::point(0.0); BLOCK];
        bounds.forms(&columns, &mut forms);
        std::array::from_fn(|i| {
            let form = &forms[i];
            let place =
                |parts: &[[f64; BLOCK]; 3]| DVec3::from(parts.each_ref().map(|part| part[i]));
            let slope = DVec3::from(form.along) / place(&columns.half);
            let size = form.centre.abs() + form.radius();
            let rounding = size * CAUTION + slope.abs().element_sum() * self.size() * ROUNDING;
            Below {
                value: single(
                    form.centre - form.error - rounding - slope.dot(place(&columns.middle)),
                ),
                slope: slope.to_array().map(single),
            }
        })
    }

    /// The columns above the cells of a block.
    fn columns(&self, side: f64, first: [f64; 2]) -> Columns {
        let wide = 0.5 * side * (1.0 + 2.0 * ROOM);
        let mut columns = Columns {
            time: self.time,
            axes: self.frame.axes.map(|axis| axis.to_array()),
            middle: [[0.0; BLOCK]; 3],
            centre: [[0.0; BLOCK]; 3],
            half: [[wide; BLOCK]; 3],
            footprint: [[0.0; BLOCK]; 2],
        };
        let rounding = self.size() * ROUNDING;
        for i in 0..BLOCK {
            let [x, y] = [i % SIDE, i / SIDE].map(|step| step as f64 + 0.5);
            let along = DVec3::new((first[0] + x) * side, (first[1] + y) * side, 0.0);
            let wide = DVec3::new(wide, wide, 0.0);
            let nearest = (along.abs() - wide).max(DVec3::ZERO).length();
            let farthest = (along.abs() + wide).length();
            let Interval { low, high } = self.frame.heights(nearest, farthest);
            let half = wide + DVec3::Z * (0.5 * (high - low) * (1.0 + ROOM) + rounding);
            let middle = along + DVec3::Z * (0.5 * (low + high));
            let centre = self.eye + self.frame.world(middle);
            let apart = middle.abs();
            let nearest = (apart - half).max(DVec3::ZERO).length() - self.travel;
            let farthest = (apart + half).length() + self.travel;
            let [least, most] = &mut columns.footprint;
            least[i] = self.footprint.at(larger(nearest, 0.0)) * (1.0 - CAUTION);
            most[i] = self.footprint.at(farthest) * (1.0 + CAUTION);
            columns.half[2][i] = half.z;
            for axis in 0..3 {
                columns.middle[axis][i] = middle[axis];
                columns.centre[axis][i] = centre[axis];
            }
        }
        columns
    }

    /// No coordinate of the eye, and no height, is larger.
    fn size(&self) -> f64 {
        let Interval { low, high } = self.frame.heights(0.0, 0.0);
        2.0 * self.eye.length() + self.travel + low.abs() + high.abs()
    }
}

/// The columns above the cells of a block.
struct Columns {
    time: Interval,
    /// The frame's axes.
    axes: [[f64; 3]; 3],
    /// Their middles in the frame, and in the world.
    middle: [[f64; BLOCK]; 3],
    centre: [[f64; BLOCK]; 3],
    /// Half of their edges along the axes.
    half: [[f64; BLOCK]; 3],
    footprint: [[f64; BLOCK]; 2],
}

/// What bounds columns.
pub(crate) struct Bounds<'a> {
    /// The field that the ground is of.
    pub(crate) field: &'a Program,
    /// How it is evaluated.
    pub(crate) level: SimdLevel,
    /// Memory of evaluations.
    pub(crate) scratch: &'a mut Scratch,
}

impl Bounds<'_> {
    /// The field over the columns.
    fn forms(&mut self, columns: &Columns, out: &mut [Reduced<3>; BLOCK]) {
        let [least, most] = &columns.footprint;
        let boxes = Boxes {
            centre: columns.centre.each_ref().map(|part| &part[..]),
            axes: columns.axes,
            half: columns.half.each_ref().map(|part| &part[..]),
            footprint: [least, most],
            time: columns.time,
        };
        self.field.over_boxes(self.level, &boxes, self.scratch, out);
    }
}
