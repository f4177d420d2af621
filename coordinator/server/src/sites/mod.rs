//! Sites: a thread for each, since queues and ssh block. What it decides is `cluster::pilot`'s or
//! `cluster::poll`'s; here it is done.

mod board;
mod errand;
mod pass;
mod poll;

use std::cell::RefCell;
use std::net::SocketAddr;
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use cluster::camp::{Camp, farm_of};
use tokio::runtime::Handle;
use tokio::sync::mpsc;
use tokio::time::timeout_at;

use crate::config::Config;
use crate::input::{Gates, Input};
use crate::start::StartError;
use crate::state::State;
use crate::trust::Trust;

pub(crate) use self::board::Board;
use self::errand::Errand;
use self::pass::{Pass, Token};

/// Waits until a moment, and not for that where the loop ends before; whether it has not. What wakes meanwhile is
/// answered by the look that follows.
fn rest(runtime: &Handle, woken: &mut mpsc::Receiver<()>, until: Instant) -> bool {
    runtime.block_on(async {
        loop {
            match timeout_at(until.into(), woken.recv()).await {
                Ok(Some(())) => {}
                Ok(None) => return false,
                Err(_) => return true,
            }
        }
    })
}

/// The loop's end of the threads; they end when it is dropped.
#[derive(Debug)]
pub(crate) struct Sites {
    board: Board,
    wakes: Vec<mpsc::Sender<()>>,
}

impl Sites {
    /// Starts a thread for every site.
    pub(crate) fn start(
        config: &Config,
        state: &Arc<State>,
        (address, addresses): (SocketAddr, &[String]),
        trust: &Arc<Trust>,
        (inputs, gates): (&mpsc::Sender<Input>, &Gates),
    ) -> Result<Self, StartError> {
        let mut sites = Self {
            board: Board::new(&config.sites),
            wakes: Vec::new(),
        };
        if config.sites.is_empty() {
            return Ok(sites);
        }
        let farm = farm_of(state.root())?;
        for site in &config.sites {
            // One wake waits at most: it stands for all.
            let (wake, woken) = mpsc::channel(1);
            let coordinator = site.coordinator.clone();
            let pass = match config.listen.ip().is_loopback() {
                true => Pass::Owner(state.root().join(wire::place::TOKEN_FILE)),
                false => Pass::Token(Token {
                    trust: trust.clone(),
                    addresses: match &coordinator {
                        Some(named) => vec![named.clone()],
                        None => addresses.to_vec(),
                    },
                    runtime: Handle::current(),
                    made: RefCell::default(),
                }),
            };
            let usual = addresses.first().cloned();
            let errand = Errand {
                camp: Camp::new(site.clone(), farm.clone(), &state.root().join("ssh")),
                coordinator: coordinator.or(usual).unwrap_or_else(|| address.to_string()),
                pass,
                revision: config.revision,
                epoch: state.epoch(),
                inputs: inputs.clone(),
                board: sites.board.clone(),
                gates: gates.clone(),
                runtime: Handle::current(),
            };
            thread::Builder::new()
                .name(format!("site {}", site.name))
                .spawn(move || errand.run(woken))
                .map_err(StartError::Thread)?;
            sites.wakes.push(wake);
        }
        Ok(sites)
    }

    /// What is known of them.
    pub(crate) fn board(&self) -> &Board {
        &self.board
    }

    /// There may be more to do, or less.
    pub(crate) fn wake(&self) {
        for wake in &self.wakes {
            // One that is full will be heard.
            let _ = wake.try_send(());
        }
    }
}
