//! Sharing independent work among threads.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::mpsc::{self, Receiver, SyncSender, TryRecvError};
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

/// Hands what `of` makes of every item to `each`, in the items' order, on this thread, while `threads` − 1 others
/// go on with the next items; no more than `ahead` of them, at least one, are begun or done and not handed on.
///
/// Ends with the first error of `each`. Where the system gives no further thread, those that there are do it all.
pub(crate) fn in_sequence<T: Send, R: Send, E>(
    items: impl IntoIterator<Item = T>,
    threads: usize,
    ahead: usize,
    of: impl Fn(T) -> R + Sync,
    mut each: impl FnMut(R) -> Result<(), E>,
) -> Result<(), E> {
    let mut items = items.into_iter();
    let (jobs, queue) = mpsc::channel::<(T, SyncSender<R>)>();
    let queue = Mutex::new(queue);
    let work = || {
        let next = || queue.lock().ok()?.recv().ok();
        while let Some((item, result)) = next() {
            // Nobody listens any more after an error.
            let _ = result.send(of(item));
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads {
            if thread::Builder::new().spawn_scoped(scope, work).is_err() {
                break;
            }
        }
        // Dropped at the end, which ends the others.
        let jobs = jobs;
        let mut begun: VecDeque<Receiver<R>> = VecDeque::new();
        loop {
            while begun.len() < ahead.max(1)
                && let Some(item) = items.next()
            {
                let (result, receiver) = mpsc::sync_channel(1);
                begun.push_back(receiver);
                // The queue is there as long as this function.
                let _ = jobs.send((item, result));
            }
            let Some(first) = begun.front() else {
                return Ok(());
            };
            let result = match first.try_recv() {
                Ok(result) => Some(result),
                Err(TryRecvError::Disconnected) => None,
                // Whoever holds the lock waits for jobs, or has just got one.
                Err(TryRecvError::Empty) => match queue.try_lock().map(|queue| queue.try_recv()) {
                    Ok(Ok((item, result))) => {
                        let _ = result.send(of(item));
                        continue;
                    }
                    _ => first.recv().ok(),
                },
            };
            let Some(result) = result else {
                // A thread panicked with its item, and the scope passes its panic on.
                return Ok(());
            };
            begun.pop_front();
            each(result)?;
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

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

    #[test]
    fn results_come_in_sequence_and_not_too_many_wait() {
        for (threads, ahead) in [(0, 0), (1, 1), (1, 5), (2, 2), (7, 3), (20, 64)] {
            let (begun, mut seen) = (AtomicUsize::new(0), Vec::new());
            let of = |n: usize| {
                begun.fetch_add(1, Ordering::SeqCst);
                n * n
            };
            let each = |square| {
                seen.push(square);
                let waiting = begun.load(Ordering::SeqCst) + 1 - seen.len();
                assert!(waiting <= ahead.max(1), "{waiting} of {ahead}");
                Ok::<_, ()>(())
            };
            in_sequence(0..1000, threads, ahead, of, each).unwrap();
            assert_eq!(seen, (0..1000).map(|n| n * n).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_first_error_ends_a_sequence() {
        for threads in [1, 4] {
            let begun = AtomicUsize::new(0);
            let of = |n: usize| {
                begun.fetch_add(1, Ordering::SeqCst);
                n
            };
            let each = |n| if n == 10 { Err(n) } else { Ok(()) };
            assert_eq!(in_sequence(0.., threads, 8, of, each), Err(10));
            assert!(begun.into_inner() <= 10 + 8 + 1);
        }
    }

    #[test]
    #[should_panic(expected = "a scoped thread panicked")]
    fn a_panic_beside_is_passed_on() {
        let main = thread::current().id();
        let of = |()| assert_eq!(thread::current().id(), main, "not this thread");
        // Endless, so that the other thread surely gets one.
        let _ = in_sequence(std::iter::repeat(()), 2, 2, of, |()| Ok::<_, ()>(()));
    }
}
