//! What the farm itself costs: [`measure`] runs a scheduler alone, then a [`coordinator`] with a [`crew`] whose renderer
//! is [`null`], on a [`disk`] that is measured beside it; [`report`] holds the rows and what is wanted of them.

pub(crate) mod coordinator;
pub(crate) mod crew;
pub(crate) mod disk;
pub(crate) mod measure;
pub(crate) mod null;
pub(crate) mod report;
