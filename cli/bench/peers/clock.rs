//! CPU time of the calling thread.

use crate::bench::clock::Clock;
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
