//! Links that break, workers that vanish, coordinators that come back.

use agent::{Ask, ExitReason};
use model::Span;
use server::StartError;
use wire::proto::{self, JobState};

use crate::harness::{Farm, Worker, film_digest, scene, submit, until};
use crate::painter::Ramp;
use crate::proxy::Proxy;

#[tokio::test]
async fn a_worker_that_was_cut_off_resumes_its_tiles() {
    let farm = Farm::start().await;
    let scene = scene("128x96", farm.folder.path()).description;
    let proxy = Proxy::start(farm.address).await;
    let painter = Ramp::held_after(7);
    let worker = Worker::start(proxy.address, &farm.token, 2, painter.clone());
    let job = submit(&farm, &scene, "0..2", (64, 96)).await;
    farm.blocks_done(job, 3).await;
    assert!(proxy.cut() >= 2, "control and delivery are two connections");
    until("the coordinator saw the cut", async || {
        let log = farm.client().await.job_log(proto::JobRequest { job }).await;
        let lines = log.unwrap().into_inner().lines;
        lines
            .iter()
            .any(|line| line.text.contains("closed"))
            .then_some(())
    })
    .await;
    // What is rendered while the link is down is delivered when it is up.
    painter.release();
    let done = farm.job_over(job).await;
    assert_eq!(done.summary().state(), JobState::Done);
    for image in &done.images {
        assert_eq!(image.film_digest, film_digest(&scene, image.image).0);
    }
    assert_eq!(painter.rendered(), 2 * 4 * 3, "nothing is rendered again");
    assert_eq!(done.summary().attempts_lost, 0);
    worker.leave(Ask::Stop).await;
}

#[tokio::test]
async fn another_worker_finishes_what_a_killed_one_began() {
    let farm = Farm::with(|config| config.liveness_limit = Span::from_millis(400)).await;
    let scene = scene("128x128", farm.folder.path()).description;
    let painter = Ramp::held_after(3);
    let killed = Worker::start(farm.address, &farm.token, 1, painter.clone());
    let job = submit(&farm, &scene, "0", (128, 128)).await;
    farm.blocks_done(job, 3).await;
    killed.kill();
    let helper = Ramp::default();
    let worker = Worker::start(farm.address, &farm.token, 1, helper.clone());
    let done = farm.job_over(job).await;
    assert_eq!(done.images[0].film_digest, film_digest(&scene, 0).0);
    assert_eq!(painter.rendered(), 3);
    assert_eq!(
        helper.rendered(),
        13,
        "what was acknowledged is not rendered again"
    );
    worker.leave(Ask::Stop).await;
}

#[tokio::test]
async fn a_worker_finds_the_next_coordinator() {
    let mut farm = Farm::start().await;
    let scene = scene("64x64", farm.folder.path()).description;
    let worker = Worker::start(farm.address, &farm.token, 1, Ramp::default());
    until("the worker is there", async || {
        let info = farm
            .client()
            .await
            .info(proto::InfoRequest {})
            .await
            .unwrap();
        (info.into_inner().workers_connected == 1).then_some(())
    })
    .await;
    farm.stop().await;
    let mut config = Farm::config(farm.folder.path());
    config.listen = farm.address;
    let next = server::start(config).await.unwrap();
    assert_eq!(next.epoch().0, 2);
    let job = submit(&farm, &scene, "3", (64, 64)).await;
    let done = farm.job_over(job).await;
    assert_eq!(done.images[0].film_digest, film_digest(&scene, 3).0);
    worker.leave(Ask::Stop).await;
    next.shutdown().await.unwrap();
}

#[tokio::test]
async fn two_coordinators_never_share_a_folder_or_a_port() {
    let farm = Farm::start().await;
    let again = server::start(Farm::config(farm.folder.path()))
        .await
        .unwrap_err();
    assert!(
        again.to_string().contains("another coordinator runs"),
        "{again}"
    );
    let other = tempfile::tempdir().unwrap();
    let mut config = Farm::config(other.path());
    config.listen = farm.address;
    let taken = server::start(config).await.unwrap_err();
    assert!(matches!(taken, StartError::PortInUse(_)), "{taken}");
}

#[tokio::test]
async fn a_worker_without_a_coordinator_can_be_stopped() {
    let farm = Farm::start().await;
    let nowhere = {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        listener.local_addr().unwrap()
    };
    let worker = Worker::start(nowhere, &farm.token, 1, Ramp::default());
    assert_eq!(worker.leave(Ask::Stop).await, ExitReason::Stopped);
}
