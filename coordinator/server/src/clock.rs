//! The coordinator's only clock.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use model::Timestamp;

/// Counts from when it was made; knows what the calendar said then.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    origin: Instant,
    unix_ms: u64,
}

impl Clock {
    pub(crate) fn start() -> Self {
        let since = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        Self {
            origin: Instant::now(),
            unix_ms: u64::try_from(since.as_millis()).unwrap_or(u64::MAX),
        }
    }

    /// Now, as the scheduler counts it.
    pub(crate) fn now(&self) -> Timestamp {
        Timestamp(u64::try_from(self.origin.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// An instant in milliseconds since 1970. Steps of the calendar's clock do not show.
    pub(crate) fn unix_ms(&self, at: Timestamp) -> u64 {
        self.unix_ms.saturating_add(at.0 / 1_000)
    }

    /// When an instant comes, for the runtime's timers.
    pub(crate) fn instant(&self, at: Timestamp) -> tokio::time::Instant {
        (self.origin + Duration::from_micros(at.0)).into()
    }
}
