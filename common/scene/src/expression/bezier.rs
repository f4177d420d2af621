//! Piecewise algebraic surfaces, thesis §2.2.3: Bézier tetrahedra as polynomials, each within its own faces.

use std::collections::BTreeMap;

use field::{NodeId, Op};
use rhai::{Array, Map};

use super::Shared;
use super::options::{self, Options};
use super::values::{Made, refuse};

const NAME: &str = "bezier_tetrahedra";

/// Highest degree of a tetrahedron.
const DEGREE_MAX: usize = 8;

/// A tetrahedron flatter than this, as its volume over that of a cube on its longest edge, has no inside to speak of.
const FLAT: f64 = 1e-9;

/// How far a tetrahedron goes beyond its faces, in longest edges: what two of them share lies inside both.
const OVERLAP: f64 = 1e-9;

type Place = [f64; 3];

/// A polynomial in x, y and z: coefficients by their powers.
type Polynomial = BTreeMap<[u8; 3], f64>;

/// A tetrahedron about its middle: barycentric coordinate m of a place is 1/4 + slopes[m] · (place − middle).
struct Tetrahedron {
    middle: Place,
    slopes: [Place; 4],
    longest: f64,
}

impl Tetrahedron {
    /// `None` if its corners lie in one plane.
    fn new(corners: [Place; 4]) -> Option<Self> {
        let middle = [0, 1, 2].map(|k| 0.25 * corners.iter().map(|corner| corner[k]).sum::<f64>());
        let mut longest = 0.0;
        for a in corners {
            for b in corners {
                let length = dot(less(a, b), less(a, b));
                if length > longest {
                    longest = length;
                }
            }
        }
        let longest = libm::sqrt(longest);
        let mut slopes = [[0.0; 3]; 4];
        for (m, slope) in slopes.iter_mut().enumerate() {
            let [a, b, c] = [1, 2, 3].map(|step| corners[(m + step) % 4]);
            let across = cross(less(b, a), less(c, a));
            let height = dot(across, less(corners[m], a));
            if height.abs() <= FLAT * longest * longest * longest {
                return None;
            }
            *slope = across.map(|part| part / height);
        }
        Some(Self {
            middle,
            slopes,
            longest,
        })
    }

    /// Σ b (d; i j k l) rⁱ sʲ tᵏ uˡ (thesis eq. (2.8)) multiplied out, in coordinates about the middle.
    fn expanded(&self, degree: usize, values: &[f64]) -> Polynomial {
        let forms = self.slopes.map(|slope| {
            let linear = [([0, 0, 0], 0.25)]
                .into_iter()
                .chain((0..3).map(|axis| (unit(axis), slope[axis])));
            powers(&linear.collect(), degree)
        });
        let mut sum = Polynomial::new();
        for (exponents, value) in exponents(degree).into_iter().zip(values) {
            let mut term = Polynomial::from([([0; 3], value * multinomial(degree, exponents))]);
            for (form, exponent) in forms.iter().zip(exponents) {
                term = product(&term, &form[exponent]);
            }
            for (powers, factor) in term {
                *sum.entry(powers).or_insert(0.0) += factor;
            }
        }
        sum
    }
}

/// `bezier_tetrahedra([#{corners: [[x, y, z], ...], values: [b, ...]}, ...], #{thickness: 0})`, thesis eq. (2.8).
///
/// The values are the coefficients b_ijkl with (i, j, k, l) falling: those of degree 1 belong to the corners in
/// their order. Each tetrahedron holds what is below 0 within its own faces; with a thickness it holds
/// |f| < thickness instead, a sheet without an inside. Surfaces go on from one tetrahedron to the next where the
/// values on the face that they share are the same.
pub(super) fn tetrahedra(shared: &Shared, at: NodeId, parts: &Array, given: &Map) -> Made<NodeId> {
    let options = Options::new(NAME, &["thickness"], given)?;
    let thickness = options.number("thickness", 0.0)?;
    if thickness < 0.0 {
        return refuse(
            format!("`{NAME}` wants a thickness of 0 or above, not {thickness}"),
            "it is a value of the polynomials, not a length",
        );
    }
    let mut joined: Option<NodeId> = None;
    for part in parts {
        let Some(map) = part.clone().try_cast::<Map>() else {
            return refuse(
                format!("`{NAME}` wants maps that each hold a tetrahedron"),
                "#{corners: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], values: [1, -1, -1, -1]}",
            );
        };
        let piece = piece(shared, at, &map, thickness)?;
        joined = Some(match joined {
            None => piece,
            Some(before) => shared.push(Op::Min, &[before, piece], &[])?,
        });
    }
    match joined {
        Some(id) => Ok(id),
        None => refuse(
            format!("`{NAME}` wants at least one tetrahedron"),
            "#{corners: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], values: [1, -1, -1, -1]}",
        ),
    }
}

/// The part of the surface within one tetrahedron.
fn piece(shared: &Shared, at: NodeId, map: &Map, thickness: f64) -> Made<NodeId> {
    Options::new(NAME, &["corners", "values"], map)?;
    let (Some(corners), Some(values)) = (map.get("corners"), map.get("values")) else {
        return refuse(
            format!("a tetrahedron of `{NAME}` has corners and values"),
            "#{corners: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], values: [1, -1, -1, -1]}",
        );
    };
    let what = format!("{NAME}: corners");
    let places = options::list(&what, corners)?
        .iter()
        .map(|corner| options::place(&what, corner))
        .collect::<Made<Vec<_>>>()?;
    let Ok(corners) = <[Place; 4]>::try_from(places) else {
        return refuse(
            format!("a tetrahedron of `{NAME}` has four corners"),
            "corners: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        );
    };
    let values = options::numbers(&format!("{NAME}: values"), values)?;
    let Some(degree) = (1..=DEGREE_MAX).find(|d| exponents(*d).len() == values.len()) else {
        return refuse(
            format!(
                "a tetrahedron of `{NAME}` cannot have {} values",
                values.len()
            ),
            "degrees 1 to 8 have 4, 10, 20, 35, 56, 84, 120 and 165",
        );
    };
    let Some(tetrahedron) = Tetrahedron::new(corners) else {
        return refuse(
            format!("the corners of a tetrahedron of `{NAME}` lie in one plane"),
            "no three of them in a line, no four in a plane",
        );
    };
    let middle = constant_vector(shared, tetrahedron.middle)?;
    let about = shared.push(Op::VectorSub, &[at, middle], &[])?;
    let mut terms = Vec::new();
    for (powers, factor) in tetrahedron.expanded(degree, &values) {
        terms.extend(powers.map(f64::from));
        terms.push(factor);
    }
    let mut value = shared.push(Op::Polynomial, &[about], &terms)?;
    if thickness > 0.0 {
        let size = shared.push(Op::Abs, &[value], &[])?;
        value = shared.push(Op::Sub, &[size, shared.number(thickness)?], &[])?;
    }
    for slope in tetrahedron.slopes {
        // The distance beyond the face on which this coordinate is 0.
        let steep = libm::sqrt(dot(slope, slope));
        let outward = constant_vector(shared, slope.map(|part| -part / steep))?;
        let way = shared.push(Op::Dot, &[about, outward], &[])?;
        let room = shared.number(0.25 / steep + OVERLAP * tetrahedron.longest)?;
        let beyond = shared.push(Op::Sub, &[way, room], &[])?;
        value = shared.push(Op::Max, &[value, beyond], &[])?;
    }
    Ok(value)
}

fn constant_vector(shared: &Shared, [x, y, z]: Place) -> Made<NodeId> {
    let parts = [shared.number(x)?, shared.number(y)?, shared.number(z)?];
    shared.push(Op::Vector, &parts, &[])
}

/// All (i, j, k, l) with the sum `degree`, falling.
fn exponents(degree: usize) -> Vec<[usize; 4]> {
    let mut all = Vec::new();
    for i in (0..=degree).rev() {
        for j in (0..=degree - i).rev() {
            for k in (0..=degree - i - j).rev() {
                all.push([i, j, k, degree - i - j - k]);
            }
        }
    }
    all
}

/// degree! / (i! j! k! l!): in how many ways the term comes about.
fn multinomial(degree: usize, exponents: [usize; 4]) -> f64 {
    let factorial = |n: usize| {
        (1..=n).fold(1.0, |product: f64, factor| {
            product * f64::from(u32::try_from(factor).unwrap_or(u32::MAX))
        })
    };
    exponents
        .into_iter()
        .fold(factorial(degree), |left, exponent| {
            left / factorial(exponent)
        })
}

fn unit(axis: usize) -> [u8; 3] {
    let mut powers = [0; 3];
    powers[axis] = 1;
    powers
}

/// The powers of a polynomial from 0 to `most`.
fn powers(a: &Polynomial, most: usize) -> Vec<Polynomial> {
    let mut powers = vec![Polynomial::from([([0; 3], 1.0)])];
    for at in 0..most {
        powers.push(product(&powers[at], a));
    }
    powers
}

fn product(a: &Polynomial, b: &Polynomial) -> Polynomial {
    let mut product = Polynomial::new();
    for (p, s) in a {
        for (q, t) in b {
            let powers = [0, 1, 2].map(|k| p[k] + q[k]);
            *product.entry(powers).or_insert(0.0) += s * t;
        }
    }
    product
}

fn less(a: Place, b: Place) -> Place {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: Place, b: Place) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Place, b: Place) -> Place {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use field::{Interval, Points, Program, Scratch, SimdLevel};

    use super::*;
    use crate::description::Seed;
    use crate::expression::Fields;

    const CORNERS: [Place; 4] = [
        [0.3, -1.0, 0.2],
        [2.0, 0.4, -0.3],
        [-0.5, 1.4, 0.1],
        [0.2, 0.3, 1.9],
    ];

    fn at(polynomial: &Polynomial, p: Place) -> f64 {
        polynomial
            .iter()
            .map(|(powers, factor)| {
                let product = (0..3).map(|k| libm::pow(p[k], f64::from(powers[k])));
                factor * product.product::<f64>()
            })
            .sum()
    }

    /// De Casteljau's algorithm, which knows nothing of powers of x.
    fn casteljau(degree: usize, values: &[f64], barycentric: [f64; 4]) -> f64 {
        let mut values = values.to_vec();
        for d in (0..degree).rev() {
            let (lower, upper) = (exponents(d), exponents(d + 1));
            let value = |exponents: &[usize; 4]| {
                let place = |m: usize| {
                    let mut raised = *exponents;
                    raised[m] += 1;
                    upper.iter().position(|known| *known == raised).unwrap()
                };
                (0..4).map(|m| barycentric[m] * values[place(m)]).sum()
            };
            values = lower.iter().map(value).collect();
        }
        values[0]
    }

    #[test]
    fn multiplied_out_it_is_what_de_casteljau_says() {
        let tetrahedron = Tetrahedron::new(CORNERS).unwrap();
        for degree in 1..=6 {
            let count = exponents(degree).len();
            let values: Vec<f64> = (0..count)
                .map(|i| libm::sin(2.3 * f64::from(u32::try_from(i * i).unwrap())))
                .collect();
            let polynomial = tetrahedron.expanded(degree, &values);
            for share in [
                [0.25; 4],
                [0.1, 0.2, 0.3, 0.4],
                [0.0, 0.5, 0.5, 0.0],
                [1.0, 0.0, 0.0, 0.0],
                [-0.2, 0.7, 0.1, 0.4],
            ] {
                let p = [0, 1, 2].map(|k| (0..4).map(|m| share[m] * CORNERS[m][k]).sum::<f64>());
                let seen = at(&polynomial, less(p, tetrahedron.middle));
                let wanted = casteljau(degree, &values, share);
                assert!(
                    (seen - wanted).abs() < 1e-12,
                    "{degree} {share:?}: {seen} {wanted}"
                );
            }
        }
    }

    /// Values of a field at places.
    fn field(text: &str, places: &[Place]) -> Vec<f64> {
        let fields = Fields::new(Seed::Plane, BTreeMap::new());
        let root = fields.field(text).unwrap();
        let time = Interval::point(0.0);
        let program = Program::compile(&fields.into_graph(), &[root], time).unwrap();
        let axis = |k: usize| places.iter().map(|place| place[k]).collect::<Vec<_>>();
        let zero = vec![0.0; places.len()];
        let points = Points {
            x: &axis(0),
            y: &axis(1),
            z: &axis(2),
            footprint: &zero,
            time: &zero,
        };
        let mut out = vec![0.0; places.len()];
        let level = SimdLevel::best();
        program.evaluate(level, &points, &mut Scratch::new(), &mut [&mut out]);
        out
    }

    #[test]
    fn two_tetrahedra_make_one_surface() {
        // z = 0.25 + x² over x ≥ 0 and over x ≤ 0, by quadratic values: one parabola across the face x = 0.
        let tetrahedron = |x: f64| {
            let corners = [
                [0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [x, 0.0, 0.0],
            ];
            let height = |c: usize| corners[c][2];
            let values: Vec<String> = exponents(2)
                .into_iter()
                .map(|exponents| {
                    let at = |nth: usize| {
                        let mut left = nth;
                        (0..4)
                            .find(|m| {
                                let here = left < exponents[*m];
                                left = left.saturating_sub(exponents[*m]);
                                here
                            })
                            .unwrap()
                    };
                    // The blossom of z − x² − 0.25.
                    let (a, b) = (at(0), at(1));
                    let value =
                        0.5 * (height(a) + height(b)) - corners[a][0] * corners[b][0] - 0.25;
                    format!("{value:?}")
                })
                .collect();
            format!("#{{corners: {corners:?}, values: [{}]}}", values.join(", "))
        };
        let (right, left) = (tetrahedron(1.0), tetrahedron(-1.0));
        let text = format!("bezier_tetrahedra([{right}, {left}])");
        let sheet = format!("bezier_tetrahedra([{right}, {left}], #{{thickness: 0.01}})");
        let inside = [
            [0.2, 0.2, 0.1],
            [-0.2, 0.2, 0.1],
            [0.3, 0.1, 0.45],
            [-0.3, 0.1, 0.45],
        ];
        for (p, value) in inside.iter().zip(field(&text, &inside)) {
            let f = p[2] - p[0] * p[0] - 0.25;
            // A face may be nearer than the surface, on the same side of it.
            assert!(
                (value - f).abs() < 1e-12 || (value > f && value < 0.0),
                "{p:?}: {value}"
            );
        }
        // On the face that both share the solid goes on; beyond both there is nothing.
        let seam = field(&text, &[[0.0, 0.2, 0.1], [0.0, 0.2, 0.3]]);
        assert!(seam[0] < 0.0 && seam[1] > 0.0, "{seam:?}");
        let beyond = field(
            &text,
            &[[0.6, 0.3, 0.2], [-0.1, -0.1, 0.1], [0.0, 0.0, 1.1]],
        );
        assert!(beyond.iter().all(|value| *value > 0.0), "{beyond:?}");
        let sheets = field(
            &sheet,
            &[[0.1, 0.1, 0.26], [0.1, 0.1, 0.2], [0.0, 0.1, 0.25]],
        );
        assert!(
            sheets[0] < 0.0 && sheets[1] > 0.0 && sheets[2] < 0.0,
            "{sheets:?}"
        );
    }

    #[test]
    fn values_stand_in_the_order_of_the_corners() {
        let tetrahedron = Tetrahedron::new(CORNERS).unwrap();
        let polynomial = tetrahedron.expanded(1, &[1.0, 2.0, 3.0, 4.0]);
        for (corner, value) in CORNERS.into_iter().zip([1.0, 2.0, 3.0, 4.0]) {
            assert!((at(&polynomial, less(corner, tetrahedron.middle)) - value).abs() < 1e-13);
        }
        assert_eq!(
            exponents(2)[..3],
            [[2, 0, 0, 0], [1, 1, 0, 0], [1, 0, 1, 0]]
        );
        assert!(Tetrahedron::new([[0.0; 3], [1.0; 3], [2.0; 3], [0.0, 1.0, 0.0]]).is_none());
    }
}
