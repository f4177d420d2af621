//! Jobs that not every worker can render.

mod situation;

use std::collections::BTreeSet;

use model::{Span, SubmissionId};
use sched::{Effect, Event, LinkId, Needs, Offer, SubmitRefusal, WorkerRefusal};
use situation::*;

fn labels(labels: &[&str]) -> BTreeSet<String> {
    labels.iter().map(|label| (*label).to_owned()).collect()
}

fn joins_with(farm: &mut Farm, id: u64, offer: Offer) {
    farm.is_told(Event::WorkerJoined {
        worker: worker(id),
        link: LinkId(id),
        offer,
        held: vec![],
        begun: vec![],
    })
    .wants_tiles(id, 4);
}

fn asks(farm: &mut Farm, needs: Needs) {
    let mut asked = submission(1, 1);
    asked.needs = needs;
    farm.is_told(Event::Submit(asked));
}

fn held(farm: &Farm, id: u64) -> u32 {
    farm.sched.worker(worker(id)).expect("it joined").attempts
}

#[test]
fn a_job_goes_to_workers_that_offer_all_it_asks_for() {
    let needs = Needs {
        labels: labels(&["avx512"]),
        threads: 2,
        memory_bytes: 1 << 30,
    };
    let good = Offer {
        threads: 2,
        memory_bytes: 1 << 30,
        labels: labels(&["avx512", "quiet"]),
        ..offer()
    };
    let bad = [
        Offer {
            threads: 1,
            ..good.clone()
        },
        Offer {
            memory_bytes: (1 << 30) - 1,
            ..good.clone()
        },
        Offer {
            labels: labels(&["quiet"]),
            ..good.clone()
        },
    ];
    // Whoever comes first.
    for job_first in [true, false] {
        let mut farm = farm();
        if job_first {
            asks(&mut farm, needs.clone());
        }
        for (id, offer) in (1..).zip(bad.iter().chain([&good])) {
            joins_with(&mut farm, id, offer.clone());
        }
        if !job_first {
            asks(&mut farm, needs.clone());
        }
        let attempts: Vec<u32> = (1..=4).map(|id| held(&farm, id)).collect();
        assert_eq!(attempts, [0, 0, 0, 2]);
    }
}

#[test]
fn a_worker_that_is_good_for_several_kinds_of_job_takes_them_by_rank() {
    let mut farm = farm();
    farm.job(1);
    let mut asked = submission(2, 1);
    asked.needs.threads = 2;
    asked.priority = 1;
    farm.is_told(Event::Submit(asked)).never_mind();
    let offer = Offer {
        threads: 2,
        ..offer()
    };
    joins_with(&mut farm, 1, offer);
    let jobs = farm
        .never_mind()
        .into_iter()
        .filter_map(|effect| match effect {
            Effect::Lease { lease, .. } => Some(lease.image.job.0),
            _ => None,
        });
    assert_eq!(jobs.collect::<Vec<_>>(), [2, 2, 1, 1]);
}

#[test]
fn kinds_of_job_and_labels_have_limits() {
    let mut farm = farm();
    for kind in 0..65 {
        let mut asked = submission(u128::from(kind), 1);
        asked.needs.memory_bytes = kind;
        farm.is_told(Event::Submit(asked));
    }
    let refusal = SubmitRefusal::TooManyKinds { max: 64 };
    assert!(refusal.is_retryable());
    let submission_id = SubmissionId(64);
    assert_eq!(
        farm.never_mind().last(),
        Some(&Effect::SubmitRefused {
            submission: submission_id,
            refusal
        })
    );
    let many: BTreeSet<String> = (0..17).map(|label| label.to_string()).collect();
    for labels in [many, labels(&[&"x".repeat(65)])] {
        let mut asked = submission(100, 1);
        asked.needs.labels.clone_from(&labels);
        let refusal = SubmitRefusal::TooManyLabels {
            labels_max: 16,
            bytes_max: 64,
        };
        farm.is_told(Event::Submit(asked))
            .wants(&[Effect::SubmitRefused {
                submission: SubmissionId(100),
                refusal,
            }]);
        let offer = Offer { labels, ..offer() };
        farm.is_told(Event::WorkerJoined {
            worker: worker(1),
            link: LinkId(1),
            offer,
            held: vec![],
            begun: vec![],
        })
        .wants(&[Effect::WorkerRefused {
            worker: worker(1),
            refusal: WorkerRefusal::TooManyLabels {
                labels_max: 16,
                bytes_max: 64,
            },
        }]);
    }
}

/// A worker that may run so long.
fn short_lived(left: Span) -> Offer {
    Offer {
        time_left: Some(left),
        ..offer()
    }
}

#[test]
fn a_tile_that_is_not_expected_to_fit_is_not_leased() {
    let mut farm = farm();
    farm.job(4).worker(1, 1);
    // Ten seconds for a tile.
    farm.waits_with_heartbeats(Span::from_secs(10), 1, &[(1, 0)]);
    for rect in tile(0).blocks() {
        farm.is_told(Event::BlockStored {
            worker: worker(1),
            block: block_ref(1, 0, rect),
            elapsed: Span::from_secs(5),
            pixels: model::Digest([1; 32]),
        });
    }
    joins_with(&mut farm, 2, short_lived(Span::from_secs(12)));
    joins_with(&mut farm, 3, short_lived(Span::from_secs(14)));
    joins_with(&mut farm, 4, short_lived(Span::from_secs(40)));
    // A fifth of its time is kept back.
    assert_eq!([2, 3, 4].map(|id| held(&farm, id)), [0, 1, 3]);
}

#[test]
fn of_a_job_that_nothing_is_known_of_nobody_takes_a_tile_at_the_last_minute() {
    let mut farm = farm();
    farm.job(1);
    joins_with(&mut farm, 1, short_lived(Span::from_secs(29)));
    joins_with(&mut farm, 2, short_lived(Span::from_secs(31)));
    assert_eq!([1, 2].map(|id| held(&farm, id)), [0, 2]);
}
