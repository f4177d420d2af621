//! Threads that a caller lends: this crate makes none.

use std::sync::OnceLock;

/// Who does independent pieces of work.
pub trait Crew: Sync {
    /// Does pieces 0 to `count` − 1, in any order and side by side, and returns when all are done.
    fn each(&self, count: usize, piece: &(dyn Fn(usize) + Sync));
}

/// The calling thread, one piece after the other.
#[derive(Clone, Copy, Debug)]
pub struct Alone;

impl Crew for Alone {
    fn each(&self, count: usize, piece: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(piece);
    }
}

/// What `of` makes of every item, in the items' order.
pub(crate) fn in_order<T: Sync, R: Send + Sync>(
    crew: &dyn Crew,
    items: &[T],
    of: impl Fn(&T) -> R + Sync,
) -> Vec<R> {
    let results: Vec<OnceLock<R>> = items.iter().map(|_| OnceLock::new()).collect();
    crew.each(items.len(), &|index| {
        results[index].get_or_init(|| of(&items[index]));
    });
    results
        .into_iter()
        .filter_map(OnceLock::into_inner)
        .collect()
}
