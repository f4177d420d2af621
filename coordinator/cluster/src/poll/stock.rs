//! How many images a polled site holds, so that no slot waits for work from one look to the next (thesis §C.3.5).
//!
//! An image that has begun is no stock: its last tasks run while the next image's already wait for nothing but a slot.
//! So a site holds the images that have begun and, behind them, `ahead` that have not; more where that does not last.

/// Images that wait behind those that have begun, at most.
const BEHIND_MAX: u32 = 64;

/// The stock lasts for so many times the tasks that begin between two looks.
const LASTS: u32 = 2;

/// Of the most tasks that began between two looks, one in so many is forgotten at each look.
const FORGETS: u32 = 8;

/// What was seen at a look.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Flow {
    /// Images that are held, of which a task has begun.
    pub(super) begun: u32,
    /// Tasks that have begun since the last look.
    pub(super) tasks_begun: u32,
    /// Tasks that an image has.
    pub(super) image_tasks: u32,
}

/// The stock of a site.
#[derive(Clone, Debug)]
pub(super) struct Stock {
    /// By the site's word; where it is 0 an image follows when the one before is whole.
    ahead: u32,
    begun: u32,
    behind: u32,
    /// The most tasks that began between two looks, of late.
    pace: u32,
}

impl Stock {
    pub(super) fn new(ahead: u32) -> Self {
        Self {
            ahead,
            begun: 0,
            behind: ahead,
            pace: 0,
        }
    }

    /// Images that the site should hold.
    pub(super) fn credit(&self) -> u32 {
        self.begun.max(1).saturating_add(self.behind)
    }

    /// Learns from a look.
    pub(super) fn saw(&mut self, flow: Flow) {
        self.begun = flow.begun;
        if self.ahead == 0 {
            return;
        }
        let kept = self.pace - self.pace.div_ceil(FORGETS);
        self.pace = flow.tasks_begun.max(kept);
        let lasts = self.pace.saturating_mul(LASTS);
        let behind = lasts.div_ceil(flow.image_tasks.max(1));
        self.behind = behind.min(BEHIND_MAX).max(self.ahead);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(ahead: u32, flows: &[(u32, u32)]) -> u32 {
        let mut stock = Stock::new(ahead);
        for &(begun, tasks_begun) in flows {
            stock.saw(Flow {
                begun,
                tasks_begun,
                image_tasks: 48,
            });
        }
        stock.credit()
    }

    #[test]
    fn behind_what_has_begun_there_is_what_the_site_says() {
        assert_eq!([0, 1, 2].map(|ahead| after(ahead, &[])), [1, 2, 3]);
        assert_eq!([0, 1, 2].map(|ahead| after(ahead, &[(1, 4)])), [1, 2, 3]);
        // The last tasks of one image run beside the first of the next.
        assert_eq!(after(1, &[(1, 4), (2, 4)]), 3);
    }

    #[test]
    fn where_that_does_not_last_there_is_more_and_not_for_ever() {
        assert_eq!(after(1, &[(1, 24)]), 2);
        assert_eq!(after(1, &[(1, 25)]), 3);
        assert_eq!(after(1, &[(3, 480)]), 23);
        assert_eq!(after(1, &[(3, u32::MAX)]), 3 + BEHIND_MAX);
        let slower = [&[(3, 480)][..], &[(1, 1); 60]].concat();
        assert_eq!(after(1, &slower), 2);
        // Who wants nothing to wait gets that.
        assert_eq!(after(0, &[(3, 480), (1, 480)]), 1);
    }
}
