//! A progress bar with rate and time left, on standard error, where that is a terminal.

use std::fmt::Display;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::output::Format;

/// Work that takes less time is not worth a bar.
const DELAY: Duration = Duration::from_secs(1);

/// How far some work is, counted in steps of its own.
pub(crate) struct Progress {
    bar: ProgressBar,
    started: Instant,
    /// Steps that were done before it started, which no rate counts.
    before: u64,
    visible: Visible,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Visible {
    Never,
    Later,
    Now,
}

impl Progress {
    /// A bar of `total` steps, of which `before` need not be done any more.
    pub(crate) fn new(format: Format, total: u64, before: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        let style = ProgressStyle::with_template("{bar:28} {percent:>3} %  {msg}")
            .expect("the template is well formed")
            .progress_chars("█▉▊▋▌▍▎▏ ");
        bar.set_style(style);
        bar.set_position(before);
        Self {
            bar,
            started: Instant::now(),
            before,
            visible: if format == Format::Quiet {
                Visible::Never
            } else {
                Visible::Later
            },
        }
    }

    /// Says that `done` of the steps are done, and what else is worth knowing.
    pub(crate) fn update(&mut self, done: u64, about: impl Display) {
        let left = self.seconds_left(done);
        self.update_with(done, about, left);
    }

    /// The same, where somebody knows better how long it will take.
    pub(crate) fn update_with(&mut self, done: u64, about: impl Display, left: Option<Duration>) {
        if self.visible == Visible::Later && self.started.elapsed() >= DELAY {
            self.visible = Visible::Now;
            // Draws nothing where standard error is no terminal.
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        self.bar.set_position(done);
        let left = match left {
            Some(left) => format!(", {} left", duration(left)),
            None => String::new(),
        };
        self.bar.set_message(format!("{about}{left}"));
    }

    /// Says that so many steps were done before it started, which is sometimes known late.
    pub(crate) fn set_before(&mut self, before: u64) {
        self.before = before;
    }

    /// How many units a second were done since the start, of `units` done since then.
    pub(crate) fn rate(&self, units: f64) -> f64 {
        units / self.started.elapsed().as_secs_f64().max(1e-3)
    }

    /// Prints a line above the bar.
    pub(crate) fn say(&self, sentence: impl Display) {
        self.bar.suspend(|| crate::output::say(sentence));
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn seconds_left(&self, done: u64) -> Option<Duration> {
        let total = self.bar.length()?;
        let since = done.checked_sub(self.before).filter(|steps| *steps > 0)?;
        let rate = self.rate(since as f64);
        let left = total.saturating_sub(done) as f64 / rate;
        Duration::try_from_secs_f64(left).ok()
    }
}

/// A length of time for people: `12 s`, `3 min 20 s`, `2 h 5 min`.
pub(crate) fn duration(time: Duration) -> String {
    let seconds = time.as_secs();
    match seconds {
        0..=9 => format!("{:.1} s", time.as_secs_f64()),
        10..=59 => format!("{seconds} s"),
        60..=3599 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
    }
}

/// A number for people, with three digits and a prefix: `812 k`, `1.23 M`.
pub(crate) fn amount(number: f64) -> String {
    let (scaled, prefix) = match number {
        n if n >= 1e12 => (n / 1e12, " T"),
        n if n >= 1e9 => (n / 1e9, " G"),
        n if n >= 1e6 => (n / 1e6, " M"),
        n if n >= 1e3 => (n / 1e3, " k"),
        n => (n, " "),
    };
    let digits = match scaled {
        n if n >= 100.0 => 0,
        n if n >= 10.0 => 1,
        _ => 2,
    };
    format!("{scaled:.digits$}{prefix}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_numbers_for_people() {
        assert_eq!(duration(Duration::from_millis(2_340)), "2.3 s");
        assert_eq!(duration(Duration::from_secs(59)), "59 s");
        assert_eq!(duration(Duration::from_secs(200)), "3 min 20 s");
        assert_eq!(duration(Duration::from_secs(7_500)), "2 h 5 min");
        assert_eq!(amount(812_300.0), "812 k");
        assert_eq!(amount(1_234_000.0), "1.23 M");
        assert_eq!(amount(12.34), "12.3 ");
    }

    #[test]
    fn what_was_done_before_makes_no_rate() {
        let progress = Progress::new(Format::Table, 100, 60);
        assert_eq!(progress.seconds_left(60), None);
        assert!(progress.seconds_left(70).is_some());
    }
}
