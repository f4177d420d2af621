//! Waiting for a condition, with a limit that only a mistake reaches.

use std::thread;
use std::time::{Duration, Instant};

/// How long anything may take on a slow, busy machine. Reaching it fails the test.
pub(crate) const LIMIT: Duration = Duration::from_secs(300);

/// How long one image at full settings may take on such a machine.
pub(crate) const LONG_LIMIT: Duration = Duration::from_secs(40 * 60);

/// How often a condition is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// What `condition` answers once it answers something; panics, naming `what`, when [`LIMIT`] is over.
#[track_caller]
pub(crate) fn until<T>(what: &str, condition: impl FnMut() -> Option<T>) -> T {
    until_within(LIMIT, what, condition)
}

/// [`until`] with another limit.
#[track_caller]
pub(crate) fn until_within<T>(
    limit: Duration,
    what: &str,
    mut condition: impl FnMut() -> Option<T>,
) -> T {
    let start = Instant::now();
    loop {
        if let Some(answer) = condition() {
            return answer;
        }
        assert!(
            start.elapsed() < limit,
            "waited {limit:?} in vain until {what}"
        );
        thread::sleep(LOOK_EVERY);
    }
}
