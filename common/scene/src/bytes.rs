//! Canonical bytes: a version, then postcard; equal scenes have equal bytes, others never do.
//!
//! Bytes that were released keep their meaning and their digest. The forms
//! written are private ([`v1`]), so that renaming a field of a description
//! changes no digest. −0 is written as +0; NaN and infinities are refused.

mod v1;

use model::Digest;

use crate::description::Description;
use crate::rules::{self, Problem};

/// Most bytes of a scene: it travels in one message.
pub const BYTES_MAX: usize = 3 << 20;

const VERSION: u8 = 1;

const DIGEST_CONTEXT: &str = "flyby scene v1";

/// Why a description has no bytes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotWritable {
    /// It breaks rules.
    #[error("the scene is not valid: {}", list(.0))]
    Invalid(Vec<Problem>),
    /// Its bytes are more than [`BYTES_MAX`].
    #[error("the scene takes {0} bytes; {BYTES_MAX} are the most")]
    TooLong(usize),
}

/// Why bytes are no scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotAScene {
    /// More than [`BYTES_MAX`].
    #[error("a scene of {0} bytes is too long; {BYTES_MAX} are the most")]
    TooLong(usize),
    /// No byte at all.
    #[error("the scene is empty")]
    Empty,
    /// Written by a newer program.
    #[error("the scene has version {0}; this program reads version {VERSION}")]
    Version(u8),
    /// Cut off, too long, or not this format.
    #[error("the bytes are damaged or no scene: {0}")]
    Damaged(String),
    /// Another spelling of a scene; its digest would not name it.
    #[error("the scene's bytes are not in canonical form")]
    NotCanonical,
    /// It breaks rules.
    #[error("the scene is not valid: {}", list(.0))]
    Invalid(Vec<Problem>),
}

fn list(problems: &[Problem]) -> String {
    let sentences: Vec<_> = problems.iter().map(Problem::to_string).collect();
    sentences.join("; ")
}

impl Description {
    /// The scene's canonical bytes: a version, then postcard.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NotWritable> {
        let problems = rules::problems(self);
        if !problems.is_empty() {
            return Err(NotWritable::Invalid(problems));
        }
        let wire = v1::Scene::from(&self.clone().canonical());
        let bytes = encode(&wire);
        if bytes.len() > BYTES_MAX {
            return Err(NotWritable::TooLong(bytes.len()));
        }
        Ok(bytes)
    }

    /// The scene of canonical bytes, held to every rule of [`crate::rules`].
    ///
    /// Takes bytes from anybody: memory stays within a small multiple of their
    /// length, and a scene has only one spelling that is accepted.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, NotAScene> {
        if bytes.len() > BYTES_MAX {
            return Err(NotAScene::TooLong(bytes.len()));
        }
        let (&version, body) = bytes.split_first().ok_or(NotAScene::Empty)?;
        if version != VERSION {
            return Err(NotAScene::Version(version));
        }
        let wire: v1::Scene =
            postcard::from_bytes(body).map_err(|cause| NotAScene::Damaged(cause.to_string()))?;
        if encode(&wire) != bytes {
            return Err(NotAScene::NotCanonical);
        }
        let description = wire.into_description()?;
        let problems = rules::problems(&description);
        if !problems.is_empty() {
            return Err(NotAScene::Invalid(problems));
        }
        if !description.is_canonical() {
            return Err(NotAScene::NotCanonical);
        }
        Ok(description)
    }

    /// What the scene is called by everybody: [`digest_of`] its canonical bytes.
    pub fn digest(&self) -> Result<Digest, NotWritable> {
        Ok(digest_of(&self.to_bytes()?))
    }
}

/// The digest of a scene's canonical bytes: BLAKE3 with a derived key.
pub fn digest_of(bytes: &[u8]) -> Digest {
    let mut hasher = blake3::Hasher::new_derive_key(DIGEST_CONTEXT);
    hasher.update(bytes);
    Digest(*hasher.finalize().as_bytes())
}

fn encode(wire: &v1::Scene) -> Vec<u8> {
    postcard::to_extend(wire, vec![VERSION])
        .expect("a vector takes every byte, and the forms of v1 have no failing part")
}

#[cfg(test)]
mod tests;
