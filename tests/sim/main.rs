//! A whole farm in one thread: the scheduler, several sessions, and a simulated network,
//! clock, disk and processor, all from one key.
//!
//! Messages are late and come twice; links are cut; workers are killed, frozen,
//! drained and stopped; the coordinator pauses. However that goes, the job ends
//! by itself with every image encoded exactly once, out of every one of its pixels.
//! A failure names its key; [`Farm::new`] with that key shows it again.

mod coordinator;
mod farm;
mod random;
mod worker;

use farm::{Farm, Troubles};
use model::{JobId, Span};
use sched::{JobOutcome, JobState};

/// Long past what the worst of these farms needs; one that is not done by then never is.
const END: Span = Span::from_secs(3 * 3_600);

fn ends_well(key: u64, troubles: Troubles) -> Farm {
    let mut farm = Farm::new(key, troubles);
    farm.run(END);
    let job = farm.coordinator.sched.job(JobId(1));
    let job = job.expect("it was submitted");
    assert_eq!(
        job.state,
        JobState::Over(JobOutcome::Finished),
        "key {key}: {job:?} {:?}",
        farm.coordinator.sched.failures(JobId(1)),
    );
    assert_eq!(job.pixels_done, job.pixels, "key {key}");
    let encoded = &farm.coordinator.encoded;
    assert_eq!(encoded.len(), job.images.encoded as usize, "key {key}");
    assert!(encoded.values().all(|&times| times == 1), "key {key}");
    farm
}

#[test]
fn in_peace_no_block_is_rendered_twice_but_on_purpose() {
    let mut alone = 0;
    for key in 0..40 {
        let farm = ends_well(key, Troubles::NONE);
        let job = farm.coordinator.sched.job(JobId(1)).expect("it is known");
        assert_eq!((job.blocks_again, job.attempts_lost), (0, 0), "key {key}");
        if job.seconds + job.called_back == 0 {
            assert_eq!(farm.blocks_rendered, job.blocks_done, "key {key}");
            alone += 1;
        }
    }
    assert!(
        (1..40).contains(&alone),
        "some farms end with second leases, some without"
    );
}

#[test]
fn late_and_repeated_messages() {
    for key in 0..60 {
        ends_well(
            key,
            Troubles {
                repeats: 20,
                ..Troubles::NONE
            },
        );
    }
}

#[test]
fn cut_links() {
    let (mut again, mut late) = (0, 0);
    for key in 0..60 {
        let farm = ends_well(
            key,
            Troubles {
                cuts: 60,
                ..Troubles::NONE
            },
        );
        let job = farm.coordinator.sched.job(JobId(1)).expect("it is known");
        late += u32::from(job.attempts_lost > 0);
        again += job.blocks_again;
    }
    // A cut link loses nobody, but who notices it later than his limit, which is rare.
    assert!(late <= 2, "{late}");
    // A second attempt at the tile of a worker that then came back.
    assert!(again > 0, "links were cut in the middle of tiles");
}

#[test]
fn dying_frozen_and_leaving_workers() {
    let mut lost = 0;
    for key in 0..60 {
        let farm = ends_well(
            key,
            Troubles {
                kills: 15,
                freezes: 15,
                leaves: 15,
                ..Troubles::NONE
            },
        );
        let job = farm.coordinator.sched.job(JobId(1)).expect("it is known");
        lost += job.attempts_lost;
    }
    assert!(lost > 0, "workers were lost in the middle of tiles");
}

#[test]
fn everything_at_once() {
    for key in 0..200 {
        ends_well(
            key,
            Troubles {
                repeats: 10,
                cuts: 30,
                kills: 8,
                freezes: 8,
                leaves: 8,
                pauses: 3,
                refusals: 10,
                failures: 10,
            },
        );
    }
}
