//! Sharing independent work among threads.

use std::sync::Mutex;
use std::thread;

/// What `of` makes of every item, in the items' order, on this thread and `threads` − 1 others.
///
/// Where the system gives no further thread, those that there are do it all.
pub fn in_order<T: Send, R: Send>(
    items: Vec<T>,
    threads: usize,
    of: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    if threads <= 1 || items.len() <= 1 {
        return items.into_iter().map(of).collect();
    }
    let count = items.len();
    let mut results: Vec<Option<R>> = items.iter().map(|_| None).collect();
    let waiting = Mutex::new(items.into_iter().zip(&mut results));
    let work = || {
        // A thread that panicked took its item with it, and the scope passes its panic on.
        let next = || match waiting.lock() {
            Ok(mut items) => items.next(),
            Err(poisoned) => poisoned.into_inner().next(),
        };
        while let Some((item, result)) = next() {
            *result = Some(of(item));
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads.min(count) {
            if thread::Builder::new().spawn_scoped(scope, work).is_err() {
                break;
            }
        }
        work();
    });
    results.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_their_items() {
        let squares: Vec<u64> = (0..1000).map(|n| n * n).collect();
        for threads in [0, 1, 2, 7, 2000] {
            assert_eq!(
                in_order((0..1000).collect(), threads, |n: u64| n * n),
                squares
            );
        }
        assert_eq!(in_order(Vec::<u8>::new(), 4, |n| n), [0; 0]);
    }
}
