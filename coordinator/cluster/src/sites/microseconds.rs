//! Lengths of time in JSON: whole microseconds.

use model::Span;
use serde::{Deserialize as _, Deserializer, Serializer};

pub(crate) fn serialize<S: Serializer>(span: &Span, into: S) -> Result<S::Ok, S::Error> {
    into.serialize_u64(span.0)
}

pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Span, D::Error> {
    u64::deserialize(from).map(Span)
}

/// Where there may be none.
pub(crate) mod perhaps {
    use model::Span;
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    pub(crate) fn serialize<S: Serializer>(
        span: &Option<Span>,
        into: S,
    ) -> Result<S::Ok, S::Error> {
        span.map(|span| span.0).serialize(into)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Option<Span>, D::Error> {
        Ok(Option::<u64>::deserialize(from)?.map(Span))
    }
}
