//! The coordinator's only clock.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use model::Timestamp;

/// Counts microseconds from 1970, as the calendar stood when it was made; steps of the calendar's clock since then do
/// not show. It stands still while it is held.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    origin: Instant,
    start: Timestamp,
    /// How long it was held so far.
    stood: Duration,
    held: Option<Instant>,
}

impl Clock {
    pub(crate) fn start() -> Self {
        let since = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        Self {
            origin: Instant::now(),
            start: Timestamp(micros(since)),
            stood: Duration::ZERO,
            held: None,
        }
    }

    /// Now, as the scheduler counts it.
    pub(crate) fn now(&self) -> Timestamp {
        let real = self.held.unwrap_or_else(Instant::now);
        let gone = real.duration_since(self.origin).saturating_sub(self.stood);
        Timestamp(self.start.0.saturating_add(micros(gone)))
    }

    /// When it was made.
    pub(crate) fn started(&self) -> Timestamp {
        self.start
    }

    /// The calendar now, in milliseconds since 1970.
    pub(crate) fn unix_ms_now(&self) -> u64 {
        self.start.0.saturating_add(micros(self.origin.elapsed())) / 1_000
    }

    /// When an instant comes, for the runtime's timers.
    pub(crate) fn instant(&self, at: Timestamp) -> tokio::time::Instant {
        let ahead = Duration::from_micros(at.0.saturating_sub(self.start.0));
        (self.origin + self.stood + ahead).into()
    }

    /// Stands still until [`Clock::release`]: nobody is late for what the coordinator itself holds up.
    pub(crate) fn hold(&mut self) {
        self.held.get_or_insert_with(Instant::now);
    }

    /// Goes on.
    pub(crate) fn release(&mut self) {
        if let Some(since) = self.held.take() {
            self.stood += since.elapsed();
        }
    }

    pub(crate) fn is_held(&self) -> bool {
        self.held.is_some()
    }
}

/// An instant in milliseconds since 1970.
pub(crate) fn unix_ms(at: Timestamp) -> u64 {
    at.0 / 1_000
}

fn micros(span: Duration) -> u64 {
    u64::try_from(span.as_micros()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_is_late_while_it_is_held() {
        let mut clock = Clock::start();
        clock.hold();
        let then = clock.now();
        let deadline = clock.instant(then);
        std::thread::sleep(Duration::from_millis(5));
        assert_eq!(clock.now(), then);
        clock.release();
        let late = clock.now().0 - then.0;
        assert!(clock.instant(then) >= deadline + Duration::from_millis(5));
        assert!(late < clock.unix_ms_now() * 1_000 + 1_000 - then.0);
    }
}
