//! The language of field expressions: what of Rhai is there, what is added, and every limit.

use std::rc::Rc;

use field::Op;
use rhai::packages::{BasicIteratorPackage, Package};
use rhai::{Array, Dynamic, Engine, FLOAT, INT, Map, OptimizationLevel};

use super::Shared;
use super::cascades::CASCADES;
use super::differences;
use super::grids;
use super::library::LIBRARY;
use super::noises::NOISES;
use super::refusal;
use super::shapes;
use super::solids;
use super::values::{Made, Scalar, Vector, refuse};

/// Names that mean something without having been defined.
pub(super) const NAMES: &[&str] = &["p", "t", "seed", "height", "base", "R", "PI"];

/// Functions of the language.
pub(super) const FUNCTIONS: &[&str] = &[
    "noise",
    "fbm",
    "turbulence",
    "ridged",
    "altitude1",
    "altitude2",
    "ridged_multifractal",
    "heightmap",
    "volume",
    "spectral_terrain",
    "spectral_flakes",
    "sea",
    "midpoint_terrain",
    "weierstrass",
    "gradient_noise",
    "value_noise",
    "value_gradient_noise",
    "simplex",
    "sparse",
    "cellular",
    "spot",
    "wavelet",
    "gradient",
    "slope",
    "curvature",
    "warp",
    "length",
    "dot",
    "vec",
    "onto_sphere",
    "onto_plane",
    "abs",
    "min",
    "max",
    "clamp",
    "sqrt",
    "sin",
    "cos",
    "exp",
    "smoothstep",
    "mix",
    "select",
    "len",
    "polynomial",
    "superquadric",
    "sphere",
    "blobs",
    "distances",
    "convolution",
    "bezier_tetrahedra",
    "union",
    "intersection",
    "difference",
    "blend",
    "morph",
    "twist",
    "taper",
    "bend",
    "free_form",
    "hills",
    "mountains",
    "canyons",
    "dunes",
    "craters",
    "boulders",
    "flames",
    "mud",
];

/// Symbols that are refused while parsing; [`refusal`] says what to use instead.
pub(super) const REFUSED: &[&str] = &[
    "^",
    "^=",
    "/=",
    "**=",
    "switch",
    "eval",
    "import",
    "export",
    "print",
    "debug",
    "Fn",
    "call",
    "curry",
    "try",
    "catch",
    "throw",
    "this",
    "private",
    "is_shared",
];

/// What a division by a constant 0 is told.
pub(super) const BY_ZERO: &str = "this divides by zero";
pub(super) const BY_ZERO_HELP: &str = "check what stands below the `/`";

/// An engine without anything but this language.
pub(super) fn engine(shared: &Rc<Shared>) -> Engine {
    let mut engine = Engine::new_raw();
    limit(&mut engine);
    for symbol in REFUSED {
        engine.disable_symbol(*symbol);
    }
    // Rhai's own arithmetic would be taken before ours, while parsing and while running.
    engine.set_optimization_level(OptimizationLevel::None);
    engine.set_fast_operators(false);
    engine.register_type_with_name::<Scalar>("field");
    engine.register_type_with_name::<Vector>("vector");
    BasicIteratorPackage::new().register_into_engine(&mut engine);
    engine.register_iterator::<Array>();
    engine.register_fn("len", |array: &mut Array| {
        INT::try_from(array.len()).unwrap_or(INT::MAX)
    });
    numbers(&mut engine);
    operators(&mut engine, shared);
    comparisons(&mut engine);
    functions(&mut engine, shared);
    cascades(&mut engine, shared);
    shapes::register(&mut engine, shared);
    solids::register(&mut engine, shared);
    differences::register(&mut engine, shared);
    grids::register(&mut engine, shared);
    noises(&mut engine, shared);
    library(&mut engine, shared);
    names(&mut engine, shared);
    engine
}

/// Nothing a script does may cost more than a few tens of milliseconds and of megabytes.
fn limit(engine: &mut Engine) {
    engine.set_max_operations(500_000);
    engine.set_max_call_levels(16);
    engine.set_max_expr_depths(64, 32);
    engine.set_max_string_size(1024);
    engine.set_max_array_size(1024);
    engine.set_max_map_size(1024);
    engine.set_max_variables(256);
    engine.set_max_functions(64);
    engine.set_max_modules(0);
    engine.set_allow_anonymous_fn(false);
}

/// What Rhai's integers would do differently from numbers on paper.
#[expect(
    clippy::cast_precision_loss,
    reason = "as Rhai itself turns integers into floats"
)]
fn numbers(engine: &mut Engine) {
    let divide = |a: FLOAT, b: FLOAT| -> Made<FLOAT> {
        if b == 0.0 {
            return refuse(BY_ZERO, BY_ZERO_HELP);
        }
        Ok(a / b)
    };
    engine.register_fn("/", move |a: INT, b: INT| divide(a as FLOAT, b as FLOAT));
    engine.register_fn("/", move |a: FLOAT, b: INT| divide(a, b as FLOAT));
    engine.register_fn("/", move |a: INT, b: FLOAT| divide(a as FLOAT, b));
    engine.register_fn("/", divide);
    engine.register_fn("**", |a: INT, b: INT| libm::pow(a as FLOAT, b as FLOAT));
    engine.register_fn("**", |a: FLOAT, b: INT| libm::pow(a, b as FLOAT));
    engine.register_fn("**", |a: INT, b: FLOAT| libm::pow(a as FLOAT, b));
    engine.register_fn("**", |a: FLOAT, b: FLOAT| libm::pow(a, b));
    engine.register_fn("-", |a: INT| -> Made<INT> {
        a.checked_neg().map_or_else(
            || refuse("the number is too large", "write it as 1.0e3"),
            Ok,
        )
    });
    engine.register_fn("-", |a: FLOAT| -a);
    engine.register_fn("+", |a: INT| a);
    engine.register_fn("+", |a: FLOAT| a);
    engine.register_fn("!", |a: bool| !a);
}

/// Registers a function of two values for every pair of which one is a field or a vector.
fn with_a_field(
    engine: &mut Engine,
    name: &str,
    function: impl Fn(&Dynamic, &Dynamic) -> Made<Dynamic> + Clone + 'static,
) {
    let f = function.clone();
    engine.register_fn(name, move |a: Scalar, b: Dynamic| f(&Dynamic::from(a), &b));
    let f = function.clone();
    engine.register_fn(name, move |a: Dynamic, b: Scalar| f(&a, &Dynamic::from(b)));
    let f = function.clone();
    engine.register_fn(name, move |a: Vector, b: Dynamic| f(&Dynamic::from(a), &b));
    engine.register_fn(name, move |a: Dynamic, b: Vector| {
        function(&a, &Dynamic::from(b))
    });
}

fn operators(engine: &mut Engine, shared: &Rc<Shared>) {
    for op in [Op::Add, Op::Sub, Op::Mul, Op::Div] {
        let shared = shared.clone();
        let name = op.signature().name;
        with_a_field(engine, name, move |a, b| shared.arithmetic(op, a, b));
    }
    let power = shared.clone();
    with_a_field(engine, "**", move |a, b| power.power(a, b));
    let negate = shared.clone();
    engine.register_fn("-", move |a: Scalar| negate.negated(&Dynamic::from(a)));
    let negate = shared.clone();
    engine.register_fn("-", move |a: Vector| negate.negated(&Dynamic::from(a)));
    engine.register_fn("+", |a: Scalar| a);
    engine.register_fn("+", |a: Vector| a);
    for (name, op) in [("x", Op::X), ("y", Op::Y), ("z", Op::Z)] {
        let shared = shared.clone();
        engine.register_get(name, move |vector: &mut Vector| {
            shared.component(op, vector.0)
        });
    }
}

/// Comparing fields would give one answer for all of space: Rhai's `==` even gives `false`.
fn comparisons(engine: &mut Engine) {
    for name in ["==", "!=", "<", "<=", ">", ">="] {
        with_a_field(engine, name, move |_, _| {
            refuse(
                format!("a field cannot be compared with `{name}`: it differs from point to point"),
                refusal::SELECT,
            )
        });
    }
}

fn functions(engine: &mut Engine, shared: &Rc<Shared>) {
    let least = |a: f64, b: f64| if b < a { b } else { a };
    let largest = |a: f64, b: f64| if b > a { b } else { a };
    type OfOne = (&'static str, Op, fn(f64) -> f64);
    let of_one: [OfOne; 5] = [
        ("abs", Op::Abs, f64::abs),
        (
            "sqrt",
            Op::Sqrt,
            |a| if a > 0.0 { libm::sqrt(a) } else { 0.0 },
        ),
        ("sin", Op::Sin, libm::sin),
        ("cos", Op::Cos, libm::cos),
        ("exp", Op::Exp, libm::exp),
    ];
    for (name, op, number) in of_one {
        let shared = shared.clone();
        engine.register_fn(name, move |a: Dynamic| {
            shared.scalars(op, [&a], |[a]| number(a))
        });
    }
    let s = shared.clone();
    engine.register_fn("min", move |a: Dynamic, b: Dynamic| {
        s.scalars(Op::Min, [&a, &b], |[a, b]| least(a, b))
    });
    let s = shared.clone();
    engine.register_fn("max", move |a: Dynamic, b: Dynamic| {
        s.scalars(Op::Max, [&a, &b], |[a, b]| largest(a, b))
    });
    let s = shared.clone();
    engine.register_fn("clamp", move |a: Dynamic, low: Dynamic, high: Dynamic| {
        let raised = s.scalars(Op::Max, [&a, &low], |[a, b]| largest(a, b))?;
        s.scalars(Op::Min, [&raised, &high], |[a, b]| least(a, b))
    });
    let s = shared.clone();
    engine.register_fn("select", move |c: Dynamic, a: Dynamic, b: Dynamic| {
        s.scalars(
            Op::Select,
            [&c, &a, &b],
            |[c, a, b]| if c < 0.0 { a } else { b },
        )
    });
    let s = shared.clone();
    engine.register_fn(
        "smoothstep",
        move |low: Dynamic, high: Dynamic, a: Dynamic| s.smoothstep(&low, &high, &a),
    );
    let s = shared.clone();
    engine.register_fn("mix", move |a: Dynamic, b: Dynamic, u: Dynamic| {
        s.mix(&a, &b, &u)
    });
    let s = shared.clone();
    engine.register_fn("length", move |v: Dynamic| {
        s.component(Op::Length, Shared::vector("length", &v)?)
    });
    let s = shared.clone();
    engine.register_fn("dot", move |a: Dynamic, b: Dynamic| s.dot(&a, &b));
    let s = shared.clone();
    engine.register_fn("vec", move |x: Dynamic, y: Dynamic, z: Dynamic| {
        s.vec([&x, &y, &z])
    });
    let s = shared.clone();
    engine.register_fn("onto_plane", move |v: Dynamic| s.onto(&v, None));
    let s = shared.clone();
    engine.register_fn("onto_sphere", move |v: Dynamic, radius: Dynamic| {
        s.onto(&v, Some(&radius))
    });
    let s = shared.clone();
    engine.register_fn("noise", move |v: Dynamic| s.noise(&v, 0.0));
    let s = shared.clone();
    engine.register_fn("noise", move |v: Dynamic, key: Dynamic| {
        s.noise(&v, Shared::constant("noise", &key)?)
    });
}

/// A function of a place and a map of options.
type OfPlace = fn(&Shared, &Dynamic, &Map) -> Made<Dynamic>;

fn noises(engine: &mut Engine, shared: &Rc<Shared>) {
    for noise in NOISES {
        let s = shared.clone();
        engine.register_fn(noise.name, move |v: Dynamic| {
            s.noise_function(noise, &v, &Map::new())
        });
        let s = shared.clone();
        engine.register_fn(noise.name, move |v: Dynamic, options: Map| {
            s.noise_function(noise, &v, &options)
        });
        let s = shared.clone();
        engine.register_fn(noise.name, move |v: Dynamic, key: Dynamic| {
            Shared::constant(noise.name, &key)?;
            s.noise_function(noise, &v, &Map::from([("key".into(), key)]))
        });
    }
    let of_place: [(&str, OfPlace); 3] = [
        ("gradient", Shared::noise_gradient),
        ("warp", Shared::warp),
        ("weierstrass", Shared::weierstrass),
    ];
    for (name, function) in of_place {
        let s = shared.clone();
        engine.register_fn(name, move |v: Dynamic| function(&s, &v, &Map::new()));
        let s = shared.clone();
        engine.register_fn(name, move |v: Dynamic, options: Map| {
            function(&s, &v, &options)
        });
    }
}

fn cascades(engine: &mut Engine, shared: &Rc<Shared>) {
    for cascade in CASCADES {
        let s = shared.clone();
        engine.register_fn(cascade.name, move |v: Dynamic| {
            s.cascade(cascade, &v, &Map::new())
        });
        let s = shared.clone();
        engine.register_fn(cascade.name, move |v: Dynamic, options: Map| {
            s.cascade(cascade, &v, &options)
        });
    }
}

fn library(engine: &mut Engine, shared: &Rc<Shared>) {
    for ready in LIBRARY {
        let s = shared.clone();
        engine.register_fn(ready.name, move |v: Dynamic| {
            s.ready(ready, &v, &Map::new())
        });
        let s = shared.clone();
        engine.register_fn(ready.name, move |v: Dynamic, options: Map| {
            s.ready(ready, &v, &options)
        });
    }
}

#[expect(
    deprecated,
    reason = "Rhai marks on_var so because its signature may change"
)]
fn names(engine: &mut Engine, shared: &Rc<Shared>) {
    let shared = shared.clone();
    engine.on_var(move |name, _, context| {
        // What a script itself defines, a function's parameter above all, comes first.
        if context.scope().contains(name) {
            return Ok(None);
        }
        shared.name(name)
    });
}
