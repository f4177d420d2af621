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

/// What two independent pieces of work make.
pub(crate) fn both<A: Send + Sync, B: Send + Sync>(
    crew: &dyn Crew,
    first: impl Fn() -> A + Sync,
    second: impl Fn() -> B + Sync,
) -> (A, B) {
    let (made_first, made_second) = (OnceLock::new(), OnceLock::new());
    crew.each(2, &|index| {
        if index == 0 {
            made_first.get_or_init(&first);
        } else {
            made_second.get_or_init(&second);
        }
    });
    // A crew does every piece; one that did not leaves it to this thread.
    (
        made_first.into_inner().unwrap_or_else(first),
        made_second.into_inner().unwrap_or_else(second),
    )
}
