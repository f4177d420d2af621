//! The colour of a surface: what it is made of, and how light leaves it.

pub(crate) mod light;
pub(crate) mod material;
mod ramp;

pub(crate) use material::{Fields, Palette, mean_albedo};
