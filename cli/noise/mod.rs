//! The statistics by which the thesis judges noises, §4.2, and their plots.
//!
//! [`source`] gives realisations of a stochastic field, [`measure`] averages over them,
//! [`rings`] takes a spectrum apart into radial power and anisotropy, [`copies`] adds it up over octaves, [`plot`] draws.
//! Nothing here knows a noise: what is measured is any field expression.

pub(crate) mod copies;
pub(crate) mod measure;
pub(crate) mod plot;
pub(crate) mod report;
pub(crate) mod rings;
pub(crate) mod source;

#[cfg(test)]
mod tests;
