//! What always holds, in code.

use crate::Session;
use crate::held::Phase;
use crate::leave::Leaving;

impl Session {
    /// Looks at the whole state and asserts what must hold between two events.
    ///
    /// For tests: it costs as much as all blocks that are kept.
    ///
    /// # Panics
    ///
    /// Where something does not hold, which is a mistake in this crate.
    pub fn check_invariants(&self) {
        let of = |phase: Phase| self.held.values().filter(move |held| held.phase == phase);
        assert_eq!(of(Phase::Running).count(), self.running as usize);
        assert!(self.running <= self.config.threads, "one thread per tile");
        assert_eq!(of(Phase::Waiting).count(), self.waiting.len());
        let kept: usize = self.held.values().map(|held| held.unacked.len()).sum();
        assert_eq!(kept, self.unacked as usize);
        let is_free = self.running < self.config.threads && !self.paused;
        let gone = self.leaving == Leaving::Gone;
        assert!(
            gone || !is_free || self.waiting.is_empty(),
            "no thread idles"
        );
        let high = self.config.unacked_blocks_max - self.config.threads;
        assert!(
            self.unacked < high || self.paused,
            "too many blocks pause rendering"
        );
        for held in self.held.values() {
            assert!(held.phase != Phase::Waiting || held.unacked.is_empty());
            let over = held.phase == Phase::Rendered && held.unacked.is_empty();
            assert!(!over, "what is delivered is not held");
        }
        let settled = [Leaving::No, Leaving::Gone].contains(&self.leaving);
        assert!(
            settled || !self.held.is_empty(),
            "a session that has nothing to wait for leaves"
        );
    }
}
