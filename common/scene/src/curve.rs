//! Numbers that may change over time.

/// A number over time; instants are seconds from image 0.
#[derive(Clone, PartialEq, Debug, serde::Serialize, serde::Deserialize)]
pub enum Curve {
    /// The same at every instant.
    Constant(f64),
    /// Straight lines between (instant, value) keys, constant outside; instants rise.
    Linear(Vec<(f64, f64)>),
    /// Monotone cubic through (instant, value) keys, constant outside; instants rise.
    Smooth(Vec<(f64, f64)>),
}
