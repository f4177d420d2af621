//! How many tiles a worker wants to hold: as many as it takes that no thread waits.

mod situation;

use model::Span;
use session::{Config, Effect, Event};
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
    // Never more than there may be, not even while nothing is measured.
    let few = Config {
        ahead_max: 3,
        ..four()
    };
    let mut worker = Situation::new(few.clone());
    worker.is_told(Event::Started).is_told(Event::Dialled);
    assert!(asks(&worker.is_told(welcome(&[])).never_mind()).contains(&(4 + 3)));
    let credits = after(few, Span::from_millis(5), round_trip);
    assert_eq!(credits, []);
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

#[test]
fn who_starves_asks_for_twice_as_many_at_once_and_comes_back() {
    let one = Config {
        threads: 1,
        ahead: 1,
        ahead_max: 6,
        ..config()
    };
    let mut worker = Situation::connected(one);
    let render = |worker: &mut Situation, number| {
        worker
            .is_told(rendered(number, 0))
            .is_told(rendered(number, 1));
        worker.is_told(tile_rendered(number));
    };
    // The thread has nothing to begin, and nothing more comes before an acknowledgement.
    worker.leased([1, 2]);
    render(&mut worker, 1);
    assert!(!asks(&worker.never_mind()).contains(&(1 + 2)));
    render(&mut worker, 2);
    assert_eq!(asks(&worker.never_mind()), [1 + 2]);
    // It waits until it has those, and asks again where they are too few, up to what there may be.
    worker.leased([3]);
    render(&mut worker, 3);
    assert_eq!(asks(&worker.never_mind()), [1 + 4]);
    worker.leased([4, 5]);
    render(&mut worker, 4);
    assert_eq!(asks(&worker.never_mind()), []);
    render(&mut worker, 5);
    assert_eq!(asks(&worker.never_mind()), [1 + 6]);
    worker.leased([6, 7]);
    render(&mut worker, 6);
    render(&mut worker, 7);
    assert_eq!(asks(&worker.never_mind()), []);
    for number in 1..=7 {
        worker.is_told(acked(number, 0)).is_told(acked(number, 1));
    }
    // While nobody starves, it wants less from heartbeat to heartbeat, down to what is measured.
    let mut credits = Vec::new();
    for _ in 0..20 {
        worker.waits(Span::from_secs(1));
        credits.extend(asks(&worker.never_mind()));
    }
    assert!(credits.is_sorted_by(|a, b| a > b), "{credits:?}");
    assert_eq!(credits.last(), Some(&(1 + 1)));
}

/// The credits among these.
fn asks(effects: &[Effect]) -> Vec<u32> {
    let credits = effects.iter().filter_map(|effect| match effect {
        Effect::SendCredit { credit } => Some(*credit),
        _ => None,
    });
    credits.collect()
}
