//! What is said of sites.

pub(crate) mod check;
pub(crate) mod plot;
pub(crate) mod view;
