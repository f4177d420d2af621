//! A worker's certificate: got for a token once, renewed at two thirds of its life.
//!
//! What is open when a certificate is renewed stays open; only what is opened later shows the new one.

use std::path::Path;
use std::time::Duration;

use tokio::sync::{Mutex, Notify, watch};
use tokio::time::Instant;
use wire::Failure;
use wire::link::{self, Workers};
use wire::proto::{self, ErrorKind};
use wire::tls::certificate::{Age, Claims, moment, now};
use wire::tls::client::{self, Identity};
use wire::way::Way;

use super::Invitation;
use super::kept::Place;
use crate::RunError;

/// How long the coordinator may take over a certificate.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(8);

/// How long to wait before a renewal is tried again: at least this…
const AGAIN_LEAST: Duration = Duration::from_secs(1);

/// …and at most this; between them, a tenth of the time that is left.
const AGAIN_MOST: Duration = Duration::from_secs(60);

/// A worker that has joined, or is to.
#[derive(Debug)]
pub(crate) struct Member {
    invitation: Invitation,
    place: Place,
    standing: Mutex<Option<Standing>>,
    /// Told when there is a certificate that was not there before.
    joined: Notify,
}

/// A certificate, and what is done with it.
#[derive(Debug)]
struct Standing {
    claims: Claims,
    way: Way,
    /// When it is to be renewed.
    renew_at: Instant,
}

impl Member {
    pub(super) fn new(invitation: Invitation) -> Result<Self, RunError> {
        let keep = invitation.keep.as_deref().map(Path::to_owned);
        let place = Place::take(keep.as_deref(), &invitation.file)?;
        // One of before is renewed at once: nobody knows how long it still counts by the coordinator's clock.
        let standing = place
            .certificate()
            .and_then(|kept| Standing::new(&invitation, &place, kept, Instant::now()).ok())
            .filter(|standing| standing.claims.age(now()) == Age::Alive);
        Ok(Self {
            invitation,
            place,
            standing: Mutex::new(standing),
            joined: Notify::new(),
        })
    }

    /// The way in by the certificate; where there is none that counts, one is got first.
    pub(super) async fn way(&self) -> Result<Way, Failure> {
        let mut standing = self.standing.lock().await;
        let expired = match &*standing {
            // Whether a certificate counts *yet* is for the coordinator to say.
            Some(standing) if standing.claims.age(now()) != Age::Expired => {
                return Ok(standing.way.clone());
            }
            Some(standing) => Some(standing.claims.not_after),
            None => None,
        };
        let got = self.join().await.map_err(|failure| match expired {
            None => failure,
            Some(at) => Failure {
                sentence: format!(
                    "the worker's certificate counted until {}, this machine's clock says {}, and the token gave no other: {}",
                    moment(at),
                    moment(now()),
                    failure.sentence
                ),
                ..failure
            },
        })?;
        let way = got.way.clone();
        *standing = Some(got);
        self.joined.notify_one();
        Ok(way)
    }

    /// Renews the certificate whenever that is due.
    pub(super) async fn renew(&self, fetching: &watch::Sender<Option<Workers>>) {
        loop {
            let due = self
                .standing
                .lock()
                .await
                .as_ref()
                .map(|standing| standing.renew_at);
            let Some(due) = due else {
                self.joined.notified().await;
                continue;
            };
            tokio::time::sleep_until(due).await;
            let mut standing = self.standing.lock().await;
            let Some(current) = standing.as_mut() else {
                continue;
            };
            match self.renewed(current).await {
                Ok((fresh, connection)) => {
                    fetching.send_replace(Some(connection));
                    tracing::info!(
                        until = moment(fresh.claims.not_after),
                        "the worker's certificate is renewed"
                    );
                    *current = fresh;
                }
                Err(failure) => {
                    tracing::warn!(
                        reason = failure.sentence,
                        "the worker's certificate cannot be renewed now"
                    );
                    let left = Duration::from_secs(current.claims.not_after.saturating_sub(now()));
                    let wait = (left / 10).clamp(AGAIN_LEAST, AGAIN_MOST);
                    current.renew_at = Instant::now() + wait;
                }
            }
        }
    }

    /// A certificate for the token's secret, which is said only to whoever has shown the right authority.
    async fn join(&self) -> Result<Standing, Failure> {
        let Invitation { file, .. } = &self.invitation;
        let config = client::config(file.authority, None).map_err(unusable)?;
        let way = Way::tls(self.invitation.addresses(), config, None);
        let request = proto::JoinRequest {
            secret: file.secret.reveal().to_owned(),
            public_key: self.place.key.public_key_raw().to_vec(),
        };
        let answer = timely(async {
            let mut joining = link::joining(&way).await?;
            Ok(joining.join(request).await?.into_inner())
        });
        let standing = self.taken(answer.await?)?;
        tracing::info!(
            token = file.id,
            until = moment(standing.claims.not_after),
            "the worker has joined"
        );
        Ok(standing)
    }

    /// A certificate in place of one, and a connection that was opened with it. For one that counts no more by the coordinator's
    /// clock, as after a sleep, none is given: the token gives another while it lives.
    async fn renewed(&self, current: &Standing) -> Result<(Standing, Workers), Failure> {
        let renewed = match self.fresh(&current.way).await {
            Err(failure) if failure.kind == ErrorKind::Unauthenticated => self.join().await?,
            fresh => fresh?,
        };
        let connection = timely(link::workers(&renewed.way)).await?;
        Ok((renewed, connection))
    }

    /// A certificate for the one that is shown.
    async fn fresh(&self, way: &Way) -> Result<Standing, Failure> {
        let request = proto::RenewRequest {
            public_key: self.place.key.public_key_raw().to_vec(),
        };
        let answer = timely(async {
            let mut joining = link::joining(way).await?;
            Ok(joining.renew(request).await?.into_inner())
        });
        self.taken(answer.await?)
    }

    /// A certificate as the coordinator sent it: used from now on, and kept.
    fn taken(&self, answer: proto::Certificate) -> Result<Standing, Failure> {
        let proto::Certificate {
            certificate,
            now_unix_ms,
        } = answer;
        let claims = Claims::read(&certificate).ok_or_else(|| unusable("it cannot be read"))?;
        // Its life by the clock that it was made by, counted from here: no other clock matters.
        let life = Duration::from_secs(claims.not_after.saturating_sub(now_unix_ms / 1_000));
        let renew_at = Instant::now() + life * 2 / 3;
        let standing = Standing::new(&self.invitation, &self.place, certificate.clone(), renew_at)?;
        self.place.keep(&certificate);
        Ok(standing)
    }
}

impl Standing {
    fn new(
        invitation: &Invitation,
        place: &Place,
        certificate: Vec<u8>,
        renew_at: Instant,
    ) -> Result<Self, Failure> {
        let claims = Claims::read(&certificate).ok_or_else(|| unusable("it cannot be read"))?;
        let identity = Identity {
            certificate,
            key: place.key.serialize_der(),
        };
        let config = client::config(invitation.file.authority, Some(identity)).map_err(unusable)?;
        Ok(Self {
            claims,
            way: Way::tls(invitation.addresses(), config, None),
            renew_at,
        })
    }
}

async fn timely<T>(call: impl Future<Output = Result<T, Failure>>) -> Result<T, Failure> {
    let answer = tokio::time::timeout(ANSWER_TIMEOUT, call).await;
    answer.unwrap_or_else(|_| {
        Err(Failure::later(
            ErrorKind::Unspecified,
            "the coordinator takes too long over a certificate",
        ))
    })
}

fn unusable(why: impl std::fmt::Display) -> Failure {
    Failure::new(
        ErrorKind::Internal,
        format!("the worker's certificate cannot be used: {why}"),
    )
}
