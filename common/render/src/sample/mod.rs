//! Where and when the image is sampled: stratified B-spline filters and a box shutter.
//!
//! Thesis §6.2 and §6.3. Nothing here knows what is sampled.

mod order;
pub(crate) mod spline;
pub(crate) mod strata;

pub(crate) use order::Order;
pub(crate) use strata::{Draws, Sample, Strata};
