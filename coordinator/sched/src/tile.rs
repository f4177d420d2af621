//! A tile: a part of an image that is leased, and what is known against it.

use alloc::boxed::Box;
use alloc::vec::Vec;

use model::{Rect, WorkerId};

use crate::check::{Check, Evidence};
use crate::region::Region;

/// Most live attempts of one tile.
pub(crate) const LIVE_MAX: usize = 2;

/// What is kept of a tile from its first lease until it is done or waits again.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    pub(crate) region: Region,
    pub(crate) rect: Rect,
    /// Pixels that are not durable.
    pub(crate) missing: u64,
    pub(crate) trouble: Trouble,
    live: [Option<u64>; LIVE_MAX],
    /// What was made of its blocks.
    pub(crate) evidence: Evidence,
    /// Where it is rendered once more: what it is held against.
    pub(crate) check: Option<Box<Check>>,
}

/// What went wrong with some pixels; it stays with them however they are cut.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trouble {
    /// Attempts that failed or got stuck.
    pub(crate) failures: u32,
    /// Attempts that ran on a worker that was then lost, since a pixel was last made durable.
    pub(crate) losses: u32,
    /// It was leased a second time on purpose, or called back: what is rendered twice is no failure's fault.
    pub(crate) on_purpose: bool,
    /// The workers of those that failed, each once.
    pub(crate) failed_on: Vec<WorkerId>,
}

impl Tile {
    /// Pixels of which some are to be rendered.
    pub(crate) fn new(
        (region, rect): (Region, Rect),
        missing: u64,
        (trouble, evidence): (Trouble, Evidence),
    ) -> Self {
        Self {
            region,
            rect,
            missing,
            trouble,
            live: [None; LIVE_MAX],
            evidence,
            check: None,
        }
    }

    /// Pixels that are all durable, to be rendered once more.
    pub(crate) fn to_check(region: Region, rect: Rect, check: Check) -> Self {
        let trouble = Trouble {
            on_purpose: true,
            ..Trouble::default()
        };
        Self {
            check: Some(Box::new(check)),
            ..Self::new((region, rect), 0, (trouble, Evidence::default()))
        }
    }

    /// Live attempts.
    pub(crate) fn attempts(&self) -> impl Iterator<Item = u64> + use<> {
        self.live.into_iter().flatten()
    }

    pub(crate) fn live_count(&self) -> usize {
        self.attempts().count()
    }

    pub(crate) fn begins(&mut self, attempt: u64) {
        let slot = self.live.iter_mut().find(|slot| slot.is_none());
        *slot.expect("a tile is leased only while it has room for an attempt") = Some(attempt);
    }

    pub(crate) fn ends(&mut self, attempt: u64) {
        for slot in &mut self.live {
            if *slot == Some(attempt) {
                *slot = None;
            }
        }
    }
}

impl Trouble {
    /// Notes an attempt that failed on a worker.
    pub(crate) fn fails(&mut self, worker: WorkerId) {
        self.failures += 1;
        if !self.failed_on.contains(&worker) {
            self.failed_on.push(worker);
        }
    }

    /// Adds what went wrong with other pixels.
    pub(crate) fn add(&mut self, other: &Self) {
        self.failures = self.failures.max(other.failures);
        self.losses = self.losses.max(other.losses);
        self.on_purpose |= other.on_purpose;
        for worker in &other.failed_on {
            if !self.failed_on.contains(worker) {
                self.failed_on.push(*worker);
            }
        }
    }

    /// Whether a worker should be given these pixels, of `able` workers that there are: one that
    /// failed at them comes last.
    pub(crate) fn suits(&self, worker: WorkerId, able: u32) -> bool {
        self.failed_on.len() >= able as usize || !self.failed_on.contains(&worker)
    }
}

/// Tiles by number; a number is given anew once its tile is gone.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    rows: Vec<Option<Tile>>,
    free: Vec<u32>,
}

impl Tiles {
    pub(crate) fn get(&self, number: u32) -> Option<&Tile> {
        self.rows.get(number as usize)?.as_ref()
    }

    pub(crate) fn get_mut(&mut self, number: u32) -> Option<&mut Tile> {
        self.rows.get_mut(number as usize)?.as_mut()
    }

    pub(crate) fn insert(&mut self, tile: Tile) -> u32 {
        match self.free.pop() {
            Some(number) => {
                self.rows[number as usize] = Some(tile);
                number
            }
            None => {
                self.rows.push(Some(tile));
                u32::try_from(self.rows.len() - 1).expect("tiles are limited")
            }
        }
    }

    pub(crate) fn remove(&mut self, number: u32) -> Option<Tile> {
        let tile = self.rows.get_mut(number as usize)?.take()?;
        self.free.push(number);
        Some(tile)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rows.len() == self.free.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, &Tile)> {
        (0..)
            .zip(&self.rows)
            .filter_map(|(number, row)| Some((number, row.as_ref()?)))
    }
}
