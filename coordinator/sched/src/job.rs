//! A job: its images in order, those in flight, and what was counted.

use alloc::boxed::Box;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use model::{ImageNumber, ImageRef, JobId, Rect, Span, Timestamp, WorkerId};

use crate::costs::Costs;
use crate::market::{Rank, Stands};
use crate::needs::Kind;
use crate::pace::time_of;
use crate::places::Places;
use crate::spread::Spread;
use crate::tiling::TileGrid;
use crate::timers::Alarm;
use crate::view::Paused;
use crate::work::{Amount, Ask, Work};
use crate::{
    Config, ImageCounts, ImageFailure, ImageState, ImageView, JobOutcome, JobState, JobView,
    Submission,
};

#[derive(Clone, Debug)]
pub(crate) struct Job {
    pub(crate) id: JobId,
    pub(crate) spec: Submission,
    pub(crate) kind: Kind,
    pub(crate) shape: Shape,
    pub(crate) outcome: Option<JobOutcome>,
    pub(crate) priority: i32,
    pub(crate) share: u32,
    pub(crate) paused: Paused,
    /// Jobs that must be finished before it begins, and are not.
    pub(crate) after: BTreeSet<JobId>,
    focus: Option<Rect>,
    /// By place in the frame range.
    images: Vec<ImageState>,
    counts: ImageCounts,
    /// Images that wait, by place.
    waiting: Places,
    /// Images being rendered, by place in the frame range.
    pub(crate) work: BTreeMap<u32, Work>,
    /// Images being encoded.
    encoding: BTreeSet<u32>,
    pub(crate) failures: Vec<ImageFailure>,
    pub(crate) tally: Tally,
    /// Who rendered the latest images that are rendered, where that may matter.
    pub(crate) makers: BTreeMap<u32, Box<[WorkerId]>>,
    /// Of all those images together.
    pub(crate) makers_count: usize,
    pub(crate) costs: Costs,
    pub(crate) spread: Spread,
    /// Attempts that are their tile's only one, by when they are expected to be done.
    pub(crate) ending: BTreeSet<(Timestamp, u64)>,
    /// Workers that are set aside for it…
    pub(crate) aside: u32,
    /// …and those of them that would take its tiles if they were not.
    pub(crate) aside_able: u32,
    /// When the first of its checks that wait has waited for too long, or earlier.
    pub(crate) unverified: Alarm,
    /// Where it stands in the market.
    pub(crate) stands: Stands,
}

/// How the images of a job are cut.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Shape {
    /// What tiles are made of.
    pub(crate) grid: TileGrid,
    /// How long a tile should take; where absent, each cell is one.
    pub(crate) aim: Option<Span>,
}

/// What a job has counted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) pixels_done: u64,
    pub(crate) blocks_done: u64,
    pub(crate) blocks_again: u64,
    pub(crate) pixels_again: u64,
    pub(crate) blocks_twice: u64,
    pub(crate) incidents: u64,
    /// Of those, the ones of which nobody knows yet who is right.
    pub(crate) undecided: u64,
    pub(crate) unverified: u64,
    pub(crate) seconds: u64,
    pub(crate) called_back: u64,
    pub(crate) render_time: Span,
    pub(crate) attempts_live: u32,
    pub(crate) attempts_failed: u64,
    pub(crate) attempts_lost: u64,
    pub(crate) submitted: Timestamp,
    pub(crate) started: Option<Timestamp>,
    pub(crate) ended: Option<Timestamp>,
}

impl Job {
    pub(crate) fn new(
        id: JobId,
        spec: Submission,
        (kind, shape): (Kind, Shape),
        submitted: Timestamp,
    ) -> Self {
        let count = spec.frames.count();
        Self {
            id,
            kind,
            shape,
            outcome: None,
            priority: spec.priority,
            share: spec.share,
            paused: Paused::No,
            after: BTreeSet::new(),
            focus: None,
            images: vec![ImageState::Waiting; count as usize],
            counts: ImageCounts {
                waiting: count,
                ..ImageCounts::default()
            },
            waiting: Places::all(count),
            work: BTreeMap::new(),
            encoding: BTreeSet::new(),
            failures: Vec::new(),
            tally: Tally {
                submitted,
                ..Tally::default()
            },
            makers: BTreeMap::new(),
            makers_count: 0,
            costs: Costs::unknown(spec.window),
            spread: Spread::default(),
            ending: BTreeSet::new(),
            aside: 0,
            aside_able: 0,
            unverified: Alarm::default(),
            stands: Stands::default(),
            spec,
        }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.outcome.is_some()
    }

    /// Whether it is neither over nor held up by its user or by another job.
    pub(crate) fn goes_on(&self) -> bool {
        !self.is_over() && self.paused == Paused::No && self.after.is_empty()
    }

    /// The place of an image in the frame range.
    pub(crate) fn place(&self, image: ImageNumber) -> Option<u32> {
        self.spec.frames.index_of(image)
    }

    pub(crate) fn image_ref(&self, place: u32) -> ImageRef {
        let image = self.spec.frames.nth(place);
        ImageRef {
            job: self.id,
            image: image.expect("places are below the number of images"),
        }
    }

    /// An image's state, whatever became of the job.
    pub(crate) fn state(&self, place: u32) -> ImageState {
        self.images[place as usize]
    }

    pub(crate) fn set_state(&mut self, place: u32, state: ImageState) {
        let slot = &mut self.images[place as usize];
        *self.counts.of(*slot) -= 1;
        *self.counts.of(state) += 1;
        *slot = state;
        match state {
            ImageState::Waiting => self.waiting.insert(place),
            _ => self.waiting.remove(place),
        }
        if state == ImageState::Encoding {
            self.encoding.insert(place);
        } else {
            self.encoding.remove(&place);
        }
    }

    /// Whether an image waits to be begun.
    pub(crate) fn waits(&self, place: u32) -> bool {
        self.waiting.contains(place)
    }

    /// The image that is begun next.
    pub(crate) fn first_waiting(&self) -> Option<u32> {
        self.waiting.first()
    }

    /// Where it belongs in the market.
    pub(crate) fn belongs(&self, config: &Config) -> Stands {
        if !self.goes_on() {
            return Stands::default();
        }
        let rank = Rank::new(self.priority, self.tally.attempts_live, self.share, self.id);
        let is_open = self.has_tiles(config);
        // While pixels are missing that nobody renders, whoever has nothing to do does those.
        let is_ending = !self.ending.is_empty() && !self.has_missing(config);
        Stands {
            open: is_open.then_some(rank),
            ending: is_ending.then_some(rank),
        }
    }

    /// Whether some worker could be given a tile.
    pub(crate) fn has_tiles(&self, config: &Config) -> bool {
        self.may_begin(config) || self.work.values().any(Work::has_open)
    }

    /// Whether pixels that are not durable wait for a worker.
    pub(crate) fn has_missing(&self, config: &Config) -> bool {
        self.may_begin(config) || self.work.values().any(Work::has_missing)
    }

    /// Whether this worker could be.
    pub(crate) fn has_for(&self, ask: &Ask, config: &Config) -> bool {
        self.work.values().any(|work| work.has_for(ask)) || self.may_begin_for(ask, config)
    }

    /// The next tile for a worker, as (place of its image, tile): in the region of interest first, then
    /// in order; an image is begun where none in flight has one.
    pub(crate) fn take_tile(&mut self, ask: &Ask, config: &Config) -> Option<(u32, u32)> {
        let take = |(&place, work): (&u32, &mut Work)| {
            let tile = work.take(ask)?;
            if ask.queue.is_some() {
                work.is_for(ask.worker);
            }
            Some((place, tile))
        };
        let mut focused = self.work.iter_mut().filter(|(_, work)| work.has_focused());
        if let Some(found) = focused.find_map(take) {
            return Some(found);
        }
        if let Some(found) = self.work.iter_mut().find_map(take) {
            return Some(found);
        }
        let place = self.waiting.first();
        let place = place.filter(|_| self.may_begin_for(ask, config))?;
        let work = match ask.queue {
            None => self.begin(place),
            Some(queue) => {
                let work = self.begin_cut(place, queue.grid);
                work.is_for(ask.worker);
                work
            }
        };
        Some((place, work.take(ask)?))
    }

    /// Begins an image that waits.
    pub(crate) fn begin(&mut self, place: u32) -> &mut Work {
        self.begin_cut(place, self.shape.grid)
    }

    fn begin_cut(&mut self, place: u32, grid: TileGrid) -> &mut Work {
        self.set_state(place, ImageState::Rendering);
        let map = self.costs.map(grid).map(Arc::new);
        let work = Work::new(grid, map, self.focus);
        self.work.entry(place).or_insert(work)
    }

    /// Cuts an image in flight for a queue, if nobody holds a tile of it.
    pub(crate) fn cut_for_queue(&mut self, place: u32, (queue, grid): (WorkerId, TileGrid)) {
        let map = self.costs.map(grid).map(Arc::new);
        if let Some(work) = self.work.get_mut(&place) {
            work.cut_anew(grid, map);
            work.is_for(queue);
        }
    }

    pub(crate) fn may_begin(&self, config: &Config) -> bool {
        let in_flight = self.counts.rendering + self.counts.encoding;
        self.waiting.count() > 0 && in_flight < config.images_in_flight(self.spec.window.area())
    }

    /// Whether an image may be begun for a worker. Not for one whose time is too short for what there is.
    fn may_begin_for(&self, ask: &Ask, config: &Config) -> bool {
        let fits = |fits: Amount| {
            let cell = self.costs.mean(self.shape.grid.tile(0).area());
            let is_short = cell.is_some_and(|cost| cost > fits.cost);
            !is_short && !self.work.values().any(Work::has_open)
        };
        let has_room = ask.queue.is_none_or(|queue| queue.has_room);
        has_room && self.may_begin(config) && ask.fits.is_none_or(fits)
    }

    /// What all that waits for a worker is expected to cost, if anything was measured.
    pub(crate) fn open_cost(&self) -> Option<u64> {
        let of_image = self.costs.mean(self.spec.window.area())?;
        let waiting = of_image.saturating_mul(u64::from(self.waiting.count()));
        let in_flight = self.work.values().map(|work| match work.is_measured() {
            true => work.open().cost,
            false => self.costs.mean(work.open().pixels).unwrap_or(0),
        });
        Some(in_flight.fold(waiting, u64::saturating_add))
    }

    /// Moves what lies in a region to the front.
    pub(crate) fn focus(&mut self, focus: Option<Rect>) {
        self.focus = focus;
        for work in self.work.values_mut() {
            work.focus(focus);
        }
    }

    /// Live attempts at any of its tiles.
    pub(crate) fn live(&self) -> impl Iterator<Item = u64> {
        let tiles = self.work.values().flat_map(|work| work.tiles.iter());
        tiles.flat_map(|(_, tile)| tile.attempts())
    }

    /// Live attempts at the tiles of one image.
    pub(crate) fn live_of(&self, place: u32) -> impl Iterator<Item = u64> {
        let tiles = self.work.get(&place).into_iter();
        let tiles = tiles.flat_map(|work| work.tiles.iter());
        tiles.flat_map(|(_, tile)| tile.attempts())
    }

    /// Forgets the pixels of an image in flight.
    pub(crate) fn drop_pixels(&mut self, place: u32) {
        self.tally.pixels_done -= match self.work.remove(&place) {
            Some(work) => {
                // Nobody needs to know any more.
                let doubts = work.doubts().min(self.tally.undecided);
                self.tally.undecided -= doubts;
                work.pixels.count()
            }
            None if self.state(place) == ImageState::Encoding => self.spec.window.area(),
            None => 0,
        };
    }

    /// Lets an image that is over wait again.
    pub(crate) fn wait_again(&mut self, place: u32) {
        if let ImageState::Encoded { .. } = self.state(place) {
            self.tally.pixels_done -= self.spec.window.area();
        }
        let image = self.image_ref(place).image;
        self.failures.retain(|failure| failure.image != image);
        self.forget_makers(place);
        self.set_state(place, ImageState::Waiting);
    }

    /// The places of images that are being rendered or encoded.
    pub(crate) fn in_flight(&self) -> Vec<u32> {
        self.work.keys().chain(&self.encoding).copied().collect()
    }

    /// How the job ends, if no image is left to do.
    pub(crate) fn ends(&self) -> Option<JobOutcome> {
        let counts = self.counts;
        if counts.encoded + counts.failed < self.spec.frames.count() {
            None
        } else if counts.failed > 0 {
            Some(JobOutcome::Failed)
        } else {
            Some(JobOutcome::Finished)
        }
    }

    /// Notes why an image failed.
    pub(crate) fn blame(&mut self, place: u32, reason: String, config: &Config) {
        if self.failures.len() < config.limits.failures_kept_max as usize {
            let image = self.image_ref(place).image;
            self.failures.push(ImageFailure {
                image,
                reason: cut(reason, config.limits.reason_bytes_max),
            });
        }
    }

    /// How long an attempt may take over one block on a worker of a speed, after so many others at
    /// its tile failed; `cost` is what a block of the tile is expected to cost.
    ///
    /// Each failure doubles it: a tile may be slower than expected by
    /// more than the limit allows for, and must not fail for that.
    pub(crate) fn block_limit(
        &self,
        config: &Config,
        (cost, speed): (u64, u32),
        failures: u32,
    ) -> Span {
        let limit = match self.costs.mean_square() {
            Some(mean) => time_of(mean.max(cost), speed)
                .times(config.progress_factor)
                .max(config.progress_least),
            None => config.progress_unmeasured,
        };
        limit.times(1 << failures.min(16))
    }

    pub(crate) fn view(&self) -> JobView<'_> {
        let tally = &self.tally;
        let mut images = self.counts;
        if self.outcome == Some(JobOutcome::Cancelled) {
            images.dropped = images.waiting + images.rendering + images.encoding;
            (images.waiting, images.rendering, images.encoding) = (0, 0, 0);
        }
        JobView {
            job: self.id,
            submission: self.spec.submission,
            name: &self.spec.name,
            scene: self.spec.scene,
            revision: self.spec.revision,
            frames: self.spec.frames,
            window: self.spec.window,
            tiles: self.shape.aim.is_none().then(|| {
                let count = u32::try_from(self.shape.grid.count());
                (self.shape.grid.size(), count.unwrap_or(u32::MAX))
            }),
            priority: self.priority,
            share: self.share,
            needs: &self.spec.needs,
            paused: self.paused,
            focus: self.focus,
            after: &self.after,
            state: self.outcome.map_or(JobState::Running, JobState::Over),
            images,
            pixels_done: tally.pixels_done,
            pixels: self.spec.window.area() * u64::from(self.spec.frames.count()),
            blocks_done: tally.blocks_done,
            blocks_again: tally.blocks_again,
            pixels_again: tally.pixels_again,
            blocks_twice: tally.blocks_twice,
            incidents: tally.incidents,
            undecided: tally.undecided,
            unverified: tally.unverified,
            seconds: tally.seconds,
            called_back: tally.called_back,
            render_time: tally.render_time,
            attempts_live: tally.attempts_live,
            attempts_failed: tally.attempts_failed,
            attempts_lost: tally.attempts_lost,
            submitted: tally.submitted,
            started: tally.started,
            ended: tally.ended,
        }
    }

    pub(crate) fn image_view(&self, place: u32) -> ImageView {
        let pixels = self.spec.window.area();
        let state = match self.state(place) {
            ImageState::Encoded { film } => ImageState::Encoded { film },
            ImageState::Failed => ImageState::Failed,
            _ if self.outcome == Some(JobOutcome::Cancelled) => ImageState::Dropped,
            state => state,
        };
        let pixels_done = match state {
            ImageState::Encoding | ImageState::Encoded { .. } => pixels,
            _ => self.work.get(&place).map_or(0, |work| work.pixels.count()),
        };
        ImageView {
            image: self.image_ref(place).image,
            state,
            pixels_done,
            pixels,
        }
    }
}

impl ImageCounts {
    fn of(&mut self, state: ImageState) -> &mut u32 {
        match state {
            ImageState::Waiting => &mut self.waiting,
            ImageState::Rendering => &mut self.rendering,
            ImageState::Encoding => &mut self.encoding,
            ImageState::Encoded { .. } => &mut self.encoded,
            ImageState::Failed => &mut self.failed,
            ImageState::Dropped => &mut self.dropped,
        }
    }
}

/// The text, or as much of its start as `bytes_max` allows.
fn cut(mut text: String, bytes_max: usize) -> String {
    if text.len() > bytes_max {
        let end = (0..=bytes_max)
            .rev()
            .find(|&end| text.is_char_boundary(end));
        text.truncate(end.unwrap_or(0));
    }
    text
}
