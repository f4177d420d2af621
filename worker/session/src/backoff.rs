//! How long to wait before dialling again.

use model::Span;

/// Exponential backoff: the n-th wait is `first · 2ⁿ`, at most `longest`, of
/// which the upper half is scaled by a keyed random number, so that workers cut off together do not come back together.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Backoff {
    /// The first wait, before scaling.
    pub first: Span,
    /// The longest wait.
    pub longest: Span,
    /// Key of the random numbers; different for every worker.
    pub key: u64,
}

impl Default for Backoff {
    fn default() -> Self {
        Self {
            first: Span::from_millis(250),
            longest: Span::from_secs(15),
            key: 0,
        }
    }
}

impl Backoff {
    /// The wait after `failures` dials in a row that failed before it; between a
    /// half and the whole of the n-th step. The same key and number give the same wait.
    pub fn wait(&self, failures: u32) -> Span {
        let doubled = self.first.times(1 << failures.min(40));
        let step = doubled.min(self.longest).0;
        let random = split_mix(self.key ^ (u64::from(failures) << 32)) >> 32;
        let scaled = (u128::from(step.div_ceil(2)) * u128::from(random)) >> 32;
        Span(step / 2 + u64::try_from(scaled).unwrap_or(u64::MAX))
    }
}

/// The finaliser of SplitMix64: every bit of the key reaches every bit of the number.
fn split_mix(key: u64) -> u64 {
    let mixed = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_longest_and_differ_between_keys() {
        let backoff = Backoff {
            key: 7,
            ..Backoff::default()
        };
        for failures in 0..100 {
            let step = (250_000_u64 << failures.min(20)).min(15_000_000);
            let wait = backoff.wait(failures).0;
            assert!(wait >= step / 2 && wait <= step, "{failures}: {wait}");
            assert_eq!(backoff.wait(failures).0, wait);
        }
        let other = Backoff { key: 8, ..backoff };
        assert_ne!(backoff.wait(3), other.wait(3));
    }
}
