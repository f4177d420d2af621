//! Every limit of a session, in one value.

use model::Span;

use crate::Backoff;

/// How a session behaves; fixed for its life.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Config {
    /// Tiles rendered at a time, one thread each; at least 1 counts.
    pub threads: u32,
    /// Tiles held beyond those, so that no thread waits for a round trip (thesis C.3.5), until it is
    /// measured how many that takes.
    pub ahead: u32,
    /// Fewest tiles held ahead, whatever is measured…
    pub ahead_least: u32,
    /// …and most.
    pub ahead_max: u32,
    /// Most blocks that are rendered but not yet acknowledged; more than `threads` count.
    /// One is at most 32 KiB of pixels in the shell's memory.
    pub unacked_blocks_max: u32,
    /// When to dial again after a link broke.
    pub backoff: Backoff,
    /// How long dialling and the greeting may take together.
    pub connect_limit: Span,
    /// How long the session tries to reach a coordinator that it cannot reach, before it exits.
    pub give_up: Span,
    /// When to send a block again that was refused for a passing reason.
    pub resend_after: Span,
    /// A worker that has nothing to do for so long leaves; `None`: it waits for ever.
    pub idle: Option<Span>,
    /// How long a worker that was asked to stop waits for answers to the blocks it has rendered.
    pub stop_limit: Span,
}

impl Config {
    /// The usual limits for a worker of so many render threads.
    pub fn new(threads: u32) -> Self {
        let threads = threads.max(1);
        Self {
            threads,
            ahead: threads,
            ahead_least: 1,
            ahead_max: 512,
            unacked_blocks_max: threads.saturating_mul(16).max(1_024),
            backoff: Backoff::default(),
            connect_limit: Span::from_secs(10),
            give_up: Span::from_secs(24 * 3_600),
            resend_after: Span::from_secs(1),
            idle: None,
            stop_limit: Span::from_secs(5),
        }
    }
}
