//! Room for connections: how many may be open, and who is told that there is none.

use std::sync::Arc;

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::acceptor::ARRIVING_MAX;

/// Most connections, whatever the system allows: some thousand workers have two each.
const CONNECTIONS_MAX: usize = 16_384;

/// Of all files that the process may have open one in so many is kept for the store, scratch files and frames.
const KEPT: u64 = 4;

/// Callers beyond those that are told so, at a time; what comes besides is closed without a word.
const TOLD_MAX: usize = 64;

/// What a connection takes up while it is open.
#[derive(Debug)]
pub(crate) struct Place {
    _taken: OwnedSemaphorePermit,
    /// Whether it is one too many, only to be told so.
    pub(crate) is_over: bool,
}

/// All places.
#[derive(Clone, Debug)]
pub(crate) struct Room {
    places: Arc<Semaphore>,
    over: Arc<Semaphore>,
}

impl Room {
    /// As much as this process may have; asks the system for all that it lets users have.
    pub(crate) fn of_process() -> Self {
        Self::new(connections_of(files()))
    }

    fn new(connections: usize) -> Self {
        Self {
            places: Arc::new(Semaphore::new(connections)),
            over: Arc::new(Semaphore::new(TOLD_MAX)),
        }
    }

    /// A place for a connection, if there is any.
    pub(crate) fn place(&self) -> Option<Place> {
        let take = |from: &Arc<Semaphore>, is_over| {
            let taken = from.clone().try_acquire_owned().ok()?;
            Some(Place {
                _taken: taken,
                is_over,
            })
        };
        take(&self.places, false).or_else(|| take(&self.over, true))
    }
}

/// Files that this process may have open, once it has all that it may ask for; `None` where there is no limit.
fn files() -> Option<u64> {
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: maximum,
        maximum,
    };
    match setrlimit(Resource::Nofile, raised) {
        Ok(()) => maximum,
        Err(_) => current,
    }
}

fn connections_of(files: Option<u64>) -> usize {
    let room = files.map_or(u64::MAX, |files| files - files / KEPT);
    let others = (TOLD_MAX + ARRIVING_MAX) as u64;
    let room = room.saturating_sub(others).max(1);
    usize::try_from(room).map_or(CONNECTIONS_MAX, |room| room.min(CONNECTIONS_MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_comes_when_all_places_are_taken_is_told_and_who_comes_then_is_not() {
        let room = Room::new(2);
        let seated: Vec<_> = (0..2).map(|_| room.place().unwrap()).collect();
        assert!(seated.iter().all(|place| !place.is_over));
        let told: Vec<_> = (0..TOLD_MAX).map(|_| room.place().unwrap()).collect();
        assert!(told.iter().all(|place| place.is_over));
        assert!(room.place().is_none());
        drop(seated);
        assert!(!room.place().unwrap().is_over);
    }

    #[test]
    fn other_files_keep_their_share() {
        assert_eq!(connections_of(Some(1_024)), 448);
        assert_eq!(connections_of(Some(65_536)), CONNECTIONS_MAX);
        assert_eq!(connections_of(None), CONNECTIONS_MAX);
        assert_eq!(connections_of(Some(16)), 1);
    }
}
