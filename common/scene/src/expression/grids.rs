//! Discrete surfaces in expressions: from files, and by recipe.
//!
//! The graph's grids count samples; here they are given their place in the world, in metres.

use std::rc::Rc;
use std::sync::Arc;

use field::grid::{Edges, Samples};
use field::{NodeId, Op};
use rhai::{Dynamic, Engine, ImmutableString, Map};

use super::Shared;
use super::values::{Made, Operand, refuse};
use crate::file::nearest;
use crate::grid_file;

/// What options may say where they are words, with the numbers that graphs know them by.
type Words = &'static [(&'static str, f64)];

const SPLINES: Words = &[("linear", 1.0), ("quadratic", 2.0), ("cubic", 3.0)];
const EDGES: Words = &[("repeat", 0.0), ("hold", 1.0)];
const MESHES: Words = &[("squares", 0.0), ("triangles", 1.0)];
const ADDITIONS: Words = &[("midpoints", 0.0), ("all", 1.0)];

/// Options by name, with what they are where they are not given.
struct Options<'a> {
    function: &'static str,
    given: &'a Map,
    known: &'static [&'static str],
}

impl<'a> Options<'a> {
    fn new(function: &'static str, given: &'a Map, known: &'static [&'static str]) -> Made<Self> {
        let unknown = given.keys().find(|key| !known.contains(&key.as_str()));
        if let Some(unknown) = unknown {
            let help = match nearest(unknown, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("its options are {}", known.join(", ")),
            };
            return refuse(format!("`{function}` has no option `{unknown}`"), help);
        }
        Ok(Self {
            function,
            given,
            known,
        })
    }

    fn number(&self, name: &'static str, otherwise: f64) -> Made<f64> {
        debug_assert!(self.known.contains(&name), "an option has one list");
        match self.given.get(name) {
            Some(value) => Shared::constant(&format!("{}: {name}", self.function), value),
            None => Ok(otherwise),
        }
    }

    /// A length, a spacing: something that is divided by.
    fn positive(&self, name: &'static str, otherwise: f64) -> Made<f64> {
        let value = self.number(name, otherwise)?;
        if value > 0.0 && value.is_finite() {
            return Ok(value);
        }
        refuse(
            format!(
                "`{}: {name}` is {value}, but must be above 0",
                self.function
            ),
            "it is a length in metres",
        )
    }

    fn word(&self, name: &'static str, words: Words, otherwise: &str) -> Made<f64> {
        let word = match self.given.get(name) {
            Some(value) => value.clone().into_string().unwrap_or_default(),
            None => otherwise.to_owned(),
        };
        let list = || {
            let all: Vec<_> = words
                .iter()
                .map(|(word, _)| format!("\"{word}\""))
                .collect();
            all.join(" or ")
        };
        match words.iter().find(|(known, _)| *known == word) {
            Some((_, number)) => Ok(*number),
            None => refuse(
                format!("`{}: {name}` is not {}", self.function, list()),
                format!("write {name}: {}", list()),
            ),
        }
    }
}

/// A function of the language: a place, options, a field.
type Recipe = fn(&Shared, &Dynamic, &Map) -> Made<Dynamic>;

/// Makes the functions known to the engine.
pub(super) fn register(engine: &mut Engine, shared: &Rc<Shared>) {
    let recipes: [(&str, Recipe); 4] = [
        ("spectral_terrain", Shared::spectral_terrain),
        ("spectral_flakes", Shared::spectral_flakes),
        ("sea", Shared::sea),
        ("midpoint_terrain", Shared::midpoint_terrain),
    ];
    for (name, recipe) in recipes {
        let s = shared.clone();
        engine.register_fn(name, move |p: Dynamic| recipe(&s, &p, &Map::new()));
        let s = shared.clone();
        engine.register_fn(name, move |p: Dynamic, options: Map| {
            recipe(&s, &p, &options)
        });
    }
    for (name, axes) in [("heightmap", 2), ("volume", 3)] {
        let s = shared.clone();
        engine.register_fn(name, move |file: ImmutableString, p: Dynamic| {
            s.file(name, axes, &file, &p, &Map::new())
        });
        let s = shared.clone();
        engine.register_fn(
            name,
            move |file: ImmutableString, p: Dynamic, options: Map| {
                s.file(name, axes, &file, &p, &options)
            },
        );
    }
}

impl Shared {
    /// fBm by spectral synthesis over x and y: `height` is its standard deviation, and it repeats every size · spacing.
    fn spectral_terrain(&self, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        self.spectral("spectral_terrain", 2.0, at, options)
    }

    /// The same in three dimensions: its level surfaces are fractal flakes.
    fn spectral_flakes(&self, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        self.spectral("spectral_flakes", 3.0, at, options)
    }

    fn spectral(
        &self,
        function: &'static str,
        axes: f64,
        at: &Dynamic,
        options: &Map,
    ) -> Made<Dynamic> {
        let known = &["size", "spacing", "height", "hurst", "key", "spline"];
        let options = Options::new(function, options, known)?;
        let params = [
            axes,
            options.number("size", if axes == 3.0 { 64.0 } else { 256.0 })?,
            options.number("hurst", 0.8)?,
            options.number("key", 0.0)?,
            options.word("spline", SPLINES, "cubic")?,
        ];
        let place = self.in_samples(function, at, options.positive("spacing", 1.0)?, [0.0; 3])?;
        let value = self.push(Op::SpectralTerrain, &[place], &params)?;
        self.affine(value, options.number("height", 1.0)?, 0.0)
    }

    /// A sea's height in metres over x and y: it repeats every size · spacing.
    fn sea(&self, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        let function = "sea";
        let known = &["size", "spacing", "wind", "direction", "key", "spline"];
        let options = Options::new(function, options, known)?;
        let spacing = options.positive("spacing", 1.0)?;
        let params = [
            options.number("size", 256.0)?,
            spacing,
            options.number("wind", 10.0)?,
            options.number("direction", 0.0)?.to_radians(),
            options.number("key", 0.0)?,
            options.word("spline", SPLINES, "cubic")?,
        ];
        let place = self.in_samples(function, at, spacing, [0.0; 3])?;
        Ok(Operand::Scalar(self.push(Op::Sea, &[place], &params)?).into_dynamic())
    }

    /// fBm by midpoint subdivision of a square of side `width` about the origin; outside, its edge goes on.
    fn midpoint_terrain(&self, at: &Dynamic, options: &Map) -> Made<Dynamic> {
        let function = "midpoint_terrain";
        let known = &[
            "levels", "width", "height", "hurst", "key", "mesh", "displace", "spline",
        ];
        let options = Options::new(function, options, known)?;
        let levels = options.number("levels", 8.0)?;
        let params = [
            levels,
            options.word("mesh", MESHES, "squares")?,
            options.word("displace", ADDITIONS, "midpoints")?,
            options.number("hurst", 0.8)?,
            options.number("key", 0.0)?,
            options.word("spline", SPLINES, "linear")?,
        ];
        let steps = libm::exp2(levels.clamp(0.0, 64.0));
        let spacing = options.positive("width", 1.0)? / steps;
        let place = self.in_samples(function, at, spacing, [0.5 * steps, 0.5 * steps, 0.0])?;
        let value = self.push(Op::MidpointTerrain, &[place], &params)?;
        self.affine(value, options.number("height", 1.0)?, 0.0)
    }

    /// The samples of a file about the origin, `spacing` metres apart: 0 becomes `low`, 1 becomes `high`.
    fn file(
        &self,
        function: &'static str,
        axes: usize,
        name: &str,
        at: &Dynamic,
        options: &Map,
    ) -> Made<Dynamic> {
        let known = &["spacing", "low", "high", "edges", "spline"];
        let options = Options::new(function, options, known)?;
        let (number, samples) = self.samples(name)?;
        let sides = samples.sides();
        let found = if sides[2] == 1 { 2 } else { 3 };
        if found != axes {
            return refuse(
                format!("`{name}` has samples in {found} dimensions, `{function}` wants {axes}"),
                "heightmap(...) takes files of two dimensions, volume(...) of three",
            );
        }
        let edges = options.word("edges", EDGES, "hold")?;
        let params = [
            f64::from(number),
            edges,
            options.word("spline", SPLINES, "cubic")?,
        ];
        #[expect(
            clippy::cast_precision_loss,
            reason = "a side has at most 2^24 samples"
        )]
        let middle = sides.map(|side| {
            let repeats = Edges::from_number(edges) == Some(Edges::Repeat);
            let last = if repeats { side } else { side - 1 };
            if side == 1 { 0.0 } else { 0.5 * last as f64 }
        });
        let place = self.in_samples(function, at, options.positive("spacing", 1.0)?, middle)?;
        let value = self.push(Op::Grid, &[place], &params)?;
        let (low, high) = (options.number("low", 0.0)?, options.number("high", 1.0)?);
        self.affine(value, high - low, low)
    }

    /// The samples of a file, read and attached the first time it is named.
    fn samples(&self, name: &str) -> Made<(u32, Arc<Samples>)> {
        let Some(files) = &self.files else {
            return refuse(
                "an expression outside of a scene names no files",
                "use a recipe such as spectral_terrain(p)",
            );
        };
        let help = "paths are relative to the scene file";
        let (number, bytes) = match files.get(name) {
            Ok(read) => read,
            Err(message) => return refuse(message, help),
        };
        if let Some(known) = self.graph.borrow().files().get(&number) {
            return Ok((number, known.clone()));
        }
        match grid_file::decode(&bytes) {
            Ok(samples) => {
                let samples = Arc::new(samples);
                self.graph.borrow_mut().attach(number, samples.clone());
                Ok((number, samples))
            }
            Err(message) => refuse(
                format!("`{name}` is no grid: {message}"),
                "a grid is a grey PNG image, or `flyby-grid 1`, a line of sides, and 32-bit floats",
            ),
        }
    }

    /// A place in metres as one that counts samples.
    fn in_samples(
        &self,
        function: &str,
        at: &Dynamic,
        spacing: f64,
        middle: [f64; 3],
    ) -> Made<NodeId> {
        let mut place = Self::vector(function, at)?;
        if spacing != 1.0 {
            let factor = self.push(Op::Constant, &[], &[1.0 / spacing])?;
            place = self.push(Op::Scale, &[place, factor], &[])?;
        }
        if middle != [0.0; 3] {
            let parts = middle
                .iter()
                .map(|part| self.push(Op::Constant, &[], &[*part]))
                .collect::<Made<Vec<_>>>()?;
            let middle = self.push(Op::Vector, &parts, &[])?;
            place = self.push(Op::VectorAdd, &[place, middle], &[])?;
        }
        Ok(place)
    }

    /// factor · value + offset.
    fn affine(&self, value: NodeId, factor: f64, offset: f64) -> Made<Dynamic> {
        let mut value = value;
        if factor != 1.0 {
            let factor = self.push(Op::Constant, &[], &[factor])?;
            value = self.push(Op::Mul, &[value, factor], &[])?;
        }
        if offset != 0.0 {
            let offset = self.push(Op::Constant, &[], &[offset])?;
            value = self.push(Op::Add, &[value, offset], &[])?;
        }
        Ok(Operand::Scalar(value).into_dynamic())
    }
}
