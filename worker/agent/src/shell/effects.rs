//! Performing effects.

use std::sync::Arc;
use std::time::Duration;

use model::{AttemptId, Begun, Lease};
use session::{Effect, Event};
use tokio::sync::{mpsc, watch};
use wire::failure::Retry;
use wire::link::Workers;
use wire::proto::{self, ErrorKind, control_up};

use super::Shell;
use crate::input::{Input, LinkNumber, Rendered};
use crate::link::{Clogged, Link};
use crate::pool::Paused;
use crate::scenes::Scenes;

/// How long to wait before a scene is asked for again.
const FETCH_PAUSE: Duration = Duration::from_secs(1);

impl Shell {
    /// Performs one effect; answers what it brought about at once.
    pub(super) async fn perform(&mut self, effect: Effect) -> Option<Event> {
        match effect {
            Effect::Connect => self.connect(),
            Effect::CloseLink => self.close(),
            Effect::SendHello { held, begun } => self.hello(held, begun),
            Effect::SendCredit { credit } => {
                let credit = proto::Credit { tiles: credit };
                return self.say(control_up::Message::Credit(credit));
            }
            Effect::SendHeartbeat { running } => {
                let running = running.into_iter().map(Into::into).collect();
                let heartbeat = proto::Heartbeat { running };
                return self.say(control_up::Message::Heartbeat(heartbeat));
            }
            Effect::StartTile { lease } => self.start_tile(lease),
            Effect::CancelTile { attempt } => {
                if let Some(loading) = self.loading.remove(&attempt) {
                    loading.abort();
                }
                self.pool.cancel(attempt);
            }
            Effect::PauseRendering => self.pool.set_paused(Paused::Yes),
            Effect::ResumeRendering => self.pool.set_paused(Paused::No),
            Effect::SendBlock { attempt, rect } => {
                let block = self.blocks.get(&(attempt, rect))?.clone();
                let sent = self.link.as_ref().map(|link| link.deliver(block));
                return self.after(sent);
            }
            Effect::DropBlock { attempt, rect } => {
                self.blocks.remove(&(attempt, rect));
            }
            Effect::GiveBack { attempts } => {
                let attempts = attempts.into_iter().map(Into::into).collect();
                return self.say(control_up::Message::GiveBack(proto::GiveBack { attempts }));
            }
            Effect::SendFailed { attempt, reason } => {
                let failed = proto::TileFailed {
                    attempt: Some(attempt.into()),
                    reason: wire::convert::sentence(&reason, 2_000),
                };
                return self.say(control_up::Message::Failed(failed));
            }
            Effect::SendGoodbye => {
                if let Some(link) = self.link.take() {
                    link.leave("it leaves by itself, or was asked to").await;
                }
            }
            Effect::Exit { reason } => {
                tracing::info!(?reason, "the worker leaves");
                self.exit = Some(reason);
            }
        }
        None
    }

    fn connect(&mut self) {
        let number = LinkNumber(self.next_link);
        self.next_link += 1;
        self.clients = None;
        self.link = Some(Link::dial(number, self.access.clone(), self.inputs.clone()));
    }

    fn close(&mut self) {
        self.link = None;
        self.clients = None;
    }

    fn hello(&mut self, held: Vec<AttemptId>, begun: Vec<Begun>) {
        let hello = proto::Hello {
            protocol_min: wire::version::PROTOCOL_MIN,
            protocol_max: wire::version::PROTOCOL_MAX,
            revision: self.painter.revision().0,
            build: self.config.build.clone(),
            simd_level: self.painter.simd_level(),
            threads: self.config.threads.get(),
            memory_bytes: self.config.memory_bytes,
            name: self.config.name.clone(),
            worker: Some(self.worker.into()),
            held: held.into_iter().map(Into::into).collect(),
            begun: begun.into_iter().map(Into::into).collect(),
            labels: self.config.labels.clone(),
            time_left_ms: self.time_left().map(|left| {
                // The wire counts milliseconds; part of one is none.
                u64::try_from(left.as_millis()).unwrap_or(u64::MAX)
            }),
        };
        if let (Some(link), Some(clients)) = (&mut self.link, self.clients.take()) {
            link.greet(clients, hello, self.blocks_max, self.inputs.clone());
        }
    }

    fn say(&mut self, message: control_up::Message) -> Option<Event> {
        let said = self.link.as_ref().map(|link| link.say(message));
        self.after(said)
    }

    /// Whether a stream took a message; one that does not is a link that is gone.
    fn after(&mut self, sent: Option<Result<(), Clogged>>) -> Option<Event> {
        match sent {
            Some(Ok(())) | None => None,
            Some(Err(Clogged)) => {
                self.close();
                Some(Event::LinkLost {
                    reason: "the coordinator reads too slowly".to_owned(),
                })
            }
        }
    }

    fn start_tile(&mut self, lease: Lease) {
        let attempt = lease.attempt;
        tracing::debug!(job = %lease.image.job, image = %lease.image.image, tile = ?lease.tile, %attempt, "start");
        if let Some(scene) = self.scenes.at_hand(lease.scene) {
            return self.pool.render(lease, scene);
        }
        let scenes = self.scenes.clone();
        let task = load(
            lease,
            scenes,
            self.fetching.subscribe(),
            self.inputs.clone(),
        );
        self.loading.insert(attempt, tokio::spawn(task));
    }
}

/// Gets a tile's scene, over as many links as it takes, and reports.
async fn load(
    lease: Lease,
    scenes: Arc<Scenes>,
    mut fetching: watch::Receiver<Option<Workers>>,
    inputs: mpsc::Sender<Input>,
) {
    let input = loop {
        let way = fetching.borrow_and_update().clone();
        if let Some(mut way) = way {
            match scenes.scene(lease.scene, &mut way).await {
                Ok(scene) => break Input::Ready(Box::new(lease), scene),
                // A certificate that was not renewed in time is not the tile's fault.
                Err(failure)
                    if failure.retry == Retry::Never
                        && failure.kind != ErrorKind::Unauthenticated =>
                {
                    break Input::Rendered(Rendered::Failed(lease.attempt, failure.sentence));
                }
                Err(failure) => {
                    tracing::warn!(scene = %lease.scene, reason = failure.sentence, "a scene could not be fetched");
                }
            }
        }
        tokio::select! {
            changed = fetching.changed() => {
                if changed.is_err() {
                    return;
                }
            }
            () = tokio::time::sleep(FETCH_PAUSE) => {}
        }
    };
    let _ = inputs.send(input).await;
}
