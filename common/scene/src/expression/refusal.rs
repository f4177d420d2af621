//! Rhai's errors as sentences for someone who writes a field, each with a way out.

use rhai::{EvalAltResult, LexError, ParseError, ParseErrorType, Position};

use super::Refusal;
use super::language::{FUNCTIONS, NAMES};
use crate::file::nearest;

/// What to do instead of comparing a field or branching on it.
pub(super) const SELECT: &str = "use select(c, a, b): a where c < 0, else b";

/// An error of our own, carried through Rhai.
#[derive(Clone, Debug)]
pub(super) struct Hint {
    pub(super) message: String,
    pub(super) help: Option<String>,
}

/// A type's name as the scene's author would say it.
pub(super) fn kind(type_name: &str) -> &str {
    let type_name = type_name.rsplit("::").next().unwrap_or(type_name);
    match type_name {
        "i64" | "f64" => "a number",
        "Scalar" | "field" => "a field",
        "Vector" | "vector" => "a vector",
        text if text.to_lowercase().contains("string") => "text",
        "array" => "an array",
        "map" => "a map",
        "bool" => "true or false",
        "()" => "nothing",
        other => other,
    }
}

fn refusal(message: String, help: Option<String>, position: Position) -> Refusal {
    let position = position
        .line()
        .map(|line| (line, position.position().unwrap_or(1)));
    Refusal {
        message,
        help,
        position,
    }
}

/// Why a text is no script.
pub(super) fn of_parsing(error: &ParseError) -> Refusal {
    let (message, help) = parsing(error.err_type());
    refusal(message, help, error.position())
}

fn parsing(error: &ParseErrorType) -> (String, Option<String>) {
    let symbol = match error {
        ParseErrorType::BadInput(LexError::ImproperSymbol(symbol, _))
        | ParseErrorType::UnknownOperator(symbol)
        | ParseErrorType::Reserved(symbol) => symbol.as_str(),
        ParseErrorType::BadInput(LexError::MalformedChar(_)) => {
            return (
                "text stands between double quotes".into(),
                Some("write \"ridged\", in a TOML text that begins with ' or \"\"\"".into()),
            );
        }
        ParseErrorType::ExprTooDeep => {
            return (
                "the expression is nested too deeply".into(),
                Some("give parts of it names with `let`".into()),
            );
        }
        ParseErrorType::MissingToken(token, _) => {
            return (format!("a `{token}` is missing"), None);
        }
        ParseErrorType::UnexpectedEOF => {
            return (
                "the expression ends too early".into(),
                Some("is a `)` missing?".into()),
            );
        }
        ParseErrorType::TooManyFunctions => {
            return (
                "the expression defines too many functions; 64 are the most".into(),
                None,
            );
        }
        ParseErrorType::LiteralTooLarge(..) => {
            return (
                "a text, list or map in the expression is too large".into(),
                None,
            );
        }
        other => return (lower(&other.to_string()), None),
    };
    let (message, help) = match symbol {
        "^" | "^=" => ("`^` is not a power", "write 2**3"),
        "/=" | "**=" => (
            "this would keep whole numbers whole",
            "write x = x / 2, x = x**2",
        ),
        "switch" => (
            "there is no `switch`: a field differs from point to point",
            SELECT,
        ),
        _ => ("the expression cannot use this word or symbol", ""),
    };
    let message = match help {
        "" => format!("an expression cannot use `{symbol}`"),
        _ => message.to_owned(),
    };
    (message, (!help.is_empty()).then(|| help.to_owned()))
}

/// Why a script gives no field.
pub(super) fn of_evaluation(error: EvalAltResult) -> Refusal {
    let mut error = error;
    let mut position = error.position();
    while let EvalAltResult::ErrorInFunctionCall(_, _, inner, _) = error {
        error = *inner;
        if !error.position().is_none() {
            position = error.position();
        }
    }
    let (message, help) = evaluation(error);
    refusal(message, help, position)
}

fn evaluation(error: EvalAltResult) -> (String, Option<String>) {
    use EvalAltResult as E;
    let some = |help: &str| Some(help.to_owned());
    match error {
        E::ErrorRuntime(value, _) => match value.clone().try_cast::<Hint>() {
            Some(hint) => (hint.message, hint.help),
            None => (value.to_string(), None),
        },
        E::ErrorParsing(error, _) => parsing(&error),
        E::ErrorVariableNotFound(name, _) => {
            let help = match nearest(&name, NAMES.iter().chain(FUNCTIONS).copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!(
                    "the names here are {} and those of [curves]",
                    NAMES.join(", ")
                ),
            };
            (format!("there is no `{name}`"), Some(help))
        }
        E::ErrorFunctionNotFound(signature, _) => function_not_found(&signature),
        E::ErrorTooManyOperations(_) => (
            "the expression takes too many steps".into(),
            some("does a loop not end? An expression is run once, it only builds the field"),
        ),
        E::ErrorStackOverflow(_) => (
            "the functions of the expression call each other too deeply".into(),
            some("use a loop"),
        ),
        E::ErrorTooManyVariables(_) => ("the expression has too many variables".into(), None),
        E::ErrorDataTooLarge(what, _) => (
            format!("{} in the expression grows too large", large(&what)),
            some("an expression needs numbers and fields only"),
        ),
        E::ErrorMismatchDataType(_, actual, _)
            if matches!(kind(&actual), "a field" | "a vector") =>
        {
            (
                format!(
                    "{} is neither true nor false: it differs from point to point",
                    kind(&actual)
                ),
                some(SELECT),
            )
        }
        E::ErrorMismatchDataType(wanted, actual, _) => (
            format!("{} is wanted here, not {}", kind(&wanted), kind(&actual)),
            None,
        ),
        E::ErrorAssignmentToConstant(name, _) => (
            format!("`{name}` cannot be changed"),
            some("start a variable of your own with `let`"),
        ),
        E::ErrorDotExpr(..) | E::ErrorPropertyNotFound(..) => (
            "this value has no such part".into(),
            some("vectors have .x, .y and .z; a number or a field has no parts"),
        ),
        E::ErrorFor(_) => (
            "this cannot be looped over".into(),
            some("for i in 0..8 { ... }"),
        ),
        other => {
            let text = other.to_string();
            let end = text.rfind(" (line ").unwrap_or(text.len());
            (lower(&text[..end]), None)
        }
    }
}

/// What is too large, from Rhai's words for it.
fn large(what: &str) -> &'static str {
    let what = what.to_lowercase();
    if what.contains("string") {
        "a text"
    } else if what.contains("map") {
        "a map"
    } else {
        "an array"
    }
}

/// A call that fits no function: another name, or other arguments.
fn function_not_found(signature: &str) -> (String, Option<String>) {
    let (name, args) = match signature.split_once('(') {
        Some((name, args)) => (name.trim(), args.trim_end_matches(')')),
        None => (signature, ""),
    };
    let kinds: Vec<_> = args
        .split(',')
        .map(|arg| kind(arg.trim()))
        .filter(|arg| !arg.is_empty())
        .collect();
    if FUNCTIONS.contains(&name) {
        let given = if kinds.is_empty() {
            "nothing".to_owned()
        } else {
            kinds.join(", ")
        };
        return (
            format!("`{name}` does not take ({given})"),
            Some(usage(name)),
        );
    }
    if let Some(part) = name.strip_prefix("get$") {
        return (
            format!(
                "{} has no part `{part}`",
                kinds.first().unwrap_or(&"this value")
            ),
            Some("vectors have .x, .y and .z".into()),
        );
    }
    if name.chars().all(|c| c.is_ascii_punctuation()) {
        return match kinds[..] {
            [a, b] => (format!("{a} `{name}` {b} has no meaning"), None),
            _ => (format!("`{name}` has no meaning here"), None),
        };
    }
    let help = match nearest(name, FUNCTIONS.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? {}", usage(near)),
        None => format!("the functions are {}", FUNCTIONS.join(", ")),
    };
    (format!("there is no function `{name}`"), Some(help))
}

fn usage(name: &str) -> String {
    let call = match name {
        "noise" => "noise(p) or noise(p, key)",
        "fbm" | "turbulence" | "ridged" | "altitude1" | "altitude2" | "ridged_multifractal" => {
            return format!("it is used like {name}(p, #{{octaves: 8, hurst: 0.8}})");
        }
        "heightmap" => "heightmap(\"file.png\", p, #{spacing: 10, low: 0, high: 1000})",
        "volume" => "volume(\"file.grid\", p, #{spacing: 1})",
        "spectral_terrain" | "spectral_flakes" => {
            return format!("it is used like {name}(p, #{{size: 128, spacing: 1, hurst: 0.8}})");
        }
        "sea" => "sea(p, #{size: 256, spacing: 1, wind: 10})",
        "midpoint_terrain" => "midpoint_terrain(p, #{levels: 8, width: 1000, hurst: 0.8})",
        "hills" | "mountains" | "canyons" | "dunes" | "craters" | "boulders" | "flames" | "mud" => {
            return format!("it is used like {name}(base, #{{amplitude: 10, scale: 100, key: 1}})");
        }
        "cellular" => "cellular(p, #{order: 1, norm: 2, key: 3})",
        "spot" => "spot(p, #{stretch: 3, variety: 0.5, axis: [1, 0, 0]})",
        "sparse" => "sparse(p, #{nodes: 2, kernel: \"quintic\", key: 3})",
        "simplex" | "wavelet" | "gradient_noise" | "value_noise" | "value_gradient_noise" => {
            return format!("it is used like {name}(p) or {name}(p, key)");
        }
        "gradient" => {
            "gradient(p, #{noise: \"simplex\", key: 3}), or gradient(f, 5): of the field f, taken over 5 metres"
        }
        "slope" => "slope(f, 5): how steep the field f is, taken over 5 metres",
        "curvature" => {
            "curvature(f, 5): above 0 in hollows of the field f, below on ridges, taken over 5 metres"
        }
        "warp" => "warp(p, #{amount: 0.5, scale: 1, by: \"gradient\"})",
        "weierstrass" => "weierstrass(p, #{octaves: 8, directions: 8, hurst: 0.8})",
        "dot" => "dot(a, b)",
        "vec" => "vec(x, y, z)",
        "onto_sphere" => "onto_sphere(p, radius)",
        "min" => "min(a, b)",
        "max" => "max(a, b)",
        "clamp" => "clamp(x, low, high)",
        "smoothstep" => "smoothstep(low, high, x)",
        "mix" => "mix(a, b, u)",
        "select" => "select(c, a, b): a where c < 0, else b",
        "polynomial" => "polynomial([[i, j, k, c], ...]): c x**i y**j z**k and so on",
        "superquadric" => "superquadric(#{e1: 1, e2: 1, size: [1, 1, 1]})",
        "sphere" => "sphere(#{radius: 1, exponent: 0.5})",
        "blobs" => "blobs([[x, y, z, radius, weight], ...], #{kernel: \"wyvill\"})",
        "bezier_tetrahedra" => {
            "bezier_tetrahedra([#{corners: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], values: [1, -1, -1, -1]}])"
        }
        "distances" | "convolution" => {
            return format!(
                "it is used like {name}([#{{line: [[0, 0, 0], [1, 0, 0]]}}], #{{radius: 0.5}})"
            );
        }
        "union" | "intersection" | "difference" => {
            return format!("it is used like {name}(a, b) or {name}(a, b, #{{width: 0.2}})");
        }
        "blend" => "blend(a, b, width)",
        "morph" => "morph(a, b, u)",
        "twist" => "twist(p, radians per metre)",
        "free_form" => {
            "free_form(p, [[dx, dy, dz], ...], #{min: [-1, -1, -1], max: [1, 1, 1], counts: [2, 2, 2]})"
        }
        "bend" => "bend(p, #{rate: 0.5, low: -1, high: 1})",
        "taper" => "taper(p, #{low: -1, high: 1, scale: [1, 0.5]})",
        "length" | "onto_plane" => return format!("it is used like {name}(p)"),
        other => return format!("it is used like {other}(x)"),
    };
    format!("it is used like {call}")
}

/// A sentence of Rhai's, begun like ours.
fn lower(sentence: &str) -> String {
    let mut letters = sentence.chars();
    match letters.next() {
        Some(first) => first.to_lowercase().chain(letters).collect(),
        None => String::new(),
    }
}
