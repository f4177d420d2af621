//! CPU time of the calling thread.

use std::fs;
use std::time::Instant;

use crate::error::Error;

/// A turn takes at least this long: the system counts a thread's time in steps of up to 4 ms.
const LEAST_SECONDS: f64 = 0.2;

/// Most repetitions of one turn.
const REPETITIONS_MAX: u32 = 1 << 20;

/// Seconds that `what` takes, averaged over as many repetitions as can be measured well.
pub(crate) fn seconds(mut what: impl FnMut() -> Result<(), Error>) -> Result<f64, Error> {
    let clock = Clock::start();
    let (mut done, mut wanted) = (0, 1);
    loop {
        while done < wanted {
            what()?;
            done += 1;
        }
        let spent = clock.seconds();
        if spent >= LEAST_SECONDS || done >= REPETITIONS_MAX {
            return Ok(spent / f64::from(done));
        }
        wanted = done * 2;
    }
}

/// This thread's CPU time where the system tells it, else the time of the wall.
struct Clock {
    started: Instant,
    cpu: Option<u64>,
}

impl Clock {
    fn start() -> Self {
        Self {
            cpu: cpu_nanoseconds(),
            started: Instant::now(),
        }
    }

    fn seconds(&self) -> f64 {
        let cpu = self.cpu.zip(cpu_nanoseconds());
        match cpu {
            Some((start, end)) if end >= start => (end - start) as f64 * 1e-9,
            _ => self.started.elapsed().as_secs_f64(),
        }
    }
}

/// Nanoseconds that this thread has been on a processor, as Linux counts them.
fn cpu_nanoseconds() -> Option<u64> {
    let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_short_is_repeated_until_it_can_be_measured() {
        let mut sum = 0_u64;
        let mut times = 0_u32;
        let each = seconds(|| {
            times += 1;
            for i in 0..200_000 {
                sum = std::hint::black_box(sum.wrapping_mul(3) + i);
            }
            Ok(())
        });
        let each = each.unwrap();
        assert!(times > 1 && each * f64::from(times) >= LEAST_SECONDS);
        assert!(seconds(|| Err(Error::failed("no"))).is_err());
    }
}
