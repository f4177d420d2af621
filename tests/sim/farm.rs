//! The world: time, the network, and what goes wrong in it.

use std::collections::BTreeMap;

use model::{Span, Timestamp, WorkerId};
use sched::{LinkId, TileShape};
use session::Event;

use crate::coordinator::{self, Coordinator, Down, Later, Up};
use crate::random::Random;
use crate::worker::{self, Worker};

/// How often things go wrong, in so many of 1,000 cases.
#[derive(Clone, Copy)]
pub(crate) struct Troubles {
    /// A message comes a second time, later.
    pub(crate) repeats: u64,
    /// In a second of the farm, a link is cut.
    pub(crate) cuts: u64,
    /// In a second of the farm, a worker is killed.
    pub(crate) kills: u64,
    /// In a second of the farm, a worker is frozen, longer than its limit or not.
    pub(crate) freezes: u64,
    /// In a second of the farm, a worker is drained or stopped.
    pub(crate) leaves: u64,
    /// In a second of the farm, the coordinator is frozen.
    pub(crate) pauses: u64,
    /// A block arrives at a full disk.
    pub(crate) refusals: u64,
    /// A tile fails.
    pub(crate) failures: u64,
}

impl Troubles {
    pub(crate) const NONE: Self = Self {
        repeats: 0,
        cuts: 0,
        kills: 0,
        freezes: 0,
        leaves: 0,
        pauses: 0,
        refusals: 0,
        failures: 0,
    };
}

/// Something that will happen.
#[derive(Clone, Debug)]
enum Happening {
    /// A worker's process starts.
    Start(WorkerId),
    /// A dial arrives.
    Dialled(WorkerId, u64),
    Up(WorkerId, u64, Up),
    Down(WorkerId, u64, Down),
    /// A worker notices that its link is gone.
    Lost(WorkerId, u64),
    /// The coordinator notices that a link is gone.
    Closed(WorkerId, u64),
    Disk(Later),
    Rendered(WorkerId, usize, Span),
    Trouble,
}

/// Who is told that time has passed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Clock {
    Coordinator,
    Worker(WorkerId),
}

/// Messages of one direction and kind stay in order.
type Stream = (u64, &'static str);

pub(crate) struct Farm {
    pub(crate) coordinator: Coordinator,
    pub(crate) blocks_rendered: u64,
    workers: BTreeMap<WorkerId, Worker>,
    /// The link of each worker, as the network sees it.
    links: BTreeMap<WorkerId, u64>,
    links_made: u64,
    incarnations: u64,
    /// By time, then as they were planned.
    agenda: BTreeMap<(Timestamp, u64), Happening>,
    planned: u64,
    now: Timestamp,
    streams: BTreeMap<Stream, Timestamp>,
    paused_until: Timestamp,
    troubles: Troubles,
    random: Random,
}

impl Farm {
    /// A farm of up to five workers and a job, both drawn from the key.
    pub(crate) fn new(key: u64, troubles: Troubles) -> Self {
        let mut random = Random::new(key);
        let images = 1 + u32::try_from(random.below(6)).expect("it is small");
        let shapes = [(64, 64), (40, 60), (200, 25), (200, 150)];
        let (width, height) = shapes[usize::try_from(random.below(4)).expect("it is small")];
        let tiles = match random.below(4) {
            0 => TileShape::Rule {
                min_tile_pixels: None,
            },
            1 => TileShape::Time { aim: None },
            _ => TileShape::Size { width, height },
        };
        let mut farm = Self {
            coordinator: Coordinator::new(images, tiles),
            blocks_rendered: 0,
            workers: BTreeMap::new(),
            links: BTreeMap::new(),
            links_made: 0,
            incarnations: 0,
            agenda: BTreeMap::new(),
            planned: 0,
            now: Timestamp(0),
            streams: BTreeMap::new(),
            paused_until: Timestamp(0),
            troubles,
            random,
        };
        for id in 0..1 + farm.random.below(5) {
            farm.hire(id, Span(0));
        }
        farm.plan(Span::from_secs(1), Happening::Trouble);
        farm
    }

    /// Lets the farm work until the job is over, or until `end`; then the workers are
    /// told to stop, and everything must come to rest.
    pub(crate) fn run(&mut self, end: Span) {
        while !self.coordinator.is_done() && self.now.0 < end.0 && self.step() {}
        self.troubles = Troubles::NONE;
        for id in self.workers.keys().copied().collect::<Vec<_>>() {
            self.tell_worker(id, Event::StopAsked);
        }
        // The longest freeze that is drawn is 100 s.
        let rest = self.now + Span::from_secs(200);
        while self.now < rest && self.step() {}
        if self.coordinator.is_done() {
            assert!(self.workers.is_empty(), "whoever is asked to stop does");
            assert_eq!(self.coordinator.sched.workers().count(), 0);
            assert_eq!(self.coordinator.sched.next_deadline(), None);
        }
    }

    /// Lives through what comes next; says whether anything did.
    fn step(&mut self) -> bool {
        let happening = self.agenda.first_key_value().map(|(&(time, _), _)| time);
        let tick = self.next_tick();
        // What has arrived is told before a tick.
        let comes_first = |time| tick.is_none_or(|(due, _)| time <= due);
        if happening.is_some_and(comes_first) {
            if let Some(((time, _), happening)) = self.agenda.pop_first() {
                self.now = time;
                self.live_through(happening);
            }
        } else if let Some((due, clock)) = tick {
            self.now = due;
            self.tick(clock);
        } else {
            return false;
        }
        self.grant();
        true
    }

    /// Whose deadline is next; whoever is frozen looks at the clock later.
    fn next_tick(&self) -> Option<(Timestamp, Clock)> {
        let coordinator = self.coordinator.sched.next_deadline();
        let coordinator = coordinator.map(|due| (due.max(self.paused_until), Clock::Coordinator));
        let workers = self.workers.iter().filter_map(|(&id, worker)| {
            let due = worker.session.next_deadline()?;
            Some((due.max(worker.frozen_until), Clock::Worker(id)))
        });
        let (due, clock) = workers.chain(coordinator).min()?;
        Some((due.max(self.now), clock))
    }

    fn tick(&mut self, clock: Clock) {
        match clock {
            Clock::Coordinator => self.coordinator.tell(self.now, sched::Event::Tick),
            Clock::Worker(id) => self.tell_worker(id, Event::Tick),
        }
        let next = self.next_tick();
        let is_later = |(due, next)| next != clock || due > self.now;
        assert!(next.is_none_or(is_later), "a tick is worth sending");
    }

    fn live_through(&mut self, happening: Happening) {
        match happening {
            Happening::Start(id) => self.tell_worker(id, Event::Started),
            Happening::Dialled(id, link) => {
                if self.is_current(id, link) {
                    self.tell_worker(id, Event::Dialled);
                }
            }
            Happening::Lost(id, link) => {
                let newest = self.links.get(&id).copied();
                if newest.is_none_or(|newest| newest == link) {
                    self.links.remove(&id);
                    let reason = "cut".into();
                    self.tell_worker(id, Event::LinkLost { reason });
                }
            }
            Happening::Down(id, link, message) => {
                if self.is_current(id, link) {
                    self.worker_hears(id, message);
                }
            }
            Happening::Up(id, link, message) => self.coordinator_hears(id, link, message),
            Happening::Closed(worker, link) => {
                let link = LinkId(link);
                let event = sched::Event::LinkClosed { worker, link };
                self.coordinator.tell(self.now, event);
            }
            Happening::Disk(later) => self.coordinator.finishes(self.now, later),
            Happening::Rendered(id, thread, took) => self.worker_renders(id, thread, took),
            Happening::Trouble => self.trouble(),
        }
    }

    fn plan(&mut self, after: Span, happening: Happening) {
        self.plan_at(self.now + after, happening);
    }

    /// Whoever is frozen lives through it later, in the same order.
    fn plan_at(&mut self, time: Timestamp, happening: Happening) {
        let frozen_until = match &happening {
            Happening::Start(id)
            | Happening::Dialled(id, _)
            | Happening::Down(id, ..)
            | Happening::Lost(id, _)
            | Happening::Rendered(id, ..) => self.workers.get(id).map(|worker| worker.frozen_until),
            Happening::Up(..) | Happening::Closed(..) | Happening::Disk(_) => {
                Some(self.paused_until)
            }
            Happening::Trouble => None,
        };
        let time = time.max(frozen_until.unwrap_or_default());
        self.planned += 1;
        self.agenda.insert((time, self.planned), happening);
    }

    /// After a freeze: what was planned for those who are frozen is planned anew.
    fn plan_all_anew(&mut self) {
        for ((time, _), happening) in std::mem::take(&mut self.agenda) {
            self.plan_at(time, happening);
        }
    }

    fn is_current(&self, id: WorkerId, link: u64) -> bool {
        self.links.get(&id) == Some(&link)
    }

    fn hire(&mut self, id: u64, after: Span) {
        self.incarnations += 1;
        let id = WorkerId {
            id,
            incarnation: self.incarnations,
        };
        let threads = 1 + u32::try_from(self.random.below(3)).expect("it is small");
        let pace = Span::from_millis(20 + self.random.below(400));
        self.workers.insert(id, Worker::new(id, threads, pace));
        self.plan(after, Happening::Start(id));
    }

    fn tell_worker(&mut self, id: WorkerId, event: Event) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.tell(self.now, event);
        }
        self.grant();
    }

    fn worker_hears(&mut self, id: WorkerId, message: Down) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.hears(self.now, message);
        }
    }

    fn worker_renders(&mut self, id: WorkerId, thread: usize, took: Span) {
        let fails = self.random.happens(self.troubles.failures);
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.renders(self.now, thread, took, fails);
        }
    }

    fn coordinator_hears(&mut self, id: WorkerId, link: u64, message: Up) {
        if let Up::Block(block, _) = &message
            && self.random.happens(self.troubles.refusals)
        {
            return self.coordinator.refuses_for_now(id, *block);
        }
        self.coordinator.hears(self.now, id, link, message);
    }

    /// Grants what the shells wish for, until nobody wishes for anything.
    fn grant(&mut self) {
        for wish in self.coordinator.wishes() {
            match wish {
                coordinator::Wish::Send(id, message) => self.send_down(id, message),
                coordinator::Wish::Disk(later) => {
                    let took = self.random.span(Span::from_millis(5));
                    self.plan(took, Happening::Disk(later));
                }
                coordinator::Wish::Close(id) => self.cut(id),
            }
        }
        for id in self.workers.keys().copied().collect::<Vec<_>>() {
            let wishes = self.workers.get_mut(&id).map(Worker::wishes);
            for wish in wishes.unwrap_or_default() {
                self.grant_worker(id, wish);
            }
        }

        let leaving: Vec<WorkerId> = self
            .workers
            .iter()
            .filter(|(_, worker)| worker.gone)
            .map(|(&id, _)| id)
            .collect();
        for id in leaving {
            self.dismiss(id);
        }
    }

    fn grant_worker(&mut self, id: WorkerId, wish: worker::Wish) {
        match wish {
            worker::Wish::Dial => {
                self.links_made += 1;
                self.links.insert(id, self.links_made);
                let took = self.random.span(Span::from_millis(20));
                let happening = match self.random.below(10) {
                    0 if self.troubles.cuts > 0 => Happening::Lost(id, self.links_made),
                    _ => Happening::Dialled(id, self.links_made),
                };
                self.plan(took, happening);
            }
            worker::Wish::Close => self.cut_for(id, false),
            worker::Wish::Send(message) => self.send_up(id, message),
            worker::Wish::Render(thread) => {
                let pace = self.workers[&id].pace;
                let took = self.random.span(pace);
                self.plan(took, Happening::Rendered(id, thread, took));
            }
            worker::Wish::Exit => {}
        }
    }

    fn send_up(&mut self, id: WorkerId, message: Up) {
        let Some(&link) = self.links.get(&id) else {
            return;
        };
        let stream = match message {
            Up::Block(..) => "blocks",
            _ => "control",
        };
        self.send((link, stream), Happening::Up(id, link, message));
    }

    fn send_down(&mut self, id: WorkerId, message: Down) {
        let Some(&link) = self.links.get(&id) else {
            return;
        };
        let stream = match message {
            Down::Ack(..) | Down::BlockRefused(..) => "answers",
            _ => "orders",
        };
        self.send((link, stream), Happening::Down(id, link, message));
    }

    fn send(&mut self, stream: Stream, happening: Happening) {
        let arrival = self.now + self.random.span(Span::from_millis(25));
        let last = self.streams.entry(stream).or_default();
        *last = arrival.max(*last);
        let arrival = *last;
        if self.random.happens(self.troubles.repeats) {
            let late = arrival + self.random.span(Span::from_millis(500));
            self.plan_at(late, happening.clone());
        }
        self.plan_at(arrival, happening);
    }

    /// A link breaks; both ends notice, each in its time.
    fn cut(&mut self, id: WorkerId) {
        self.cut_for(id, true);
    }

    fn cut_for(&mut self, id: WorkerId, worker_notices: bool) {
        let Some(link) = self.links.remove(&id) else {
            return;
        };
        // What was on its way never arrives.
        self.agenda.retain(|_, happening| match happening {
            Happening::Up(of, on, _) => (*of, *on) != (id, link),
            Happening::Down(of, on, _) => (*of, *on) != (id, link),
            Happening::Dialled(of, on) => (*of, *on) != (id, link),
            _ => true,
        });
        let notices = self.random.span(Span::from_millis(300));
        self.plan(notices, Happening::Closed(id, link));
        if worker_notices {
            let notices = self.random.span(Span::from_millis(300));
            self.plan(notices, Happening::Lost(id, link));
        }
    }

    /// A worker's process is over; its goodbye is on its way, if it said one.
    fn dismiss(&mut self, id: WorkerId) {
        if let Some(worker) = self.workers.remove(&id) {
            self.blocks_rendered += worker.blocks_rendered;
            assert!(worker.blocks_kept() <= 12);
            if let Some(link) = self.links.remove(&id) {
                self.plan(Span::from_secs(1), Happening::Closed(id, link));
            }
            if !self.coordinator.is_done() {
                let after = self.random.span(Span::from_secs(3));
                self.hire(id.id, after);
            }
        }
    }

    fn trouble(&mut self) {
        let count = self.workers.len() as u64;
        if count > 0 {
            let pick = usize::try_from(self.random.below(count)).expect("it is small");
            let id = self.workers.keys().nth(pick).copied().expect("it is one");
            let troubles = self.troubles;
            if self.random.happens(troubles.cuts) {
                self.cut(id);
            }
            if self.random.happens(troubles.freezes) {
                let until = self.now + self.random.span(Span::from_secs(5));
                if let Some(worker) = self.workers.get_mut(&id) {
                    worker.frozen_until = until;
                }
                self.plan_all_anew();
            }
            if self.random.happens(troubles.leaves) {
                let event = match self.random.below(2) {
                    0 => Event::DrainAsked,
                    _ => Event::StopAsked,
                };
                self.tell_worker(id, event);
            }
            if self.random.happens(troubles.kills) && self.workers.contains_key(&id) {
                self.kill(id);
            }
        }
        if self.random.happens(self.troubles.pauses) {
            self.paused_until = self.now + self.random.span(Span::from_secs(5));
            self.plan_all_anew();
        }
        if !self.coordinator.is_done() {
            self.plan(Span::from_secs(1), Happening::Trouble);
        }
    }

    /// The process is gone at once; whether anybody notices is a matter of luck.
    fn kill(&mut self, id: WorkerId) {
        let noticed = self.random.below(2) == 0;
        if noticed {
            self.cut(id);
        } else if let Some(link) = self.links.remove(&id) {
            self.agenda.retain(|_, happening| {
                !matches!(happening, Happening::Up(of, on, _) if (*of, *on) == (id, link))
            });
        }

        if let Some(worker) = self.workers.remove(&id) {
            self.blocks_rendered += worker.blocks_rendered;
        }
        let after = self.random.span(Span::from_secs(3));
        self.hire(id.id, after);
    }
}
