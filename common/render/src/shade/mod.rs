//! The colour of a surface: what it is made of, and how light leaves it.

pub(crate) mod light;
pub(crate) mod material;
mod patch;
mod ramp;

pub(crate) use material::{Fields, Palette, mean_albedo};
pub(crate) use patch::Patch;
