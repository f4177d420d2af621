//! Ready hypertextures (thesis §10.2): functions that a scene names and adjusts, made of what the language has.
//!
//! Each gives a height in metres at a place, to be taken off the seed: `seed - mountains(base)`. At `base` it is a
//! displacement map (thesis eq. (2.23)); those that live at `p` may hang over.

use field::Op;
use rhai::{Dynamic, Map};
use serde_json::{Value, json};

use super::Shared;
use super::cascades::CASCADES;
use super::noises::known_options;
use super::values::{Made, Operand, Scalar, Vector, refuse};

/// A ready hypertexture: its name, what it is, its settings where they are not given.
pub(super) struct Ready {
    pub(super) name: &'static str,
    about: &'static str,
    /// Height of the highest over the lowest, about, in metres.
    amplitude: f64,
    /// Size of its largest features in metres.
    scale: f64,
    octaves: f64,
    make: fn(&Texture<'_>) -> Made<Dynamic>,
}

/// What every one of them can be told.
const OPTIONS: [(&str, &str); 4] = [
    (
        "amplitude",
        "From its lowest to its highest, about, in metres.",
    ),
    ("scale", "Size of its largest features in metres."),
    ("octaves", "Layers of noise of its finest part, 1 to 48."),
    (
        "key",
        "Another key is another place of the same kind, 0 to 4294967231.",
    ),
];

/// Keys of one hypertexture's noises follow each other; so many are set aside for it.
const KEYS: u32 = 64;

pub(super) const LIBRARY: &[Ready] = &[
    Ready {
        name: "hills",
        about: "Rolling hills: fBm with H = 1, its valleys flattened by a power.",
        amplitude: 130.0,
        scale: 500.0,
        octaves: 6.0,
        make: hills,
    },
    Ready {
        name: "mountains",
        about: "Ridged mountains: statistics by altitude (3.45) of ridged noise, the ridges bent by a slow warp.",
        amplitude: 900.0,
        scale: 1800.0,
        octaves: 11.0,
        make: mountains,
    },
    Ready {
        name: "canyons",
        about: "A plateau cut by winding canyons with ledges of hard rock.",
        amplitude: 280.0,
        scale: 1300.0,
        octaves: 8.0,
        make: canyons,
    },
    Ready {
        name: "dunes",
        about: "Dunes across a wind from +x, with ripples on them.",
        amplitude: 14.0,
        scale: 90.0,
        octaves: 4.0,
        make: dunes,
    },
    Ready {
        name: "craters",
        about: "A cratered moon: bowls with rims around the nodes of cellular noise, in several sizes.",
        amplitude: 90.0,
        scale: 500.0,
        octaves: 5.0,
        make: craters,
    },
    Ready {
        name: "boulders",
        about: "Boulders of cellular noise in three dimensions; at `p` they hang over.",
        amplitude: 4.0,
        scale: 5.0,
        octaves: 5.0,
        make: boulders,
    },
    Ready {
        name: "flames",
        about: "Tongues as of fire or long fur: turbulence that rises steeply; at `p` they sway and come free.",
        amplitude: 0.4,
        scale: 0.5,
        octaves: 5.0,
        make: flames,
    },
    Ready {
        name: "mud",
        about: "Mud that dried and cracked: plates between the walls of cellular noise.",
        amplitude: 0.06,
        scale: 0.4,
        octaves: 5.0,
        make: mud,
    },
];

/// One that is being made: its place in units of its scale, and its settings.
struct Texture<'a> {
    shared: &'a Shared,
    at: Dynamic,
    octaves: f64,
    key: u32,
}

impl Shared {
    /// A ready hypertexture at a place.
    pub(super) fn ready(&self, ready: &Ready, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        let name = ready.name;
        Self::vector(name, at)?;
        known_options(name, options, &OPTIONS.map(|(option, _)| option))?;
        let number = |option: &str, default: f64| match options.get(option) {
            Some(value) => Self::constant(&format!("{name}: {option}"), value),
            None => Ok(default),
        };
        let amplitude = match options.get("amplitude") {
            // A height may change with time or from place to place.
            Some(value) if value.is::<Scalar>() => value.clone(),
            _ => Dynamic::from_float(number("amplitude", ready.amplitude)?),
        };
        let scale = number("scale", ready.scale)?;
        if scale <= 0.0 {
            return refuse(
                format!("`{name}` wants a scale above 0, not {scale}"),
                "it is the size of its largest features in metres",
            );
        }
        let octaves = number("octaves", ready.octaves)?;
        let key = number("key", 0.0)?;
        let keys = f64::from(u32::MAX - KEYS);
        if !(0.0..=keys).contains(&key) || key % 1.0 != 0.0 {
            return refuse(
                format!("`{name}` wants a key from 0 to {keys}, not {key}"),
                "another key is another place of the same kind",
            );
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole and in range: checked above"
        )]
        let key = key as u32;
        let texture = Texture {
            shared: self,
            at: self.arithmetic(Op::Div, at, &Dynamic::from_float(scale))?,
            octaves,
            key,
        };
        let height = (ready.make)(&texture)?;
        self.arithmetic(Op::Mul, &height, &amplitude)
    }
}

impl Texture<'_> {
    fn join(&self, op: Op, a: &Dynamic, b: impl Into<Dynamic>) -> Made<Dynamic> {
        self.shared.arithmetic(op, a, &b.into())
    }

    fn one(&self, op: Op, a: &Dynamic) -> Made<Dynamic> {
        let name = op.signature().name;
        let a = self.shared.scalar(name, Shared::operand(name, a)?)?;
        Ok(Operand::Scalar(self.shared.push(op, &[a], &[])?).into_dynamic())
    }

    fn smoothstep(&self, low: f64, high: f64, a: &Dynamic) -> Made<Dynamic> {
        let [low, high] = [low, high].map(Dynamic::from_float);
        self.shared.smoothstep(&low, &high, a)
    }

    /// A place larger by a factor: its features are smaller by it.
    fn finer(&self, at: &Dynamic, factor: f64) -> Made<Dynamic> {
        self.join(Op::Mul, at, factor)
    }

    /// One of the noises that this hypertexture has for itself.
    fn noise(&self, at: &Dynamic, which: u32) -> Made<Dynamic> {
        self.shared.noise(at, f64::from(self.key + which))
    }

    /// A cascade by its name, over a noise of its own.
    fn cascade(
        &self,
        name: &str,
        at: &Dynamic,
        which: u32,
        given: &[(&str, f64)],
    ) -> Made<Dynamic> {
        let cascade = CASCADES
            .iter()
            .find(|cascade| cascade.name == name)
            .expect("the names below are in the table");
        let mut options = self.options(which, given);
        options
            .entry("octaves".into())
            .or_insert(self.octaves.into());
        if name == "altitude2" {
            options.insert("basis".into(), "ridged".into());
        }
        self.shared.cascade(cascade, at, &options)
    }

    /// A place moved by three noises of its own.
    fn warped(&self, at: &Dynamic, which: u32, scale: f64, amount: f64) -> Made<Dynamic> {
        let options = self.options(which, &[("scale", scale), ("amount", amount)]);
        self.shared.warp(at, &options)
    }

    /// Distances to the nodes of cellular noise with these weights, their mean not taken off.
    fn distances(
        &self,
        at: &Dynamic,
        which: u32,
        weights: [f64; 2],
        density: f64,
    ) -> Made<Dynamic> {
        let at = Shared::vector("cellular", at)?;
        let key = f64::from(self.key + which);
        let [a, b] = weights;
        let constants = [key, 2.0, density, a, b, 0.0, 0.0, 0.0, 0.0];
        let id = self.shared.push(Op::CellularNoise, &[at], &constants)?;
        Ok(Operand::Scalar(id).into_dynamic())
    }

    fn options(&self, which: u32, given: &[(&str, f64)]) -> Map {
        let mut options = Map::new();
        options.insert("key".into(), f64::from(self.key + which).into());
        for (option, value) in given {
            options.insert((*option).into(), (*value).into());
        }
        options
    }

    /// The parts of the place, scaled each.
    fn stretched(&self, factors: [f64; 3]) -> Made<Dynamic> {
        let at = Shared::vector("stretched", &self.at)?;
        Ok(Dynamic::from(Vector(self.shared.stretched(at, factors)?)))
    }
}

/// (½ + ½ fBm)^1.4: rounded tops, wide valleys.
fn hills(t: &Texture<'_>) -> Made<Dynamic> {
    let sum = t.cascade("fbm", &t.at, 0, &[("hurst", 1.2)])?;
    let raised = t.join(Op::Add, &t.join(Op::Mul, &sum, 0.6)?, 0.5)?;
    t.shared.power(&raised, &Dynamic::from_float(1.5))
}

/// Where ridges run is moved by a noise twice as large as they are apart.
fn mountains(t: &Texture<'_>) -> Made<Dynamic> {
    let place = t.warped(&t.at, 8, 0.7, 0.35)?;
    let ridges = t.cascade("altitude2", &place, 0, &[("hurst", 0.45), ("xi", 0.0)])?;
    t.join(Op::Mul, &ridges, 0.55)
}

/// |noise| is 0 along winding lines: the canyons' floors. Walls rise from there in two steps with a ledge between.
fn canyons(t: &Texture<'_>) -> Made<Dynamic> {
    let place = t.warped(&t.at, 8, 1.3, 0.3)?;
    let rough = t.cascade("fbm", &t.finer(&t.at, 3.0)?, 16, &[("hurst", 0.75)])?;
    let away = t.one(Op::Abs, &t.noise(&place, 0)?)?;
    let away = t.join(Op::Add, &away, t.join(Op::Mul, &rough, 0.05)?)?;
    let lower = t.smoothstep(0.05, 0.12, &away)?;
    let upper = t.smoothstep(0.2, 0.3, &away)?;
    let walls = t.join(
        Op::Add,
        &t.join(Op::Mul, &lower, 0.45)?,
        t.join(Op::Mul, &upper, 0.5)?,
    )?;
    t.join(Op::Add, &walls, t.join(Op::Mul, &rough, 0.06)?)
}

/// Crests of 1 − |noise|, long across the wind, with a gentle slope to windward: the place is moved along the wind
/// by how high it is.
fn dunes(t: &Texture<'_>) -> Made<Dynamic> {
    let long = t.stretched([1.0, 0.4, 1.0])?;
    let place = t.warped(&long, 8, 0.6, 0.4)?;
    let crest = t.one(Op::Abs, &t.noise(&place, 0)?)?;
    // √(n² + ε) in the place of |n| keeps crests from being knives.
    let square = t.join(Op::Add, &t.join(Op::Mul, &crest, crest.clone())?, 0.0008)?;
    let crest = t.join(
        Op::Sub,
        &Dynamic::from_float(1.0),
        t.one(Op::Sqrt, &square)?,
    )?;
    let high = t.shared.power(&crest, &Dynamic::from_float(2.0))?;
    let swell = t.cascade("fbm", &t.finer(&long, 0.5)?, 16, &[("hurst", 1.0)])?;
    let waves = t.warped(&t.stretched([60.0, 9.0, 60.0])?, 24, 0.12, 4.0)?;
    let ripples = t.noise(&waves, 32)?;
    let body = t.join(
        Op::Add,
        &t.join(Op::Mul, &high, 0.8)?,
        t.join(Op::Mul, &swell, 0.2)?,
    )?;
    t.join(Op::Add, &body, t.join(Op::Mul, &ripples, 0.006)?)
}

/// Sizes of craters, each half the last, shallower in proportion.
fn craters(t: &Texture<'_>) -> Made<Dynamic> {
    const SIZES: u32 = 4;
    let rough = t.cascade("fbm", &t.finer(&t.at, 2.0)?, 32, &[("hurst", 0.9)])?;
    let mut ground = t.join(Op::Mul, &rough, 0.12)?;
    let (mut finer, mut lower) = (1.0, 1.0);
    for size in 0..SIZES {
        let place = t.finer(&t.at, finer)?;
        let away = t.distances(&place, size, [1.0, 0.0], 0.35)?;
        // A bowl up to 0.4 away, a rim there, and what was thrown out falling off to 0.75.
        let bowl = t.smoothstep(0.05, 0.42, &away)?;
        let apron = t.smoothstep(0.38, 0.75, &away)?;
        let shape = t.join(
            Op::Sub,
            &t.join(Op::Mul, &bowl, 1.0)?,
            t.join(Op::Mul, &apron, 0.3)?,
        )?;
        ground = t.join(Op::Add, &ground, t.join(Op::Mul, &shape, 0.55 * lower)?)?;
        finer *= 2.1;
        lower *= 0.5;
    }
    Ok(ground)
}

/// 1 − (distance to the nearest node)² is a ball around each node; smaller ones lie on larger ones.
fn boulders(t: &Texture<'_>) -> Made<Dynamic> {
    let place = t.warped(&t.at, 8, 1.5, 0.12)?;
    let ball = |at: &Dynamic, which: u32| {
        let away = t.distances(at, which, [1.0, 0.0], 1.0)?;
        let square = t.join(Op::Mul, &away, away.clone())?;
        t.join(Op::Sub, &Dynamic::from_float(1.0), square)
    };
    let large = t.join(Op::Mul, &ball(&place, 0)?, 0.8)?;
    let small = t.join(Op::Mul, &ball(&t.finer(&place, 2.7)?, 1)?, 0.14)?;
    let rough = t.cascade("fbm", &t.finer(&t.at, 2.5)?, 16, &[("hurst", 0.8)])?;
    let both = t.join(Op::Add, &large, small)?;
    t.join(Op::Add, &both, t.join(Op::Mul, &rough, 0.035)?)
}

/// The square of a noise that is drawn out by turbulence: few high tongues between wide low places.
fn flames(t: &Texture<'_>) -> Made<Dynamic> {
    let place = t.warped(&t.at, 8, 1.3, 0.2)?;
    let wild = t.cascade("turbulence", &t.finer(&place, 1.5)?, 0, &[("hurst", 1.0)])?;
    let tongue = t.noise(&t.finer(&place, 1.6)?, 16)?;
    let sum = t.join(Op::Add, &tongue, t.join(Op::Mul, &wild, 0.4)?)?;
    let zero = Dynamic::from_float(0.0);
    let above = t
        .shared
        .scalars(Op::Max, [&sum, &zero], |[a, b]| if b > a { b } else { a })?;
    t.shared.power(&above, &Dynamic::from_float(2.0))
}

/// The second distance less the first is 0 on the walls between cells, which crack; plates curl up a little there.
fn mud(t: &Texture<'_>) -> Made<Dynamic> {
    let place = t.warped(&t.at, 8, 2.0, 0.06)?;
    let wall = t.distances(&place, 0, [-1.0, 1.0], 1.0)?;
    let plate = t.smoothstep(0.02, 0.08, &wall)?;
    let curl = t.smoothstep(0.06, 0.5, &wall)?;
    let rough = t.cascade("fbm", &t.finer(&t.at, 4.0)?, 16, &[("hurst", 0.7)])?;
    let body = t.join(
        Op::Sub,
        &t.join(Op::Mul, &plate, 1.0)?,
        t.join(Op::Mul, &curl, 0.22)?,
    )?;
    t.join(Op::Add, &body, t.join(Op::Mul, &rough, 0.08)?)
}

/// The library and its settings, for the schema.
pub(crate) fn described() -> Value {
    let functions = LIBRARY.iter().map(|ready| {
        let option = |name: &str| match name {
            "amplitude" => json!(ready.amplitude),
            "scale" => json!(ready.scale),
            "octaves" => json!(ready.octaves),
            _ => json!(0),
        };
        let options: serde_json::Map<String, Value> = OPTIONS
            .into_iter()
            .map(|(name, about)| {
                let entry = json!({ "about": about, "default": option(name) });
                (name.to_owned(), entry)
            })
            .collect();
        let about = json!({ "about": ready.about, "options": options });
        (ready.name.to_owned(), about)
    });
    Value::Object(functions.collect())
}
