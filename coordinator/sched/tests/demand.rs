//! What a site could do.

mod situation;

use model::{Revision, Span};
use sched::{Command, Config, Demand, Event, Needs, Offer, Submission};
use situation::*;

fn left(farm: &Farm) -> Demand {
    farm.sched.demand(&offer())
}

#[test]
fn nothing_is_wanted_of_an_idle_farm() {
    let farm = Farm::new(Config::new(EPOCH));
    assert_eq!(left(&farm), Demand::default());
}

#[test]
fn what_is_left_shrinks_as_it_is_done_and_not_as_it_is_leased() {
    let mut farm = Farm::new(Config::new(EPOCH));
    farm.job(2);
    let before = left(&farm);
    assert!(before.squares > 0);
    assert_eq!(before.unmeasured, before.squares, "nothing was measured");
    farm.worker(1, 1);
    assert_eq!(left(&farm).squares, before.squares);
    farm.stores(1, 1, 0, block(0));
    let after = left(&farm);
    assert!(after.squares < before.squares, "{after:?}");
    assert_eq!(before.dearest, Span(0));
    assert!(after.dearest > Span(0), "{after:?}");
    farm.command(Command::Pause);
    assert_eq!(left(&farm).squares, 0);
    farm.command(Command::Resume);
    assert_eq!(left(&farm).squares, after.squares);
    farm.command(Command::Cancel);
    assert_eq!(left(&farm).squares, 0);
}

#[test]
fn only_what_the_offer_serves_counts() {
    let mut farm = Farm::new(Config::new(EPOCH));
    let needs = Needs {
        labels: ["big".to_owned()].into(),
        threads: 4,
        memory_bytes: 0,
    };
    farm.is_told(Event::Submit(Submission {
        needs,
        ..submission(1, 1)
    }));
    assert_eq!(left(&farm).squares, 0);
    let able = Offer {
        labels: ["big".to_owned()].into(),
        threads: 4,
        ..offer()
    };
    assert!(farm.sched.demand(&able).squares > 0);
    let other = Offer {
        revision: Revision(99),
        ..able
    };
    assert_eq!(farm.sched.demand(&other).squares, 0);
}
