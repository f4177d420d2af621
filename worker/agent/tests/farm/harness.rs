//! A farm in a temporary folder, and what tests ask of it.

use std::future::Future;
use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use agent::{Ask, ExitReason, Painter};
use image::{Scratch, ScratchIdentity};
use model::{Digest, FrameRange, ImageNumber, Rect, Span, SubmissionId};
use scene::Description;
use server::{Config, Running};
use tempfile::TempDir;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use wire::Failure;
use wire::auth::Token;
use wire::proto::{self, job_update::Update, submit_part::Part};
use wire::way::Way;

use crate::painter;

/// After how long a condition that has not come true is a failure.
const LIMIT: Duration = Duration::from_secs(60);

/// Waits for what must happen.
pub(crate) async fn soon<T>(what: &str, future: impl Future<Output = T>) -> T {
    match tokio::time::timeout(LIMIT, future).await {
        Ok(value) => value,
        Err(_) => panic!("waited in vain until {what}"),
    }
}

/// Asks again and again until the answer is there.
pub(crate) async fn until<T>(what: &str, mut ask: impl AsyncFnMut() -> Option<T>) -> T {
    soon(what, async {
        loop {
            if let Some(answer) = ask().await {
                return answer;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    })
    .await
}

pub(crate) struct Farm {
    pub(crate) folder: TempDir,
    running: Option<Running>,
    pub(crate) address: SocketAddr,
    pub(crate) token: Token,
}

impl Farm {
    pub(crate) async fn start() -> Self {
        Self::with(|_| {}).await
    }

    pub(crate) async fn with(change: impl FnOnce(&mut Config)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut config = Self::config(folder.path());
        change(&mut config);
        let running = server::start(config).await.unwrap();
        Self {
            folder,
            address: running.address(),
            token: running.token().clone(),
            running: Some(running),
        }
    }

    pub(crate) fn config(state: &Path) -> Config {
        Config {
            listen: "127.0.0.1:0".parse().unwrap(),
            heartbeat_interval: Span::from_millis(100),
            ..Config::new(state.to_owned(), painter::REVISION, "test")
        }
    }

    pub(crate) async fn stop(&mut self) {
        let running = self.running.take().expect("it runs");
        soon("the coordinator has stopped", running.shutdown())
            .await
            .unwrap();
    }

    pub(crate) async fn client(&self) -> wire::link::Farm {
        wire::link::farm(&Way::local(self.address, self.token.clone()))
            .await
            .unwrap()
    }

    pub(crate) async fn worker_client(&self) -> wire::link::Workers {
        wire::link::workers(&Way::local(self.address, self.token.clone()))
            .await
            .unwrap()
    }

    /// Everything below the folders of jobs and submissions, hidden files too.
    pub(crate) fn left(&self) -> Vec<PathBuf> {
        let mut left = Vec::new();
        walk(&self.folder.path().join("jobs"), &mut left);
        left.sort();
        left
    }

    pub(crate) async fn job(&self, job: u64) -> Job {
        let mut parts = self
            .client()
            .await
            .show_job(proto::JobRequest { job })
            .await
            .unwrap()
            .into_inner();
        let mut all = Job::default();
        while let Some(part) = parts.message().await.unwrap() {
            all.update(part);
        }
        all
    }

    /// Waits until a job is over, by watching it.
    pub(crate) async fn job_over(&self, job: u64) -> Job {
        let mut client = self.client().await;
        let watched = client.watch_job(proto::JobRequest { job }).await.unwrap();
        let mut updates = watched.into_inner();
        let mut all = Job::default();
        soon("the job is over", async {
            while let Some(update) = updates.message().await.unwrap() {
                all.update(update);
            }
        })
        .await;
        let shown = self.job(job).await;
        assert_eq!(all.images, shown.images, "watching shows what asking shows");
        assert_eq!(all.summary().state, shown.summary().state);
        all
    }

    /// Waits until so many blocks of a job are durable.
    pub(crate) async fn blocks_done(&self, job: u64, blocks: u64) {
        until("blocks are durable", async || {
            (self.job(job).await.summary().blocks_done >= blocks).then_some(())
        })
        .await;
    }
}

fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => walk(&path, files),
            false => files.push(path),
        }
    }
}

/// A job as a user sees it.
#[derive(Default, Debug)]
pub(crate) struct Job {
    pub(crate) summary: Option<proto::JobSummary>,
    pub(crate) images: Vec<proto::ImageStatus>,
}

impl Job {
    pub(crate) fn summary(&self) -> &proto::JobSummary {
        self.summary.as_ref().expect("every update has one")
    }

    fn update(&mut self, update: proto::JobUpdate) {
        match update.update.unwrap() {
            Update::Snapshot(part) => {
                if part.first {
                    self.images.clear();
                }
                self.summary = part.summary;
                self.images.extend(part.images);
            }
            Update::Delta(delta) => {
                self.summary = delta.summary;
                for changed in delta.images {
                    let number = changed.image;
                    let mut known = self.images.iter_mut();
                    let known = known.find(|image| image.image == number);
                    *known.expect("it was in the snapshot") = changed;
                }
            }
        }
    }
}

/// A worker of this process.
pub(crate) struct Worker {
    asks: mpsc::Sender<Ask>,
    pub(crate) run: JoinHandle<ExitReason>,
}

impl Worker {
    pub(crate) fn start(
        address: SocketAddr,
        token: &Token,
        threads: u32,
        painter: impl Painter,
    ) -> Self {
        let threads = NonZeroU32::new(threads).unwrap();
        let admission = agent::Admission::Local {
            coordinator: address,
            token: token.clone(),
        };
        let config = agent::Config::new(admission, "test worker", threads);
        let (asks, heard) = mpsc::channel(4);
        let run =
            tokio::spawn(
                async move { agent::run(config, Arc::new(painter), heard).await.unwrap() },
            );
        Self { asks, run }
    }

    pub(crate) async fn leave(self, ask: Ask) -> ExitReason {
        self.asks.send(ask).await.unwrap();
        self.exit().await
    }

    pub(crate) async fn exit(self) -> ExitReason {
        soon("the worker leaves", self.run).await.unwrap()
    }

    /// As `kill -9`: nobody is told.
    pub(crate) fn kill(self) {
        self.run.abort();
    }
}

/// A small scene; what it shows does not matter to the test's painter.
pub(crate) fn scene(resolution: &str, folder: &Path) -> scene::Loaded {
    let ramp = folder.join("ramp.png");
    let text = format!(
        r#"
[film]
resolution = "{resolution}"
fps = 25
images = 4

[camera.fixed]
eye = [0, -4, 0]
target = [0, 0, 0]

[surface]
field = "length(p) - 1 + 0.3*noise(4*p)"

[surface.sphere]
radius = "1 m"

[sun]
elevation = "30 deg"
{}"#,
        if ramp.exists() { RAMP } else { "" }
    );
    let source = scene::Source {
        name: "scene.toml".to_owned(),
        text,
    };
    match scene::parse(source, "test", folder, &scene::Overrides::default()) {
        Ok(loaded) => loaded,
        Err(error) => panic!("{error:?}"),
    }
}

const RAMP: &str = r#"
[[material.layer]]
ramp = { file = "ramp.png", heights = ["0 m", "1 m"] }
"#;

/// A submission, to be changed before it is sent.
pub(crate) struct Submission {
    pub(crate) head: proto::SubmitHead,
    pub(crate) description: Vec<u8>,
    pub(crate) assets: Vec<(Digest, Vec<u8>)>,
}

impl Submission {
    pub(crate) fn new(description: &Description, frames: &str, tile: (u32, u32)) -> Self {
        let bytes = description.to_bytes().unwrap();
        let frames: FrameRange = frames.parse().unwrap();
        let mut id = [0; 16];
        getrandom::fill(&mut id).unwrap();
        let head = proto::SubmitHead {
            submission: wire::convert::submission_bytes(SubmissionId(u128::from_be_bytes(id))),
            name: "flight".to_owned(),
            description_digest: scene::digest_of(&bytes).0.to_vec(),
            description_bytes: bytes.len() as u64,
            frames: Some(frames.into()),
            tile: Some(proto::TileShape {
                width: tile.0,
                height: tile.1,
            }),
            formats: vec![
                proto::FrameFormat::Exr.into(),
                proto::FrameFormat::Png8.into(),
            ],
            settings_json: "{}".to_owned(),
            ..proto::SubmitHead::default()
        };
        Self {
            head,
            description: bytes,
            assets: Vec::new(),
        }
    }

    pub(crate) async fn send(&self, farm: &Farm) -> Result<proto::Submitted, Failure> {
        let mut parts = vec![Part::Head(self.head.clone())];
        parts.extend(
            self.description
                .chunks(100)
                .map(<[u8]>::to_vec)
                .map(Part::Description),
        );
        for (digest, bytes) in &self.assets {
            parts.push(Part::Asset(proto::AssetPart {
                digest: digest.0.to_vec(),
                data: bytes.clone(),
            }));
        }
        let parts: Vec<_> = parts
            .into_iter()
            .map(|part| proto::SubmitPart { part: Some(part) })
            .collect();
        let submitted = farm.client().await.submit(tokio_stream::iter(parts)).await;
        Ok(submitted?.into_inner())
    }
}

/// Submits and answers the job's number.
pub(crate) async fn submit(
    farm: &Farm,
    description: &Description,
    frames: &str,
    tile: (u32, u32),
) -> u64 {
    let submission = Submission::new(description, frames, tile);
    submission.send(farm).await.unwrap().job
}

/// The film digest that an image must have, without any farm.
pub(crate) fn film_digest(description: &Description, image: u32) -> Digest {
    let folder = tempfile::tempdir().unwrap();
    let film = &description.film;
    let identity = ScratchIdentity {
        scene: description.digest().unwrap(),
        revision: painter::REVISION.0,
        image: ImageNumber(image),
        resolution: film.resolution,
    };
    let scratch = Scratch::create(folder.path().join("0"), identity, film.window).unwrap();
    let (mut pixels, mut payload) = (Vec::new(), Vec::new());
    for rect in blocks(description) {
        painter::paint(image, rect, &mut pixels);
        wire::block::payload_of(&pixels, &mut payload);
        scratch.write_block(rect, &payload).unwrap();
    }
    scratch.film_digest().unwrap()
}

fn blocks(description: &Description) -> impl Iterator<Item = Rect> {
    description.film.window.blocks()
}
