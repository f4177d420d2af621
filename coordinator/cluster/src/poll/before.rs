//! What a site still has of before: of an earlier coordinator, or of a time when nobody could reach it.

use std::collections::BTreeSet;

use model::{AttemptId, Begun, Rect};

use super::held::{Array, Tile};
use super::{Poll, count};
use crate::orders::{Seen, Stands};

impl Poll {
    /// Only these tiles are still the site's.
    pub fn keeps(&mut self, live: &[AttemptId]) {
        let live: BTreeSet<_> = live.iter().collect();
        let gone: Vec<_> = self.tiles.keys().copied().collect();
        for attempt in gone.into_iter().filter(|attempt| !live.contains(attempt)) {
            self.forget(attempt);
        }
    }

    /// Of a tile only these blocks are still wanted: the others are durable, by whomever.
    pub fn lacks(&mut self, attempt: AttemptId, missing: &[Rect]) {
        let missing: BTreeSet<_> = missing.iter().copied().collect();
        if let Some(tile) = self.tiles.get_mut(&attempt) {
            tile.lacks(&missing);
            if tile.missing.is_empty() {
                self.forget(attempt);
            }
        }
    }

    /// Takes up what an earlier coordinator left there: what runs, and what has ended and may have brought blocks that
    /// nobody has fetched. What only waits is not taken up, and so deleted.
    pub fn takes_up(&mut self, seen: &Seen) -> Vec<Begun> {
        let mut begun = Vec::new();
        for array in &seen.arrays {
            let Some(order) = array.order.as_ref().filter(|_| array.is_submitted) else {
                continue;
            };
            if self.arrays.contains_key(&array.name) {
                continue;
            }
            let mut tiles = vec![None; order.tasks.len()];
            for (index, (task, tile)) in array.tasks.iter().zip(&mut tiles).enumerate() {
                let number = u32::try_from(index + 1).unwrap_or(u32::MAX);
                let has_begun = task.0 != Stands::Waits && (task.0 == Stands::Runs || task.1 > 0);
                let Some(lease) = order.lease(number).filter(|_| has_begun) else {
                    continue;
                };
                *tile = Some(lease.attempt);
                let claim = Begun {
                    attempt: lease.attempt,
                    image: lease.image,
                    tile: lease.tile,
                };
                let place = (array.name.clone(), number);
                begun.push(claim);
                self.tiles
                    .insert(claim.attempt, Tile::new(lease, Some(place)));
            }
            let mut found = Array::new(tiles);
            found.time_limit = order.time_limit;
            found.waiting = count(array, Stands::Waits);
            self.arrays.insert(array.name.clone(), found);
        }
        begun
    }
}
