//! Tests of whole images and of what they promise.

mod analytic;
mod choice;
mod golden;
mod grids;
mod ground;
mod guarantee;
mod led;
mod same;
mod scenes;
