//! How long the parts of a block took, by a clock that the caller brings: this crate reads none.

use core::ops::AddAssign;

/// Tells nanoseconds since any instant that stays the same.
pub type Clock = fn() -> u64;

macro_rules! parts {
    ($($(#[doc = $doc:literal])+ $part:ident $name:literal,)+) => {
        /// A part of the work on a block.
        #[derive(Clone, Copy, PartialEq, Eq, Debug)]
        pub enum Part {
            $($(#[doc = $doc])+ $part,)+
        }

        impl Part {
            /// Every part, in the order of the work.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$part),+];

            /// What it is called.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$part => $name,)+
                }
            }
        }
    };
}

parts! {
    /// Sampling: where and when the image is looked at, and the rays from there.
    Sampling "sampling",
    /// Camera rays that are followed together.
    Bundles "bundles",
    /// Camera rays that are searched one by one.
    Search "search",
    /// Roots brought to their last bits.
    Polish "polish",
    /// Gradients where rays met the surface.
    Normals "normals",
    /// Rays towards the sun, from beginning to end.
    Shadows "shadows",
    /// Light from the surface.
    Shading "shading",
    /// Light from sky and clouds.
    Sky "sky",
    /// Samples that become pixels.
    Film "film",
}

/// Time per part, nanoseconds.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Times([u64; Part::ALL.len()]);

impl Times {
    /// Every part with its nanoseconds, in the order of the work.
    pub fn parts(&self) -> impl Iterator<Item = (Part, u64)> {
        Part::ALL.into_iter().zip(self.0)
    }
}

impl AddAssign for Times {
    fn add_assign(&mut self, other: Self) {
        for (mine, other) in self.0.iter_mut().zip(other.0) {
            *mine += other;
        }
    }
}

/// Puts all time between two readings down to the part under way; without a clock it does nothing.
#[derive(Default)]
pub(crate) struct Stopwatch {
    clock: Option<Clock>,
    under_way: Option<(Part, u64)>,
    /// What was measured so far.
    pub(crate) times: Times,
}

impl Stopwatch {
    /// Stands still until a part begins.
    pub(crate) fn new(clock: Option<Clock>) -> Self {
        Self {
            clock,
            ..Self::default()
        }
    }

    /// A part begins, and what was under way ends.
    pub(crate) fn begin(&mut self, part: Part) {
        self.turn(Some(part));
    }

    /// What was under way ends.
    pub(crate) fn stop(&mut self) {
        self.turn(None);
    }

    fn turn(&mut self, next: Option<Part>) {
        let Some(clock) = self.clock else { return };
        let now = clock();
        if let Some((part, since)) = self.under_way {
            self.times.0[part as usize] += now.saturating_sub(since);
        }
        self.under_way = next.map(|part| (part, now));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn time_belongs_to_the_part_under_way() {
        // 1, 10, 100, …: every difference says between which readings it lies.
        fn clock() -> u64 {
            static NEXT: AtomicU64 = AtomicU64::new(1);
            NEXT.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |now| Some(now * 10))
                .unwrap_or_default()
        }
        let mut stopwatch = Stopwatch::new(Some(clock));
        stopwatch.begin(Part::Search);
        stopwatch.begin(Part::Polish);
        stopwatch.begin(Part::Search);
        stopwatch.stop();
        stopwatch.begin(Part::Film);
        stopwatch.stop();
        let times: Vec<_> = stopwatch
            .times
            .parts()
            .filter(|(_, time)| *time > 0)
            .map(|(part, time)| (part.name(), time))
            .collect();
        assert_eq!(
            times,
            [("search", 9 + 900), ("polish", 90), ("film", 90_000)]
        );
    }

    #[test]
    fn without_a_clock_nothing_is_measured() {
        let mut stopwatch = Stopwatch::new(None);
        stopwatch.begin(Part::Search);
        stopwatch.stop();
        assert_eq!(stopwatch.times, Times::default());
    }
}
