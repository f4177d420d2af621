//! Poll mode: which arrays a site should have, and what of them is wanted, decided from what was leased and what was seen
//! there. A function of its state and an observation; whoever drives it asks the agent at the site, and does what it says.
//!
//! What always holds: a tile is in at most one array; nothing ends unnoticed, since a task that will not go on and has
//! not brought all its blocks gives its tile back, so that the rest is leased anew (thesis §C.5); after three tries
//! without a block a tile fails; after a refusal nothing is submitted for a while, longer each time.

mod held;
mod settings;
mod stock;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use model::{AttemptId, Begun, Digest, ImageRef, Lease, Rect, Running, Span, Timestamp};

use crate::orders::{Order, Seen, SeenArray, Stands, TaskOrder, Wants};

use held::{Array, History, Tile};
pub use settings::{ARRAY_TASKS, Settings};
use stock::{Flow, Stock};

/// Tries in a row that brought no block, after which a tile fails.
const TRIES_MAX: u32 = 3;

/// A task asks for so many times what it is expected to take…
const LIMIT_FACTOR: u64 = 4;

/// …and so much for its start, and never for less than…
const LIMIT_START: Span = Span::from_secs(60);

/// …this.
const LIMIT_LEAST: Span = Span::from_secs(120);

/// What became of a tile is forgotten so many observations after it was last leased.
const REMEMBERED: u64 = 1_000;

/// How long nothing is submitted after the first refusal; twice as long after each further one…
const PAUSE_FIRST: Span = Span::from_secs(10);

/// …and never longer than this.
const PAUSE_LONGEST: Span = Span::from_secs(900);

/// What to do now, in this order.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Action {
    /// End these, by the array's name.
    Delete(Vec<(String, Option<u32>)>),
    /// Remove the folders of these arrays.
    Remove(Vec<String>),
    /// Give these tiles back: their tasks ended before they were done.
    GiveBack(Vec<AttemptId>),
    /// A tile came to nothing several times: the log of this task may say why.
    Fail {
        /// The tile.
        attempt: AttemptId,
        /// Its array.
        array: String,
        /// Its task.
        task: u32,
    },
}

/// How a site stands, for people.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Standing {
    /// Tasks that wait in the queue.
    pub waiting: u32,
    /// Tasks that run.
    pub running: u32,
    /// What is wrong, and what to do; nothing where nothing is.
    pub trouble: Option<String>,
}

/// The state of one site.
#[derive(Clone, Debug)]
pub struct Poll {
    settings: Settings,
    number: u64,
    observations: u64,
    tiles: BTreeMap<AttemptId, Tile>,
    arrays: BTreeMap<String, Array>,
    histories: BTreeMap<(ImageRef, Rect), History>,
    stock: Stock,
    failures: u32,
    quiet_until: Timestamp,
    standing: Standing,
}

impl Poll {
    /// A site that holds nothing.
    pub fn new(settings: Settings) -> Self {
        Self {
            stock: Stock::new(settings.ahead),
            settings,
            number: 0,
            observations: 0,
            tiles: BTreeMap::new(),
            arrays: BTreeMap::new(),
            histories: BTreeMap::new(),
            failures: 0,
            quiet_until: Timestamp(0),
            standing: Standing::default(),
        }
    }

    /// How it stands.
    pub fn standing(&self) -> &Standing {
        &self.standing
    }

    /// Images that the site should hold.
    pub fn credit(&self) -> u32 {
        self.stock.credit()
    }

    /// Whether there is anything at the site, or should be.
    pub fn is_empty(&self) -> bool {
        self.tiles.is_empty() && self.arrays.is_empty()
    }

    /// Grid squares, of 1,024 pixels each, that are leased to the site and not durable.
    pub fn squares(&self) -> u64 {
        let missing = self.tiles.values().flat_map(|tile| &tile.missing);
        let pixels: u64 = missing.map(|block| block.area()).sum();
        pixels.div_ceil(1_024)
    }

    /// The scenes of what is leased.
    pub fn scenes(&self) -> BTreeSet<Digest> {
        self.tiles.values().map(|tile| tile.lease.scene).collect()
    }

    /// The tiles that are held, for whoever connects anew.
    pub fn held(&self) -> Vec<AttemptId> {
        self.tiles.keys().copied().collect()
    }

    /// The tiles that run, and how far they are.
    pub fn running(&self) -> Vec<Running> {
        let tiles = self.tiles.iter().filter(|(_, tile)| tile.runs);
        tiles
            .map(|(&attempt, tile)| Running {
                attempt,
                blocks: tile.arrived,
            })
            .collect()
    }

    /// A tile is leased to the site.
    pub fn leased(&mut self, lease: Lease) {
        self.tiles
            .entry(lease.attempt)
            .or_insert_with(|| Tile::new(lease, None));
    }

    /// Nobody wants a tile any more.
    pub fn revoked(&mut self, attempt: AttemptId) {
        self.forget(attempt);
    }

    /// Only these tiles are still the site's.
    pub fn keeps(&mut self, live: &[AttemptId]) {
        let live: BTreeSet<_> = live.iter().collect();
        let gone: Vec<_> = self.tiles.keys().copied().collect();
        for attempt in gone.into_iter().filter(|attempt| !live.contains(attempt)) {
            self.forget(attempt);
        }
    }

    /// Takes up what an earlier coordinator left there: what runs, and what has ended and may have brought blocks that
    /// nobody has fetched. What only waits is not taken up, and so deleted.
    pub fn takes_up(&mut self, seen: &Seen) -> Vec<Begun> {
        let mut begun = Vec::new();
        for array in &seen.arrays {
            let Some(order) = array.order.as_ref().filter(|_| array.is_submitted) else {
                continue;
            };
            if self.arrays.contains_key(&array.name) {
                continue;
            }
            let mut tiles = vec![None; order.tasks.len()];
            for (index, (task, tile)) in array.tasks.iter().zip(&mut tiles).enumerate() {
                let number = u32::try_from(index + 1).unwrap_or(u32::MAX);
                let has_begun = task.0 != Stands::Waits && (task.0 == Stands::Runs || task.1 > 0);
                let Some(lease) = order.lease(number).filter(|_| has_begun) else {
                    continue;
                };
                *tile = Some(lease.attempt);
                let claim = Begun {
                    attempt: lease.attempt,
                    image: lease.image,
                    tile: lease.tile,
                };
                let place = (array.name.clone(), number);
                let mut taken = Tile::new(lease, Some(place));
                if let Some(had) = array.had.get(index) {
                    taken.inherits(had);
                }
                // Of one that is whole nothing more is wanted.
                if taken.missing.is_empty() {
                    *tile = None;
                    continue;
                }
                begun.push(claim);
                self.tiles.insert(claim.attempt, taken);
            }
            let mut found = Array::new(tiles);
            found.time_limit = order.time_limit;
            found.waiting = count(array, Stands::Waits);
            self.arrays.insert(array.name.clone(), found);
        }
        begun
    }

    /// Arrays whose orders are known.
    pub fn known(&self) -> Vec<String> {
        self.arrays.keys().cloned().collect()
    }

    /// What is wanted of the arrays.
    pub fn wants(&self) -> Vec<Wants> {
        let offset = |attempt: &Option<AttemptId>| {
            let tile = self.tiles.get(attempt.as_ref()?)?;
            Some(tile.offset)
        };
        let wants = self.arrays.iter().map(|(name, array)| Wants {
            array: name.clone(),
            offsets: array.tiles.iter().map(offset).collect(),
        });
        wants
            .filter(|wants| wants.offsets.iter().any(Option::is_some))
            .collect()
    }

    /// Of a task's file all bytes before `end` are done with.
    pub fn is_done_to(&mut self, array: &str, task: u32, end: u64) {
        let attempt = self.arrays.get(array).and_then(|array| array.attempt(task));
        if let Some(tile) = attempt.and_then(|attempt| self.tiles.get_mut(&attempt)) {
            tile.offset = tile.offset.max(end);
        }
    }

    /// A block is durable.
    pub fn delivered(&mut self, attempt: AttemptId, block: Rect, took: Span) {
        let Some(tile) = self.tiles.get_mut(&attempt) else {
            return;
        };
        if !tile.missing.remove(&block) {
            return;
        }
        tile.arrived += 1;
        tile.took = tile.took + took;
        if tile.missing.is_empty() {
            let key = (tile.lease.image, tile.lease.tile);
            self.histories.remove(&key);
            self.forget(attempt);
        }
    }

    /// Looks at what is there, of which all blocks that are wanted were delivered, and says what to do. What is leased
    /// after that, since the [credit](Self::credit) is another now, still comes in time for [`Self::orders`].
    pub fn observe(&mut self, seen: &Seen) -> Vec<Action> {
        self.observations += 1;
        let mut actions = Vec::new();
        let by_name: BTreeMap<_, _> = seen
            .arrays
            .iter()
            .map(|array| (array.name.as_str(), array))
            .collect();
        self.follow(&by_name, &mut actions);
        self.tidy(&by_name, &mut actions);
        let flow = self.flow(&by_name);
        self.stock.saw(flow);
        let (now_is, kept) = (self.observations, REMEMBERED);
        self.histories
            .retain(|_, history| history.observation + kept > now_is);
        actions
    }

    /// Arrays to submit, in this order; where one fails say so: [`Self::refused`].
    pub fn orders(&mut self, now: Timestamp) -> Vec<Order> {
        match now >= self.quiet_until {
            true => self.put_into_arrays(),
            false => Vec::new(),
        }
    }

    /// An array could not be submitted, or may have been: the next look says.
    pub fn refused(&mut self, now: Timestamp, array: &str, words: String) {
        if let Some(array) = self.arrays.get_mut(array) {
            array.is_sure = false;
        }
        let pause = PAUSE_FIRST.times(1 << self.failures.min(16));
        self.failures += 1;
        self.quiet_until = now + pause.min(PAUSE_LONGEST);
        self.standing.trouble = Some(words);
    }

    /// An array was submitted.
    pub fn submitted(&mut self) {
        self.failures = 0;
        self.standing.trouble = None;
    }

    /// Finds out how each tile's task stands; what ended too early goes back.
    fn follow(&mut self, seen: &BTreeMap<&str, &SeenArray>, actions: &mut Vec<Action>) {
        let mut ended = Vec::new();
        for (&attempt, tile) in &mut self.tiles {
            let Some((name, task)) = tile.place.clone() else {
                continue;
            };
            let there = seen.get(name.as_str()).filter(|there| there.is_submitted);
            let array = self.arrays.get_mut(&name);
            let array = array.filter(|array| there.is_none() && !array.is_sure);
            match (there.map(|there| stands(there, task)), array) {
                // It never came there.
                (_, Some(array)) => {
                    if let Some(place) = array.place(task) {
                        array.tiles[place] = None;
                    }
                    tile.place = None;
                }
                (None | Some(Stands::Ended), None) => ended.push((attempt, name, task)),
                (Some(stands), None) => tile.runs = stands == Stands::Runs,
            }
        }
        let mut back = Vec::new();
        for (attempt, array, task) in ended {
            let Some(tile) = self.forget(attempt) else {
                continue;
            };
            let key = (tile.lease.image, tile.lease.tile);
            let history = self.histories.entry(key).or_default();
            history.observation = self.observations;
            history.limit = self.arrays.get(&array).and_then(|array| array.time_limit);
            match tile.arrived - tile.inherited {
                0 => history.tries += 1,
                blocks => {
                    history.tries = 0;
                    history.block = Span(tile.took.0 / u64::from(blocks));
                }
            }
            match history.tries >= TRIES_MAX {
                true => {
                    self.histories.remove(&key);
                    actions.push(Action::Fail {
                        attempt,
                        array,
                        task,
                    });
                }
                false => back.push(attempt),
            }
        }
        if !back.is_empty() {
            actions.push(Action::GiveBack(back));
        }
    }

    /// Ends and removes what nobody needs, and counts what is live.
    fn tidy(&mut self, seen: &BTreeMap<&str, &SeenArray>, actions: &mut Vec<Action>) {
        let (mut delete, mut remove) = (Vec::new(), Vec::new());
        let (mut waiting, mut running) = (0, 0);
        for (&name, there) in seen {
            waiting += count(there, Stands::Waits);
            running += count(there, Stands::Runs);
            // What nobody knows, nobody wants.
            let unknown = || Array::new(vec![None; there.tasks.len()]);
            let array = self.arrays.entry(name.to_owned()).or_insert_with(unknown);
            array.is_sure |= there.is_submitted;
            let is_wanted = array.tiles.iter().any(Option::is_some);
            let live = (1..)
                .zip(&there.tasks)
                .filter(|(_, task)| task.0 != Stands::Ended);
            let live: Vec<u32> = live.map(|(number, _)| number).collect();
            match (is_wanted, live.is_empty()) {
                (false, true) => remove.push(name.to_owned()),
                (false, false) => delete.push((name.to_owned(), None)),
                (true, _) => {
                    for task in live {
                        if array.attempt(task).is_none() && array.deleted.insert(task) {
                            delete.push((name.to_owned(), Some(task)));
                        }
                    }
                }
            }
        }
        self.arrays
            .retain(|name, _| seen.contains_key(name.as_str()));
        self.standing.waiting = waiting;
        self.standing.running = running;
        if !delete.is_empty() {
            actions.push(Action::Delete(delete));
        }
        if !remove.is_empty() {
            actions.push(Action::Remove(remove));
        }
    }

    /// How fast tasks begin, and how many images have begun.
    fn flow(&mut self, seen: &BTreeMap<&str, &SeenArray>) -> Flow {
        let mut flow = Flow::default();
        for (name, array) in &mut self.arrays {
            let there = seen.get(name.as_str());
            let waiting = there.map_or(0, |there| count(there, Stands::Waits));
            let before = std::mem::replace(&mut array.waiting, waiting);
            if array.tiles.iter().any(Option::is_some) {
                flow.tasks_begun += before.saturating_sub(waiting);
            }
        }
        let mut images = BTreeMap::<ImageRef, (u32, bool)>::new();
        for tile in self.tiles.values() {
            let (tasks, has_begun) = images.entry(tile.lease.image).or_default();
            *tasks += 1;
            let array = tile
                .place
                .as_ref()
                .and_then(|(name, _)| self.arrays.get(name));
            *has_begun |= array.is_some_and(Array::has_begun);
        }
        flow.image_tasks = images.values().map(|image| image.0).max().unwrap_or(0);
        let begun = images.values().filter(|image| image.1);
        flow.begun = u32::try_from(begun.count()).unwrap_or(u32::MAX);
        flow
    }

    /// Puts what is leased and in no array into new ones, an image into as few as it takes.
    fn put_into_arrays(&mut self) -> Vec<Order> {
        let mut orders = Vec::new();
        let mut images = BTreeMap::<(ImageRef, Digest), Vec<AttemptId>>::new();
        for (&attempt, tile) in self.tiles.iter().filter(|(_, tile)| tile.place.is_none()) {
            let key = (tile.lease.image, tile.lease.scene);
            images.entry(key).or_default().push(attempt);
        }
        let array_max = usize::try_from(self.settings.array_max).unwrap_or(usize::MAX);
        for ((image, scene), attempts) in images {
            for attempts in attempts.chunks(array_max.max(1)) {
                self.number += 1;
                let name = format!("{}{}", self.settings.names, self.number);
                let time_limit = self.limit(attempts);
                let mut tasks = Vec::new();
                for (number, attempt) in (1..).zip(attempts) {
                    if let Some(tile) = self.tiles.get_mut(attempt) {
                        tile.place = Some((name.clone(), number));
                        tile.runs = false;
                        tasks.push(TaskOrder::from(&tile.lease));
                    }
                }
                let mut array = Array::new(attempts.iter().copied().map(Some).collect());
                array.time_limit = time_limit;
                self.arrays.insert(name.clone(), array);
                orders.push(Order {
                    name,
                    scene: scene.to_string(),
                    job: image.job.0,
                    image: image.image.0,
                    revision: self.settings.revision.0,
                    threads: self.settings.threads,
                    running_max: self.settings.running_max,
                    time_limit,
                    tasks,
                });
            }
        }
        orders
    }

    /// How long a task of these tiles may run: by the site's word, else by what is known of the dearest.
    fn limit(&self, attempts: &[AttemptId]) -> Option<Span> {
        let threads = u64::from(self.settings.threads.max(1));
        let tiles = attempts
            .iter()
            .filter_map(|attempt| self.tiles.get(attempt));
        let one = |tile: &Tile| {
            let history = self.histories.get(&(tile.lease.image, tile.lease.tile));
            let measured = history.map_or(Span(0), |history| history.block);
            let expected = match measured {
                Span(0) => tile.lease.expected,
                block => block.times(tile.missing.len() as u64),
            };
            let enough = Span(expected.0 / threads).times(LIMIT_FACTOR) + LIMIT_START;
            let enough = (expected > Span(0)).then_some(enough.max(LIMIT_LEAST));
            // What was killed without a block needs more than it had.
            let last = history.filter(|history| history.tries > 0);
            let longer = last
                .and_then(|history| history.limit)
                .map(|limit| limit.times(2));
            enough.max(longer)
        };
        let limit = self
            .settings
            .time_limit
            .or_else(|| tiles.filter_map(one).max())?;
        Some(self.settings.time_max.map_or(limit, |most| limit.min(most)))
    }

    /// A tile is the site's no more.
    fn forget(&mut self, attempt: AttemptId) -> Option<Tile> {
        let tile = self.tiles.remove(&attempt)?;
        if let Some((name, task)) = &tile.place
            && let Some(array) = self.arrays.get_mut(name)
            && let Some(place) = array.place(*task)
        {
            array.tiles[place] = None;
        }
        Some(tile)
    }
}

fn stands(array: &SeenArray, task: u32) -> Stands {
    let place = task
        .checked_sub(1)
        .and_then(|place| usize::try_from(place).ok());
    let task = place.and_then(|place| array.tasks.get(place));
    task.map_or(Stands::Ended, |task| task.0)
}

fn count(array: &SeenArray, stands: Stands) -> u32 {
    let tasks = array.tasks.iter().filter(|task| task.0 == stands);
    u32::try_from(tasks.count()).unwrap_or(u32::MAX)
}
