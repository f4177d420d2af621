//! What commands do with a coordinator: reach it, start one, follow a job, fetch its
//! frames, show what it says.

pub(crate) mod doctor;
pub(crate) mod fetch;
pub(crate) mod follow;
pub(crate) mod link;
pub(crate) mod local;
pub(crate) mod submit;
pub(crate) mod view;
