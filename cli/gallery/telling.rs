//! What a gallery says while it renders: a bar on a terminal, plain lines in a log.

use std::io::{self, IsTerminal as _};
use std::time::{Duration, Instant};

use super::index::Figure;
use crate::output::{self, Format};
use crate::progress::{Progress, duration};

/// How long a log may go without a line.
const SILENCE: Duration = Duration::from_secs(20);

/// How far one picture is.
pub(crate) struct Telling {
    what: String,
    total: u64,
    progress: Progress,
    lines: Option<Lines>,
}

/// Lines for where there is no terminal.
struct Lines {
    begun: Instant,
    last: Instant,
}

impl Telling {
    /// Of the figure that is number `at` of so many, counted from 1, with `total` pixels.
    pub(crate) fn new(
        format: Format,
        figure: &Figure,
        (at, of): (usize, usize),
        total: u64,
    ) -> Self {
        let what = format!("{at} of {of}: {} ({})", figure.name, figure.number);
        let wanted = format != Format::Quiet && !io::stderr().is_terminal();
        let now = Instant::now();
        Self {
            what,
            total,
            progress: Progress::new(format, total, 0),
            lines: wanted.then_some(Lines {
                begun: now,
                last: now,
            }),
        }
    }

    /// Says that so many pixels are done.
    pub(crate) fn update(&mut self, done: u64) {
        self.progress.update(done, &self.what);
        if let Some(lines) = &mut self.lines
            && lines.last.elapsed() >= SILENCE
        {
            lines.last = Instant::now();
            let share = 100 * done / self.total.max(1);
            output::say(format_args!("{}: {share} %", self.what));
        }
    }

    /// Ends it, the picture done or not.
    pub(crate) fn finish(self, picture: Picture) {
        self.progress.finish();
        if let (Some(lines), Picture::Done) = (self.lines, picture) {
            output::say(format_args!(
                "{}: {}",
                self.what,
                duration(lines.begun.elapsed())
            ));
        }
    }
}

/// Whether there is a picture in the end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Picture {
    Done,
    Failed,
}
