//! The workers that are known, each at a place of its own.
//!
//! An event looks its worker up by name once; everything inside refers to the
//! place, so that ten thousand workers cost no more than ten.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use core::ops::{Index, IndexMut};

use model::WorkerId;

use crate::worker::Worker;

/// Where a worker is kept. A place is given anew once its worker is gone.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Place(u32);

/// All workers, by place and by name.
#[derive(Clone, Debug, Default)]
pub(crate) struct Roster {
    places: BTreeMap<WorkerId, Place>,
    workers: Vec<Option<Worker>>,
    free: Vec<Place>,
}

impl Roster {
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// Where a worker is, if it is known.
    pub(crate) fn place(&self, id: WorkerId) -> Option<Place> {
        self.places.get(&id).copied()
    }

    pub(crate) fn by_id(&self, id: WorkerId) -> Option<&Worker> {
        Some(&self[self.place(id)?])
    }

    /// Takes up a worker that is not known yet.
    pub(crate) fn insert(&mut self, worker: Worker) -> Place {
        let id = worker.id;
        let place = match self.free.pop() {
            Some(place) => {
                self.workers[place.0 as usize] = Some(worker);
                place
            }
            None => {
                let place = u32::try_from(self.workers.len()).expect("workers are limited");
                self.workers.push(Some(worker));
                Place(place)
            }
        };
        self.places.insert(id, place);
        place
    }

    pub(crate) fn remove(&mut self, place: Place) -> Option<Worker> {
        let worker = self.workers.get_mut(place.0 as usize)?.take()?;
        self.places.remove(&worker.id);
        self.free.push(place);
        Some(worker)
    }

    /// By name.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Place, &Worker)> {
        self.places.values().map(|&place| (place, &self[place]))
    }

    /// All places that are taken, by name of who is there.
    pub(crate) fn places(&self) -> impl Iterator<Item = Place> {
        self.places.values().copied()
    }
}

impl Index<Place> for Roster {
    type Output = Worker;

    fn index(&self, place: Place) -> &Worker {
        let worker = self.workers[place.0 as usize].as_ref();
        worker.expect("whoever refers to a place is removed before its worker")
    }
}

impl IndexMut<Place> for Roster {
    fn index_mut(&mut self, place: Place) -> &mut Worker {
        let worker = self.workers[place.0 as usize].as_mut();
        worker.expect("whoever refers to a place is removed before its worker")
    }
}
