//! Workers that die, freeze or lose their link: the job ends by itself, with the same pixels,
//! and nothing that was acknowledged is rendered again.

use model::{AttemptId, ImageRef, Rect};
use wire::BlockHeader;
use wire::proto::deliver_down::Message as Answer;

use crate::harness::raw::{self, Raw};
use crate::harness::scenes::{FLYBY, slow};
use crate::harness::{Farm, Job, Proxy, Signal, wait};

/// Limits short enough for a test to wait for them.
pub(crate) const SHORT_LIMITS: [&str; 2] = ["--liveness", "1500 ms"];

/// Submits the slow job, in tiles of a few blocks each.
pub(crate) fn submit(farm: &Farm) -> u64 {
    farm.submit(&slow().with(&[FLYBY, "--tile", "40x30"]))
}

/// How many blocks the job has: two images of 200×150 pixels in those tiles.
pub(crate) fn blocks() -> u64 {
    let rows = (0..150).step_by(30);
    let tiles = rows.flat_map(|y0| (0..200).step_by(40).map(move |x0| (x0, y0)));
    let rect = |(x0, y0)| Rect {
        x0,
        y0,
        x1: x0 + 40,
        y1: y0 + 30,
    };
    2 * tiles
        .map(|corner| rect(corner).blocks().count() as u64)
        .sum::<u64>()
}

/// Some blocks of the job are acknowledged, and some are not.
fn in_the_middle(job: &Job) {
    assert_eq!(job.state(), "running", "the job was over too soon: {job:?}");
    let done = job.number("blocks_done");
    assert!(
        (1..blocks()).contains(&done),
        "{done} of {} blocks",
        blocks()
    );
}

/// The job ended with the pixels of an undisturbed render, and every block is durable once.
fn same_pixels_and_nothing_twice(farm: &Farm, job: u64) -> Job {
    let done = farm.wait_done(job);
    assert_eq!(done.film_digests(), slow().digests);
    assert_eq!(done.number("blocks_done"), blocks(), "{done:?}");
    done
}

#[test]
fn a_killed_worker_is_replaced_by_another() {
    let mut farm = Farm::of_workers(1);
    let job = submit(&farm);
    farm.wait_acknowledged(job, 5);
    farm.workers[0].kill();
    in_the_middle(&farm.job(job));

    farm.worker(&["--threads", "1"]);
    let done = same_pixels_and_nothing_twice(&farm, job);
    assert_eq!(
        done.number("blocks_again"),
        0,
        "acknowledged blocks came twice: {done:?}"
    );
    let log = farm.flyby(["job", "log", &job.to_string()]).ok();
    assert!(log.contains("the link of worker"), "{log}");
}

#[test]
fn a_worker_killed_among_others_costs_only_what_it_had_not_delivered() {
    let mut farm = Farm::of_workers(3);
    farm.wait_connected(3);
    let job = submit(&farm);
    farm.wait_acknowledged(job, 5);
    farm.workers[1].kill();
    in_the_middle(&farm.job(job));

    let done = same_pixels_and_nothing_twice(&farm, job);
    assert_eq!(
        done.number("blocks_again"),
        0,
        "acknowledged blocks came twice: {done:?}"
    );
}

#[test]
fn a_worker_frozen_past_its_limits_loses_its_tiles_and_may_return() {
    let mut farm = Farm::new(&SHORT_LIMITS);
    farm.worker(&["--threads", "1"]);
    let job = submit(&farm);
    farm.wait_acknowledged(job, 5);
    farm.workers[0].signal(Signal::Stop);
    in_the_middle(&farm.job(job));
    farm.wait_connected(0);

    // The first tiles of the job, which the frozen worker held, go to another.
    farm.worker(&["--threads", "1"]);
    let before = farm.job(job).number("blocks_done");
    farm.wait_acknowledged(job, before + 5);
    farm.workers[0].signal(Signal::Continue);
    farm.wait_connected(2);
    let done = same_pixels_and_nothing_twice(&farm, job);
    // What the frozen worker had rendered and not delivered may come late: one block for its one thread.
    assert!(done.number("blocks_again") <= 1, "{done:?}");
}

#[test]
fn cut_connections_are_opened_again_and_the_worker_goes_on() {
    let mut farm = Farm::new(&[]);
    let proxy = Proxy::to(farm.address);
    farm.worker_through(proxy.address(), &["--threads", "1"]);
    let job = submit(&farm);
    for cut in 1..=3 {
        let before = farm.wait_acknowledged(job, cut * 10);
        in_the_middle(&before);
        let opened = proxy.accepted();
        proxy.cut();
        // Blocks on their way through the cut may still be acknowledged, so that says nothing yet.
        wait::until("both connections are opened again", || {
            (proxy.accepted() >= opened + 2).then_some(())
        });
        farm.wait_acknowledged(job, before.number("blocks_done") + 5);
    }
    let done = same_pixels_and_nothing_twice(&farm, job);
    assert_eq!(done.number("blocks_again"), 0, "{done:?}");
}

#[test]
fn a_link_that_falls_silent_is_a_lost_worker_and_may_return() {
    let mut farm = Farm::new(&SHORT_LIMITS);
    let proxy = Proxy::to(farm.address);
    farm.worker_through(proxy.address(), &["--threads", "1"]);
    let job = submit(&farm);
    farm.wait_acknowledged(job, 5);
    proxy.freeze();
    in_the_middle(&farm.job(job));
    farm.wait_connected(0);
    proxy.thaw();
    same_pixels_and_nothing_twice(&farm, job);
}

#[test]
fn what_is_acknowledged_is_not_leased_again() {
    let farm = Farm::new(&[]);
    let job = submit(&farm);
    let token = std::fs::read_to_string(farm.place.state().join("token")).unwrap();

    let mut first = Raw::connect(farm.address, &token);
    let mut control = first.hello(raw::worker(1)).unwrap();
    let mut delivery = first.deliver(&control);
    let lease = first.lease(&mut control, 1);
    let tile = Rect::try_from(lease.tile.unwrap()).unwrap();
    let block = tile.blocks().nth(1).unwrap();
    let header = BlockHeader {
        image: ImageRef {
            job: model::JobId(job),
            image: model::ImageNumber(lease.image),
        },
        rect: block,
        attempt: AttemptId::try_from(lease.attempt.unwrap()).unwrap(),
    };
    let pixels = vec![0; usize::try_from(block.area()).unwrap() * model::film::PIXEL_BYTES];
    let answer = first.block(&mut delivery, header.record(&pixels).unwrap());
    assert!(matches!(answer, Answer::Acknowledged(_)), "{answer:?}");
    drop((control, delivery, first));
    farm.wait_connected(0);

    let mut second = Raw::connect(farm.address, &token);
    let mut control = second.hello(raw::worker(2)).unwrap();
    let lease = second.lease(&mut control, 1);
    assert_eq!(
        Rect::try_from(lease.tile.unwrap()).unwrap(),
        tile,
        "the first tile again"
    );
    let wanted: Vec<Rect> = lease
        .blocks
        .into_iter()
        .map(|rect| rect.try_into().unwrap())
        .collect();
    let missing: Vec<Rect> = tile.blocks().filter(|&other| other != block).collect();
    assert_eq!(wanted, missing);
}
