//! Noises and their options.

use field::hash::{hash, unit};
use field::{Interval, Place, Program};

use super::*;

#[test]
fn noises_take_options() {
    for (text, graph) in [
        ("simplex(4*p)", "simplex((p*4))"),
        ("value_noise(p, 3)", "value_noise(p)"),
        (
            "cellular(4*p, #{order: 1, norm: 2, key: 3})",
            "cellular((p*4))",
        ),
        (
            "cellular(p, #{weights: [-1, 1], norm: \"max\", bias: true})",
            "cellular(p)",
        ),
        ("sparse(p, #{nodes: 2, kernel: \"lewis\"})", "sparse(p)"),
        ("sparse(p, #{scatter: \"disc\"})", "sparse(p)"),
        ("spot(p, #{stretch: 3, axis: [1, 0, 0]})", "spot(p)"),
        ("wavelet(p, 2)", "wavelet(p)"),
        ("fbm(p, #{noise: \"cellular\"})", "cascade(p)"),
        (
            "ridged_multifractal(p, #{noise: #{kind: \"sparse\", nodes: 2}})",
            "cascade(p)",
        ),
        ("fbm(p, #{hurst: [0.9, 0.8, 0.7]})", "cascade(p)"),
        ("fbm(p, #{power: 2})", "(fbm(p)*fbm(p))"),
        ("fbm(p, #{power: 1.5})", "pow(fbm(p))"),
        (
            "fbm(p, #{hurst: p.x, octaves: 2})",
            "(cascade(p) + (exp((p.x*-0.6931471805599453))*cascade(p)))",
        ),
        (
            "gradient(p, #{noise: \"simplex\"}).x",
            "noise_gradient(p).x",
        ),
        (
            "warp(p, #{amount: 2}).x",
            "(p + (vec(noise(p), noise(p), noise(p))*2)).x",
        ),
        (
            "cellular(p, #{dimensions: 2, exponent: 3})",
            "cellular of two dimensions(p)",
        ),
        ("sparse(p, #{dimensions: 2})", "sparse(p)"),
        (
            "value_noise(p, #{dimensions: 2})",
            "value_noise(onto_plane(p))",
        ),
        (
            "warp(p, #{octaves: 3, hurst: 0.5}).x",
            "(p + (vec(fbm(p), fbm(p), fbm(p))*0.5)).x",
        ),
        (
            "warp(p, #{by: \"gradient\", scale: 3}).z",
            "(p + (noise_gradient((p*3))*0.5)).z",
        ),
    ] {
        assert_eq!(read(text), graph, "{text}");
    }
    // Per octave or the same H: the same field where they agree.
    let fields = fields();
    let each = fields.field("fbm(p, #{hurst: [0.8, 0.8]})").unwrap();
    let nodes = fields.into_graph();
    let params = &nodes.nodes()[each.index()].params;
    assert_eq!(
        (params[5], &params[params.len() - 2..]),
        (2.0, &[0.8, 0.8][..])
    );
}

#[test]
fn mistakes_in_noises_have_sentences() {
    for (text, message, help) in [
        (
            "cellular(p, #{ordre: 2})",
            "`cellular` has no option `ordre`",
            Some("did you mean `order`?"),
        ),
        (
            "cellular(p, #{order: 5})",
            "`cellular` wants an order from 1 to 4, not 5",
            None,
        ),
        (
            "cellular(p, #{norm: 0.5})",
            "`cellular` wants a norm from 1 to 16, or \"max\", not 0.5",
            None,
        ),
        (
            "cellular(p, #{norm: 0})",
            "`cellular` wants a norm from 1 to 16, or \"max\", not -1",
            None,
        ),
        (
            "cellular(p, #{density: 100})",
            "`cellular` wants a density from 0.25 to 8 nodes per cell, not 100",
            None,
        ),
        (
            "cellular(p, #{weights: [0, 0]})",
            "`cellular` wants a weight that is not 0, not 0",
            None,
        ),
        (
            "cellular(p, #{weights: 3})",
            "`cellular: weights` is a list of one to four numbers",
            None,
        ),
        (
            "cellular(p, #{squared: 2})",
            "`cellular: squared` is true or false",
            None,
        ),
        (
            "sparse(p, #{nodes: 9})",
            "`sparse` wants 1 to 8 whole nodes per cell, not 9",
            None,
        ),
        (
            "sparse(p, #{nodes: 2, scatter: \"disc\"})",
            "`sparse` wants 1 node per cell where they keep apart, not 2",
            None,
        ),
        (
            "sparse(p, #{kernel: \"cubic\"})",
            "`sparse: kernel` cannot be `cubic`",
            Some("it is \"quintic\" or \"lewis\" or \"linear\""),
        ),
        (
            "simplex(p, 0.5)",
            "`simplex` wants a key from 0 to 4294967295, not 0.5",
            None,
        ),
        (
            "simplex(p.x)",
            "`simplex` wants a vector here, not a field",
            None,
        ),
        ("simplx(p)", "there is no function `simplx`", None),
        (
            "fbm(p, #{noise: \"perlin\"})",
            "`fbm: noise` names no noise",
            None,
        ),
        (
            "fbm(p, #{noise: #{kind: \"sparse\", order: 1}})",
            "`sparse` has no option `order`",
            None,
        ),
        (
            "fbm(p, #{hurst: [0.8, 9]})",
            "`cascade` wants a Hurst coefficient from -4 to 4, not 9",
            None,
        ),
        (
            "fbm(p, #{hurst: [0.8], octaves: 2})",
            "`cascade` wants one Hurst coefficient for each octave, not 1",
            None,
        ),
        (
            "fbm(p, #{hurst: []})",
            "`fbm: hurst` is an empty list",
            None,
        ),
        (
            "fbm(p, #{first: 44})",
            "`cascade` wants octaves that end at the 48th, not 44",
            None,
        ),
        (
            "fbm(p, #{hurst: p.x, octaves: 99})",
            "`cascade` wants 1 to 48 whole octaves, not 99",
            None,
        ),
        (
            "cellular(p, #{exponent: 0.5})",
            "`cellular` wants an exponent from 1 to 4, not 0.5",
            None,
        ),
        (
            "cellular(p, #{squared: true, exponent: 2})",
            "`cellular` takes `squared` or `exponent`, not both",
            Some("squared: true is exponent: 2"),
        ),
        (
            "cellular(p, #{dimensions: 4})",
            "`cellular` has 2 or 3 dimensions, not 4",
            None,
        ),
        (
            "cellular(p, #{dimensions: 2, density: 0.5})",
            "`cellular of two dimensions` wants a density from 1 to 8 nodes per cell in two dimensions, not 0.5",
            None,
        ),
        (
            "sparse(p, #{dimensions: 2, scatter: \"disc\"})",
            "`sparse` has no `scatter` in two dimensions",
            None,
        ),
        (
            "simplex(p, #{dimensions: 2})",
            "`simplex` has no option `dimensions`",
            None,
        ),
        (
            "fbm(p, #{noise: #{kind: \"cellular\", dimensions: 2}})",
            "`fbm: noise` has three dimensions",
            None,
        ),
        (
            "warp(p, #{by: \"gradient\", octaves: 3}).x",
            "`warp` goes by the gradient of a single noise, not of octaves",
            None,
        ),
        (
            "gradient(p, #{noise: \"cellular\"}).x",
            "`gradient` wants a smooth noise: this one's gradient jumps",
            None,
        ),
        (
            "gradient(p)",
            "the expression is a vector, but a field is a number at every point",
            None,
        ),
        (
            "warp(p, #{by: \"wind\"}).x",
            "`warp: by` is \"vector\" or \"gradient\"",
            None,
        ),
        ("warp(p, #{far: 1}).x", "`warp` has no option `far`", None),
        (
            "weierstrass(p, #{directions: 0})",
            "`weierstrass` wants 1 to 64 whole directions, not 0",
            None,
        ),
    ] {
        let refusal = refused(text);
        assert_eq!(refusal.message, message, "{text}");
        if help.is_some() {
            assert_eq!(refusal.help.as_deref(), help, "{text}");
        }
    }
}

/// Where H is the same everywhere it makes no difference that it could vary.
#[test]
fn a_hurst_coefficient_that_varies_agrees_with_one_that_does_not() {
    for call in [
        "fbm(3*p, #{octaves: 4, HURST})",
        "turbulence(3*p, #{octaves: 4, first: 2, HURST})",
        "ridged(3*p, #{octaves: 3, HURST, noise: \"sparse\"})",
        "altitude1(3*p, #{octaves: 5, xi: 0.4, HURST})",
        "altitude2(3*p, #{octaves: 5, xi: 0.4, HURST, basis: \"ridged\"})",
        "ridged_multifractal(3*p, #{octaves: 5, offset: 0.9, gain: 1.7, HURST})",
    ] {
        let values = |hurst: &str| {
            let fields = fields();
            let root = fields.field(&call.replace("HURST", hurst)).unwrap();
            let graph = fields.into_graph();
            let program = Program::compile(&graph, &[root], Interval::point(0.0)).unwrap();
            let at = |i: u32| {
                let p = [0, 1, 2].map(|axis| 8.0 * unit(hash(&[i, axis])) - 4.0);
                program.at(&Place {
                    at: p,
                    time: 0.0,
                    footprint: 0.01,
                })
            };
            (0..500).map(at).collect::<Vec<f64>>()
        };
        let (even, varying) = (values("hurst: 0.7"), values("hurst: 0.7 + 0*p.x"));
        for (a, b) in even.iter().zip(&varying) {
            assert!((a - b).abs() < 1e-6, "{call}: {a} {b}");
        }
        let other = values("hurst: 0.7 + 0.2*sin(p.x)");
        let moved = even
            .iter()
            .zip(&other)
            .filter(|(a, b)| (*a - *b).abs() > 1e-3);
        assert!(moved.count() > 250, "{call}");
    }
}
