//! Shapes for the suites of every arithmetic, and what is particular to each.

use crate::hash::{hash, unit};
use crate::program::tests::{position, scaled};
use crate::{Graph, Interval, NodeId, Op, Points, Program, Scratch, SimdLevel};

/// Twelve points at the vertices of an icosahedron: fig. 2.6.
fn icosahedron(radius: f64) -> Vec<f64> {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut points = Vec::new();
    for axis in 0..3 {
        for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let mut place = [0.0; 3];
            place[axis] = s;
            place[(axis + 1) % 3] = t * golden;
            points.extend(place);
            points.extend([radius, 1.0]);
        }
    }
    points
}

/// One primitive: its kind, radius, weight and numbers.
pub(super) fn primitive(kind: f64, radius: f64, weight: f64, numbers: &[f64]) -> Vec<f64> {
    let count = f64::from(u32::try_from(numbers.len()).unwrap());
    let mut list = vec![kind, radius, weight, count];
    list.extend(numbers);
    list
}

const LINE: [f64; 9] = [-1.5, 0.2, 0.1, 0.4, -0.3, 0.5, 1.2, 0.9, -0.4];
const SQUARE: [f64; 12] = [
    -1.0, -0.8, 0.0, 0.9, -0.7, 0.3, 1.2, 1.1, 0.4, -0.7, 1.0, 0.1,
];
const CURVE: [f64; 12] = [
    -1.6, -1.0, 0.3, 0.5, 1.4, 0.9, 1.1, -1.3, -0.2, 1.8, 0.8, 0.6,
];
const ARC: [f64; 10] = [0.1, 0.2, 0.3, 1.1, 0.2, 0.3, 0.0, 0.3, 1.0, 4.0];

/// Skeletons of every kind: name, kernel, list.
fn skeletons() -> Vec<(&'static str, f64, Vec<f64>)> {
    let flat = flattened(SQUARE);
    let mut all = Vec::new();
    for kernel in [3.0, 4.0, 5.0] {
        for (name, kind, numbers) in [
            ("point", 0.0, &[0.3, -0.2, 0.4][..]),
            ("line", 1.0, &LINE),
            ("polygon", 2.0, &flat),
            ("curve", 3.0, &CURVE),
            ("arc", 4.0, &ARC),
        ] {
            all.push((name, kernel, primitive(kind, 0.9, 1.1, numbers)));
        }
    }
    let mut both = primitive(1.0, 1.2, 1.0, &LINE);
    both.extend(primitive(4.0, 0.7, -0.6, &ARC));
    all.push(("both", 3.0, both));
    all
}

/// A quadrilateral put into one plane: its last vertex is moved there along z.
fn flattened(mut numbers: [f64; 12]) -> [f64; 12] {
    let vertex = |i: usize| [numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]];
    let (a, b, c, d) = (vertex(0), vertex(1), vertex(2), vertex(3));
    let less = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let (u, v) = (less(b, a), less(c, a));
    let n = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let w = less(d, a);
    numbers[11] = a[2] - (n[0] * w[0] + n[1] * w[1]) / n[2];
    numbers
}

/// Named graphs that together use every shape.
pub(crate) fn zoo() -> Vec<(String, Graph, NodeId)> {
    let mut zoo = Vec::new();
    let mut add = |name: &str, op: Op, params: &[f64]| {
        let mut graph = Graph::new();
        let p = graph.push(Op::Position, &[], &[]).unwrap();
        let root = graph.push(op, &[p], params).unwrap();
        zoo.push((name.to_owned(), graph, root));
    };
    add(
        "plane",
        Op::Polynomial,
        &[1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, -1.0],
    );
    add(
        "Steiner",
        Op::Polynomial,
        &[
            2.0, 2.0, 0.0, 1.0, 0.0, 2.0, 2.0, 1.0, 2.0, 0.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0,
        ],
    );
    add(
        "odd powers",
        Op::Polynomial,
        &[5.0, 0.0, 3.0, 0.01, 0.0, 7.0, 0.0, -0.001],
    );
    for (e1, e2) in [(1.0, 1.0), (0.5, 2.0), (2.0, 0.3), (0.4, 0.4), (1.3, 0.9)] {
        add(
            &format!("superquadric {e1} {e2}"),
            Op::Superquadric,
            &[e1, e2],
        );
    }
    for kernel in 0..6u32 {
        for far in [0.0, 1.0] {
            if far == 1.0 && (kernel == 0 || kernel == 5) {
                continue;
            }
            let mut params = vec![f64::from(kernel), 0.4, far];
            params.extend(icosahedron(1.4));
            params.extend([0.2, 0.3, 1.9, 0.7, -0.8]);
            add(&format!("blobs {kernel} far {far}"), Op::Blobs, &params);
        }
    }
    add(
        "bernstein",
        Op::Bernstein,
        &[
            &[2.0, 1.0, 3.0, -1.5, -2.0, -1.0, 1.5, 2.0, 2.0][..],
            &(0..24)
                .map(|i| unit(hash(&[i, 5])) - 0.5)
                .collect::<Vec<_>>(),
        ]
        .concat(),
    );
    for (name, part, rate) in [
        ("x", 0.0, 0.3),
        ("z", 1.0, 0.3),
        ("z, to the left", 1.0, -0.25),
    ] {
        add(
            &format!("bend {name}"),
            Op::Bend,
            &[part, rate, -1.2, 2.0, 0.4],
        );
    }
    for (name, kernel, list) in skeletons() {
        for far in [0.0, 1.0] {
            let mut params = vec![kernel, 0.6, far];
            params.extend(&list);
            if far == 0.0 || kernel != 5.0 {
                add(
                    &format!("distances {kernel} {name} far {far}"),
                    Op::Distances,
                    &params,
                );
            }
            let closed = kernel == 3.0 || (kernel == 5.0 && name != "curve");
            if far == 0.0 && closed {
                add(
                    &format!("convolution {kernel} {name}"),
                    Op::Convolution,
                    &params,
                );
            }
        }
    }
    for (kind, size) in [
        (0.0, 1.0),
        (0.0, 8.0),
        (1.0, 1.0),
        (1.0, 5.0),
        (2.0, 0.7),
        (3.0, 1.5),
    ] {
        let mut graph = Graph::new();
        let [x, y, z] = position(&mut graph);
        let q = scaled(&mut graph, 0.7);
        let length = graph.push(Op::Length, &[q], &[]).unwrap();
        let sum = graph.push(Op::Add, &[x, y], &[]).unwrap();
        let ball = graph.push(Op::Sub, &[length, z], &[]).unwrap();
        let root = graph.push(Op::Blend, &[sum, ball], &[kind, size]).unwrap();
        zoo.push((format!("blend {kind} {size}"), graph, root));
    }
    zoo
}

/// Values of one shape at places.
pub(super) fn values(op: Op, params: &[f64], places: &[[f64; 3]]) -> Vec<f64> {
    let mut graph = Graph::new();
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    let root = graph.push(op, &[p], params).unwrap();
    let program = Program::compile(&graph, &[root], Interval::point(0.0)).unwrap();
    let axis = |k: usize| places.iter().map(|place| place[k]).collect::<Vec<_>>();
    let (x, y, z) = (axis(0), axis(1), axis(2));
    let zero = vec![0.0; places.len()];
    let points = Points {
        x: &x,
        y: &y,
        z: &z,
        footprint: &zero,
        time: &zero,
    };
    let mut out = vec![0.0; places.len()];
    program.evaluate(
        SimdLevel::best(),
        &points,
        &mut Scratch::new(),
        &mut [&mut out],
    );
    out
}

#[test]
fn spheres_are_polynomials_and_superquadrics() {
    let places = [[0.6, 0.0, 0.8], [1.0, 2.0, 2.0], [-0.3, 0.1, 0.2], [0.0; 3]];
    let polynomial = [
        2.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 1.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, -1.0,
    ];
    let sphere = values(Op::Polynomial, &polynomial, &places);
    let round = values(Op::Superquadric, &[1.0, 1.0], &places);
    for (i, p) in places.iter().enumerate() {
        let f = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - 1.0;
        assert!(
            (sphere[i] - f).abs() < 1e-14 && (round[i] - f).abs() < 1e-14,
            "{i}"
        );
    }
    // ε₁ = ε₂ = 2 is an octahedron, small ones are nearly a cube.
    assert!(values(Op::Superquadric, &[2.0, 2.0], &[[0.2, 0.3, -0.5]])[0].abs() < 1e-14);
    let cube = values(
        Op::Superquadric,
        &[0.0625, 0.0625],
        &[[0.93, 0.93, -0.93], [1.01, 0.0, 0.0]],
    );
    assert!(cube[0] < 0.0 && cube[1] > 0.0, "{cube:?}");
}

/// The integral of a kernel over a primitive by many midpoints: what the closed forms are measured against.
fn quadrature(kernel: f64, kind: f64, numbers: &[f64], radius: f64, x: [f64; 3]) -> f64 {
    const N: u32 = 4000;
    let h = |p: [f64; 3]| {
        let u = (0..3).map(|k| (p[k] - x[k]) * (p[k] - x[k])).sum::<f64>() / (radius * radius);
        if kernel == 5.0 {
            1.0 / ((1.0 + u) * (1.0 + u))
        } else if u < 1.0 {
            (1.0 - u) * (1.0 - u)
        } else {
            0.0
        }
    };
    let place = |i: usize| [numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]];
    let mix = |a: [f64; 3], b: [f64; 3], t: f64| [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t);
    let apart = |a: [f64; 3], b: [f64; 3]| {
        (0..3)
            .map(|k| (b[k] - a[k]) * (b[k] - a[k]))
            .sum::<f64>()
            .sqrt()
    };
    let line = |at: &dyn Fn(f64) -> [f64; 3]| {
        (0..N)
            .map(|i| {
                let t = |i: f64| at(i / f64::from(N));
                let i = f64::from(i);
                h(t(i + 0.5)) * apart(t(i), t(i + 1.0))
            })
            .sum::<f64>()
    };
    match kind {
        0.0 => h(place(0)),
        1.0 => (0..2)
            .map(|i| line(&|t| mix(place(i), place(i + 1), t)))
            .sum(),
        2.0 => {
            // Two triangles, each as a square folded onto it.
            let fold = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
                let n = 600;
                let mut sum = 0.0;
                let (u, v) = (
                    [0, 1, 2].map(|k| b[k] - a[k]),
                    [0, 1, 2].map(|k| c[k] - a[k]),
                );
                let cross = [
                    u[1] * v[2] - u[2] * v[1],
                    u[2] * v[0] - u[0] * v[2],
                    u[0] * v[1] - u[1] * v[0],
                ];
                let twice = apart(cross, [0.0; 3]);
                for i in 0..n {
                    for j in 0..n {
                        let (s, t) = (
                            (f64::from(i) + 0.5) / f64::from(n),
                            (f64::from(j) + 0.5) / f64::from(n),
                        );
                        let p = [0, 1, 2].map(|k| a[k] + s * (u[k] + t * (v[k] - u[k])));
                        sum += h(p) * s * twice;
                    }
                }
                sum / f64::from(n) / f64::from(n)
            };
            fold(place(0), place(1), place(2)) + fold(place(0), place(2), place(3))
        }
        3.0 => {
            let (a, b, c, d) = (place(0), place(1), place(2), place(3));
            let m = mix(b, c, 0.5);
            let bezier = |p, q, r| line(&|t| mix(mix(p, q, t), mix(q, r, t), t));
            bezier(a, b, m) + bezier(m, c, d)
        }
        _ => {
            let (centre, start, normal) = (place(0), place(1), place(2));
            let x = [0, 1, 2].map(|k| start[k] - centre[k]);
            let up = apart(normal, [0.0; 3]);
            let n = normal.map(|part| part / up);
            let y = [
                n[1] * x[2] - n[2] * x[1],
                n[2] * x[0] - n[0] * x[2],
                n[0] * x[1] - n[1] * x[0],
            ];
            line(&|t| {
                let (c, s) = (libm::cos(numbers[9] * t), libm::sin(numbers[9] * t));
                [0, 1, 2].map(|k| centre[k] + c * x[k] + s * y[k])
            })
        }
    }
}

#[test]
fn closed_forms_are_the_integrals() {
    let flat = flattened(SQUARE);
    let nearly_straight = [
        -1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.9, 0.0, 0.02, 1.5, 0.1, 0.0,
    ];
    let cases: [(&str, f64, &[f64]); 6] = [
        ("point", 0.0, &[0.3, -0.2, 0.4]),
        ("line", 1.0, &LINE),
        ("polygon", 2.0, &flat),
        ("curve", 3.0, &CURVE),
        ("straight curve", 3.0, &nearly_straight),
        ("arc", 4.0, &ARC),
    ];
    for kernel in [3.0, 5.0] {
        for (name, kind, numbers) in cases {
            if kernel == 5.0 && kind == 3.0 {
                continue;
            }
            let count = if kind == 2.0 { 12 } else { 60 };
            let places: Vec<[f64; 3]> = (0..count)
                .map(|i| [0, 1, 2].map(|k| 3.2 * unit(hash(&[i, k, 77])) - 1.6))
                .chain([[0.1, 0.2, 0.3], [-1.5, 0.2, 0.1], [0.1, 0.2, 1.3]])
                .collect();
            let mut params = vec![kernel, 0.0, 0.0];
            params.extend(primitive(kind, 0.8, -1.0, numbers));
            let mut seen = 0;
            for (p, value) in places.iter().zip(values(Op::Convolution, &params, &places)) {
                let integral = quadrature(kernel, kind, numbers, 0.8, *p);
                let tolerance = if kind == 2.0 { 2e-5 } else { 2e-6 };
                assert!(
                    (value - integral).abs() < tolerance,
                    "{name} {kernel} at {p:?}: {value} against {integral}"
                );
                seen += usize::from(integral > 1e-3);
            }
            assert!(seen > 3, "{name}: {seen}");
        }
    }
}

#[test]
fn distances_are_those_of_the_nearest_point() {
    let flat = flattened(SQUARE);
    for (kind, numbers) in [(1.0, &LINE[..]), (2.0, &flat), (3.0, &CURVE), (4.0, &ARC)] {
        // With a far field and a tiny radius the value is T + distance − r.
        let mut params = vec![3.0, 0.0, 1.0];
        params.extend(primitive(kind, 1e-6, 1.0, numbers));
        let places: Vec<[f64; 3]> = (0..60)
            .map(|i| [0, 1, 2].map(|k| 5.0 * unit(hash(&[i, k, 78])) - 2.5))
            .collect();
        for (p, value) in places.iter().zip(values(Op::Distances, &params, &places)) {
            // The kernel's integral over ever smaller balls ends where the distance does.
            let near = quadrature(3.0, kind, numbers, value + 0.03, *p);
            let short = quadrature(3.0, kind, numbers, value - 0.001, *p);
            assert!(
                near > 0.0 && short == 0.0,
                "{kind} at {p:?}: {value} {near} {short}"
            );
        }
    }
}

#[test]
fn control_values_along_a_line_give_that_line() {
    // Bernstein polynomials of any degree reproduce linear functions: here x + 2y − z over a box.
    let (min, max) = ([-1.0, 0.0, 2.0], [2.0, 1.0, 4.0]);
    let mut params = vec![3.0, 1.0, 2.0];
    params.extend(min);
    params.extend(max);
    let at = |k: usize, share: f64| min[k] + (max[k] - min[k]) * share;
    for k in 0..3 {
        for j in 0..2 {
            for i in 0..4 {
                let (i, j, k) = (f64::from(i) / 3.0, f64::from(j), f64::from(k) / 2.0);
                params.push(at(0, i) + 2.0 * at(1, j) - at(2, k));
            }
        }
    }
    let places = [
        [0.3, 0.2, 3.1],
        [-1.0, 1.0, 2.0],
        [1.7, 0.9, 2.2],
        [9.0, 0.5, 3.0],
    ];
    let seen = values(Op::Bernstein, &params, &places);
    for (p, value) in places.iter().zip(seen) {
        let x = p[0].min(2.0);
        assert!(
            (value - (x + 2.0 * p[1] - p[2])).abs() < 1e-14,
            "{p:?}: {value}"
        );
    }
}

/// Where Barr's bend puts a point of the straight body: the definition that [`Op::Bend`] undoes.
fn bent([x, y, z]: [f64; 3], [rate, low, high, centre]: [f64; 4]) -> [f64; 3] {
    let held = z.clamp(low, high);
    let (axis, angle) = (1.0 / rate, rate * (held - centre));
    let (cos, sin) = (libm::cos(angle), libm::sin(angle));
    [
        axis - (axis - x) * cos + (z - held) * sin,
        y,
        centre + (axis - x) * sin + (z - held) * cos,
    ]
}

#[test]
fn a_bend_is_undone() {
    for rules in [
        [0.8, -1.0, 1.5, 0.0],
        [-0.7, -1.0, 1.5, 0.3],
        [1.0, -3.0, 3.0, 0.0],
        [1e-3, -10.0, 10.0, -10.0],
    ] {
        let straight: Vec<[f64; 3]> = (0..400)
            .map(|i| [0, 1, 2].map(|k| 4.0 * unit(hash(&[i, k, 79])) - 2.0))
            .map(|[x, y, z]| [0.45 * x, y, z])
            .collect();
        let places: Vec<[f64; 3]> = straight.iter().map(|p| bent(*p, rules)).collect();
        let part = |part: f64| {
            let [rate, low, high, centre] = rules;
            values(Op::Bend, &[part, rate, low, high, centre], &places)
        };
        let (x, z) = (part(0.0), part(1.0));
        for (i, p) in straight.iter().enumerate() {
            assert!(
                (x[i] - p[0]).abs() < 1e-11 && (z[i] - p[2]).abs() < 1e-11,
                "{rules:?} at {p:?}: {} and {}",
                x[i],
                z[i]
            );
        }
    }
}

#[test]
fn a_bend_jumps_on_the_far_side_of_its_axis_and_says_so() {
    let params = [1.0, 0.5, -1.0, 1.0, 0.0];
    let Some(Ok(bend)) = super::Shape::new(Op::Bend, &params) else {
        panic!("it is a bend")
    };
    let known = |x: [f64; 2], z: [f64; 2]| {
        let zero = Interval::point(0.0);
        bend.known([Interval::new(x[0], x[1]), zero, Interval::new(z[0], z[1])])
    };
    let across = values(Op::Bend, &params, &[[4.0, 0.0, -1e-9], [4.0, 0.0, 1e-9]]);
    assert!(across[1] - across[0] > 1.0, "{across:?}");
    let jump = known([3.5, 4.5], [-0.1, 0.1]);
    assert_eq!(jump.slope, f64::INFINITY);
    assert!(jump.range.contains(across[0]) && jump.range.contains(across[1]));
    // Beside it, beyond an end, nothing is stretched; between the ends what is close to the axis is.
    assert!((known([3.5, 4.5], [0.1, 0.2]).slope - 1.0).abs() < 1e-6);
    assert!((known([0.9, 1.0], [-0.1, 0.1]).slope - 2.0).abs() < 1e-6);
    // Ranges close in on values.
    let small = known([-0.3, -0.299], [0.7, 0.701]);
    assert!(small.range.width() < 2e-3, "{small:?}");
}

#[test]
fn beyond_the_supports_the_far_field_is_a_distance() {
    // Thesis eq. (7.9): 0.5 + ‖x − xᵢ‖ − Rᵢ of the nearest ball.
    let near = [
        2.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 4.0, 0.0, 0.0, 2.0, 1.0,
    ];
    let places = [
        [0.0, 3.0, 0.0],
        [10.0, 0.0, 0.0],
        [1.5, 0.0, 0.0],
        [0.0; 3],
        [1.0, 0.0, 0.0],
    ];
    let f = values(Op::Blobs, &near, &places);
    assert_eq!(f[..4], [2.5, 4.5, 1.0, -0.5]);
    assert_eq!(f[4], 0.5);
    let mut without = near;
    without[2] = 0.0;
    assert_eq!(
        values(Op::Blobs, &without, &places),
        [0.5, 0.5, 0.5, -0.5, 0.5]
    );
}

#[test]
fn blends_keep_what_they_join() {
    // Mended (2.14): with a large exponent the minimum; on the surface of one far from the other nothing moves.
    let mut graph = Graph::new();
    let [x, y, _] = position(&mut graph);
    let join =
        |g: &mut Graph, kind: f64, size: f64| g.push(Op::Blend, &[x, y], &[kind, size]).unwrap();
    let roots: Vec<NodeId> = [(0.0, 64.0), (1.0, 64.0), (2.0, 0.1), (3.0, 0.1), (0.0, 2.0)]
        .map(|(kind, size)| join(&mut graph, kind, size))
        .to_vec();
    let program = Program::compile(&graph, &roots, Interval::point(0.0)).unwrap();
    let (x, y, zero) = ([0.0, 0.25, 0.4], [0.5, 0.0, 0.4], [0.0; 3]);
    let points = Points {
        x: &x,
        y: &y,
        z: &zero,
        footprint: &zero,
        time: &zero,
    };
    let mut out = vec![vec![0.0; 3]; roots.len()];
    let mut slices: Vec<&mut [f64]> = out.iter_mut().map(Vec::as_mut_slice).collect();
    program.evaluate(SimdLevel::best(), &points, &mut Scratch::new(), &mut slices);
    for i in 0..3 {
        let (least, most) = (x[i].min(y[i]), x[i].max(y[i]));
        assert!((out[0][i] - least).abs() < 0.02 && (out[1][i] - most).abs() < 0.02);
    }
    assert_eq!((out[2][0], out[3][0]), (0.0, 0.5));
    assert!((out[2][2] - (0.4 - 0.025)).abs() < 1e-15, "{}", out[2][2]);
    // (1⁻² + 1.5⁻²)^{−1/2} − 1
    assert!((out[4][0] - (libm::pow(1.0 + 1.0 / 2.25, -0.5) - 1.0)).abs() < 1e-14);
}

#[test]
fn wrong_constants_are_refused_with_sentences() {
    for (op, params, sentence) in [
        (
            Op::Polynomial,
            &[1.0, 0.0][..],
            "`polynomial` wants terms of four numbers: three powers and a coefficient, not 0",
        ),
        (
            Op::Polynomial,
            &[0.5, 0.0, 0.0, 1.0],
            "`polynomial` wants whole powers from 0 to 16, not 0.5",
        ),
        (
            Op::Superquadric,
            &[1.0, 3.0],
            "`superquadric` wants exponents from 1/16 to 2, not 3",
        ),
        (
            Op::Blobs,
            &[2.0, 0.5, 0.0, 0.0, 0.0, 0.0, -1.0, 1.0],
            "`blobs` wants radii from a millionth to a hundred million, not -1",
        ),
        (
            Op::Blobs,
            &[9.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0],
            "`blobs` wants a kernel, not 9",
        ),
        (
            Op::Bend,
            &[0.0, 2.0, -1.0, 2.0, 0.0],
            "`bend` wants less than half a turn on each side of its centre, not 4",
        ),
        (
            Op::Bend,
            &[0.0, 1.0, -1.0, 2.0, 3.0],
            "`bend` wants a low below its high, and its centre between them, not 3",
        ),
    ] {
        let mut graph = Graph::new();
        let p = graph.push(Op::Position, &[], &[]).unwrap();
        assert_eq!(
            graph.push(op, &[p], params).unwrap_err().to_string(),
            sentence
        );
    }
    let mut graph = Graph::new();
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    assert!(graph.push(Op::Polynomial, &[p], &vec![1.0; 8196]).is_err());
}
