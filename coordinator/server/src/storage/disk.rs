//! A disk in trouble: what may pass is waited for.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::mpsc;

use crate::input::News;

/// How long a disk in trouble is left alone before it is tried again: nobody tells when it has room.
const RETRY_INTERVAL: Duration = Duration::from_millis(200);

/// Which thread waits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Hand {
    /// While it waits, nothing is acknowledged.
    Writer,
    /// While it waits, nothing is acknowledged.
    Committer,
    /// While it waits, images that are rendered are not finished.
    Encoder,
}

impl Hand {
    /// Whether workers would be late for no fault of theirs.
    pub(crate) fn holds_up_blocks(self) -> bool {
        match self {
            Self::Writer | Self::Committer => true,
            Self::Encoder => false,
        }
    }
}

/// Whether the coordinator stops.
#[derive(Debug, Default)]
pub(super) struct Stopping {
    is_set: Mutex<bool>,
    changed: Condvar,
}

impl Stopping {
    pub(super) fn set(&self) {
        *self.is_set.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.changed.notify_all();
    }

    pub(super) fn is_set(&self) -> bool {
        *self.is_set.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until it is set, but not for longer than this.
    fn wait(&self, limit: Duration) {
        let guard = self.is_set.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self
            .changed
            .wait_timeout_while(guard, limit, |is_set| !*is_set);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }
}

/// A thread's view of the disk, and its way to the loop.
#[derive(Debug)]
pub(super) struct Disk {
    hand: Hand,
    news: mpsc::Sender<News>,
    stopping: Arc<Stopping>,
}

impl Disk {
    pub(super) fn new(hand: Hand, news: mpsc::Sender<News>, stopping: Arc<Stopping>) -> Self {
        Self {
            hand,
            news,
            stopping,
        }
    }

    pub(super) fn is_stopping(&self) -> bool {
        self.stopping.is_set()
    }

    pub(super) fn say(&self, news: News) {
        // An error says that the loop has ended: nobody waits for an answer.
        let _ = self.news.blocking_send(news);
    }

    /// Tries until it works; `None` where the coordinator stops before, or where `is_wanted` says no more.
    pub(super) fn insist<T>(
        &self,
        is_wanted: impl Fn() -> bool,
        mut attempt: impl FnMut() -> Result<T, String>,
    ) -> Option<T> {
        let hand = self.hand;
        let mut told = None;
        let result = loop {
            match attempt() {
                Ok(done) => break Some(done),
                Err(_) if self.is_stopping() || !is_wanted() => break None,
                Err(sentence) => {
                    if told.as_ref() != Some(&sentence) {
                        self.say(News::Trouble(hand, Some(sentence.clone())));
                        told = Some(sentence);
                    }
                    self.stopping.wait(RETRY_INTERVAL);
                }
            }
        };
        if told.is_some() {
            self.say(News::Trouble(hand, None));
        }
        result
    }
}
