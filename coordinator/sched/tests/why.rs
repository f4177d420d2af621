//! Why something waits: for each situation its answer, and a sentence.

mod situation;

use model::{ImageNumber, JobId, Span};
use sched::{
    Command, Config, Event, JobOutcome, LinkId, Offer, WhyImage, WhyJob, WhyTile, WhyWorker,
};
use situation::*;

fn job(farm: &Farm, id: u64) -> WhyJob {
    farm.sched.why_job(JobId(id)).expect("it is known")
}

fn image(farm: &Farm, image: u32) -> WhyImage {
    farm.sched.why_image(image_ref(image)).expect("it is known")
}

fn tile_of(farm: &Farm, image: u32, index: u32) -> WhyTile {
    farm.sched
        .why_tile(image_ref(image), block(index))
        .expect("it is known")
}

fn idle(farm: &Farm, id: u64) -> WhyWorker {
    farm.sched.why_worker(worker(id)).expect("it is known")
}

#[test]
fn a_job_on_its_way() {
    let mut farm = farm();
    farm.job(2);
    assert_eq!(job(&farm, 1), WhyJob::NoWorkers);
    assert_eq!(image(&farm, 1), WhyImage::Job(WhyJob::NoWorkers));
    farm.joins(1, &[]);
    let takes = WhyJob::NobodyTakes {
        workers: 1,
        aside: 0,
    };
    assert_eq!(job(&farm, 1), takes);
    farm.wants_tiles(1, 1);
    let busy = WhyJob::WorkersBusy {
        workers: 1,
        attempts: 1,
    };
    assert_eq!(job(&farm, 1), busy);
    let rendering = WhyImage::Rendering {
        attempts: 1,
        pixels_waiting: 64 * 32,
    };
    assert_eq!(image(&farm, 0), rendering);
    let first = ImageNumber(0);
    assert_eq!(image(&farm, 1), WhyImage::Behind { image: first });
    let leased = WhyTile::Leased {
        worker: worker(1),
        second: None,
    };
    assert_eq!(tile_of(&farm, 0, 0), leased);
    assert_eq!(tile_of(&farm, 0, 3), WhyTile::Image(rendering));
    farm.stores(1, 1, 0, block(0));
    assert_eq!(tile_of(&farm, 0, 0), WhyTile::Done);
    assert_eq!(tile_of(&farm, 0, 1), leased);
    farm.wants_tiles(1, 4);
    assert_eq!(job(&farm, 1), WhyJob::Rendering { attempts: 4 });
    farm.stores(1, 1, 0, block(1)).stores_tile(1, 2, 0, 1);
    assert_eq!(image(&farm, 0), WhyImage::Encoding);
    assert_eq!(tile_of(&farm, 0, 3), WhyTile::Done);
    farm.encoded(0);
    assert_eq!(image(&farm, 0), WhyImage::Done);
    farm.stores_tile(1, 3, 1, 0).stores_tile(1, 4, 1, 1);
    assert_eq!(job(&farm, 1), WhyJob::Encoding { images: 1 });
    farm.encoded(1);
    assert_eq!(job(&farm, 1), WhyJob::Over(JobOutcome::Finished));
}

#[test]
fn jobs_that_wait_for_users_for_other_jobs_and_for_other_workers() {
    let mut farm = farm();
    farm.job(1);
    let mut asked = submission(2, 1);
    asked.after = vec![JobId(1)];
    farm.is_told(Event::Submit(asked));
    let mut asked = submission(3, 1);
    asked.needs.threads = 8;
    farm.is_told(Event::Submit(asked));
    let mut asked = submission(4, 1);
    asked.priority = -1;
    farm.is_told(Event::Submit(asked));
    farm.worker(1, 1);
    let after = |ended| WhyJob::After {
        job: JobId(1),
        ended,
    };
    assert_eq!(job(&farm, 2), after(None));
    assert_eq!(job(&farm, 3), WhyJob::NobodyServes { workers: 1 });
    assert_eq!(job(&farm, 4), WhyJob::Outranked { by: JobId(1) });
    farm.command(Command::Pause);
    assert_eq!(job(&farm, 1), WhyJob::Paused);
    farm.command(Command::Cancel);
    assert_eq!(job(&farm, 2), after(Some(JobOutcome::Cancelled)));
    assert_eq!(image(&farm, 0), WhyImage::Dropped);
    let sentence = job(&farm, 2).to_string();
    assert!(
        sentence.ends_with("retry that one, or cancel this one"),
        "{sentence}"
    );
}

#[test]
fn a_tile_that_failed_and_the_workers_beside_it() {
    let mut farm = Farm::new(Config {
        faults_max: 1,
        ..Config::new(EPOCH)
    });
    farm.job(1).worker(1, 1).worker(2, 1);
    farm.fails(1, 1);
    let failed = WhyTile::Failed {
        failures: 1,
        losses: 0,
    };
    assert_eq!(tile_of(&farm, 0, 0), failed);
    assert_eq!(idle(&farm, 1), WhyWorker::FailedBefore);
    assert_eq!(idle(&farm, 2), WhyWorker::Full { attempts: 1 });
    // Worker 2 does both; worker 1 is to blame. Another job waits, of the same user.
    farm.stores_tile(2, 2, 0, 1).stores_tile(2, 3, 0, 0);
    assert_eq!(idle(&farm, 1), WhyWorker::NoTiles);
    farm.command(Command::Again(ImageNumber(0))).encoded(0);
    farm.wants_tiles(2, 0)
        .command(Command::Again(ImageNumber(0)));
    let until = farm.now + Span::from_secs(300);
    let aside = WhyWorker::AsideForJob {
        job: JobId(1),
        until,
    };
    assert_eq!(idle(&farm, 1), aside);
    assert_eq!(idle(&farm, 2), WhyWorker::WantsNone);
    let takes = WhyJob::NobodyTakes {
        workers: 2,
        aside: 1,
    };
    assert_eq!(job(&farm, 1), takes);
}

#[test]
fn workers_that_are_away_near_their_end_or_of_no_use() {
    let mut farm = farm();
    farm.job(1).worker(1, 1).newest_link_breaks(1);
    assert_eq!(idle(&farm, 1), WhyWorker::Away);
    let other = Offer {
        revision: model::Revision(9),
        ..offer()
    };
    let short = Offer {
        time_left: Some(Span::from_secs(1)),
        ..offer()
    };
    for (id, offer) in [(2, other), (3, short)] {
        farm.is_told(Event::WorkerJoined {
            worker: worker(id),
            link: LinkId(id + 10),
            offer,
            held: vec![],
            begun: vec![],
        })
        .wants_tiles(id, 1);
    }
    assert_eq!(idle(&farm, 2), WhyWorker::NoneServed);
    let ends = farm.now + Span::from_secs(1);
    assert_eq!(idle(&farm, 3), WhyWorker::NearItsEnd { ends });
}

#[test]
fn nothing_is_known_of_what_is_not_there() {
    let mut farm = farm();
    farm.job(1);
    assert_eq!(farm.sched.why_job(JobId(2)), None);
    assert_eq!(farm.sched.why_image(image_ref(1)), None);
    assert_eq!(farm.sched.why_tile(image_ref(0), tile(0)), None);
    assert_eq!(farm.sched.why_worker(worker(1)), None);
}
