//! Random histories: whatever workers, users and the network do, what must hold holds.
//!
//! The scheduler is told random events, late and repeated ones among them, and
//! is held against a plain model of what it said. In the end diligent workers
//! join and every job must come to its end; or the coordinator dies first, and what it had
//! committed is told to another one. `PROPTEST_CASES=20000` looks longer.

mod acts;
mod bystander;
mod ends;
mod history;
#[path = "../situation/mod.rs"]
mod situation;
mod step;

use history::History;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use step::step;

// Saved beside this file.
const SAVED: FileFailurePersistence = FileFailurePersistence::WithSource("proptest-regressions");

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: Some(Box::new(SAVED)),
        ..ProptestConfig::default()
    })]

    #[test]
    fn what_must_hold_holds(steps in prop::collection::vec(step(), 1..120)) {
        let mut history = History::new();
        for step in steps {
            history.take(step);
        }
        history.fall_silent();
        history.finish();
    }

    #[test]
    fn what_is_durable_comes_back(steps in prop::collection::vec(step(), 1..120)) {
        let mut history = History::new();
        for step in steps {
            history.take(step);
        }
        history.begin_anew();
        history.finish();
    }
}
