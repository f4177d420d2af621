//! What the rays of a trial may cost: whoever needs more is told that it was cancelled.

use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;

use crate::error::Cancelled;

/// The least that a ray of any trial was found to need so far, in evaluations of a value.
#[derive(Debug)]
pub(crate) struct Least(AtomicU64);

impl Least {
    /// At first.
    pub(crate) fn new(cost: f64) -> Self {
        Self(AtomicU64::new(cost.to_bits()))
    }

    /// Of what is known and this; costs are not negative.
    pub(crate) fn hear(&self, cost: f64) {
        // The bits of numbers that are not negative are in the numbers' order.
        self.0.fetch_min(cost.to_bits(), Ordering::Relaxed);
    }

    fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }
}

/// The evaluations of one trial's rays, whatever threads trace them, and the least that others need.
#[derive(Debug)]
pub(crate) struct Allowance {
    spent: AtomicU64,
    rays: f64,
    least: Arc<Least>,
}

impl Allowance {
    /// For a trial of so many rays.
    pub(crate) fn new(rays: usize, least: &Arc<Least>) -> Self {
        Self {
            spent: AtomicU64::new(0),
            rays: rays as f64,
            least: Arc::clone(least),
        }
    }

    /// Takes evaluations; fails once these rays need more than the least.
    pub(crate) fn spend(&self, evaluations: u64) -> Result<(), Cancelled> {
        let spent = self.spent.fetch_add(evaluations, Ordering::Relaxed) + evaluations;
        if spent as f64 > self.least.get() * self.rays {
            Err(Cancelled)
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_ends_where_it_costs_more_than_another() {
        let least = Arc::new(Least::new(f64::INFINITY));
        let (first, second) = (Allowance::new(10, &least), Allowance::new(10, &least));
        assert!(first.spend(1_000_000).is_ok());
        least.hear(7.0);
        least.hear(9.0);
        assert!(second.spend(70).is_ok());
        assert!(second.spend(1).is_err());
        assert!(second.spend(0).is_err());
        assert!(first.spend(0).is_err());
    }
}
