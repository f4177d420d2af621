//! The scene language: scene files, their validation with spans, canonical bytes and digest.
//!
//! A scene file becomes a [`Description`] once, where it is submitted. Everyone
//! else only ever sees the description.

pub mod curve;
pub mod description;

pub use curve::Curve;
pub use description::Description;
