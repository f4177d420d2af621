//! Poll mode: which arrays a site should have, and what of them is wanted, decided from what was leased and what was seen
//! there. A function of its state and an observation; whoever drives it asks the agent at the site, and does what it says.
//!
//! What always holds: a tile is in at most one array; nothing ends unnoticed, since a task that will not go on and has
//! not brought all its blocks gives its tile back, so that the rest is leased anew (thesis §C.5); after three tries
//! without a block a tile fails; after a refusal nothing is submitted for a while, longer each time. While the site's folder is
//! full only what runs stays there, and no tile is blamed.

mod before;
mod held;
mod settings;
mod stock;
mod submit;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use model::{AttemptId, Digest, ImageRef, Lease, Rect, Running, Span, Timestamp};

use crate::orders::{Order, Seen, SeenArray, Stands, Wants, edges};

use held::{Array, History, Tile};
pub use settings::{ARRAY_TASKS, Settings};
use stock::{Flow, Stock};

/// Tries in a row that brought no block, after which a tile fails.
const TRIES_MAX: u32 = 3;

/// A task whose host is gone counts as ended after so many looks in a row: a queue's daemon that was started again hears of
/// all its hosts within a minute.
const AWAY_LOOKS: u32 = 3;

/// What became of a tile is forgotten so many observations after it was last leased.
const REMEMBERED: u64 = 1_000;

/// What tasks say that have come to nothing for lack of room.
const COULD_NOT_WRITE: &str = "a task could not write its blocks";

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

/// Whether a block came for the first time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Came {
    /// It did.
    First,
    /// It was durable already, and was brought in vain.
    Again,
}

/// How a site stands, for people.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Standing {
    /// Tasks that wait in the queue.
    pub waiting: u32,
    /// Tasks that run.
    pub running: u32,
    /// Tasks whose hosts are gone.
    pub away: u32,
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
    /// What was said when nothing more could be written there.
    full: Option<String>,
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
            full: None,
            standing: Standing::default(),
        }
    }

    /// The site's settings, by what its queue says now.
    pub fn settle(&mut self, settings: Settings) {
        self.settings = settings;
    }

    /// How it stands.
    pub fn standing(&self) -> &Standing {
        &self.standing
    }

    /// Images that the site should hold.
    pub fn credit(&self) -> u32 {
        match self.full {
            Some(_) => 0,
            None => self.stock.credit(),
        }
    }

    /// What was said where nothing more could be written there, when it was last looked at.
    pub fn full(&self) -> Option<&String> {
        self.full.as_ref()
    }

    /// Whether it matters if there is room for more: who brings nothing writes nothing there.
    pub fn asks_for_room(&self) -> bool {
        !self.tiles.is_empty() || self.full.is_some()
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
        let but = |attempt: &Option<AttemptId>| {
            let tile = attempt.as_ref().and_then(|it| self.tiles.get(it));
            tile.map_or_else(Vec::new, |tile| {
                tile.found.iter().copied().map(edges).collect()
            })
        };
        let wants = self.arrays.iter().map(|(name, array)| {
            let but: Vec<Vec<_>> = array.tiles.iter().map(but).collect();
            Wants {
                array: name.clone(),
                offsets: array.tiles.iter().map(offset).collect(),
                but: match but.iter().all(Vec::is_empty) {
                    true => Vec::new(),
                    false => but,
                },
            }
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

    /// A block is durable; answers whether it was known to be.
    pub fn delivered(&mut self, attempt: AttemptId, block: Rect, took: Span) -> Came {
        let Some(tile) = self.tiles.get_mut(&attempt) else {
            return Came::Again;
        };
        if !tile.missing.remove(&block) {
            return Came::Again;
        }
        tile.arrived += 1;
        tile.took = tile.took + took;
        if tile.missing.is_empty() {
            let key = (tile.lease.image, tile.lease.tile);
            self.histories.remove(&key);
            self.forget(attempt);
        }
        Came::First
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
        self.has_room(seen.full.clone());
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
        match now >= self.quiet_until && self.full.is_none() {
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

    /// Whether there is room, or what was said. Where there is again, a pause is over.
    fn has_room(&mut self, full: Option<String>) {
        let was_full = std::mem::replace(&mut self.full, full).is_some();
        if was_full && self.full.is_none() {
            self.failures = 0;
            self.quiet_until = Timestamp(0);
            self.standing.trouble = None;
        }
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
                (Some(Stands::Full), None) => {
                    self.full.get_or_insert_with(|| COULD_NOT_WRITE.to_owned());
                    ended.push((attempt, name, task));
                }
                (Some(stands), None) => {
                    tile.runs = stands == Stands::Runs;
                    tile.away = match stands {
                        Stands::Away => tile.away + 1,
                        _ => 0,
                    };
                    if tile.away >= AWAY_LOOKS {
                        ended.push((attempt, name, task));
                    }
                }
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
                // It is nobody's fault but its host's, or its disk's.
                0 if tile.away > 0 || self.full.is_some() => {}
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
        if self.full.is_some() {
            back.extend(self.retreat());
        }
        if !back.is_empty() {
            actions.push(Action::GiveBack(back));
        }
    }

    /// Where nothing more can be written nothing is begun: others may have what does not run.
    fn retreat(&mut self) -> Vec<AttemptId> {
        let tiles = self.tiles.iter().filter(|(_, tile)| !tile.runs);
        let waiting: Vec<_> = tiles.map(|(&attempt, _)| attempt).collect();
        for &attempt in &waiting {
            self.forget(attempt);
        }
        waiting
    }

    /// Ends and removes what nobody needs, and counts what is live.
    fn tidy(&mut self, seen: &BTreeMap<&str, &SeenArray>, actions: &mut Vec<Action>) {
        let (mut delete, mut remove) = (Vec::new(), Vec::new());
        let (mut waiting, mut running, mut away) = (0, 0, 0);
        for (&name, there) in seen {
            away += count(there, Stands::Away);
            waiting += count(there, Stands::Waits);
            running += count(there, Stands::Runs);
            // What nobody knows, nobody wants.
            let unknown = || Array::new(vec![None; there.tasks.len()]);
            let array = self.arrays.entry(name.to_owned()).or_insert_with(unknown);
            array.is_sure |= there.is_submitted;
            let is_wanted = array.tiles.iter().any(Option::is_some);
            let live = (1..).zip(&there.tasks).filter(|(_, task)| task.0.is_live());
            let live: Vec<(u32, Stands)> = live.map(|(number, task)| (number, task.0)).collect();
            match (is_wanted, live.is_empty()) {
                (false, true) => remove.push(name.to_owned()),
                (false, false) => {
                    // Of those that are away nothing comes of asking twice.
                    let mut is_new = false;
                    for &(task, stands) in &live {
                        is_new |= array.deleted.insert(task) || stands != Stands::Away;
                    }
                    if is_new {
                        delete.push((name.to_owned(), None));
                    }
                }
                (true, _) => {
                    for (task, _) in live {
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
        self.standing.away = away;
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
