//! Asking a worker to leave.

use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;

/// What a worker may be asked from outside.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ask {
    /// Leave soon: finish no tile, give back, say goodbye. Asked a second time: at once.
    Stop,
    /// Finish the tiles that are held, take no more, then leave.
    Drain,
}

/// Where a worker hears what it is asked.
pub type Asks = mpsc::Receiver<Ask>;

/// Asks to stop at each SIGINT (Ctrl-C) and SIGTERM that this process gets.
///
/// Fails where the system refuses to hand over its signals.
pub fn signals() -> std::io::Result<Asks> {
    let mut interrupts = signal(SignalKind::interrupt())?;
    let mut terminations = signal(SignalKind::terminate())?;
    let (asks, heard) = mpsc::channel(4);
    tokio::spawn(async move {
        loop {
            tokio::select! {
                _ = interrupts.recv() => {}
                _ = terminations.recv() => {}
            }
            if asks.send(Ask::Stop).await.is_err() {
                return;
            }
        }
    });
    Ok(heard)
}
