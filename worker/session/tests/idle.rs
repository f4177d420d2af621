//! A worker that gives its place back when there is nothing to do.

mod situation;

use model::Span;
use session::{Config, Effect, Event, ExitReason};
use situation::*;

/// Between two heartbeats.
const IDLE: Span = Span::from_millis(10_500);

fn leaves_when_idle() -> Config {
    Config {
        idle: Some(IDLE),
        ..config()
    }
}

const EXIT: Effect = Effect::Exit {
    reason: ExitReason::Idle,
};

#[test]
fn it_leaves_when_nothing_came_for_long() {
    let mut worker = Situation::connected(leaves_when_idle());
    worker.waits(Span(IDLE.0 - 1));
    assert!(!worker.never_mind().contains(&EXIT));
    worker.waits(Span(1)).wants(&[Effect::SendGoodbye, EXIT]);
}

#[test]
fn work_begins_the_time_anew() {
    let mut worker = Situation::connected(leaves_when_idle());
    worker.waits(Span(IDLE.0 - 1)).leased([1]);
    worker.waits(IDLE.times(3));
    worker
        .is_told(rendered(1, 0))
        .is_told(rendered(1, 1))
        .is_told(tile_rendered(1))
        .is_told(acked(1, 0))
        .is_told(acked(1, 1))
        .waits(Span(IDLE.0 - 1));
    assert!(!worker.never_mind().contains(&EXIT));
    worker.waits(Span(1)).wants(&[Effect::SendGoodbye, EXIT]);
}

#[test]
fn it_leaves_without_a_coordinator_too() {
    let mut worker = Situation::new(leaves_when_idle());
    worker.is_told(Event::Started).waits(IDLE);
    assert_eq!(worker.never_mind().last(), Some(&EXIT));
}

#[test]
fn nobody_leaves_who_was_not_asked_to() {
    let mut worker = Situation::connected(config());
    worker.waits(Span::from_secs(3_600));
    let exits = |effect: &Effect| matches!(effect, Effect::Exit { .. });
    assert!(!worker.never_mind().iter().any(exits));
}
