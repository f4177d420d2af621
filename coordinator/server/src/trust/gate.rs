//! Before every call: who asks, and whether that is allowed.

use std::future::{Future, ready};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use tonic::Status;
use tonic::body::Body;
use tonic::codegen::{Service, http};
use tonic::metadata::MetadataMap;
use tonic::server::NamedService;
use wire::Failure;
use wire::auth::Token;
use wire::proto::ErrorKind;
use wire::tls::certificate::{Age, Claims, moment, now};

use super::Trust;
use super::acceptor::{Caller, Line};
use super::authority::Authority;
use super::role::{Need, Role, need};

/// Who asks. Whoever serves a call finds it among the request's extensions.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Who {
    /// Whoever can read the state folder, on the coordinator's machine: everything is allowed.
    Owner,
    /// The same from elsewhere: all that users may.
    OwnerAbroad,
    /// Whoever has a token of a role.
    Holder(Role),
    /// A worker with a certificate that was got by a token.
    Worker {
        /// The token.
        token: u64,
    },
    /// Nobody known; the call brings a secret.
    Stranger,
}

/// A service before which a gate stands.
#[derive(Clone, Debug)]
pub(crate) struct Gated<S> {
    service: S,
    trust: Arc<Trust>,
}

impl<S> Gated<S> {
    pub(crate) fn new(service: S, trust: Arc<Trust>) -> Self {
        Self { service, trust }
    }
}

impl<S: NamedService> NamedService for Gated<S> {
    const NAME: &'static str = S::NAME;
}

impl<S> Service<http::Request<Body>> for Gated<S>
where
    S: Service<http::Request<Body>, Response = http::Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = S::Response;
    type Error = S::Error;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, S::Error>> + Send>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.service.poll_ready(context)
    }

    fn call(&mut self, mut request: http::Request<Body>) -> Self::Future {
        let caller = request.extensions().get::<Caller>();
        match self
            .trust
            .admit(caller, request.uri().path(), request.headers())
        {
            Ok(who) => {
                request.extensions_mut().insert(who);
                Box::pin(self.service.call(request))
            }
            Err(failure) => {
                let peer = caller.map(|caller| caller.peer);
                tracing::debug!(?peer, path = request.uri().path(), %failure, "refused at the gate");
                Box::pin(ready(Ok(Status::from(failure).into_http())))
            }
        }
    }
}

impl Trust {
    /// Who asks for the call of a path, if that is allowed.
    fn admit(
        &self,
        caller: Option<&Caller>,
        path: &str,
        headers: &http::HeaderMap,
    ) -> Result<Who, Failure> {
        let need = need(path).ok_or_else(|| {
            Failure::new(
                ErrorKind::WrongProtocol,
                format!("the coordinator knows no call `{path}`: it is older than whoever asks"),
            )
        })?;
        let caller =
            caller.ok_or_else(|| Failure::new(ErrorKind::Internal, "a call from nowhere"))?;
        let who = self.who(caller, need, headers)?;
        permit(who, need, path)?;
        Ok(who)
    }

    fn who(&self, caller: &Caller, need: Need, headers: &http::HeaderMap) -> Result<Who, Failure> {
        let shown = match &caller.line {
            Line::Open => {
                return Err(Failure::new(
                    ErrorKind::Unauthenticated,
                    "this coordinator speaks TLS with other machines, and what came was in the clear: make a token where it runs (`flyby token create`), and give its file with `--token-file`",
                ));
            }
            Line::Over => {
                return Err(Failure::later(
                    ErrorKind::NotReady,
                    "the coordinator has as many connections open as it may: try again later, or let its process have more open files (`ulimit -n`; LimitNOFILE of its unit)",
                ));
            }
            Line::Loopback => None,
            Line::Tls(shown) => shown.as_deref(),
        };
        if need == Need::Secret {
            return Ok(Who::Stranger);
        }
        let metadata = MetadataMap::from_headers(headers.clone());
        if let Some(said) = Token::said(&metadata) {
            return match (self.owner.check(&metadata), &caller.line) {
                (Ok(()), Line::Loopback) => Ok(Who::Owner),
                (Ok(()), _) => Ok(Who::OwnerAbroad),
                (Err(_), _) => self.tokens.role(&said).map(Who::Holder),
            };
        }
        match (shown, &caller.line) {
            (Some(claims), _) => self.worker(claims),
            (None, Line::Loopback) => self.owner.check(&metadata).map(|()| Who::Owner),
            (None, _) => Err(Failure::new(
                ErrorKind::Unauthenticated,
                "the call carries neither a token nor a certificate: make a token where the coordinator runs (`flyby token create`), and give its file with `--token-file`",
            )),
        }
    }

    /// Returns when a worker's token is revoked; never where nothing can be.
    pub(crate) async fn revoked(&self, who: Who) {
        let Who::Worker { token } = who else {
            return std::future::pending().await;
        };
        let mut revocations = self.tokens.revocations();
        while self.tokens.check_certificates(token).is_ok() {
            // The sender lives as long as `self`, so this cannot fail.
            let _ = revocations.changed().await;
        }
    }

    /// The worker whose certificate was shown, if it still counts.
    fn worker(&self, claims: &Claims) -> Result<Who, Failure> {
        let refused = |sentence: String| Failure::new(ErrorKind::Unauthenticated, sentence);
        let clock = now();
        match claims.age(clock) {
            Age::Alive => {}
            Age::Expired => {
                return Err(refused(format!(
                    "the worker's certificate counted until {}, and the coordinator's clock says {}: it was away for too long to renew it, or one of the two clocks is wrong; give the worker a new token (`flyby token create`)",
                    moment(claims.not_after),
                    moment(clock)
                )));
            }
            Age::TooYoung => {
                return Err(refused(format!(
                    "the worker's certificate counts from {} on, and the coordinator's clock says {}: that clock was set back; let it follow a time server",
                    moment(claims.not_before),
                    moment(clock)
                )));
            }
        }
        let token = Authority::token_of(claims);
        let token = token.ok_or_else(|| refused("the certificate shown is no worker's".into()))?;
        self.tokens.check_certificates(token)?;
        Ok(Who::Worker { token })
    }
}

/// Whether somebody may make a call.
fn permit(who: Who, need: Need, path: &str) -> Result<(), Failure> {
    let Need::Role(needed) = need else {
        return Ok(());
    };
    let call = path.rsplit('/').next().unwrap_or_default();
    let forbidden = |sentence| Err(Failure::new(ErrorKind::Forbidden, sentence));
    match (who, needed) {
        (Who::Owner, _) | (Who::Worker { .. }, Role::Worker) => Ok(()),
        (Who::Worker { .. }, _) => forbidden(format!(
            "a worker's certificate allows no `{call}`, which needs the role `{needed}`: use a token of that role (`flyby token create --role {needed}`)"
        )),
        (_, Role::Worker) => Err(Failure::new(
            ErrorKind::Unauthenticated,
            format!(
                "`{call}` needs a worker's certificate: start the worker with a token for workers (`flyby token create --role worker`, `flyby worker --token-file FILE`)"
            ),
        )),
        (Who::OwnerAbroad, _) => Ok(()),
        (Who::Holder(role), needed) if role.includes(needed) => Ok(()),
        (Who::Holder(role), needed) => forbidden(format!(
            "a token of the role `{role}` allows no `{call}`, which needs the role `{needed}`: ask whoever runs the farm for one (`flyby token create --role {needed}`)"
        )),
        (Who::Stranger, _) => Err(Failure::new(ErrorKind::Internal, "a stranger was let in")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_certificate_that_does_not_count_is_told_with_both_clocks() {
        let folder = tempfile::tempdir().unwrap();
        let state = crate::state::State::take(folder.path()).unwrap();
        let trust = Trust::open(&state, model::Span::from_secs(60)).unwrap();
        let refused = |name: &str, not_before, not_after| {
            let claims = Claims {
                name: name.to_owned(),
                not_before,
                not_after,
            };
            let failure = trust.worker(&claims).unwrap_err();
            assert_eq!(failure.kind, ErrorKind::Unauthenticated);
            failure.sentence
        };
        let worker = "flyby worker of token 1";
        let clock = now();
        let (year, _) = moment(clock)
            .split_once('-')
            .map(|(a, b)| (a.to_owned(), b.to_owned()))
            .unwrap();
        let said = refused(worker, 0, 100);
        assert!(
            said.contains("counted until 1970-01-01 00:01:40 UTC"),
            "{said}"
        );
        assert!(said.contains(&format!("clock says {year}")), "{said}");
        let said = refused(worker, clock + 1_000, clock + 2_000);
        assert!(said.contains("was set back"), "{said}");
        // Of a token that nobody remembers, and of somebody who is no worker.
        assert!(refused(worker, 0, clock + 1_000).contains("not this coordinator's"));
        assert!(refused("coordinator.flyby", 0, clock + 1_000).contains("no worker's"));
    }

    #[test]
    fn what_each_may() {
        let everybody = [
            Who::Owner,
            Who::OwnerAbroad,
            Who::Holder(Role::View),
            Who::Holder(Role::Submit),
            Who::Holder(Role::Operate),
            Who::Holder(Role::Worker),
            Who::Worker { token: 1 },
        ];
        let may =
            |role| everybody.map(|who| u8::from(permit(who, Need::Role(role), "/a/B").is_ok()));
        assert_eq!(may(Role::View), [1, 1, 1, 1, 1, 0, 0]);
        assert_eq!(may(Role::Submit), [1, 1, 0, 1, 1, 0, 0]);
        assert_eq!(may(Role::Operate), [1, 1, 0, 0, 1, 0, 0]);
        assert_eq!(may(Role::Worker), [1, 0, 0, 0, 0, 0, 1]);
        let said = permit(
            Who::Holder(Role::View),
            Need::Role(Role::Submit),
            "/a/CancelJob",
        );
        let said = said.unwrap_err();
        assert_eq!(said.kind, ErrorKind::Forbidden);
        assert!(said.sentence.contains("--role submit"), "{said}");
    }
}
