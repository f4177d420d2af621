//! A scheduler that is told events, one after the other, beside a twin and a bystander.

use model::{Begun, Span, Timestamp, WorkerId};
use sched::{Command, Config, Effect, Event, Sched};

use crate::bystander::Bystander;
use crate::situation::EPOCH;

/// The scheduler, and what a bystander makes of its words.
pub(crate) struct History {
    pub(crate) sched: Sched,
    pub(crate) now: Timestamp,
    /// What was told, and how often the scratch file of its image had been dropped by then.
    pub(crate) told: Vec<(Event, u32)>,
    pub(crate) links: u64,
    /// What workers had begun when the coordinator died.
    pub(crate) begun: Vec<(WorkerId, Begun)>,
    pub(crate) seen: Bystander,
}

pub(crate) fn config() -> Config {
    Config {
        images_in_flight_max: 2,
        // A third of all tiles.
        verify: 333_333,
        aside: Span::from_secs(20),
        ..Config::new(EPOCH)
    }
}

impl History {
    pub(crate) fn new() -> Self {
        Self {
            sched: Sched::new(config()),
            now: Timestamp(1),
            told: Vec::new(),
            links: 0,
            begun: Vec::new(),
            seen: Bystander::default(),
        }
    }

    pub(crate) fn tell(&mut self, event: Event) {
        let mut effects = Vec::new();
        let mut twin = self.sched.clone();
        self.sched.handle(self.now, event.clone(), &mut effects);
        self.sched.check_invariants();
        let mut again = Vec::new();
        twin.handle(self.now, event.clone(), &mut again);
        assert_eq!(effects, again, "the same event gives the same effects");
        let is_command = matches!(event, Event::Command { .. });
        let drops = self.seen.drops_of(&event);
        self.told.push((event, drops));
        self.seen.forget_what_goes_on(&self.sched);
        if is_command {
            self.seen.drop_what_waits_again(&self.sched);
        }
        let mut given_up = Vec::new();
        for effect in effects {
            match effect {
                Effect::GiveUp { image, reason } => {
                    given_up.push(Event::ImageFailed { image, reason });
                }
                Effect::RenderAgain { image, .. } => given_up.push(Event::Command {
                    job: image.job,
                    command: Command::Again(image.image),
                }),
                effect => self.seen.hear(&self.sched, effect),
            }
        }
        self.seen.check(&self.sched);
        for event in given_up {
            self.tell(event);
        }
    }
}
