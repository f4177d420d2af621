//! How many tiles a worker wants to hold: as many as it takes that no thread waits.

mod situation;

use model::Span;
use session::{Config, Effect};
use situation::*;

/// A tile takes so long, and its blocks' acknowledgement comes so much later; then a heartbeat.
fn after(config: Config, tile: Span, round_trip: Span) -> Vec<Effect> {
    let mut worker = Situation::connected(config);
    worker.leased([1]).waits(tile);
    worker.is_told(rendered(1, 0)).waits(round_trip);
    worker.is_told(acked(1, 0)).is_told(rendered(1, 1));
    worker.is_told(tile_rendered(1)).is_told(acked(1, 1));
    worker.never_mind();
    worker.waits(Span::from_secs(3));
    let effects = worker.never_mind();
    let credits = effects.into_iter();
    credits
        .filter(|effect| matches!(effect, Effect::SendCredit { .. }))
        .collect()
}

#[test]
fn credit_follows_the_measured_times_and_is_said_once() {
    let four = || Config {
        threads: 4,
        ahead: 4,
        ..config()
    };
    let round_trip = Span::from_millis(5);
    // Tiles of a second: one ahead, and one for the round trip.
    let credits = after(four(), Span::from_millis(495), round_trip);
    assert_eq!(credits, [Effect::SendCredit { credit: 4 + 2 }]);
    // Tiles of ten milliseconds: two round trips of four threads are four tiles.
    let credits = after(four(), Span::from_millis(5), round_trip);
    assert_eq!(credits, [Effect::SendCredit { credit: 4 + 1 + 4 }]);
    // Never more than there may be.
    let few = Config {
        ahead_max: 3,
        ..four()
    };
    let credits = after(few, Span::from_millis(5), round_trip);
    assert_eq!(credits, [Effect::SendCredit { credit: 4 + 3 }]);
}

#[test]
fn what_does_not_change_is_not_said_again() {
    // One thread, one ahead and one for the round trip: what it wanted from the start.
    let two = Config {
        ahead: 2,
        ..config()
    };
    let credits = after(two, Span::from_millis(500), Span::from_millis(5));
    assert_eq!(credits, []);
}
