//! Many rays clipped together to where they can meet the surface.

use field::{BATCH, SimdLevel};
use scene::description::Bound;

use super::batch::Lanes;
use super::bound::{Holds, Region};
use super::bundle::Span;
use super::tracer::Ray;

/// Memory in which rays are clipped.
#[repr(align(64))]
pub(crate) struct Clips {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    start: Lanes,
    end: Lanes,
}

impl Default for Clips {
    fn default() -> Self {
        Self {
            origin: [[0.0; BATCH]; 3],
            direction: [[0.0; BATCH]; 3],
            start: [0.0; BATCH],
            end: [0.0; BATCH],
        }
    }
}

impl Clips {
    /// Replaces `spans` by those of the rays that may meet a surface within the bound, as [`super::bound::clip`] gives them.
    pub(crate) fn clip(
        &mut self,
        level: SimdLevel,
        bound: &Bound,
        rays: &[Ray],
        spans: &mut Vec<Span>,
    ) {
        spans.clear();
        let region = Region::of(bound);
        for (batch, rays) in rays.chunks(BATCH).enumerate() {
            for (lane, ray) in rays.iter().enumerate() {
                for axis in 0..3 {
                    self.origin[axis][lane] = ray.origin[axis];
                    self.direction[axis][lane] = ray.direction[axis];
                }
            }
            match &region {
                Region::Ball(ball) => self.within(level, ball),
                Region::Shell(shell) => self.within(level, shell),
                Region::Slab(slab) => self.within(level, slab),
                Region::Block(block) => self.within(level, block),
            }
            for lane in 0..rays.len() {
                let (clear, end) = (self.start[lane], self.end[lane]);
                if clear <= end {
                    spans.push(Span {
                        ray: batch * BATCH + lane,
                        clear,
                        end,
                        steps: 0.0,
                    });
                }
            }
        }
    }

    fn within(&mut self, level: SimdLevel, bound: &impl Holds) {
        level.vectorize(
            #[inline(always)]
            || {
                let ([x, y, z], [dx, dy, dz]) = (&self.origin, &self.direction);
                for i in 0..BATCH {
                    let (origin, direction) = ([x[i], y[i], z[i]], [dx[i], dy[i], dz[i]]);
                    (self.start[i], self.end[i]) = bound.span(origin, direction);
                }
            },
        );
    }
}
