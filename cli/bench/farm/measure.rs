//! What is measured, in the order in which it happens.

use std::num::NonZeroU32;
use std::path::Path;
use std::time::{Duration, Instant};

use image::{Format, Formats};
use model::Resolution;
use scene::{Overrides, Source};
use sched::TileShape;
use sched::load::{Load, LoadSize};
use tempfile::TempDir;
use tokio::runtime::Runtime;

use super::coordinator::Coordinator;
use super::crew::{Crew, THREADS};
use super::null::{self, Null};
use crate::bench::clock::Clock;
use crate::error::Error;
use crate::farm::submit::Submission;
use crate::load::{self, Scene};
use crate::options::{Context, FarmOptions, PlaceOptions};
use crate::stop::Stop;

/// A scene that nobody renders.
const SCENE: &str = include_str!("null.toml");

/// Simulated workers of the scheduler's row.
const SIMULATED_WORKERS: u64 = 10_000;

/// Workers of the larger crew, two threads each, as HyperQueue's sixteen.
pub(crate) const CREW: usize = 16;

/// How long one worker is watched, at most.
const ALONE: Duration = Duration::from_secs(10);

/// Tiles that nobody is to finish, so that the job is never over.
const SPARE: u64 = 50_000;

/// Pixels along a side of an image of such tiles: an image is cut into 75,000 at most.
const SIDE: u64 = 256;

/// How long a first lease may take.
const LEASE_TIMEOUT: Duration = Duration::from_secs(120);

/// Scheduler events in a second of one processor.
pub(crate) fn scheduler(tiles: u64, stop: &Stop) -> Result<f64, Error> {
    let size = LoadSize {
        workers: SIMULATED_WORKERS.min(tiles),
        squares: tiles,
    };
    let shape = TileShape::Size {
        width: 32,
        height: 32,
    };
    let mut load = Load::new(shape, size);
    let clock = Clock::start();
    while load.tiles() < tiles && load.step() {
        if load.tiles().is_multiple_of(1_000) && stop.is_set() {
            return Err(interrupted());
        }
    }
    Ok(load.events() as f64 / clock.seconds())
}

/// How fast a crew was.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Durable tiles in a second.
    pub(crate) tiles_per_second: f64,
    /// The coordinator's processor time for each, in microseconds, where the system tells it.
    pub(crate) cpu_us: Option<f64>,
}

/// What a job of empty tiles showed.
#[derive(Debug)]
pub(crate) struct Empty {
    /// Seconds to submit it.
    pub(crate) submit: f64,
    /// One worker.
    pub(crate) alone: Pace,
    /// Sixteen.
    pub(crate) crew: Pace,
    /// Durable tiles rendered again after `kill -9`.
    pub(crate) again: u64,
    /// The most memory that a coordinator had, in bytes.
    pub(crate) peak_bytes: Option<u64>,
}

/// Where measurements are made, and what may stop them.
pub(crate) struct Bench<'a> {
    pub(crate) context: &'a Context,
    pub(crate) runtime: &'a Runtime,
    pub(crate) stop: &'a Stop,
    /// A folder on the disk that is measured.
    pub(crate) folder: &'a Path,
}

impl<'a> Bench<'a> {
    /// A job of at least so many tiles of one pixel.
    pub(crate) fn empty(&self, tiles: u64, mut say: impl FnMut(&str)) -> Result<Empty, Error> {
        let state = self.state()?;
        let mut coordinator = self.coordinator(state.path(), None)?;
        let mut peak_bytes = None;
        say("submitting");
        let scene = square(SIDE, (tiles + SPARE).div_ceil(SIDE * SIDE))?;
        let begun = Instant::now();
        self.submit(&scene, 1, &coordinator, state.path())?;
        let submit = begun.elapsed().as_secs_f64();

        say("one worker");
        let crew = self.crew((1, THREADS), &coordinator, Null::default());
        let alone = pace(&mut coordinator, tiles / 8, ALONE)?;
        crew.leave();

        say("sixteen workers");
        let mut crew = self.crew((CREW, THREADS), &coordinator, Null::default());
        let done = coordinator.job()?.blocks_done;
        let half = (tiles * 5 / 8).saturating_sub(done).max(1);
        let together = pace(&mut coordinator, half, Duration::MAX)?;

        say("sixteen workers and a coordinator that is killed");
        peak_bytes = peak_bytes.max(coordinator.peak_bytes());
        let address = coordinator.kill();
        let mut coordinator = self.coordinator(state.path(), Some(address))?;
        let after = coordinator.wait(|job| job.blocks_done >= tiles)?;
        if let Some(error) = crew.ended() {
            return Err(error);
        }
        crew.leave();
        let again = after.blocks_again.max(coordinator.job()?.blocks_again);
        peak_bytes = peak_bytes.max(coordinator.peak_bytes());
        Ok(Empty {
            submit,
            alone,
            crew: together,
            again,
            peak_bytes,
        })
    }

    /// Seconds from the start of a coordinator to its first lease, where its store holds so many durable tiles of
    /// images of which none is finished; of finished ones it keeps no tiles.
    pub(crate) fn restart(&self, tiles: u64) -> Result<f64, Error> {
        let state = self.state()?;
        let mut coordinator = self.coordinator(state.path(), None)?;
        // One tile of each image is held back.
        let images = (tiles + SPARE).div_ceil(SIDE * SIDE - 1);
        self.submit(&square(SIDE, images)?, 1, &coordinator, state.path())?;
        let threads = u32::try_from(images).ok().and_then(|images| {
            // Each tile that is held back holds a thread.
            images.checked_add(THREADS.get()).and_then(NonZeroU32::new)
        });
        let threads = threads.ok_or_else(|| Error::failed("too many images"))?;
        let crew = self.crew((1, threads), &coordinator, Null::holding());
        coordinator.wait(|job| job.blocks_done >= tiles)?;
        let address = coordinator.kill();
        crew.let_go();
        crew.leave();

        let begun = Instant::now();
        let coordinator = self.coordinator(state.path(), Some(address))?;
        let crew = self.crew((1, THREADS), &coordinator, Null::default());
        let first = crew.first(LEASE_TIMEOUT, self.stop)?;
        let first = first.ok_or_else(|| Error::failed("no tile was leased after the restart"))?;
        crew.leave();
        Ok((first - begun).as_secs_f64())
    }

    /// Megabytes (10⁶) of whole blocks that become durable in a second, of so many blocks, by sixteen workers.
    pub(crate) fn blocks(&self, blocks: u64) -> Result<f64, Error> {
        let state = self.state()?;
        let mut coordinator = self.coordinator(state.path(), None)?;
        let scene = square(32 * ((2 * blocks).isqrt() + 1), 1)?;
        self.submit(&scene, 32, &coordinator, state.path())?;
        let crew = self.crew((CREW, THREADS), &coordinator, Null::default());
        let pace = pace(&mut coordinator, blocks, Duration::MAX)?;
        crew.leave();
        Ok(pace.tiles_per_second * model::film::BLOCK_BYTES_MAX as f64 / 1e6)
    }

    fn state(&self) -> Result<TempDir, Error> {
        let state = tempfile::Builder::new()
            .prefix("state-")
            .tempdir_in(self.folder)
            .map_err(|error| Error::failed("cannot make a temporary folder").because(error))?;
        null::mark(state.path())?;
        Ok(state)
    }

    fn coordinator(
        &self,
        state: &Path,
        address: Option<std::net::SocketAddr>,
    ) -> Result<Coordinator<'a>, Error> {
        Coordinator::start(self.runtime, self.stop, state, address)
    }

    fn crew(
        &self,
        size: (usize, NonZeroU32),
        coordinator: &Coordinator<'_>,
        null: Null,
    ) -> Crew<'a> {
        let Coordinator { address, token, .. } = coordinator;
        Crew::start(self.runtime, size, *address, token, null)
    }

    fn submit(
        &self,
        scene: &Scene,
        tile: u32,
        coordinator: &Coordinator<'_>,
        state: &Path,
    ) -> Result<(), Error> {
        let submission = Submission {
            scene,
            name: "null",
            frames: scene.frames(None)?,
            tile: Some(Resolution {
                width: tile,
                height: tile,
            }),
            min_tile_pixels: None,
            place: PlaceOptions::default(),
            formats: Formats::new([Format::Exr]),
            settings_json: String::new(),
        };
        let context = Context {
            state: Some(state.to_owned()),
            token_file: None,
            ..self.context.clone()
        };
        let farm = FarmOptions {
            coordinator: Some(coordinator.address.to_string()),
        };
        let handed = submission.hand_in(&context, &farm);
        self.runtime.block_on(handed).map(drop)
    }
}

/// Watches a job from its next durable block on until so many more are there, or for so long.
fn pace(coordinator: &mut Coordinator<'_>, blocks: u64, longest: Duration) -> Result<Pace, Error> {
    let before = coordinator.job()?.blocks_done;
    let first = coordinator.wait(|job| job.blocks_done > before)?;
    let (begun, cpu) = (Instant::now(), coordinator.cpu_seconds());
    let enough = (before + blocks).max(first.blocks_done + 1);
    let last = coordinator.wait(|job| {
        let is_late = begun.elapsed() > longest && job.blocks_done > first.blocks_done;
        job.blocks_done >= enough || is_late
    })?;
    let count = (last.blocks_done - first.blocks_done) as f64;
    let seconds = begun.elapsed().as_secs_f64();
    let cpu = cpu.zip(coordinator.cpu_seconds());
    Ok(Pace {
        tiles_per_second: count / seconds,
        cpu_us: cpu.map(|(before, after)| (after - before) * 1e6 / count),
    })
}

/// A scene of so many square images.
fn square(side: u64, images: u64) -> Result<Scene, Error> {
    let side = u32::try_from(side).unwrap_or(u32::MAX);
    let source = Source {
        name: "null.toml".to_owned(),
        text: SCENE.to_owned(),
    };
    let overrides = Overrides {
        resolution: Some(Resolution {
            width: side,
            height: side,
        }),
        set: vec![format!("film.images={images}")],
        ..Overrides::default()
    };
    let loaded = scene::parse(source, "null", Path::new("."), &overrides);
    Scene::new(loaded.map_err(|error| load::mistakes(&error))?)
}

fn interrupted() -> Error {
    Error::interrupted("the measurement was stopped")
}
