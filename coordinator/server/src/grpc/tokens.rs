//! Tokens, as operators make and revoke them.

use wire::Failure;
use wire::proto::{self, ErrorKind};

use super::Door;
use crate::trust::role::Role;

/// Makes one, and says where it leads.
pub(super) async fn create(
    door: &Door,
    wanted: proto::CreateTokenRequest,
) -> Result<proto::CreatedToken, Failure> {
    let role = Role::from_message(wanted.role()).ok_or_else(|| {
        Failure::new(
            ErrorKind::BadRequest,
            "a token needs a role that this coordinator knows",
        )
    })?;
    let tokens = &door.trust.tokens;
    let (token, secret) = tokens.create(role, wanted.uses, wanted.life_s).await?;
    tracing::info!(token = token.id, %role, "a token was made");
    Ok(proto::CreatedToken {
        token: Some(token),
        secret: secret.reveal().to_owned(),
        authority: door.trust.authority.fingerprint().0.to_vec(),
        addresses: door.addresses.clone(),
        loopback_only: door.loopback_only,
    })
}

/// Ends one.
pub(super) async fn revoke(door: &Door, id: u64) -> Result<proto::Token, Failure> {
    let revoked = door.trust.tokens.revoke(id).await?;
    tracing::info!(token = id, "a token is revoked");
    Ok(revoked)
}
