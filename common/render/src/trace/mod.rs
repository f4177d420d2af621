//! Where rays meet the surface: guaranteed, and a function of ray and field alone.
//!
//! The hit is *defined* as the first point of the ray's [`grid`] with f ≤ 0; the
//! distance is then polished between that point and the one before. How the search
//! gets there ([`tracer`]) decides only what need not be looked at.

mod allowance;
pub(crate) mod batch;
pub(crate) mod bound;
pub(crate) mod bracket;
pub(crate) mod bundle;
mod choice;
mod clearance;
pub(crate) mod clip;
mod coarse;
mod cone;
pub(crate) mod grid;
pub(crate) mod ground;
pub(crate) mod means;
pub mod methods;
pub(crate) mod polish;
pub(crate) mod ranges;
pub(crate) mod search;
pub(crate) mod simplify;
pub(crate) mod split;
pub(crate) mod surface;
pub(crate) mod techniques;
pub(crate) mod tracer;
pub(crate) mod walk;

pub use means::{Arithmetic, Means};
pub(crate) use surface::Surface;
pub use techniques::Technique;
pub(crate) use tracer::{Goal, Hit, Ray, Tracer};

/// The larger of two numbers, by comparison.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
