//! What a coordinator lends to a worker: one tile, for one attempt.

use alloc::vec::Vec;

use crate::{AttemptId, Digest, ImageRef, Rect, Span};

/// A tile that a worker may render, until it has delivered it, gives it back or
/// the coordinator ends the attempt.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Lease {
    /// The attempt that every block of it is sent under.
    pub attempt: AttemptId,
    /// The image it is part of.
    pub image: ImageRef,
    /// Digest of the scene description to render.
    pub scene: Digest,
    /// The tile.
    pub tile: Rect,
    /// Those of the tile's blocks that are missing, in the order in which they
    /// are wanted; empty where all are.
    pub wanted: Vec<Rect>,
    /// How long one thread is expected to take over it; zero where nobody knows yet.
    pub expected: Span,
}

impl Lease {
    /// The blocks to render, in order.
    pub fn blocks(&self) -> impl Iterator<Item = Rect> {
        let all = self.wanted.is_empty().then(|| self.tile.blocks());
        all.into_iter().flatten().chain(self.wanted.iter().copied())
    }
}

/// A tile that a worker has begun, as it tells a coordinator that may not know of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Begun {
    /// The attempt, of whichever epoch.
    pub attempt: AttemptId,
    /// Its image.
    pub image: ImageRef,
    /// Its pixels.
    pub tile: Rect,
}

/// How far a worker is with a tile that it has started.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Running {
    /// The attempt.
    pub attempt: AttemptId,
    /// Blocks rendered for it so far, delivered or not.
    pub blocks: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Epoch, ImageNumber, JobId};

    #[test]
    fn a_lease_names_its_missing_blocks_or_all_of_them() {
        let tile = Rect {
            x0: 0,
            y0: 0,
            x1: 64,
            y1: 32,
        };
        let mut lease = Lease {
            attempt: AttemptId {
                epoch: Epoch(1),
                number: 1,
            },
            image: ImageRef {
                job: JobId(1),
                image: ImageNumber(0),
            },
            scene: Digest::default(),
            tile,
            wanted: Vec::new(),
            expected: Span(0),
        };
        let all: Vec<_> = tile.blocks().collect();
        assert_eq!(lease.blocks().collect::<Vec<_>>(), all);
        lease.wanted.push(all[1]);
        assert_eq!(lease.blocks().collect::<Vec<_>>(), [all[1]]);
    }
}
