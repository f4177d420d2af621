//! How busy a site was, as the looks at its queue saw it: what shows whether `ahead` is enough (thesis §C.3.5).
//!
//! Between two looks nobody looks. Whether a slot was free is taken to change evenly from what one look left to what the next
//! one found; a queue that is seen to do nothing for the first time so counts for half the time since.

use std::collections::VecDeque;

/// Looks that are remembered: three days at one every 30 s.
pub const LOOKS_MAX: usize = 8_192;

/// What one look at a queue saw, and what followed from it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Look {
    /// When, milliseconds since 1970 (UTC).
    pub at_unix_ms: u64,
    /// Tasks that ran.
    pub running: u32,
    /// Tasks that waited in the queue.
    pub waiting: u32,
    /// Tasks that were submitted because of the look.
    pub submitted: u32,
    /// Whether the farm had more for the site than the site then held.
    pub has_more: bool,
}

/// The latest looks at a site.
#[derive(Clone, Debug, Default)]
pub struct Looks(VecDeque<Look>);

/// For how long a slot was free while nothing of the farm's waited in the queue, though the farm had more to render.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Free {
    /// The time that counts, milliseconds: whenever the farm had more than the site held.
    pub counted_ms: u64,
    /// Of that, the time in which a slot was free.
    pub free_ms: u64,
}

impl Looks {
    /// Remembers a look, and of too many forgets the oldest.
    pub fn saw(&mut self, look: Look) {
        if self.0.len() >= LOOKS_MAX {
            self.0.pop_front();
        }
        self.0.push_back(look);
    }

    /// The looks, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &Look> {
        self.0.iter()
    }
}

impl Look {
    /// Whether one of so many slots was free and nothing waited for it: before what followed from the look.
    fn found_free(&self, slots: u32) -> bool {
        self.waiting == 0 && self.running < slots
    }

    /// The same after it.
    fn left_free(&self, slots: u32) -> bool {
        self.submitted == 0 && self.found_free(slots)
    }
}

impl Free {
    /// What looks, in order, say of a site that lets the farm have so many slots.
    pub fn of(looks: &[Look], slots: u32) -> Self {
        let mut free = Self::default();
        for pair in looks.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            if !from.has_more {
                continue;
            }
            let time = to.at_unix_ms.saturating_sub(from.at_unix_ms);
            let ends = u64::from(from.left_free(slots)) + u64::from(to.found_free(slots));
            free.counted_ms += time;
            free.free_ms += time * ends / 2;
        }
        free
    }

    /// The share of the time, 0 to 1; `None` where no time counts.
    pub fn share(&self) -> Option<f64> {
        #[expect(
            clippy::cast_precision_loss,
            reason = "milliseconds of less than a thousand years"
        )]
        let share = self.free_ms as f64 / self.counted_ms as f64;
        (self.counted_ms > 0).then_some(share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOTS: u32 = 4;

    fn look(at_s: u64, [running, waiting, submitted]: [u32; 3], has_more: bool) -> Look {
        Look {
            at_unix_ms: at_s * 1_000,
            running,
            waiting,
            submitted,
            has_more,
        }
    }

    fn free(looks: &[Look]) -> [u64; 2] {
        let free = Free::of(looks, SLOTS);
        [free.free_ms / 1_000, free.counted_ms / 1_000]
    }

    #[test]
    fn a_slot_that_is_found_free_was_so_for_half_the_time() {
        let busy = look(0, [4, 9, 0], true);
        assert_eq!(free(&[busy, look(30, [4, 2, 0], true)]), [0, 30]);
        assert_eq!(free(&[busy, look(30, [3, 0, 12], true)]), [15, 30]);
        // What is submitted fills it.
        let filled = [busy, look(30, [0, 0, 12], true), look(60, [4, 8, 0], true)];
        assert_eq!(free(&filled), [15, 60]);
        let stays = [busy, look(30, [0, 0, 0], true), look(60, [0, 0, 12], true)];
        assert_eq!(free(&stays), [45, 60]);
        // One that runs in every slot leaves none free, whatever waits.
        assert_eq!(free(&[busy, look(30, [4, 0, 0], true)]), [0, 30]);
    }

    #[test]
    fn what_is_not_used_because_there_is_nothing_to_render_is_not_free() {
        let last = look(0, [4, 9, 0], false);
        assert_eq!(free(&[last, look(30, [0, 0, 0], false)]), [0, 0]);
        assert_eq!(Free::of(&[last], SLOTS).share(), None);
        let half = [look(0, [1, 0, 0], true), look(10, [4, 1, 0], true)];
        assert_eq!(Free::of(&half, SLOTS).share(), Some(0.5));
    }

    #[test]
    fn the_oldest_looks_are_forgotten() {
        let mut looks = Looks::default();
        for at in 0..LOOKS_MAX as u64 + 2 {
            looks.saw(look(at, [0; 3], false));
        }
        assert_eq!(looks.iter().count(), LOOKS_MAX);
        assert_eq!(looks.iter().next().unwrap().at_unix_ms, 2_000);
    }
}
