//! The coordinator's only clock. Certificates and tokens alone ask the calendar itself, as those do who show them.

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
        self.at(Instant::now())
    }

    fn at(&self, real: Instant) -> Timestamp {
        let real = self.held.unwrap_or(real);
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
        self.hold_at(Instant::now());
    }

    fn hold_at(&mut self, real: Instant) {
        self.held.get_or_insert(real);
    }

    /// Goes on.
    pub(crate) fn release(&mut self) {
        self.release_at(Instant::now());
    }

    fn release_at(&mut self, real: Instant) {
        if let Some(since) = self.held.take() {
            self.stood += real.duration_since(since);
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
    use model::Span;

    use super::*;

    #[test]
    fn nobody_is_late_while_it_is_held() {
        let mut clock = Clock::start();
        let second = Duration::from_secs(1);
        let start = clock.origin;
        let deadline = clock.at(start) + Span::from_secs(3);
        let due = clock.instant(deadline);
        clock.hold_at(start + second);
        clock.hold_at(start + 2 * second);
        assert!(clock.is_held());
        assert_eq!(clock.at(start + 100 * second), clock.at(start + second));
        clock.release_at(start + 11 * second);
        clock.release_at(start + 12 * second);
        assert_eq!(clock.at(start + 13 * second), deadline);
        assert_eq!(clock.instant(deadline), due + 10 * second);
    }
}
