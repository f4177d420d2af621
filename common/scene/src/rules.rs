//! What a scene may say: ranges of every number, apart from where it was written.
//!
//! A scene file and canonical bytes pass the same rules. Rules that must look at
//! the surface itself (does the path keep clear of the ground?) stand in
//! `crate::ground` and `crate::bound`; they guard users from mistakes, these
//! guard the farm from anybody.

#![expect(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "what is not known to be right is wrong: NaN breaks every rule"
)]

mod camera;
mod film;
mod light;
mod surface;

pub use camera::PATH_KEYS_MAX;
pub use film::{FILTER_ORDER_MAX, RAYS_MAX};

use std::fmt;

use crate::curve::Curve;
use crate::description::{AssetRef, Description};

/// Most files that a scene may name.
pub const ASSETS_MAX: usize = 64;

/// Most bytes of one file that a scene names.
pub const ASSET_BYTES_MAX: u64 = 64 << 20;

/// Most layers of a material.
pub const LAYERS_MAX: usize = 64;

/// Most pixels of an image: eight channels of them are 8 GiB.
pub const PIXELS_MAX: u64 = 1 << 28;

/// Largest coordinate and length in metres: where the field's bounds end.
pub const LENGTH_MAX: f64 = field::surroundings::WORLD;

/// Latest instant in seconds that anything may name, in either direction.
pub const TIME_MAX: f64 = 1e9;

/// One rule that a scene breaks.
#[derive(Clone, PartialEq, Debug)]
pub struct Problem {
    /// Which number, as a dotted path of a scene file's keys.
    pub key: String,
    /// What is wrong with it, a sentence without its full stop.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.key, self.message)?;
        self.help.iter().try_for_each(|help| write!(f, " ({help})"))
    }
}

/// Every rule that a description breaks; empty for a valid one.
pub fn problems(scene: &Description) -> Vec<Problem> {
    let mut found = Problems::default();
    name(&scene.name, &mut found);
    film::check(&scene.film, &mut found);
    film::check_sampling(&scene.sampling, &mut found);
    camera::check(&scene.camera, &mut found);
    surface::check(&scene.surface, scene.assets.len(), &mut found);
    light::check_sun(&scene.sun, &mut found);
    light::check_sky(&scene.sky, &scene.surface.graph, &mut found);
    assets(&scene.assets, &mut found);
    found.0
}

/// What a named curve, whose values may be anything finite, breaks.
pub(crate) fn named_curve(name: &str, curve: &Curve) -> Option<Problem> {
    let mut found = Problems::default();
    let wanted = Wanted::number(-1e15, 1e15, "a curve's value");
    found.curve(&format!("curves.{name}"), curve, wanted);
    found.0.into_iter().next()
}

#[derive(Default)]
struct Problems(Vec<Problem>);

impl Problems {
    fn add(&mut self, key: impl Into<String>, message: impl Into<String>) {
        self.0.push(Problem {
            key: key.into(),
            message: message.into(),
            help: None,
        });
    }

    fn add_with_help(
        &mut self,
        key: impl Into<String>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        self.0.push(Problem {
            key: key.into(),
            message: message.into(),
            help: Some(help.into()),
        });
    }

    /// Holds a number to a closed range; NaN lies in none. Says whether it fits.
    fn range(&mut self, key: &str, value: f64, wanted: Wanted) -> bool {
        let fits = wanted.low <= value && value <= wanted.high;
        if !fits {
            self.add(
                key,
                format!("{} is {}", wanted.complaint(), show(value, wanted.unit)),
            );
        }
        fits
    }

    /// Holds every value of a curve to a range, and its keys to the form of a curve.
    fn curve(&mut self, key: &str, curve: &Curve, wanted: Wanted) {
        let keys = curve.keys();
        if curve.values().is_empty() {
            self.add(key, "the curve has no keys");
        }
        if keys.len() > field::graph::KEYS_MAX {
            self.add(
                key,
                format!(
                    "the curve has {} keys; {} are the most",
                    keys.len(),
                    field::graph::KEYS_MAX
                ),
            );
        }
        if keys.iter().any(|key| !(key.0.abs() <= TIME_MAX)) {
            self.add(
                key,
                "an instant of the curve is not within 1e9 s of image 0",
            );
        }
        if let Some(pair) = keys.windows(2).find(|pair| !(pair[0].0 < pair[1].0)) {
            self.add(
                key,
                format!(
                    "instants of a curve must rise, but {} s follows {} s",
                    pair[1].0, pair[0].0
                ),
            );
        }
        for value in curve.values() {
            if !self.range(key, value, wanted) {
                break;
            }
        }
    }

    fn place(&mut self, key: &str, place: [f64; 3]) {
        for value in place {
            if !self.range(
                key,
                value,
                Wanted::length(-LENGTH_MAX, LENGTH_MAX, "a coordinate"),
            ) {
                break;
            }
        }
    }

    fn colour(&mut self, key: &str, colour: [f64; 3], high: f64) {
        for value in colour {
            if !self.range(
                key,
                value,
                Wanted::number(0.0, high, "a colour's component"),
            ) {
                break;
            }
        }
    }

    /// Holds a pair to rising order.
    fn rising(&mut self, key: &str, [low, high]: [f64; 2]) {
        if !(low < high) {
            self.add_with_help(
                key,
                "the range is empty: its first end must be below its second",
                format!("swap them? {low} is not below {high}"),
            );
        }
    }
}

/// A closed range, and how to speak of it.
#[derive(Clone, Copy)]
struct Wanted {
    low: f64,
    high: f64,
    what: &'static str,
    unit: Unit,
}

#[derive(Clone, Copy, PartialEq)]
enum Unit {
    Number,
    Length,
    Angle,
    Time,
    Speed,
}

impl Wanted {
    const fn number(low: f64, high: f64, what: &'static str) -> Self {
        Self {
            low,
            high,
            what,
            unit: Unit::Number,
        }
    }

    const fn length(low: f64, high: f64, what: &'static str) -> Self {
        Self {
            low,
            high,
            what,
            unit: Unit::Length,
        }
    }

    /// The range is given in degrees and held in radians.
    fn angle(low: f64, high: f64, what: &'static str) -> Self {
        // Half an ulp more than the bound, so that the bound itself, read from degrees, fits.
        let slack = 1e-12;
        Self {
            low: low.to_radians() - slack,
            high: high.to_radians() + slack,
            what,
            unit: Unit::Angle,
        }
    }

    const fn time(low: f64, high: f64, what: &'static str) -> Self {
        Self {
            low,
            high,
            what,
            unit: Unit::Time,
        }
    }

    const fn speed(low: f64, high: f64, what: &'static str) -> Self {
        Self {
            low,
            high,
            what,
            unit: Unit::Speed,
        }
    }

    fn complaint(self) -> String {
        format!(
            "{} must lie between {} and {}, but it",
            self.what,
            show(self.low, self.unit),
            show(self.high, self.unit)
        )
    }
}

fn show(value: f64, unit: Unit) -> String {
    match unit {
        Unit::Number => brief(value),
        Unit::Length => format!("{} m", brief(value)),
        Unit::Angle => format!("{} deg", brief(value.to_degrees())),
        Unit::Time => format!("{} s", brief(value)),
        Unit::Speed => format!("{} m/s", brief(value)),
    }
}

/// A number with as many digits as help: 1e9, 25, 0.333333.
fn brief(value: f64) -> String {
    if value != 0.0 && !(1e-4..1e7).contains(&value.abs()) {
        return format!("{value:e}");
    }
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn name(name: &str, found: &mut Problems) {
    let fits = (1..=64).contains(&name.len())
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'))
        && name.starts_with(|c: char| c.is_ascii_alphanumeric());
    if !fits {
        found.add_with_help(
            "name",
            format!("{name:?} cannot start the names of frames"),
            "use 1 to 64 letters, digits, `-`, `_` and `.`, the first a letter or digit",
        );
    }
}

fn assets(assets: &[AssetRef], found: &mut Problems) {
    if assets.len() > ASSETS_MAX {
        found.add(
            "assets",
            format!(
                "the scene names {} files; {ASSETS_MAX} are the most",
                assets.len()
            ),
        );
    }
    for asset in assets {
        if asset.name.is_empty() || asset.name.len() > 1024 {
            found.add("assets", "a file's name has 1 to 1024 bytes");
        }
        if asset.bytes > ASSET_BYTES_MAX {
            found.add(
                "assets",
                format!(
                    "`{}` is larger than {} MiB",
                    asset.name,
                    ASSET_BYTES_MAX >> 20
                ),
            );
        }
    }
}
