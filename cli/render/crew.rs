//! Threads for a moment in which the others have nothing to do.

use render::Crew;

/// So many threads, the calling one included; fewer where the system gives no more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Threads(pub(super) usize);

impl Crew for Threads {
    fn each(&self, count: usize, piece: &(dyn Fn(usize) + Sync)) {
        image::in_order((0..count).collect(), self.0, piece);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

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
