//! Certificates for workers.

use tonic::{Request, Response, Status};
use wire::Failure;
use wire::auth::Token;
use wire::proto::joining_server::Joining;
use wire::proto::{self, ErrorKind};
use wire::tls::certificate::{fingerprint, now};

use super::{Door, who};
use crate::trust::gate::Who;

#[tonic::async_trait]
impl Joining for Door {
    async fn join(
        &self,
        request: Request<proto::JoinRequest>,
    ) -> Result<Response<proto::Certificate>, Status> {
        let proto::JoinRequest { secret, public_key } = request.into_inner();
        let secret: Token = secret.parse().map_err(|_| {
            Failure::new(
                ErrorKind::BadRequest,
                "the secret is no token: 64 hexadecimal digits",
            )
        })?;
        let authority = &self.trust.authority;
        let until = authority.until();
        // What cannot be signed uses nothing up.
        authority.sign_worker(&public_key, 0)?;
        let key = fingerprint(&public_key);
        let token = self.trust.tokens.join(&secret, key, until).await?;
        tracing::info!(token, "a worker has joined");
        Ok(certificate(authority.sign_worker(&public_key, token)?))
    }

    async fn renew(
        &self,
        request: Request<proto::RenewRequest>,
    ) -> Result<Response<proto::Certificate>, Status> {
        let who = who(&request);
        let Who::Worker { token } = who else {
            let sentence = "only a worker's certificate can be renewed, and by itself";
            return Err(Failure::new(ErrorKind::Forbidden, sentence).into());
        };
        let authority = &self.trust.authority;
        let signed = authority.sign_worker(&request.get_ref().public_key, token)?;
        self.trust.tokens.renew(token, authority.until()).await?;
        tracing::debug!(token, "a worker's certificate is renewed");
        Ok(certificate(signed))
    }
}

fn certificate(certificate: Vec<u8>) -> Response<proto::Certificate> {
    Response::new(proto::Certificate {
        certificate,
        now_unix_ms: now().saturating_mul(1_000),
    })
}
