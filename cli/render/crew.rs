//! Threads for a moment in which the others have nothing to do.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use render::Crew;

/// So many threads, the calling one included; fewer where the system gives no more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Threads(pub(super) usize);

impl Crew for Threads {
    fn each(&self, count: usize, piece: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        let work = || {
            loop {
                match next.fetch_add(1, Ordering::Relaxed) {
                    index if index < count => piece(index),
                    _ => return,
                }
            }
        };
        thread::scope(|scope| {
            for _ in 1..self.0.min(count) {
                let spawned = thread::Builder::new().spawn_scoped(scope, work);
                if spawned.is_err() {
                    break;
                }
            }
            work();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_is_done_once() {
        for threads in [0, 1, 2, 7, 2000] {
            let done: Vec<_> = (0..1000).map(|_| AtomicUsize::new(0)).collect();
            Threads(threads).each(done.len(), &|index| {
                done[index].fetch_add(1, Ordering::Relaxed);
            });
            let done = done.into_iter().map(AtomicUsize::into_inner);
            assert!(done.into_iter().all(|times| times == 1));
            Threads(threads).each(0, &|_| panic!("there is no piece"));
        }
    }
}
