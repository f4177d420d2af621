mod differences;
mod hostile;
mod noises;

use std::time::{Duration, Instant};

use super::*;
use crate::show;

fn fields() -> Fields {
    let curves = [
        (
            "wave".to_owned(),
            Curve::Linear(vec![(0.0, 0.0), (1.0, 2.0)]),
        ),
        ("four".to_owned(), Curve::Constant(4.0)),
    ];
    Fields::new(Seed::Sphere { radius: 2.0 }, curves.into())
}

/// The field as its graph says it.
fn read(text: &str) -> String {
    let fields = fields();
    match fields.field(text) {
        Ok(id) => show::node(&fields.into_graph(), id, 1000),
        Err(refusal) => format!("refused: {}", refusal.message),
    }
}

fn refused(text: &str) -> Refusal {
    match fields().field(text) {
        Err(refusal) => refusal,
        Ok(_) => panic!("{text} was accepted as {}", read(text)),
    }
}

#[test]
fn fields_as_the_thesis_writes_them() {
    assert_eq!(
        read("length(p) - 1 + 0.3*noise(4*p) + 0.15*noise(8*p)"),
        "(((length(p) - 1) + (0.3*noise((p*4)))) + (0.15*noise((p*8))))"
    );
    for (text, graph) in [
        ("seed", "(length(p) - 2)"),
        (
            "seed - noise(base)",
            "((length(p) - 2) - noise(onto_sphere(p)))",
        ),
        ("R*p.z", "(2*p.z)"),
        ("p.z/2", "(p.z/2)"),
        ("-p.x", "neg(p.x)"),
        ("p.x**2", "(p.x*p.x)"),
        ("p.x**-1", "(1/p.x)"),
        ("p.x**1.5", "pow(p.x)"),
        ("four", "4"),
        ("t*wave", "(t*linear(t))"),
        ("0*p.x + 1*p.y + 0", "((0*p.x) + p.y)"),
        ("dot(p, vec(1, 0, t))", "dot(p, vec(1, 0, t))"),
        (
            "length((p - vec(1,2,3))/4)",
            "length(((p - vec(1, 2, 3))*0.25))",
        ),
        ("select(p.x, 1, p.y)", "select(p.x, 1, p.y)"),
        ("clamp(p.x, 0, 1)", "min(max(p.x, 0), 1)"),
        ("mix(1, 3, 0.5) + p.x", "(2 + p.x)"),
        ("smoothstep(0, 1, p.z)", "smoothstep(p.z)"),
        ("p.x.abs()", "abs(p.x)"),
        ("p.x - -1", "(p.x - -1)"),
    ] {
        assert_eq!(read(text), graph, "{text}");
    }
}

#[test]
fn numbers_mean_what_they_mean_on_paper() {
    for (text, graph) in [
        ("1/3", "0.3333333333333333"),
        ("1/3*p.x", "(0.3333333333333333*p.x)"),
        ("7/2 + 1", "4.5"),
        ("2**3", "8"),
        ("2**-1", "0.5"),
        ("2.0**0.5", "1.4142135623730951"),
        ("sqrt(4)", "2"),
        ("max(1, 2.5)", "2.5"),
        ("-3 % 2", "-1"),
        ("let x = 1; x += 0.5; x = x/2; x", "0.75"),
    ] {
        assert_eq!(read(text), graph, "{text}");
    }
}

#[test]
fn bindings_loops_and_functions() {
    assert_eq!(
        read("let f = seed; for i in 0..2 { f += 0.5**i * noise(2**i*p) } f"),
        "(((length(p) - 2) + noise(p)) + (0.5*noise((p*2))))"
    );
    assert_eq!(
        read("fn ridge(q, k) { (1 - abs(noise(q, k)))**2 } seed - ridge(base, 3)"),
        "((length(p) - 2) - ((1 - abs(noise(onto_sphere(p))))*(1 - abs(noise(onto_sphere(p))))))"
    );
    assert_eq!(
        read("fn twice(p) { 2*p } length(twice(p.z*p))"),
        "length(((p*p.z)*2))"
    );
    assert_eq!(
        read("let s = 0; for a in [1, 2, 3] { s += a } s*p.x"),
        "(6*p.x)"
    );
    assert_eq!(read("fn far() { length(p) } far()"), "length(p)");
    assert_eq!(read("if 1 < 2.5 { p.x } else { p.y }"), "p.x");
    assert_eq!(
        read("let i = 0; let f = p.x; while i < 3 { f = f*f; i += 1; } f").len(),
        45
    );
}

#[test]
fn cascades_take_options() {
    assert_eq!(read("fbm(p)"), "fbm(p)");
    assert_eq!(
        read("altitude2(p, #{basis: \"ridged\", hurst: 0.8, xi: 0.6})"),
        "altitude2(p)"
    );
    assert_eq!(
        read("ridged_multifractal(p/8, #{offset: 1, gain: 2, octaves: 8})"),
        "ridged_multifractal((p*0.125))"
    );
    assert_eq!(
        read("turbulence(p, #{key: 3}) + ridged(p)"),
        "(fbm(p) + fbm(p))"
    );
    let refusal = refused("fbm(p, #{octavs: 3})");
    assert_eq!(refusal.message, "`fbm` has no option `octavs`");
    assert_eq!(refusal.help.as_deref(), Some("did you mean `octaves`?"));
    assert_eq!(
        refused("fbm(p, #{octaves: 99})").message,
        "`fbm` wants 1 to 48 whole octaves, not 99"
    );
    assert_eq!(
        refused("fbm(p, #{basis: \"rigid\"})").message,
        "there is no basis `rigid`"
    );
    assert_eq!(
        refused("fbm(p, #{lacunarity: p.x})").message,
        "`fbm: lacunarity` wants a constant number here, not a field"
    );
    assert_eq!(
        refused("noise(p, 0.5)").message,
        "`noise` wants a key from 0 to 4294967295, not 0.5"
    );
}

#[test]
fn shapes_take_places_lists_and_options() {
    for (text, graph) in [
        ("polynomial([[2, 0, 0, 1], [0, 0, 1, -1]])", "polynomial(p)"),
        ("superquadric()", "superquadric(p)"),
        (
            "superquadric(2*p, #{e1: 0.5, size: [1, 2, 2]})",
            "superquadric(vec(((p*2).x*1), ((p*2).y*0.5), ((p*2).z*0.5)))",
        ),
        ("sphere(#{radius: 2})", "(length(p) - 2)"),
        (
            "sphere(p, #{radius: 2, exponent: 1})",
            "((2*pow(dot((p*0.5), (p*0.5)))) - 2)",
        ),
        ("blobs([[0, 0, 0], [1, 0, 0, 2, -1]])", "blobs(p)"),
        (
            "blobs(p/2, [[0, 0, 0]], #{kernel: \"blinn\", threshold: 0.2})",
            "blobs((p*0.5))",
        ),
        (
            "distances([#{point: [0, 0, 0]}, #{line: [[0, 0, 0], [1, 0, 0]], radius: 2}])",
            "distances(p)",
        ),
        (
            "convolution(p/2, [#{arc: [[0, 0, 0], [1, 0, 0], [0, 0, 1]], angle: PI}], #{kernel: \"cauchy\"})",
            "convolution((p*0.5))",
        ),
        (
            "free_form(p, [[0,0,0],[1,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0]], #{max: [2, 2, 2]}).x",
            "(p + vec(bernstein(p), bernstein(p), bernstein(p))).x",
        ),
        ("union(p.x, p.y)", "min(p.x, p.y)"),
        ("intersection([p.x, p.y, p.z])", "max(max(p.x, p.y), p.z)"),
        (
            "difference(p.x, p.y, #{width: 0.1})",
            "blend(p.x, neg(p.y))",
        ),
        ("blend(p.x, p.y, 0.1)", "blend(p.x, p.y)"),
        ("morph(p.x, p.y, 0.25)", "(p.x + ((p.y - p.x)*0.25))"),
        ("bend(p, #{rate: 0.5}).z", "vec(bend(p), p.y, bend(p)).z"),
        ("bend(p, #{rate: 0}).z", "p.z"),
        (
            "length(twist(p, 2))",
            "length(vec(((p.x*cos((p.z*2))) + (p.y*sin((p.z*2)))), ((p.y*cos((p.z*2))) - (p.x*sin((p.z*2)))), p.z))",
        ),
    ] {
        assert_eq!(read(text), graph, "{text}");
    }
    for (text, message) in [
        (
            "polynomial([[2, 0, 0]])",
            "a term of `polynomial` has four numbers, not 3",
        ),
        (
            "polynomial([3])",
            "`polynomial` wants a list here, not a number",
        ),
        (
            "polynomial([[p.x, 0, 0, 1]])",
            "`polynomial` wants a constant number here, not a field",
        ),
        (
            "blobs([])",
            "`blobs` wants points of five numbers: a place, a radius and a weight, not 0",
        ),
        (
            "blobs([[0, 0, 0, -1]])",
            "`blobs` wants radii from a millionth to a hundred million, not -1",
        ),
        (
            "blobs([[0, 0, 0]], #{kernel: \"wyvil\"})",
            "`blobs` has no kernel `wyvil`",
        ),
        (
            "blobs([[0, 0, 0]], #{far: 1})",
            "`blobs: far` wants true or false",
        ),
        ("blobs(3)", "`blobs` does not take (a number)"),
        (
            "superquadric(#{e1: 3})",
            "`superquadric` wants exponents from 1/16 to 2, not 3",
        ),
        ("superquadric(#{e: 3})", "`superquadric` has no option `e`"),
        (
            "convolution([#{point: [0, 0, 0]}], #{kernel: \"wyvill\"})",
            "`convolution` wants the kernel murakami or cauchy: others have no closed form, not 2",
        ),
        (
            "distances([#{line: [[0, 0, 0], [1, 0]]}])",
            "`distances: line` wants places of three numbers, not 2",
        ),
        (
            "distances([#{polygon: [[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]]}])",
            "`distances` wants a convex polygon, not -1.2649110640673515",
        ),
        (
            "distances([#{lin: [[0, 0, 0], [1, 0]]}])",
            "`distances` has no option `lin`",
        ),
        (
            "distances([[0, 0, 0]])",
            "`distances` wants maps that each hold a primitive",
        ),
        (
            "length(free_form(p, [[0, 0, 0]], #{counts: [2, 2, 3]}))",
            "`bernstein` wants one control value for each point of its lattice, not 1",
        ),
        (
            "bezier_tetrahedra([])",
            "`bezier_tetrahedra` wants at least one tetrahedron",
        ),
        (
            "bezier_tetrahedra([#{corners: [[0,0,0],[1,0,0],[0,1,0],[0,0,1]], values: [1, 2, 3]}])",
            "a tetrahedron of `bezier_tetrahedra` cannot have 3 values",
        ),
        (
            "bezier_tetrahedra([#{corners: [[0,0,0],[1,0,0],[0,1,0]], values: [1, 2, 3, 4]}])",
            "a tetrahedron of `bezier_tetrahedra` has four corners",
        ),
        (
            "bezier_tetrahedra([#{corners: [[0,0,0],[1,0,0],[0,1,0],[1,1,0]], values: [1, 2, 3, 4]}])",
            "the corners of a tetrahedron of `bezier_tetrahedra` lie in one plane",
        ),
        (
            "bezier_tetrahedra([#{values: [1, 2, 3, 4]}])",
            "a tetrahedron of `bezier_tetrahedra` has corners and values",
        ),
        (
            "bezier_tetrahedra([1], #{thickness: -1})",
            "`bezier_tetrahedra` wants a thickness of 0 or above, not -1",
        ),
        (
            "union(p.x, p.y, #{width: 1, sharpness: 2})",
            "`union` takes a sharpness or a width, not both",
        ),
        ("union(p, p.y)", "`union` wants a number here, not a vector"),
        (
            "blend(p.x, p.y, -1)",
            "`blend` wants a width above 0, not -1",
        ),
        (
            "length(taper(p, #{low: 1, high: 0}))",
            "`taper` wants its low below its high, not 1 and 0",
        ),
        (
            "length(bend(p, #{rate: 3, high: 2, centre: 0}))",
            "`bend` wants less than half a turn on each side of its centre, not 6",
        ),
        ("length(bend(p, #{rat: 3}))", "`bend` has no option `rat`"),
        (
            "length(bend(p, #{rate: t}))",
            "`bend: rate` wants a constant number here, not a field",
        ),
    ] {
        assert_eq!(refused(text).message, message, "{text}");
    }
}

#[test]
fn what_rhai_gets_silently_wrong_is_refused_with_a_way_out() {
    let select = Some("use select(c, a, b): a where c < 0, else b");
    for (text, message, help) in [
        ("2^3*p.x", "`^` is not a power", Some("write 2**3")),
        (
            "altitude2(p, #{basis: 'ridged'})",
            "text stands between double quotes",
            Some("write \"ridged\", in a TOML text that begins with ' or \"\"\""),
        ),
        (
            "if p.x == 0 { 1 } else { 2 }",
            "a field cannot be compared with `==`: it differs from point to point",
            select,
        ),
        (
            "if 0 == p.x { 1 } else { 2 }",
            "a field cannot be compared with `==`: it differs from point to point",
            select,
        ),
        (
            "if p.x != p.y { 1 } else { 2 }",
            "a field cannot be compared with `!=`: it differs from point to point",
            select,
        ),
        (
            "if p == 1.5 { 1 } else { 2 }",
            "a field cannot be compared with `==`: it differs from point to point",
            select,
        ),
        (
            "if p.x < 1 { 1 } else { 2 }",
            "a field cannot be compared with `<`: it differs from point to point",
            select,
        ),
        (
            "if \"a\" == p.x { 1 } else { 2 }",
            "a field cannot be compared with `==`: it differs from point to point",
            select,
        ),
        (
            "if p.x { 1 } else { 2 }",
            "a field is neither true nor false: it differs from point to point",
            select,
        ),
        (
            "while p.x { }",
            "a field is neither true nor false: it differs from point to point",
            select,
        ),
        ("if !p.x { 1 } else { 2 }", "a `!` has no meaning", None),
        (
            "let x = 1; x /= 2; x*p.x",
            "this would keep whole numbers whole",
            Some("write x = x / 2, x = x**2"),
        ),
        (
            "switch p.x { 0 => 1, _ => 2 }",
            "there is no `switch`: a field differs from point to point",
            select,
        ),
        (
            "1/0",
            "this divides by zero",
            Some("check what stands below the `/`"),
        ),
        (
            "seed + p.x/(2 - 2)",
            "this divides by zero",
            Some("check what stands below the `/`"),
        ),
        (
            "length(p/0)",
            "this divides by zero",
            Some("check what stands below the `/`"),
        ),
        (
            "2**p.x",
            "2 cannot be raised to a field",
            Some("the exponent must be a constant; exp(x * 0.693147) is 2**x"),
        ),
    ] {
        let refusal = refused(text);
        if message != "a `!` has no meaning" {
            assert_eq!(refusal.message, message, "{text}");
            assert_eq!(refusal.help.as_deref(), help, "{text}");
        }
        assert!(refusal.position.is_some(), "{text}");
    }
}

#[test]
fn mistakes_have_sentences_and_places() {
    for (text, message, position) in [
        ("lenght(p)", "there is no function `lenght`", Some((1, 1))),
        ("length(q)", "there is no `q`", Some((1, 8))),
        (
            "1 +\n  noise(3)",
            "`noise` wants a vector here, not a number",
            Some((2, 3)),
        ),
        ("noise()", "`noise` does not take (nothing)", Some((1, 1))),
        ("p.w", "this value has no such part", Some((1, 3))),
        (
            "p",
            "the expression is a vector, but a field is a number at every point",
            None,
        ),
        ("let x = p.x;", "the expression has no value", None),
        ("\"high\"", "the expression is text, not a field", None),
        (
            "p + 1",
            "a vector `+` a number has no meaning",
            Some((1, 3)),
        ),
        (
            "p*p",
            "two vectors cannot be multiplied with `*`",
            Some((1, 2)),
        ),
        ("(p.x", "a `)` is missing", Some((1, 5))),
        ("p = 3", "`p` cannot be changed", Some((1, 1))),
        (
            "noise(p.x)",
            "`noise` wants a vector here, not a field",
            Some((1, 1)),
        ),
        (
            "exp(1e9)",
            "the expression is inf, but a field is a finite number",
            None,
        ),
        (
            "fn h(q) {\n noise(q.x) }\nh(p)",
            "`noise` wants a vector here, not a field",
            Some((2, 2)),
        ),
        (
            "eval(\"1\")",
            "an expression cannot use `eval`",
            Some((1, 1)),
        ),
        (
            "import \"x\" as y; 1",
            "an expression cannot use `import`",
            Some((1, 1)),
        ),
        ("print(1)", "an expression cannot use `print`", Some((1, 1))),
        ("sleep(1)", "there is no function `sleep`", Some((1, 1))),
        (
            "timestamp()",
            "there is no function `timestamp`",
            Some((1, 1)),
        ),
        (
            "smoothstep(1, 0, p.x)",
            "`smoothstep` wants its first edge below its second, not 1",
            Some((1, 1)),
        ),
        (
            "smoothstep(p.x, 0, p.x)",
            "`smoothstep` wants a constant number here, not a field",
            Some((1, 1)),
        ),
    ] {
        let refusal = refused(text);
        assert_eq!(
            (refusal.message.as_str(), refusal.position),
            (message, position),
            "{text}"
        );
    }
    let plane = Fields::new(Seed::Plane, BTreeMap::new());
    assert_eq!(
        plane.field("R").unwrap_err().message,
        "a plane has no radius `R`"
    );
}

/// What a hostile script is told, and at which line and column of it.
#[test]
fn ready_hypertextures_are_adjusted_by_options() {
    let names = [
        "hills",
        "mountains",
        "canyons",
        "dunes",
        "craters",
        "boulders",
        "flames",
        "mud",
    ];
    assert_eq!(names.len(), library::LIBRARY.len());
    for (name, ready) in names.into_iter().zip(library::LIBRARY) {
        assert_eq!(name, ready.name);
        assert!(is_taken(name), "{name}");
        let fields = fields();
        let default = fields.field(&format!("{name}(base)")).unwrap();
        let same = fields.field(&format!("{name}(base, #{{key: 0}})")).unwrap();
        assert_eq!(default, same, "{name}");
        let mut seen = vec![default];
        for option in [
            "key: 1",
            "amplitude: 3.5",
            "scale: 77",
            "octaves: 2",
            "amplitude: wave",
        ] {
            let other = fields
                .field(&format!("{name}(base, #{{{option}}})"))
                .unwrap();
            assert!(!seen.contains(&other), "{name} {option}");
            seen.push(other);
        }
        for (text, message) in [
            (
                format!("{name}(base, #{{ke: 1}})"),
                format!("`{name}` has no option `ke`"),
            ),
            (
                format!("{name}(3)"),
                format!("`{name}` wants a vector here, not a number"),
            ),
            (
                format!("{name}(base, #{{scale: 0}})"),
                format!("`{name}` wants a scale above 0, not 0"),
            ),
            (
                format!("{name}(base, #{{key: -1}})"),
                format!("`{name}` wants a key from 0 to 4294967231, not -1"),
            ),
            (
                format!("{name}(base, #{{scale: wave}})"),
                format!("`{name}: scale` wants a constant number here, not a field"),
            ),
        ] {
            let refusal = refused(&text);
            assert_eq!(refusal.message, message);
            assert!(refusal.position.is_some());
        }
    }
}

#[test]
fn curves_that_are_used_are_known() {
    let fields = fields();
    fields.field("wave*p.x").unwrap();
    assert_eq!(fields.unused_curves(), ["four"]);
}

#[test]
fn grids_are_recipes_with_options() {
    let fields = fields();
    for text in [
        "spectral_terrain(p)",
        "spectral_terrain(p, #{size: 64, spacing: 10, height: 300, hurst: 0.7, key: 3})",
        "spectral_flakes(p, #{size: 16})",
        "sea(p, #{size: 64, wind: 12, direction: 30})",
        "midpoint_terrain(p, #{levels: 5, width: 100, mesh: \"triangles\", displace: \"all\"})",
    ] {
        assert!(
            fields.field(text).is_ok(),
            "{text}: {:?}",
            fields.field(text)
        );
    }
    for (text, said) in [
        ("spectral_terrain(p, #{size: 100})", "power of two"),
        ("spectral_terrain(p, #{hurst: 1.5})", "Hurst"),
        ("spectral_terrain(p, #{spacing: 0})", "above 0"),
        ("spectral_terrain(p, #{spaceing: 1})", "spacing"),
        ("spectral_terrain(p.x)", "vector"),
        ("sea(p, #{wind: 1000})", "wind"),
        ("midpoint_terrain(p, #{levels: 40})", "levels"),
        ("midpoint_terrain(p, #{mesh: \"hexagons\"})", "triangles"),
        ("midpoint_terrain(p, #{mesh: 3})", "triangles"),
        ("sea(p, #{spline: \"septic\"})", "cubic"),
        ("heightmap(\"a.png\", p)", "names no files"),
        ("heightmap(p)", "heightmap(\"file.png\""),
    ] {
        let refusal = fields.field(text).unwrap_err();
        let whole = format!("{} {}", refusal.message, refusal.help.unwrap_or_default());
        assert!(whole.contains(said), "{text}: {whole}");
        assert!(refusal.position.is_some(), "{text}");
    }
}
