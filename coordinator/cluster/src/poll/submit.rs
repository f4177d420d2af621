//! New arrays: what is leased and in none goes into as few as it takes, and may run for as long as its dearest tile asks for.

use std::collections::BTreeMap;

use model::{AttemptId, Digest, ImageRef, Span};

use super::Poll;
use super::held::{Array, Tile};
use crate::orders::{Order, TaskOrder};

/// A task asks for so many times what it is expected to take…
const LIMIT_FACTOR: u64 = 4;

/// …and so much for its start, and never for less than…
const LIMIT_START: Span = Span::from_secs(60);

/// …this.
pub(super) const LIMIT_LEAST: Span = Span::from_secs(120);

impl Poll {
    /// Puts what is leased and in no array into new ones, an image into as few as it takes.
    pub(super) fn put_into_arrays(&mut self) -> Vec<Order> {
        let mut orders = Vec::new();
        let mut images = BTreeMap::<(ImageRef, Digest), Vec<AttemptId>>::new();
        for (&attempt, tile) in self.tiles.iter().filter(|(_, tile)| tile.place.is_none()) {
            let key = (tile.lease.image, tile.lease.scene);
            images.entry(key).or_default().push(attempt);
        }
        let array_max = usize::try_from(self.settings.array_max).unwrap_or(usize::MAX);
        for ((image, scene), attempts) in images {
            for attempts in attempts.chunks(array_max.max(1)) {
                self.number += 1;
                let name = format!("{}{}", self.settings.names, self.number);
                let time_limit = self.limit(attempts);
                let mut tasks = Vec::new();
                for (number, attempt) in (1..).zip(attempts) {
                    if let Some(tile) = self.tiles.get_mut(attempt) {
                        tile.place = Some((name.clone(), number));
                        tile.runs = false;
                        tasks.push(TaskOrder::from(&tile.lease));
                    }
                }
                let mut array = Array::new(attempts.iter().copied().map(Some).collect());
                array.time_limit = time_limit;
                self.arrays.insert(name.clone(), array);
                orders.push(Order {
                    name,
                    scene: scene.to_string(),
                    job: image.job.0,
                    image: image.image.0,
                    revision: self.settings.revision.0,
                    threads: self.settings.threads,
                    running_max: self.settings.running_max,
                    time_limit,
                    tasks,
                });
            }
        }
        orders
    }

    /// How long a task of these tiles may run: by the site's word, else by what is known of the dearest.
    fn limit(&self, attempts: &[AttemptId]) -> Option<Span> {
        let threads = u64::from(self.settings.threads.max(1));
        let tiles = attempts
            .iter()
            .filter_map(|attempt| self.tiles.get(attempt));
        let one = |tile: &Tile| {
            let history = self.histories.get(&(tile.lease.image, tile.lease.tile));
            let measured = history.map_or(Span(0), |history| history.block);
            let expected = match measured {
                Span(0) => tile.lease.expected,
                block => block.times(tile.missing.len() as u64),
            };
            let enough = Span(expected.0 / threads).times(LIMIT_FACTOR) + LIMIT_START;
            let enough = (expected > Span(0)).then_some(enough.max(LIMIT_LEAST));
            // What was killed without a block needs more than it had.
            let last = history.filter(|history| history.tries > 0);
            let longer = last
                .and_then(|history| history.limit)
                .map(|limit| limit.times(2));
            enough.max(longer)
        };
        let limit = self
            .settings
            .time_limit
            .or_else(|| tiles.filter_map(one).max())?;
        Some(self.settings.time_max.map_or(limit, |most| limit.min(most)))
    }
}
