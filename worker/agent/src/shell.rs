//! The loop around the session: wait for the first input, turn it into an event, let the
//! session decide, perform the effects.

mod effects;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use model::{AttemptId, Rect, Span, Timestamp, WorkerId};
use session::{BlockVerdict, Event, ExitReason, Retry, Session};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use wire::failure;
use wire::link::Workers;
use wire::proto::{Delivery, ErrorKind, control_down, deliver_down};
use wire::{BadMessage, Failure, convert};

use crate::admission::Access;
use crate::config::{Config, RunError};
use crate::identity;
use crate::images::Images;
use crate::input::{Block, Clients, Input, LinkNumber, Rendered};
use crate::link::Link;
use crate::painter::Painter;
use crate::pool::Pool;
use crate::scenes::Scenes;
use crate::stop::{Ask, Asks};

/// Inputs that wait for the loop.
const INPUTS_MAX: usize = 256;

/// Images kept open beside one for each thread.
const IMAGES_AHEAD: usize = 2;

/// Time kept at the end of a limit for delivering what is rendered, at most this and a tenth of the limit.
const LEAVING: Duration = Duration::from_secs(10);

/// How much of a time limit may be rendered in.
fn useful(limit: Span) -> Duration {
    let limit = Duration::from_micros(limit.0);
    limit - LEAVING.min(limit / 10)
}

/// Runs a worker until it is let go, asked to stop, refused for good, or gives up.
pub async fn run(
    config: Config,
    painter: Arc<dyn Painter>,
    mut asks: Asks,
) -> Result<ExitReason, RunError> {
    let (inputs, mut taken) = mpsc::channel(INPUTS_MAX);
    let mut shell = Shell::new(config, painter, inputs)?;
    let (access, fetching) = (shell.access.clone(), shell.fetching.clone());
    let renewing = tokio::spawn(async move { access.renew(&fetching).await });
    shell.feed(Event::Started).await;
    let mut heard = true;
    let mut leave_at = shell.leave_at;
    while shell.exit.is_none() {
        let tick_at = shell.session.next_deadline();
        let tick_at = tick_at.map(|at| shell.origin + Duration::from_micros(at.0));
        tokio::select! {
            ask = asks.recv(), if heard => match ask {
                Some(Ask::Stop) => shell.feed(Event::StopAsked).await,
                Some(Ask::Drain) => shell.feed(Event::DrainAsked).await,
                None => heard = false,
            },
            Some(input) = taken.recv() => {
                shell.take(input).await;
                // For what has come meanwhile no timer need be set anew.
                for _ in 1..INPUTS_MAX {
                    match taken.try_recv() {
                        Ok(input) if shell.exit.is_none() => shell.take(input).await,
                        _ => break,
                    }
                }
            }
            () = wait_until(tick_at) => shell.feed(Event::Tick).await,
            () = wait_until(leave_at) => {
                tracing::info!("the time limit is near: what is rendered is delivered, and the rest is given back");
                leave_at = None;
                shell.feed(Event::StopAsked).await;
            }
        }
    }
    drop(taken);
    renewing.abort();
    Ok(shell.end().await)
}

/// Everything that the loop owns.
struct Shell {
    session: Session,
    origin: Instant,
    /// When it leaves by itself.
    leave_at: Option<Instant>,
    config: Config,
    access: Arc<Access>,
    worker: WorkerId,
    painter: Arc<dyn Painter>,
    pool: Pool,
    scenes: Arc<Scenes>,
    inputs: mpsc::Sender<Input>,
    /// The newest link.
    link: Option<Link>,
    next_link: u64,
    /// Its connections, between dialling and greeting.
    clients: Option<Clients>,
    /// Where scenes are fetched: a way over the newest link that was open.
    fetching: watch::Sender<Option<Workers>>,
    /// Tiles whose scene is not here yet.
    loading: BTreeMap<AttemptId, JoinHandle<()>>,
    /// Blocks that are not acknowledged, as they are sent.
    blocks: BTreeMap<(AttemptId, Rect), Delivery>,
    blocks_max: usize,
    exit: Option<ExitReason>,
}

impl Shell {
    fn new(
        config: Config,
        painter: Arc<dyn Painter>,
        inputs: mpsc::Sender<Input>,
    ) -> Result<Self, RunError> {
        let threads = config.threads.get();
        let mut settings = session::Config::new(threads);
        if let Some(ahead) = config.ahead {
            // What was asked for holds, whatever is measured.
            (settings.ahead, settings.ahead_least, settings.ahead_max) = (ahead, ahead, ahead);
        }
        settings.idle = config.idle;
        settings.backoff.key = identity::draw()?;
        let images_max = (threads as usize).saturating_add(IMAGES_AHEAD);
        let images = Images::new(painter.clone(), images_max);
        let origin = Instant::now();
        Ok(Self {
            worker: identity::worker(config.state.as_deref())?,
            pool: Pool::start(threads, images, inputs.clone())?,
            scenes: Arc::new(Scenes::new(config.state.as_deref())),
            blocks_max: settings.unacked_blocks_max as usize,
            session: Session::new(settings),
            origin,
            leave_at: config.time_limit.map(|limit| origin + useful(limit)),
            access: Arc::new(Access::new(&config.admission)?),
            config,
            painter,
            inputs,
            link: None,
            next_link: 1,
            clients: None,
            fetching: watch::Sender::new(None),
            loading: BTreeMap::new(),
            blocks: BTreeMap::new(),
            exit: None,
        })
    }

    /// Lets the session decide, and performs what it decided.
    async fn feed(&mut self, event: Event) {
        // What an effect brings about at once (a stream that is full) is fed after the effects.
        let mut events = vec![event];
        while let Some(event) = events.pop() {
            tracing::debug!(?event, "event");
            let mut effects = Vec::new();
            self.session.handle(self.now(), event, &mut effects);
            for effect in effects {
                tracing::debug!(?effect, "effect");
                if let Some(event) = self.perform(effect).await {
                    events.push(event);
                }
            }
        }
    }

    /// How long it may still render.
    fn time_left(&self) -> Option<Duration> {
        self.leave_at
            .map(|at| at.saturating_duration_since(Instant::now()))
    }

    fn now(&self) -> Timestamp {
        Timestamp(u64::try_from(self.origin.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// Whether something came on the newest link.
    fn is_newest(&self, number: LinkNumber) -> bool {
        self.link.as_ref().is_some_and(|link| link.number == number)
    }

    async fn take(&mut self, input: Input) {
        match input {
            Input::Dialled(number, clients) if self.is_newest(number) => {
                // Beside what little comes down on it, pixels only go up on this one.
                self.fetching.send_replace(Some(clients.delivery.clone()));
                self.clients = Some(*clients);
                self.feed(Event::Dialled).await;
            }
            Input::Connected(number, welcome) if self.is_newest(number) => {
                tracing::info!(coordinator = %self.config.admission, epoch = welcome.epoch.0, "connected");
                self.feed(Event::Connected(welcome)).await;
            }
            Input::Control(number, message) if self.is_newest(number) => {
                match control_event(message) {
                    Ok(Some(event)) => self.feed(event).await,
                    Ok(None) => {}
                    Err(bad) => self.lose(bad.into()).await,
                }
            }
            Input::Delivery(number, message) if self.is_newest(number) => {
                match delivery_event(message) {
                    Ok(Some(event)) => self.feed(event).await,
                    Ok(None) => {}
                    Err(bad) => self.lose(bad.into()).await,
                }
            }
            Input::Lost(number, failure) if self.is_newest(number) => self.lose(failure).await,
            // What older links still say counts for nothing.
            Input::Dialled(..)
            | Input::Connected(..)
            | Input::Control(..)
            | Input::Delivery(..)
            | Input::Lost(..) => {}
            Input::Ready(lease, scene) => {
                if self.loading.remove(&lease.attempt).is_some() {
                    self.pool.render(*lease, scene);
                }
            }
            Input::Rendered(rendered) => self.rendered(rendered).await,
        }
    }

    async fn rendered(&mut self, rendered: Rendered) {
        match rendered {
            Rendered::Block(block) => self.rendered_block(*block).await,
            Rendered::Last(block) => {
                let attempt = block.attempt;
                self.rendered_block(*block).await;
                self.feed(Event::TileRendered { attempt }).await;
            }
            Rendered::Failed(attempt, reason) => {
                self.loading.remove(&attempt);
                tracing::warn!(%attempt, reason, "a tile cannot be rendered");
                self.feed(Event::RenderFailed { attempt, reason }).await;
            }
        }
    }

    async fn rendered_block(&mut self, block: Block) {
        let (attempt, rect) = (block.attempt, block.rect);
        self.blocks.insert((attempt, rect), block.delivery);
        self.feed(Event::BlockRendered { attempt, rect }).await;
    }

    /// The link is gone; the session hears whether that is for good.
    async fn lose(&mut self, failure: Failure) {
        self.link = None;
        self.clients = None;
        let Failure {
            kind,
            retry,
            sentence,
        } = failure;
        tracing::warn!(reason = sentence, "the link to the coordinator is gone");
        let refused = retry == failure::Retry::Never || kind == ErrorKind::Limit;
        let event = if refused {
            Event::Refused {
                reason: sentence,
                retry: match retry {
                    failure::Retry::Later => Retry::Later,
                    failure::Retry::Never => Retry::Never,
                },
            }
        } else {
            Event::LinkLost { reason: sentence }
        };
        self.feed(event).await;
    }

    /// Ends the threads and whatever else still runs.
    async fn end(self) -> ExitReason {
        for task in self.loading.into_values() {
            task.abort();
        }
        drop(self.link);
        let pool = self.pool;
        let ended = tokio::task::spawn_blocking(move || pool.end());
        if ended.await.is_err() {
            tracing::error!("the render threads could not be ended");
        }
        self.exit.expect("the loop ends when there is a reason")
    }
}

/// What the coordinator said on the control stream.
fn control_event(message: control_down::Message) -> Result<Option<Event>, BadMessage> {
    Ok(match message {
        control_down::Message::Lease(lease) => Some(Event::Leased(lease.try_into()?)),
        control_down::Message::Revoke(revoke) => {
            let attempt: AttemptId =
                convert::require(revoke.attempt, "revoke.attempt")?.try_into()?;
            tracing::debug!(%attempt, reason = revoke.reason, "revoked");
            Some(Event::Revoked { attempt })
        }
        control_down::Message::Drain(_) => Some(Event::DrainAsked),
        control_down::Message::Welcome(_) => None,
    })
}

/// What the coordinator said on the delivery stream.
fn delivery_event(message: deliver_down::Message) -> Result<Option<Event>, BadMessage> {
    Ok(match message {
        deliver_down::Message::Acknowledged(acknowledged) => Some(Event::Acked {
            attempt: convert::require(acknowledged.attempt, "acknowledged.attempt")?.try_into()?,
            rect: convert::require(acknowledged.block, "acknowledged.block")?.try_into()?,
        }),
        deliver_down::Message::Refused(refused) => {
            let error = Failure::from(refused.error.unwrap_or_default());
            tracing::warn!(reason = error.sentence, "a block was refused");
            let (Some(attempt), Some(rect)) = (refused.attempt, refused.block) else {
                // The coordinator could not read which block it was: damaged on its way. All that
                // is not acknowledged is sent again over a new link.
                return Err(BadMessage::Missing("a block that could be read"));
            };
            let verdict = match (error.kind, error.retry) {
                (ErrorKind::AttemptDead, _) => BlockVerdict::AttemptDead,
                (_, failure::Retry::Later) => BlockVerdict::Later,
                (_, failure::Retry::Never) => BlockVerdict::Never {
                    reason: error.sentence,
                },
            };
            Some(Event::BlockRefused {
                attempt: attempt.try_into()?,
                rect: rect.try_into()?,
                verdict,
            })
        }
        deliver_down::Message::Welcome(_) => None,
    })
}

/// Waits for an instant; for ever where there is none.
async fn wait_until(at: Option<Instant>) {
    match at {
        Some(at) => tokio::time::sleep_until(at.into()).await,
        None => std::future::pending().await,
    }
}
