//! The scene language: scene files, their validation with spans, canonical bytes and digest.
//!
//! A scene file becomes a [`Description`] once, where it is submitted. Everyone
//! else only ever sees the description.

mod alone;
mod bound;
mod bytes;
mod camera;
mod canonical;
pub mod curve;
pub mod description;
mod expression;
mod file;
pub mod grid_file;
mod ground;
pub mod rules;
mod schema;
mod show;
mod spline;
mod summary;
mod sun;
mod vector;

pub use alone::{Alone, ExpressionError, expression};
pub use bytes::{BYTES_MAX, NotAScene, NotWritable, digest_of};
pub use camera::{Flight, Pose};
pub use curve::Curve;
pub use description::Description;
pub use file::{
    FILE_BYTES_MAX, Loaded, Mistake, Overrides, Place, SceneError, Source, load, parse,
};
pub use schema::schema;
pub use summary::{AssetSummary, Summary, describe};
