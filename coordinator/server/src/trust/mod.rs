//! Who may ask what of a coordinator.
//!
//! One rule, whatever it listens on: loopback is spoken with in the clear and guarded by the state folder's token;
//! everybody else speaks TLS. There a worker shows a certificate for every call, and a user a token.
//!
//! - `authority`: the farm's certificate authority; it signs the coordinator's own certificate and its workers'.
//! - `tokens`: what was given to people on other machines, and what became of it.
//! - `acceptor`: connections, as they come, told apart by their first byte.
//! - `anytime`: whose certificate it is, whatever the time.
//! - `role`: what each call needs: one table.
//! - `gate`: who asks, and whether that is allowed; before every call.
//! - `addresses`: where other machines can reach this one.

pub(crate) mod acceptor;
pub(crate) mod addresses;
mod anytime;
pub(crate) mod authority;
pub(crate) mod gate;
pub(crate) mod role;
mod room;
pub(crate) mod tokens;

use std::sync::Arc;

use model::Span;
use wire::auth::Token;

use crate::state::{State, StateError};
use authority::Authority;
use tokens::Tokens;

/// Everything that trust rests on.
#[derive(Debug)]
pub(crate) struct Trust {
    /// The token of the state folder.
    pub(crate) owner: Token,
    pub(crate) authority: Arc<Authority>,
    pub(crate) tokens: Tokens,
}

impl Trust {
    /// Reads it from the state folder, or makes it; certificates count for `life`.
    pub(crate) fn open(state: &State, life: Span) -> Result<Self, StateError> {
        Ok(Self {
            owner: state.token().clone(),
            authority: Arc::new(Authority::open(&state.authority(), life)?),
            tokens: Tokens::open(state.tokens())?,
        })
    }
}
