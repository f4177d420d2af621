//! Where a bound is wanted: a region of space, with the footprints and instants that occur in it.

use crate::interval::Interval;

/// Bounds hold for places whose coordinates, and distance from the origin, are at most this: metres.
///
/// Beyond it positions lose their micrometres, and no bound that includes rounding is of use.
pub const WORLD: f64 = 1e8;

/// A region of space, in world metres; only its part within [`WORLD`] counts.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Region {
    /// All of the world.
    All,
    /// inner ≤ ‖p‖ ≤ outer: a spherical shell about the origin.
    Shell {
        /// Least distance from the origin.
        inner: f64,
        /// Greatest distance, may be infinite.
        outer: f64,
    },
    /// low ≤ z ≤ high: a horizontal slab.
    Slab {
        /// Least height.
        low: f64,
        /// Greatest height.
        high: f64,
    },
    /// A box along the axes.
    Box {
        /// Its least corner.
        min: [f64; 3],
        /// Its greatest corner.
        max: [f64; 3],
    },
}

/// What is known of the places at which a program will be evaluated.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Surroundings {
    /// Where they lie.
    pub region: Region,
    /// Their footprints, metres.
    pub footprint: Interval,
    /// Their instants, seconds.
    pub time: Interval,
    /// How fast the footprint grows from place to place, ‖∇footprint‖: the angle of a pixel in radians.
    pub footprint_slope: f64,
}
