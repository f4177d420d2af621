//! Ctrl-C, SIGTERM, SIGHUP and a queue's warnings as something to look at and to wait for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::thread;

use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::watch;

use crate::error::{Ending, Error};

/// Whether the user wants the program to stop. Clones share one answer.
#[derive(Clone, Debug)]
pub(crate) struct Stop {
    flag: Arc<AtomicBool>,
    told: watch::Receiver<bool>,
    tell: Arc<watch::Sender<bool>>,
}

impl Stop {
    /// One that only [`Stop::now`] sets.
    pub(crate) fn new() -> Self {
        let (tell, told) = watch::channel(false);
        Self {
            flag: Arc::default(),
            told,
            tell: Arc::new(tell),
        }
    }

    /// Listens from now on. The first signal asks the program to end by itself; the
    /// second one ends it at once.
    pub(crate) fn on_signals() -> Result<Self, Error> {
        let stop = Self::new();
        let listening = stop.clone();
        let failed = |error: std::io::Error| {
            Error::failed("cannot listen for Ctrl-C and SIGTERM").because(error)
        };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .build()
            .map_err(failed)?;
        let signals = {
            let _inside = runtime.enter();
            [
                SignalKind::interrupt(),
                SignalKind::terminate(),
                SignalKind::hangup(),
                // Queues announce the end of an allocation by these.
                SignalKind::user_defined1(),
                SignalKind::user_defined2(),
            ]
            .into_iter()
            .map(signal)
            .collect::<Result<Vec<_>, _>>()
            .map_err(failed)?
        };
        thread::Builder::new()
            .name("signals".into())
            .spawn(move || runtime.block_on(listening.listen(signals)))
            .map_err(failed)?;
        Ok(stop)
    }

    async fn listen(self, mut signals: Vec<Signal>) {
        loop {
            let came = std::future::poll_fn(|context| {
                let mut polled = signals.iter_mut().map(|signal| signal.poll_recv(context));
                polled.find(Poll::is_ready).unwrap_or(Poll::Pending)
            });
            if came.await.is_none() {
                return;
            }
            if self.is_set() {
                std::process::exit(Ending::Interrupted.code().into());
            }
            self.now();
        }
    }

    /// Asks for the end.
    pub(crate) fn now(&self) {
        self.flag.store(true, Ordering::Release);
        self.tell.send_replace(true);
    }

    /// Whether the end was asked for.
    pub(crate) fn is_set(&self) -> bool {
        self.flag.load(Ordering::Acquire)
    }

    /// Returns once the end is asked for.
    pub(crate) async fn wait(&self) {
        let mut told = self.told.clone();
        // The sender lives as long as `self`, so this cannot fail.
        let _ = told.wait_for(|told| *told).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_share_one_answer() {
        let stop = Stop::new();
        let other = stop.clone();
        assert!(!other.is_set());
        stop.now();
        assert!(other.is_set());
        tokio::runtime::Builder::new_current_thread()
            .build()
            .unwrap()
            .block_on(other.wait());
    }
}
