//! What a worker does, situation by situation: exact effects, and nothing else.

mod situation;

use model::{Epoch, Running, Span};
use session::{BlockVerdict, Config, Effect, Event, ExitReason, LinkState, Retry};
use situation::*;

#[test]
fn it_dials_greets_and_says_what_it_wants() {
    Situation::new(Config {
        ahead: 2,
        ..config()
    })
    .wants(&[])
    .is_told(Event::Started)
    .wants(&[Effect::Connect])
    .is_told(Event::Dialled)
    .wants(&[Effect::SendHello {
        held: vec![],
        begun: vec![],
    }])
    .is_told(welcome(&[]))
    .wants(&[Effect::SendCredit { credit: 3 }])
    .waits(Span::from_millis(1_999))
    .wants(&[Effect::SendHeartbeat { running: vec![] }]);
}

#[test]
fn it_renders_in_the_order_of_the_leases_one_tile_per_thread() {
    let mut worker = Situation::connected(config());
    worker
        .leased([1, 2])
        .wants(&[start(1)])
        .is_told(rendered(1, 0))
        .wants(&[send(1, 0)])
        .is_told(rendered(1, 1))
        .wants(&[send(1, 1)])
        .is_told(tile_rendered(1))
        .wants(&[start(2)])
        .is_told(acked(1, 0))
        .wants(&[drop_block(1, 0)]);
    assert_eq!(worker.session.summary().delivering, 1);
    worker.is_told(acked(1, 1)).wants(&[drop_block(1, 1)]);
    let summary = worker.session.summary();
    assert_eq!((summary.tiles_delivered, summary.blocks_acked), (1, 2));
    assert_eq!((summary.running, summary.delivering), (1, 0));
}

#[test]
fn heartbeats_name_what_was_started_and_how_far_it_is() {
    let running = vec![Running {
        attempt: attempt(1),
        blocks: 1,
    }];
    Situation::connected(config())
        .leased([1, 2])
        .is_told(rendered(1, 0))
        .wants(&[start(1), send(1, 0)])
        .waits(INTERVAL)
        .wants(&[Effect::SendHeartbeat { running }]);
}

#[test]
fn what_comes_twice_counts_once() {
    Situation::connected(config())
        .leased([1, 1])
        .wants(&[start(1)])
        .is_told(rendered(1, 0))
        .is_told(rendered(1, 0))
        .wants(&[send(1, 0)])
        .is_told(acked(1, 0))
        .is_told(acked(1, 0))
        .wants(&[drop_block(1, 0)])
        .is_told(rendered(1, 1))
        .is_told(acked(1, 1))
        .is_told(tile_rendered(1))
        .is_told(tile_rendered(1))
        .wants(&[send(1, 1), drop_block(1, 1)])
        .is_told(revoked(1))
        .is_told(welcome(&[]))
        .wants(&[]);
}

#[test]
fn an_attempt_is_never_started_twice() {
    Situation::connected(config())
        .leased([1])
        .is_told(revoked(1))
        .wants(&[start(1), cancel(1)])
        .leased([1])
        .wants(&[give_back(&[1]), Effect::SendCredit { credit: 2 }]);
}

#[test]
fn a_lease_beyond_twice_the_credit_is_given_back() {
    let mut worker = Situation::connected(config());
    worker.leased(1..=4).wants(&[start(1)]);
    worker.leased([5]).wants(&[give_back(&[5])]);
    // The coordinator waits to hear that there is room again: it wants to hold two.
    let credit = Effect::SendCredit { credit: 2 };
    let mut said = Vec::new();
    for number in 1..=3 {
        for index in 0..2 {
            worker.is_told(rendered(number, index));
            worker.is_told(acked(number, index));
        }
        let effects = worker.is_told(tile_rendered(number)).never_mind();
        said.push(effects.contains(&credit));
    }
    assert_eq!(said, [false, false, true]);
}

#[test]
fn a_revoked_attempt_is_forgotten_with_its_blocks() {
    Situation::connected(config())
        .leased([1, 2])
        .is_told(rendered(1, 0))
        .wants(&[start(1), send(1, 0)])
        .is_told(revoked(1))
        .wants(&[cancel(1), drop_block(1, 0), start(2)])
        .is_told(rendered(1, 1))
        .wants(&[drop_block(1, 1)])
        .is_told(tile_rendered(1))
        .is_told(acked(1, 0))
        .wants(&[]);
}

#[test]
fn a_failed_tile_is_reported_after_its_last_block_arrived() {
    let reason = String::from("no memory");
    let failed = Event::RenderFailed {
        attempt: attempt(1),
        reason: reason.clone(),
    };
    Situation::connected(config())
        .leased([1, 2])
        .is_told(rendered(1, 0))
        .wants(&[start(1), send(1, 0)])
        .is_told(failed)
        .wants(&[start(2)])
        .is_told(acked(1, 0))
        .wants(&[
            drop_block(1, 0),
            Effect::SendFailed {
                attempt: attempt(1),
                reason,
            },
        ]);
}

#[test]
fn a_block_refused_for_a_passing_reason_is_sent_again_later() {
    let mut worker = Situation::connected(config());
    worker.leased([1]).is_told(rendered(1, 0));
    worker.never_mind();
    worker
        .is_told(Event::BlockRefused {
            attempt: attempt(1),
            rect: block(0),
            verdict: BlockVerdict::Later,
        })
        .wants(&[])
        .waits(Span(config().resend_after.0 - 1))
        .wants(&[])
        .waits(Span(1));
    assert!(worker.never_mind().contains(&send(1, 0)));
}

#[test]
fn a_block_refused_for_good_ends_its_attempt() {
    let refused = |verdict| Event::BlockRefused {
        attempt: attempt(1),
        rect: block(0),
        verdict,
    };
    let mut worker = Situation::connected(config());
    worker.leased([1]).is_told(rendered(1, 0)).never_mind();
    worker
        .is_told(refused(BlockVerdict::AttemptDead))
        .wants(&[cancel(1), drop_block(1, 0)]);

    let reason = String::from("not a block of this tile");
    let mut worker = Situation::connected(config());
    worker.leased([1]).is_told(rendered(1, 0)).never_mind();
    worker
        .is_told(refused(BlockVerdict::Never {
            reason: reason.clone(),
        }))
        .wants(&[
            cancel(1),
            drop_block(1, 0),
            Effect::SendFailed {
                attempt: attempt(1),
                reason,
            },
        ]);
}

#[test]
fn it_goes_on_without_a_link_and_resends_on_the_next_one() {
    let mut worker = Situation::connected(config());
    worker.leased([1, 2]).is_told(rendered(1, 0)).never_mind();
    worker
        .is_told(lost())
        .is_told(rendered(1, 1))
        .is_told(tile_rendered(1))
        .is_told(rendered(2, 0))
        .wants(&[start(2)])
        .waits(Span::from_millis(100))
        .wants(&[Effect::Connect])
        .is_told(Event::Dialled)
        .wants(&[Effect::SendHello {
            held: vec![attempt(1), attempt(2)],
            begun: vec![begun(1), begun(2)],
        }])
        .is_told(welcome(&[1, 2]))
        .wants(&[
            Effect::SendCredit { credit: 2 },
            send(1, 0),
            send(1, 1),
            send(2, 0),
        ]);
}

#[test]
fn what_died_while_it_was_away_is_forgotten() {
    let mut worker = Situation::connected(config());
    worker.leased([1, 2]).is_told(rendered(1, 0)).never_mind();
    worker.is_told(lost()).waits(Span::from_millis(100));
    worker.is_told(Event::Dialled).never_mind();
    worker.is_told(welcome(&[2, 9])).wants(&[
        cancel(1),
        drop_block(1, 0),
        give_back(&[9]),
        Effect::SendCredit { credit: 2 },
        start(2),
    ]);
}

#[test]
fn another_epoch_knows_nothing_of_what_is_held() {
    let mut worker = Situation::connected(config());
    worker.leased([1, 2]).is_told(rendered(1, 0)).never_mind();
    worker.is_told(lost()).waits(Span::from_millis(100));
    worker.is_told(Event::Dialled).never_mind();
    worker.is_told(welcome_in(Epoch(4), &[])).wants(&[
        cancel(1),
        drop_block(1, 0),
        Effect::SendCredit { credit: 2 },
    ]);
    assert_eq!(worker.session.summary().waiting, 0);
}

#[test]
fn another_epoch_takes_up_what_was_begun_and_nothing_is_rendered_twice() {
    let mut worker = Situation::connected(config());
    worker.leased([1, 2]).is_told(rendered(1, 0)).never_mind();
    worker.is_told(lost()).waits(Span::from_millis(100));
    worker.is_told(Event::Dialled).wants(&[
        Effect::Connect,
        Effect::SendHello {
            held: vec![attempt(1), attempt(2)],
            begun: vec![begun(1)],
        },
    ]);
    worker
        .is_told(welcome_in(Epoch(4), &[1]))
        .wants(&[Effect::SendCredit { credit: 2 }, send(1, 0)])
        .is_told(acked(1, 0))
        .is_told(rendered(1, 1))
        .is_told(tile_rendered(1))
        .wants(&[drop_block(1, 0), send(1, 1)])
        .is_told(acked(1, 1));
    assert_eq!(worker.session.summary().tiles_delivered, 1);
}

#[test]
fn away_for_longer_than_the_liveness_limit_only_what_was_started_is_kept() {
    let mut worker = Situation::connected(config());
    worker.leased([1, 2]).is_told(lost()).waits(LIVENESS);
    let summary = worker.session.summary();
    assert_eq!((summary.running, summary.waiting), (1, 0));
    assert_ne!(summary.link, LinkState::Up);
}

#[test]
fn dials_that_lead_nowhere_are_closed_and_repeated_ever_slower_until_it_gives_up() {
    let mut worker = Situation::new(Config {
        give_up: Span::from_secs(60),
        connect_limit: Span::from_secs(2),
        ..config()
    });
    worker
        .is_told(Event::Started)
        .wants(&[Effect::Connect])
        .waits(Span::from_secs(2))
        .wants(&[Effect::CloseLink])
        .waits(Span::from_secs(60));
    let effects = worker.never_mind();
    let dials = effects
        .iter()
        .filter(|effect| **effect == Effect::Connect)
        .count();
    assert!((19..=29).contains(&dials), "{dials} dials in 58 s");
    let reason = "the coordinator could not be reached in time".into();
    let exit = Effect::Exit {
        reason: ExitReason::GaveUp { reason },
    };
    assert_eq!(effects.last(), Some(&exit));
    assert_eq!(worker.session.next_deadline(), None);
    worker.is_told(Event::Started).wants(&[]);
}

#[test]
fn a_refusal_for_good_ends_it_and_another_does_not() {
    let refused = |retry| Event::Refused {
        reason: "revision 2 is wanted".into(),
        retry,
    };
    let mut worker = Situation::new(config());
    worker.is_told(Event::Started).is_told(Event::Dialled);
    worker.never_mind();
    worker
        .is_told(refused(Retry::Later))
        .wants(&[])
        .waits(Span::from_millis(100))
        .wants(&[Effect::Connect])
        .is_told(refused(Retry::Never))
        .wants(&[Effect::Exit {
            reason: ExitReason::Refused {
                reason: "revision 2 is wanted".into(),
            },
        }]);
}

#[test]
fn rendering_pauses_before_too_many_blocks_are_kept() {
    let mut worker = Situation::connected(Config {
        unacked_blocks_max: 3,
        ..config()
    });
    worker
        .leased([1, 2])
        .is_told(rendered(1, 0))
        .wants(&[start(1), send(1, 0)])
        .is_told(rendered(1, 1))
        .wants(&[send(1, 1), Effect::PauseRendering])
        .is_told(tile_rendered(1))
        .wants(&[])
        .is_told(acked(1, 0))
        .wants(&[drop_block(1, 0), Effect::ResumeRendering, start(2)]);
}

#[test]
fn let_go_it_finishes_what_runs_gives_back_the_rest_and_leaves() {
    let mut worker = Situation::connected(config());
    worker.leased([1, 2]).never_mind();
    worker
        .is_told(Event::DrainAsked)
        .wants(&[Effect::SendCredit { credit: 0 }, give_back(&[2])])
        .leased([3])
        .wants(&[give_back(&[3])])
        .is_told(rendered(1, 0))
        .is_told(tile_rendered(1))
        .wants(&[send(1, 0)])
        .is_told(acked(1, 0))
        .wants(&[
            drop_block(1, 0),
            Effect::SendGoodbye,
            Effect::Exit {
                reason: ExitReason::Drained,
            },
        ]);
}

#[test]
fn asked_to_stop_it_finishes_nothing_and_gives_everything_back() {
    let mut worker = Situation::connected(config());
    worker.leased([1, 2]).never_mind();
    worker.is_told(Event::StopAsked).wants(&[
        Effect::SendCredit { credit: 0 },
        give_back(&[2]),
        cancel(1),
        give_back(&[1]),
        Effect::SendGoodbye,
        Effect::Exit {
            reason: ExitReason::Stopped,
        },
    ]);
}

#[test]
fn asked_to_stop_it_waits_for_answers_but_not_for_long() {
    let mut worker = Situation::connected(config());
    worker.leased([1]).is_told(rendered(1, 0)).never_mind();
    worker
        .is_told(Event::StopAsked)
        .wants(&[Effect::SendCredit { credit: 0 }, cancel(1)])
        .waits(config().stop_limit);
    let effects = worker.never_mind();
    let last = [
        give_back(&[1]),
        Effect::SendGoodbye,
        Effect::Exit {
            reason: ExitReason::Stopped,
        },
    ];
    assert!(effects.ends_with(&last), "{effects:?}");
}

#[test]
fn asked_to_stop_twice_or_without_a_link_it_exits_at_once() {
    let exit = Effect::Exit {
        reason: ExitReason::Stopped,
    };
    let mut worker = Situation::connected(config());
    worker.leased([1]).is_told(rendered(1, 0));
    worker.is_told(Event::StopAsked).never_mind();
    worker
        .is_told(Event::StopAsked)
        .wants(std::slice::from_ref(&exit));

    let mut worker = Situation::connected(config());
    worker.leased([1]).is_told(lost()).never_mind();
    worker.is_told(Event::StopAsked).wants(&[exit]);
}

#[test]
fn another_epoch_numbers_its_attempts_anew() {
    let mut worker = Situation::connected(config());
    worker.leased([5]).is_told(lost());
    worker
        .waits(Span::from_millis(100))
        .is_told(Event::Dialled)
        .is_told(welcome_in(Epoch(2), &[]))
        .never_mind();
    let mut anew = lease(1);
    anew.attempt.epoch = Epoch(2);
    worker
        .is_told(Event::Leased(anew.clone()))
        .wants(&[Effect::StartTile { lease: anew }]);
}

#[test]
fn a_block_waiting_to_be_sent_again_is_sent_once_on_a_new_link() {
    let mut worker = Situation::connected(config());
    worker
        .leased([1])
        .is_told(rendered(1, 0))
        .is_told(Event::BlockRefused {
            attempt: attempt(1),
            rect: block(0),
            verdict: BlockVerdict::Later,
        })
        .is_told(lost())
        .waits(Span::from_millis(100))
        .never_mind();
    worker
        .is_told(Event::Dialled)
        .is_told(welcome(&[1]))
        .waits(Span::from_secs(3));
    let effects = worker.never_mind();
    let sent = effects.iter().filter(|effect| **effect == send(1, 0));
    assert_eq!(sent.count(), 1);
}

#[test]
fn a_link_that_lasted_makes_the_next_wait_short() {
    let mut worker = Situation::new(config());
    worker.is_told(Event::Started);
    for _ in 0..6 {
        worker.is_told(lost()).waits(Span::from_secs(1));
    }
    worker.is_told(Event::Dialled).is_told(welcome(&[]));
    worker.waits(INTERVAL).is_told(lost()).never_mind();
    worker
        .waits(Span::from_millis(100))
        .wants(&[Effect::Connect]);
}

#[test]
fn what_is_held_outlives_the_limit_once_the_link_is_back() {
    let mut worker = Situation::connected(config());
    worker
        .leased([1, 2])
        .is_told(lost())
        .waits(Span::from_millis(100))
        .is_told(Event::Dialled)
        .is_told(welcome(&[1, 2]))
        .waits(Span::from_secs(10));
    assert_eq!(worker.session.summary().waiting, 1);
}
