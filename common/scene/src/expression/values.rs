//! What expressions compute with: Rhai's own numbers, and nodes of the graph.

use field::NodeId;
use rhai::{Dynamic, EvalAltResult, Position};

use super::refusal::Hint;

/// A number at every point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Scalar(pub(super) NodeId);

/// A place or direction at every point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Vector(pub(super) NodeId);

/// A value that fields are made of.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Operand {
    Number(f64),
    Scalar(NodeId),
    Vector(NodeId),
}

/// A result, or an error that a script's caller sees at the place of the call.
pub(super) type Made<T> = Result<T, Box<EvalAltResult>>;

impl Operand {
    /// The value of Rhai's, if it is one of these.
    #[expect(
        clippy::cast_precision_loss,
        reason = "as Rhai itself turns integers into floats"
    )]
    pub(super) fn from_dynamic(value: &Dynamic) -> Option<Self> {
        if let Ok(integer) = value.as_int() {
            Some(Self::Number(integer as f64))
        } else if let Ok(number) = value.as_float() {
            Some(Self::Number(number))
        } else if let Some(Scalar(id)) = value.clone().try_cast() {
            Some(Self::Scalar(id))
        } else {
            value.clone().try_cast().map(|Vector(id)| Self::Vector(id))
        }
    }

    pub(super) fn into_dynamic(self) -> Dynamic {
        match self {
            Self::Number(number) => Dynamic::from_float(number),
            Self::Scalar(id) => Dynamic::from(Scalar(id)),
            Self::Vector(id) => Dynamic::from(Vector(id)),
        }
    }

    /// What it is, for messages.
    pub(super) fn kind(self) -> &'static str {
        match self {
            Self::Number(_) => "a number",
            Self::Scalar(_) => "a field",
            Self::Vector(_) => "a vector",
        }
    }
}

/// An error with a sentence and a hint.
pub(super) fn refuse<T>(message: impl Into<String>, help: impl Into<String>) -> Made<T> {
    let hint = Hint {
        message: message.into(),
        help: Some(help.into()),
    };
    Err(EvalAltResult::ErrorRuntime(Dynamic::from(hint), Position::NONE).into())
}
