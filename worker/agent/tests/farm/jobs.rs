//! What a user sees of jobs.

use agent::{Ask, ExitReason};
use model::Digest;
use wire::failure::Retry;
use wire::proto::{self, ErrorKind, ImageState, JobState};

use crate::harness::{Farm, Submission, Worker, film_digest, scene, soon, submit, until};
use crate::painter::Ramp;

#[tokio::test]
async fn a_job_of_several_images_has_the_right_pixels() {
    let mut farm = Farm::start().await;
    let scene = scene("200x150", farm.folder.path()).description;
    let (one, two) = (Ramp::default(), Ramp::default());
    let workers = [
        Worker::start(farm.address, &farm.token, 1, one.clone()),
        Worker::start(farm.address, &farm.token, 2, two.clone()),
    ];
    let job = submit(&farm, &scene, "0..4:2", (40, 60)).await;
    let done = farm.job_over(job).await;
    assert_eq!(done.summary().state(), JobState::Done);
    assert_eq!(done.images.len(), 2);
    for image in &done.images {
        assert_eq!(image.state(), ImageState::Done);
        assert_eq!(image.film_digest, film_digest(&scene, image.image).0);
        assert_eq!(image.files.len(), 2);
    }
    let summary = done.summary();
    assert_eq!(summary.pixels_done, 2 * 200 * 150);
    assert_eq!(
        summary.blocks_done,
        u64::from(one.rendered() + two.rendered())
    );
    assert_eq!((summary.blocks_again, summary.attempts_lost), (0, 0));
    let counted = |name: &str| {
        let mut counters = summary.counters.iter();
        counters.find(|counter| counter.name == name).unwrap().value
    };
    assert_eq!(counted("pixels"), summary.pixels_done);
    assert_eq!(counted("blocks"), summary.blocks_done);

    fetched_frames_are_those_on_disk(&farm, job).await;
    let log = farm.client().await.job_log(proto::JobRequest { job }).await;
    let log = log.unwrap().into_inner().lines;
    assert!(
        log.iter()
            .any(|line| line.text.contains("frame 2 is finished"))
    );
    let names = |farm: &Farm| -> Vec<_> {
        let left = farm.left().into_iter();
        left.map(|path| path.file_name().unwrap().to_owned())
            .collect()
    };
    until("only frames and their scene are left", async || {
        let frames = [
            "flight_0000.exr",
            "flight_0000.png",
            "flight_0002.exr",
            "flight_0002.png",
            "scene",
        ];
        (names(&farm) == frames).then_some(())
    })
    .await;
    for worker in workers {
        assert_eq!(worker.leave(Ask::Stop).await, ExitReason::Stopped);
    }
    until("the workers are forgotten", async || {
        let asked = farm
            .client()
            .await
            .list_workers(proto::ListWorkersRequest {})
            .await;
        asked.unwrap().into_inner().workers.is_empty().then_some(())
    })
    .await;
    farm.stop().await;
    assert_eq!(names(&farm).len(), 5);
    assert!(!farm.folder.path().join("coordinator.json").exists());
}

async fn fetched_frames_are_those_on_disk(farm: &Farm, job: u64) {
    let request = proto::FetchFrameRequest {
        job,
        image: 2,
        format: proto::FrameFormat::Exr.into(),
    };
    let mut client = farm.client().await;
    let mut chunks = client.fetch_frame(request).await.unwrap().into_inner();
    let (mut file, mut bytes) = (None, Vec::new());
    while let Some(chunk) = chunks.message().await.unwrap() {
        file = file.or(chunk.file);
        bytes.extend(chunk.data);
    }
    let file = file.unwrap();
    assert_eq!(file.bytes, bytes.len() as u64);
    let paths = farm.left();
    let path = paths
        .iter()
        .find(|path| path.ends_with(&file.name))
        .unwrap();
    assert_eq!(std::fs::read(path).unwrap(), bytes);
    assert_eq!(image::file_digest(path).unwrap().0.to_vec(), file.digest);
}

#[tokio::test]
async fn cancelling_leaves_nothing_behind() {
    let farm = Farm::start().await;
    let scene = scene("128x128", farm.folder.path()).description;
    let painter = Ramp::held_after(5);
    let worker = Worker::start(farm.address, &farm.token, 2, painter.clone());
    let job = submit(&farm, &scene, "0..4", (64, 64)).await;
    farm.blocks_done(job, 1).await;
    assert!(!farm.left().is_empty(), "a scratch file is there");
    let request = proto::JobRequest { job };
    let cancelled = farm.client().await.cancel_job(request).await.unwrap();
    assert_eq!(cancelled.into_inner().state(), JobState::Cancelled);
    let over = farm.job_over(job).await;
    assert_eq!(over.summary().state(), JobState::Cancelled);
    assert!(
        over.images
            .iter()
            .all(|image| image.state() == ImageState::Cancelled)
    );
    until("nothing is left", async || {
        farm.left().is_empty().then_some(())
    })
    .await;

    // The worker's threads are free again, although the painter was held up.
    painter.release();
    let next = submit(&farm, &scene, "1", (64, 64)).await;
    let done = farm.job_over(next).await;
    assert_eq!(done.images[0].film_digest, film_digest(&scene, 1).0);
    assert_eq!(worker.leave(Ask::Drain).await, ExitReason::Drained);
}

#[tokio::test]
async fn a_painter_that_panics_fails_its_image_alone() {
    let farm = Farm::start().await;
    let scene = scene("64x64", farm.folder.path()).description;
    let painter = Ramp {
        panics_at: Some(1),
        ..Ramp::default()
    };
    let worker = Worker::start(farm.address, &farm.token, 2, painter);
    let job = submit(&farm, &scene, "0..3", (64, 32)).await;
    let over = farm.job_over(job).await;
    assert_eq!(over.summary().state(), JobState::Failed);
    let states: Vec<_> = over.images.iter().map(proto::ImageStatus::state).collect();
    assert_eq!(
        states,
        [ImageState::Done, ImageState::Failed, ImageState::Done]
    );
    let error = &over.images[1].error;
    assert!(error.contains("the paint ran out"), "{error}");
    worker.leave(Ask::Stop).await;
}

#[tokio::test]
async fn assets_are_checked_and_fetched() {
    let farm = Farm::start().await;
    let ramp = include_bytes!("ramp.png");
    std::fs::write(farm.folder.path().join("ramp.png"), ramp).unwrap();
    let loaded = scene("32x32", farm.folder.path());
    let scene = loaded.description;
    assert_eq!(scene.assets.len(), 1);
    let digest = scene.assets[0].digest;
    let mut submission = Submission::new(&scene, "0", (32, 32));

    let refused = submission.send(&farm).await.unwrap_err();
    assert!(
        refused.sentence.contains("is cut off: 0 bytes"),
        "{refused}"
    );
    let mut damaged = ramp.to_vec();
    damaged[20] ^= 1;
    submission.assets = vec![(digest, damaged)];
    let refused = submission.send(&farm).await.unwrap_err();
    assert_eq!(refused.kind, ErrorKind::DigestMismatch);
    submission.assets = vec![(Digest::default(), ramp.to_vec())];
    let refused = submission.send(&farm).await.unwrap_err();
    assert!(refused.sentence.contains("another asset"), "{refused}");
    assert!(farm.left().is_empty());

    submission.assets = vec![(digest, ramp.to_vec())];
    let job = submission.send(&farm).await.unwrap().job;
    let painter = Ramp::default();
    let worker = Worker::start(farm.address, &farm.token, 1, painter.clone());
    let done = farm.job_over(job).await;
    assert_eq!(done.summary().state(), JobState::Done);
    assert_eq!(painter.asset_bytes(), ramp.len());
    worker.leave(Ask::Stop).await;
}

#[tokio::test]
async fn bad_submissions_cost_themselves() {
    let farm = Farm::start().await;
    let scene = scene("32x32", farm.folder.path()).description;
    let good = || Submission::new(&scene, "0", (32, 32));
    let refused = async |change: fn(&mut Submission)| {
        let mut submission = good();
        change(&mut submission);
        submission.send(&farm).await.unwrap_err()
    };
    let said = refused(|bad| bad.description.truncate(40)).await;
    assert!(said.sentence.contains("cut off: 40 bytes of"), "{said}");
    let said = refused(|bad| bad.description[7] ^= 1).await;
    assert_eq!(said.kind, ErrorKind::DigestMismatch);
    let said = refused(|bad| {
        bad.description[0] = 99;
        bad.head.description_digest = scene::digest_of(&bad.description).0.to_vec();
    })
    .await;
    assert_eq!(said.kind, ErrorKind::BadScene);
    let said = refused(|bad| bad.head.description_bytes = u64::MAX).await;
    assert_eq!((said.kind, said.retry), (ErrorKind::Limit, Retry::Never));
    let said = refused(|bad| bad.head.frames.as_mut().unwrap().end = 5).await;
    assert!(
        said.sentence.contains("the scene's frames are 0..4"),
        "{said}"
    );
    let said = refused(|bad| bad.head.frames.as_mut().unwrap().end = u32::MAX).await;
    assert!(said.sentence.contains("more than 10000000"), "{said}");
    let said = refused(|bad| bad.head.formats = vec![99]).await;
    assert!(said.sentence.contains("format 99 is not known"), "{said}");
    let said = refused(|bad| bad.head.tile.as_mut().unwrap().width = 0).await;
    assert!(said.sentence.contains("at least one column"), "{said}");
    let said = refused(|bad| bad.head.submission = vec![1; 15]).await;
    assert!(
        said.sentence.contains("`submission` has 15 bytes"),
        "{said}"
    );
    let said = refused(|bad| bad.head.name = "a\nb".to_owned()).await;
    assert!(
        said.sentence.contains("without control characters"),
        "{said}"
    );
    assert!(farm.left().is_empty());

    let jobs = farm
        .client()
        .await
        .list_jobs(proto::ListJobsRequest {})
        .await;
    assert!(jobs.unwrap().into_inner().jobs.is_empty());
    let unknown = farm
        .client()
        .await
        .job_log(proto::JobRequest { job: 9 })
        .await;
    let unknown = wire::Failure::from(unknown.unwrap_err());
    assert_eq!(unknown.kind, ErrorKind::NotFound);
}

#[tokio::test]
async fn submitting_twice_is_submitting_once() {
    let farm = Farm::start().await;
    let scene = scene("32x32", farm.folder.path()).description;
    let mut submission = Submission::new(&scene, "0", (32, 32));
    let first = submission.send(&farm).await.unwrap();
    let again = submission.send(&farm).await.unwrap();
    assert_eq!(
        (first.job, first.again, again.job, again.again),
        (1, false, 1, true)
    );
    submission.head.name = "other".to_owned();
    let conflict = submission.send(&farm).await.unwrap_err();
    assert_eq!(conflict.kind, ErrorKind::Conflict);
    let jobs = farm
        .client()
        .await
        .list_jobs(proto::ListJobsRequest {})
        .await;
    assert_eq!(jobs.unwrap().into_inner().jobs.len(), 1);
    let request = proto::FetchFrameRequest {
        job: 1,
        image: 0,
        format: proto::FrameFormat::Exr.into(),
    };
    let early = farm.client().await.fetch_frame(request).await.unwrap_err();
    assert_eq!(wire::Failure::from(early).kind, ErrorKind::NotReady);
}

#[tokio::test]
async fn a_coordinator_that_stops_tells_everybody() {
    let mut farm = Farm::start().await;
    let scene = scene("64x64", farm.folder.path()).description;
    let worker = Worker::start(farm.address, &farm.token, 1, Ramp::held_after(1));
    let job = submit(&farm, &scene, "0", (64, 64)).await;
    farm.blocks_done(job, 1).await;
    let mut client = farm.client().await;
    let mut watched = client
        .watch_job(proto::JobRequest { job })
        .await
        .unwrap()
        .into_inner();
    watched.message().await.unwrap().expect("a snapshot");
    farm.stop().await;
    soon("the watcher hears of it", async {
        while let Ok(Some(_)) = watched.message().await {}
    })
    .await;
    assert_eq!(worker.leave(Ask::Stop).await, ExitReason::Stopped);
}
