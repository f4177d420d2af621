//! What a measurement counts as time.

use std::fs;
use std::time::Instant;

/// This thread's CPU time where the system tells it, else the time of the wall.
pub(crate) struct Clock {
    started: Instant,
    cpu: Option<u64>,
}

impl Clock {
    /// From now on.
    pub(crate) fn start() -> Self {
        Self {
            cpu: cpu_nanoseconds(),
            started: Instant::now(),
        }
    }

    /// Seconds since then.
    pub(crate) fn seconds(&self) -> f64 {
        let cpu = self.cpu.zip(cpu_nanoseconds());
        match cpu {
            Some((start, end)) if end > start => (end - start) as f64 * 1e-9,
            _ => self.started.elapsed().as_secs_f64(),
        }
    }
}

/// Nanoseconds that this thread has been on a processor, as Linux counts them.
fn cpu_nanoseconds() -> Option<u64> {
    let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse().ok()
}
