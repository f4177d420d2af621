//! Scripts that mean no good, or take too much.

use super::*;

#[test]
fn hostile_scripts_are_told_where_they_go_wrong() {
    for (text, message, position) in [
        (
            "fn f(x) { f(x) + f(x) } f(1)",
            "the functions of the expression call each other too deeply",
            Some((1, 25)),
        ),
        (
            "let i = 0;\nwhile true { i += 1 }",
            "the expression takes too many steps",
            Some((2, 19)),
        ),
        (
            "let a = [1];\nfor i in 0..64 { a += a; } 1",
            "an array in the expression grows too large",
            Some((2, 20)),
        ),
        (
            "let f = p.x;\nfor i in 0..10000000 { f += sin(i*f) } f",
            "the field is nested more than 4096 operations deep",
            Some((2, 29)),
        ),
        (
            "for i in 0..10000000 { let f = p.x*i; }\np.z",
            "the field has more than 65536 operations",
            Some((1, 35)),
        ),
        (
            "let n = 1e300*1e300;\nnoise((n - n)*p)",
            "`*` is given a number that is NaN: numbers must be finite",
            Some((2, 14)),
        ),
        (
            "fbm(p, #{hurst: 1e300*1e300})",
            "`fbm: hurst` is given a number that is inf: numbers must be finite",
            Some((1, 1)),
        ),
        (
            "blobs([[0, 0, 1e300*1e300]])",
            "`blobs` is given a number that is inf: numbers must be finite",
            Some((1, 1)),
        ),
        (
            "let n = 1e300*1e300; n - n",
            "the expression is NaN, but a field is a finite number",
            None,
        ),
    ] {
        let begun = Instant::now();
        let refusal = refused(text);
        assert_eq!(
            (refusal.message.as_str(), refusal.position),
            (message, position),
            "{text}"
        );
        assert!(begun.elapsed() < Duration::from_secs(5), "{text}");
    }
}

#[test]
fn hostile_scripts_end_soon() {
    let long_sum = vec!["p.x"; 15_000].join("+");
    let nested = format!("{}p.x{}", "(".repeat(20_000), ")".repeat(20_000));
    let negations = format!("{}p.x", "-".repeat(30_000));
    let many_functions: String = (0..500).map(|i| format!("fn f{i}() {{ 1 }} ")).collect();
    let many_variables: String = (0..5000).map(|i| format!("let v{i} = 1; ")).collect();
    let scripts = [
        "while true { }",
        "loop { }",
        "let i = 0; while true { i += 1 }",
        "let a = []; loop { a += [1] }",
        "let a = [1]; for i in 0..64 { a = [a, a]; } 1",
        "let s = \"x\"; for i in 0..64 { s += s; } 1",
        "let s = \"x\"; loop { s = s + s + s; }",
        "let m = #{}; for i in 0..100000 { m[\"k\" + i] = m; } 1",
        "let m = #{a: 1}; for i in 0..64 { m = #{a: m, b: m}; } 1",
        "fn f(x) { f(x) + f(x) } f(1)",
        "fn f(x) { if x == 0 { 1 } else { f(x - 1) + f(x - 1) } } f(15) * f(15) * f(15) * f(15) + f(30)",
        "for i in 0..9223372036854775807 { }",
        "let f = p.x; for i in 0..100000 { f = f*f + i; } f",
        "let f = p.x; for i in 0..100000 { f = sin(f); } f",
        "let f = p.x; for i in 0..100000 { f = noise(i*p) } f",
        "let n = 1; for i in 0..64 { n = n*1000000 } n",
        "let n = 1e300; for i in 0..64 { n = n*n } n",
        "9223372036854775807 + 1",
        "-(-9223372036854775807 - 1)",
        "p.x[3]",
        "let x = x; x",
        &long_sum,
        &nested,
        &negations,
        &many_functions,
        &many_variables,
    ];
    for script in scripts {
        let begun = Instant::now();
        let refusal = refused(script);
        assert!(!refusal.message.is_empty());
        let shown: String = script.chars().take(60).collect();
        assert!(begun.elapsed() < Duration::from_secs(5), "{shown}");
        println!(
            "{shown:60} {:6.1} ms  {}",
            begun.elapsed().as_secs_f64() * 1e3,
            refusal.message
        );
    }
}

#[test]
fn doubling_sixty_four_times_is_small() {
    let fields = fields();
    let script = "let x = p.x; for i in 0..64 { x = x + x } x";
    fields.field(script).unwrap();
    assert!(fields.into_graph().nodes().len() < 70);
}
