//! What is said of sites.

pub(crate) mod check;
pub(crate) mod view;
