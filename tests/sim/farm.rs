//! The world: time, the network, and what goes wrong in it.

use std::collections::BTreeMap;

use model::{Span, Timestamp, WorkerId};
use sched::LinkId;
use session::Event;

use crate::coordinator::{self, Coordinator, Later};
use crate::disk::Pixels;
use crate::message::{Down, Up};
use crate::plan::{Plan, Troubles};
use crate::random::Random;
use crate::site::Site;
use crate::user::User;
use crate::worker::{self, Worker};

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
    /// The coordinator starts again.
    Restart,
    /// There is room on the disk again.
    Room,
    /// A second has passed.
    Trouble,
}

/// Who is told that time has passed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Whose {
    Coordinator,
    Worker(WorkerId),
    Site(usize),
}

/// Messages of one direction and kind stay in order.
type Stream = (u64, &'static str);

pub(crate) struct Farm {
    pub(crate) coordinator: Coordinator,
    user: User,
    workers: BTreeMap<WorkerId, Worker>,
    sites: Vec<Site>,
    /// Events of workers that are gone.
    events: u64,
    /// The link of each worker, as the network sees it.
    links: BTreeMap<WorkerId, u64>,
    links_made: u64,
    incarnations: u64,
    /// Workers that make wrong pixels, of all there ever were.
    liars: u64,
    /// By time, then as they were planned.
    agenda: BTreeMap<(Timestamp, u64), Happening>,
    planned: u64,
    now: Timestamp,
    streams: BTreeMap<Stream, Timestamp>,
    paused_until: Timestamp,
    /// Nobody is reached before.
    parted_until: BTreeMap<WorkerId, Timestamp>,
    troubles: Troubles,
    random: Random,
}

/// After so long nothing goes wrong any more…
const TROUBLED: Span = Span::from_secs(1_200);

/// …and after so long everything must be done, even by one slow thread.
const END: Span = Span::from_secs(24 * 3_600);

impl Farm {
    pub(crate) fn new(plan: Plan) -> Self {
        let mut random = Random::new(plan.key);
        let mut farm = Self {
            coordinator: Coordinator::new(plan),
            user: User::new(&plan, &mut random),
            workers: BTreeMap::new(),
            sites: Vec::new(),
            events: 0,
            links: BTreeMap::new(),
            links_made: 0,
            incarnations: 0,
            liars: 0,
            agenda: BTreeMap::new(),
            planned: 0,
            now: Timestamp(0),
            streams: BTreeMap::new(),
            paused_until: Timestamp(0),
            parted_until: BTreeMap::new(),
            troubles: plan.troubles,
            random,
        };
        for id in 0..plan.workers {
            farm.hire(id, Span(0));
        }
        for number in 0..plan.sites {
            let mut site = Site::new(number, &mut farm.random);
            site.begins(farm.now, &mut farm.coordinator);
            farm.sites.push(site);
        }
        farm.plan(Span(0), Happening::Trouble);
        farm
    }

    /// Events that the scheduler and the sessions were told.
    pub(crate) fn events(&self) -> u64 {
        let here: u64 = self.workers.values().map(|worker| worker.events).sum();
        self.coordinator.events + self.events + here
    }

    fn is_done(&self) -> bool {
        self.coordinator.is_up && self.user.is_content(&self.coordinator.sched)
    }

    /// Lets the farm work until its jobs are over; then the workers are told to stop, and everything
    /// must come to rest.
    pub(crate) fn run(&mut self) {
        while !self.is_done() && self.step() {
            assert!(self.now.0 < END.0, "every job ends: {:?}", self.user);
            if self.now.0 > TROUBLED.0 {
                self.troubles = Troubles::NONE;
            }
        }
        assert!(self.is_done(), "something goes on");
        self.troubles = Troubles::NONE;
        for id in self.workers.keys().copied().collect::<Vec<_>>() {
            self.tell_worker(id, Event::StopAsked);
        }
        for site in &mut self.sites {
            site.leaves();
        }
        // The longest freeze that is drawn is 100 s.
        let rest = self.now + Span::from_secs(300);
        while self.now < rest && self.step() {}
        assert!(self.workers.is_empty(), "whoever is asked to stop does");
        let has_left = self.sites.iter().all(Site::has_left);
        assert!(has_left, "nothing is left at a site");
        assert!(self.coordinator.is_up && self.coordinator.is_at_rest());
        assert_eq!(
            self.coordinator.sched.workers().count(),
            0,
            "every lease ends, and whoever is gone is forgotten"
        );
        assert_eq!(self.coordinator.disk.images(), [], "scratch files are gone");
        self.coordinator.sched.check_invariants();
        self.user.looks_at(&self.coordinator);
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
        } else if let Some((due, whose)) = tick {
            self.now = due;
            self.tick(whose);
        } else {
            return false;
        }
        self.grant();
        true
    }

    /// Whose deadline is next; whoever is frozen looks at the clock later.
    fn next_tick(&self) -> Option<(Timestamp, Whose)> {
        let coordinator = self.coordinator.next_deadline();
        let coordinator = coordinator.map(|due| (due.max(self.paused_until), Whose::Coordinator));
        let workers = self.workers.iter().filter_map(|(&id, worker)| {
            let due = worker.next_deadline()?;
            Some((due, Whose::Worker(id)))
        });
        let sites = self.sites.iter().enumerate().filter_map(|(number, site)| {
            // It is of the coordinator's process.
            let due = site.due()?.max(self.paused_until);
            Some((due, Whose::Site(number)))
        });
        let (due, whose) = workers.chain(coordinator).chain(sites).min()?;
        Some((due.max(self.now), whose))
    }

    fn tick(&mut self, whose: Whose) {
        match whose {
            Whose::Coordinator => self.coordinator.tell(self.now, sched::Event::Tick),
            Whose::Worker(id) => self.tell_worker(id, Event::Tick),
            Whose::Site(number) => {
                let (now, links) = (self.now, &mut self.links_made);
                return self.sites[number].goes_on(now, links, &mut self.coordinator);
            }
        }
        let next = self.next_tick();
        let is_later = |(due, next)| next != whose || due > self.now;
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
            Happening::Up(id, link, message) => {
                self.coordinator.hears(self.now, id, link, message);
            }
            Happening::Restart => {
                self.coordinator.restart(self.now);
                for site in &mut self.sites {
                    site.begins(self.now, &mut self.coordinator);
                }
            }
            Happening::Room => self.coordinator.disk.is_full = false,
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
            Happening::Restart | Happening::Room | Happening::Trouble => None,
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
        let slower = if self.random.happens(self.troubles.slow) {
            10
        } else {
            1
        };
        let pace = Span::from_millis(20 + self.random.below(400)).times(slower);
        let mut worker = Worker::new(self.now, id, threads, pace);
        worker.lies = self.random.happens(self.troubles.liars);
        self.liars += u64::from(worker.lies);
        self.workers.insert(id, worker);
        self.plan(after, Happening::Start(id));
    }

    /// One liar among at least two others is found where every tile is verified, or where it was
    /// found at all: no frame that stays has a wrong pixel.
    pub(crate) fn check_frames(&self, plan: &Plan) {
        let is_alone = self.liars == 1 && plan.workers > 2;
        let is_found = plan.verify == 1_000_000 || self.coordinator.witness.convicted > 0;
        if is_alone && is_found {
            assert_eq!(
                self.coordinator.wrong_frames(),
                0,
                "a liar's pixels are not kept"
            );
        }
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
        let lies = self.random.below(2) == 0;
        if let Some(worker) = self.workers.get_mut(&id) {
            let pixels = if worker.lies && lies {
                Pixels::Wrong
            } else {
                Pixels::Right
            };
            worker.renders(self.now, thread, took, (!fails).then_some(pixels));
        }
    }

    /// Grants what the shells wish for, until nobody wishes for anything.
    fn grant(&mut self) {
        for wish in self.coordinator.wishes() {
            match wish {
                coordinator::Wish::Send(id, message) => match self.site(id) {
                    // In the same process.
                    Some(number) => self.sites[number].hears(self.now, message, &self.coordinator),
                    None => self.send_down(id, message),
                },
                coordinator::Wish::Disk(later, mean) => {
                    let took = self.random.span(mean);
                    self.plan(took, Happening::Disk(later));
                }
                coordinator::Wish::Close(id) => match self.site(id) {
                    Some(number) => {
                        let is_lost = !self.sites[number].has_left();
                        self.coordinator.witness.lost += u64::from(is_lost);
                        self.sites[number].is_cut(self.now);
                    }
                    None => self.cut(id),
                },
                coordinator::Wish::Tell(submission, job) => self.user.hears(submission, job),
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

    /// The site that is this worker to the scheduler.
    fn site(&self, id: WorkerId) -> Option<usize> {
        self.sites.iter().position(|site| site.is(id))
    }

    fn grant_worker(&mut self, id: WorkerId, wish: worker::Wish) {
        match wish {
            worker::Wish::Dial => {
                self.links_made += 1;
                self.links.insert(id, self.links_made);
                let took = self.random.span(Span::from_millis(20));
                let parted = self
                    .parted_until
                    .get(&id)
                    .is_some_and(|&until| until > self.now);
                let happening = match self.random.below(10) {
                    _ if parted || !self.coordinator.is_up => Happening::Lost(id, self.links_made),
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
            self.events += worker.events;
            assert!(worker.blocks_kept() <= 12);
            if let Some(link) = self.links.remove(&id) {
                self.plan(Span::from_secs(1), Happening::Closed(id, link));
            }
            if !self.is_done() {
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
                self.freeze(id, until);
            }
            if self.random.happens(troubles.clocks) {
                self.trouble_clock(id);
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
        self.trouble_sites();
        self.trouble_coordinator();
        if self.coordinator.is_up {
            let wishes = self.random.happens(self.troubles.wishes);
            for event in self
                .user
                .wants(&self.coordinator.sched, wishes, &mut self.random)
            {
                self.coordinator.tell(self.now, event);
            }
            if self.now > self.paused_until + Span::from_secs(1) {
                let sched = &self.coordinator.sched;
                self.coordinator.witness.check_leases(self.now, sched);
            }
        }
        if !self.is_done() {
            self.plan(Span::from_secs(1), Happening::Trouble);
        }
    }

    /// A worker does nothing before.
    fn freeze(&mut self, id: WorkerId, until: Timestamp) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.frozen_until = until;
        }
        self.plan_all_anew();
    }

    fn trouble_clock(&mut self, id: WorkerId) {
        let Some(worker) = self.workers.get_mut(&id) else {
            return;
        };
        let kind = self.random.below(3);
        if kind == 0 {
            let ahead = self.random.span(Span::from_secs(10));
            return worker.clock.jumps(ahead);
        }
        let until = self.now + self.random.span(Span::from_secs(5));
        worker.clock.stands_still(self.now, until);
        // As on a machine that sleeps: nothing happens there meanwhile.
        if kind == 1 {
            self.freeze(id, until);
        }
    }

    fn trouble_sites(&mut self) {
        for site in &mut self.sites {
            site.dies(self.troubles.deaths);
            if self.random.happens(self.troubles.aways) {
                site.is_away(self.now + self.random.span(Span::from_secs(60)));
            }
        }
    }

    fn trouble_coordinator(&mut self) {
        let troubles = self.troubles;
        if self.random.happens(troubles.partitions) {
            let until = self.now + self.random.span(Span::from_secs(6));
            for id in self.workers.keys().copied().collect::<Vec<_>>() {
                if self.random.below(2) == 0 {
                    self.parted_until.insert(id, until);
                    self.cut(id);
                }
            }
        }
        if self.random.happens(troubles.pauses) {
            self.paused_until = self.now + self.random.span(Span::from_secs(5));
            self.plan_all_anew();
        }
        if self.random.happens(troubles.jumps) {
            let back = self.random.below(4) == 0;
            let jump = self.random.span(Span::from_secs(10)).0;
            let skew = self.coordinator.skew;
            self.coordinator.skew = if back {
                skew.saturating_sub(1_000_000)
            } else {
                skew + jump
            };
        }
        if self.random.happens(troubles.fulls) && !self.coordinator.disk.is_full {
            self.coordinator.disk.is_full = true;
            let full = self.random.span(Span::from_secs(8));
            self.plan(full, Happening::Room);
        }
        if self.coordinator.is_up && self.random.happens(troubles.crashes) {
            self.crash();
        }
    }

    /// The coordinator's machine loses its power, and what was on its way to it or planned by it.
    fn crash(&mut self) {
        self.coordinator.crash(&mut self.random);
        for site in &mut self.sites {
            site.ends();
        }
        self.agenda
            .retain(|_, happening| !matches!(happening, Happening::Disk(_)));
        for id in self.links.keys().copied().collect::<Vec<_>>() {
            self.cut(id);
        }
        // It remembers no link that it could hear the end of.
        self.agenda
            .retain(|_, happening| !matches!(happening, Happening::Closed(..) | Happening::Up(..)));
        let down = self.random.span(Span::from_secs(3));
        self.plan(down, Happening::Restart);
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
            self.events += worker.events;
        }
        let after = self.random.span(Span::from_secs(3));
        self.hire(id.id, after);
    }
}
