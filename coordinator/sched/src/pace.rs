//! How fast a worker's threads are.
//!
//! *Speed* is what a thread gets done of what was expected of it, times 1,024: what the farm
//! took for the same pixels before is the measure, so 1,024 is the usual worker.

use model::Span;

use crate::costs::scale;

/// The speed of a worker of which nothing is known.
pub(crate) const SPEED_USUAL: u32 = 1_024;

/// Blocks after which half of the past is forgotten.
const BLOCKS_REMEMBERED: u32 = 256;

/// A worker's speed, measured block by block.
#[derive(Clone, Debug)]
pub(crate) struct Pace {
    cost: u64,
    time: u64,
    blocks: u32,
    speed: u32,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            cost: 0,
            time: 0,
            blocks: 0,
            speed: SPEED_USUAL,
        }
    }
}

impl Pace {
    /// Notes that a thread took `elapsed` over a block that was expected to cost `cost`.
    pub(crate) fn note(&mut self, cost: u64, elapsed: Span) {
        if self.blocks == 0 {
            // The first blocks do not make a worker a thousand times as fast as another.
            (self.cost, self.time) = (cost, cost);
        }
        self.cost = self.cost.saturating_add(cost);
        self.time = self.time.saturating_add(elapsed.0);
        self.blocks += 1;
        if self.blocks >= BLOCKS_REMEMBERED {
            self.blocks /= 2;
            self.cost /= 2;
            self.time /= 2;
        }
        self.speed = self.measured();
    }

    /// The speed; from 1/64 of the usual to 64 times that.
    pub(crate) fn speed(&self) -> u32 {
        self.speed
    }

    fn measured(&self) -> u32 {
        if self.time == 0 || self.cost == 0 {
            return SPEED_USUAL;
        }
        let speed = scale(self.cost, u64::from(SPEED_USUAL), self.time);
        let speed = speed.clamp(u64::from(SPEED_USUAL / 64), u64::from(SPEED_USUAL) * 64);
        u32::try_from(speed).unwrap_or(SPEED_USUAL)
    }
}

/// How long work of a cost takes at a speed.
pub(crate) fn time_of(cost: u64, speed: u32) -> Span {
    Span(scale(cost, u64::from(SPEED_USUAL), u64::from(speed)))
}

/// What is got done in a time at a speed.
pub(crate) fn cost_of(time: Span, speed: u32) -> u64 {
    scale(time.0, u64::from(speed), u64::from(SPEED_USUAL))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_learnt_and_learnt_anew() {
        let mut pace = Pace::default();
        assert_eq!(pace.speed(), SPEED_USUAL);
        for _ in 0..100 {
            pace.note(3_000, Span(1_000));
        }
        assert!((2_900..=3_072).contains(&pace.speed()), "{}", pace.speed());
        for _ in 0..2_000 {
            pace.note(1_000, Span(2_000));
        }
        assert!((505..=540).contains(&pace.speed()), "{}", pace.speed());
        assert_eq!(time_of(1_000, 512), Span(2_000));
        assert_eq!(cost_of(Span(2_000), 512), 1_000);
    }
}
