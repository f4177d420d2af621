//! Distance and convolution surfaces: lists of primitives, each a map such as `#{line: [[0, 0, 0], [1, 0, 0]]}`.

use field::{NodeId, Op};
use rhai::{Array, Dynamic, Map};

use super::Shared;
use super::options::{self, Options};
use super::shapes::rules;
use super::values::{Made, refuse};

/// The kinds of primitives by their numbers.
const KINDS: [&str; 5] = ["point", "line", "polygon", "curve", "arc"];

/// What a primitive's map may hold.
const KEYS: [&str; 8] = [
    "point", "line", "polygon", "curve", "arc", "angle", "radius", "weight",
];

/// Where the kernels stand in the list that all sums of influences share.
const MURAKAMI: usize = 3;

/// `distances([...], #{...})`, thesis eq. (2.10).
pub(super) fn distances(shared: &Shared, at: NodeId, parts: &Array, given: &Map) -> Made<NodeId> {
    let known = ["kernel", "radius", "weight", "threshold", "far"];
    let options = Options::new("distances", &known, given)?;
    let mut params = rules(&options, MURAKAMI)?.to_vec();
    primitives("distances", &options, parts, &mut params)?;
    shared.push(Op::Distances, &[at], &params)
}

/// `convolution([...], #{...})`, thesis eq. (2.11).
pub(super) fn convolution(shared: &Shared, at: NodeId, parts: &Array, given: &Map) -> Made<NodeId> {
    let known = ["kernel", "radius", "weight", "threshold"];
    let options = Options::new("convolution", &known, given)?;
    let mut params = rules(&options, MURAKAMI)?.to_vec();
    params[2] = 0.0;
    primitives("convolution", &options, parts, &mut params)?;
    shared.push(Op::Convolution, &[at], &params)
}

fn primitives(
    function: &'static str,
    options: &Options<'_>,
    parts: &Array,
    params: &mut Vec<f64>,
) -> Made<()> {
    let radius = options.number("radius", 1.0)?;
    let weight = options.number("weight", 1.0)?;
    for part in parts {
        let Some(map) = part.clone().try_cast::<Map>() else {
            return refuse(
                format!("`{function}` wants maps that each hold a primitive"),
                "#{line: [[0, 0, 0], [1, 0, 0]], radius: 0.5}; others are point, polygon, curve and arc",
            );
        };
        let own = Options::new(function, &KEYS, &map)?;
        let mut kinds = (0..5u32)
            .zip(KINDS)
            .filter_map(|(number, kind)| Some((number, kind, map.get(kind)?)));
        let (Some((number, kind, shape)), None) = (kinds.next(), kinds.next()) else {
            return refuse(
                format!("a primitive of `{function}` is one point, line, polygon, curve or arc"),
                "#{line: [[0, 0, 0], [1, 0, 0]], radius: 0.5}",
            );
        };
        let what = format!("{function}: {kind}");
        let mut numbers = if kind == "point" {
            options::place(&what, shape)?.to_vec()
        } else {
            places(&what, shape)?
        };
        if kind == "arc" {
            if numbers.len() != 9 {
                return refuse(
                    format!("`{what}` wants three places: centre, start and normal"),
                    "#{arc: [[0, 0, 0], [1, 0, 0], [0, 0, 1]], angle: PI}",
                );
            }
            numbers.push(own.number("angle", 2.0 * core::f64::consts::PI)?);
        }
        params.extend([
            f64::from(number),
            own.number("radius", radius)?,
            own.number("weight", weight)?,
            f64::from(u32::try_from(numbers.len()).unwrap_or(u32::MAX)),
        ]);
        params.extend(numbers);
    }
    Ok(())
}

fn places(what: &str, value: &Dynamic) -> Made<Vec<f64>> {
    let mut numbers = Vec::new();
    for place in options::list(what, value)? {
        numbers.extend(options::place(what, &place)?);
    }
    Ok(numbers)
}
