//! The power fails, and a coordinator begins again with what is there.

use std::collections::BTreeSet;

use model::{ImageRef, Timestamp};
use sched::{Effect, Sched};
use store::Store as _;

use super::effects::Held;
use super::{Coordinator, config};
use crate::random::Random;

impl Coordinator {
    /// The machine's power fails.
    pub(crate) fn crash(&mut self, random: &mut Random) {
        let is_committing = self.group.as_ref().is_some_and(|group| group.is_synced);
        if is_committing && !self.disk.is_full && random.below(2) == 0 {
            let committed = self.store.commit(&self.entries());
            committed.expect("there is room");
        }
        // Where everything was committed, nothing may be missing.
        self.witness.before = self.is_at_rest().then(|| self.sched.clone());
        self.store = std::mem::take(&mut self.store).crash();
        self.disk.crash(random);
        self.is_up = false;
        self.orders.clear();
        self.group = None;
        self.is_writing_planned = false;
        self.held.clear();
        self.committed.clear();
        self.wishes.clear();
        self.witness.crash();
        self.sched = Sched::new(config(self.epoch, &self.plan));
    }

    /// A coordinator starts over what is there.
    pub(crate) fn restart(&mut self, now: Timestamp) {
        self.epoch += 1;
        self.is_up = true;
        self.sched = Sched::new(config(self.epoch, &self.plan));
        let recalled = self.store.recall().expect("it is in memory");
        let mut effects = Vec::new();
        for (_, event) in recalled.events() {
            self.events += 1;
            self.sched
                .handle(Timestamp(now.0 + self.skew), event, &mut effects);
        }
        self.sched.check_invariants();
        let is_honest = self.plan.troubles.liars == 0;
        let mut begun = BTreeSet::new();
        for job in &recalled.jobs {
            for block in &job.blocks {
                let image = ImageRef {
                    job: job.job,
                    image: block.image,
                };
                begun.insert(image);
                let holds = self.disk.holds(image, block.rect, block.pixels);
                assert!(
                    holds || !is_honest,
                    "{image:?}: what is committed was synced"
                );
            }
        }
        self.witness.compare(&self.sched, &recalled);
        for image in self.disk.images() {
            if !begun.contains(&image) {
                self.disk.remove(image);
            }
        }
        for effect in effects {
            match effect {
                // For nobody that is here.
                Effect::Ack { .. } | Effect::Submitted { .. } => {}
                effect => {
                    let about = self.about(&effect);
                    self.held.push_back(Held::Effect(effect, about));
                }
            }
        }
        self.flush(now);
    }
}
