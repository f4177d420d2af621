use field::{Graph, NodeId, Op};
use model::{Digest, Rect, Resolution};
use proptest::prelude::*;

use super::*;
use crate::curve::Curve;
use crate::description::*;

/// Canonical bytes as version 1 first wrote them. They must load for ever, under this digest.
const SAMPLE: &[u8] = include_bytes!("../../testdata/sample.v1.scene");
const SAMPLE_DIGEST: &str = include_str!("../../testdata/sample.v1.digest");

/// A scene that uses every part of the format at least once.
fn sample() -> Description {
    let mut graph = Graph::new();
    let p = graph.push(Op::Position, &[], &[]).unwrap();
    // A node that nothing needs, in the middle.
    graph.push(Op::Exp, &[NodeId(0)], &[]).unwrap_err();
    let dead = graph.constant(17.0).unwrap();
    graph.push(Op::Exp, &[dead], &[]).unwrap();
    let noise = graph.push(Op::Noise, &[p], &[3.0]).unwrap();
    let time = graph.push(Op::Time, &[], &[]).unwrap();
    let height = graph
        .push(Op::Smooth, &[time], &[0.0, -1.0, 2.0, 4.0])
        .unwrap();
    let z = graph.push(Op::Z, &[p], &[]).unwrap();
    let above = graph.push(Op::Sub, &[z, height], &[]).unwrap();
    let field = graph.push(Op::Add, &[above, noise], &[]).unwrap();
    Description {
        name: "sample".into(),
        key: 7,
        film: Film {
            resolution: Resolution {
                width: 800,
                height: 600,
            },
            window: Rect {
                x0: 10,
                y0: 20,
                x1: 300,
                y1: 400,
            },
            images: 500,
            fps: 25.0,
            shutter: 0.02,
            exposure: -0.0,
        },
        sampling: Sampling {
            rays: 10,
            filter_order: 4,
        },
        camera: Camera {
            path: Path::GreatCircle(GreatCircle {
                radius: 6_371_000.0,
                altitude: 25.0,
                speed: 60.0 / 3.6,
                latitude: 0.1,
                longitude: 0.2,
                heading: 0.3,
                pitch: Curve::Linear(vec![(0.0, -0.1), (10.0, 0.1)]),
                yaw: Curve::Constant(0.0),
                roll: Curve::Smooth(vec![(0.0, 0.0), (3.0, 0.1), (4.0, 0.0)]),
                clearance: 2.0,
            }),
            projection: Projection::Perspective {
                angle: Curve::Constant(1.0),
            },
        },
        surface: Surface {
            graph,
            field,
            seed: Seed::Sphere {
                radius: 6_371_000.0,
            },
            bound: Bound::Shell {
                inner: 6_370_990.0,
                outer: 6_371_020.0,
            },
            material: Material {
                albedo: [0.3, 0.2, 0.1],
                variation: Some(noise),
                layers: vec![Layer {
                    albedo: [1.0; 3],
                    above: Some([1.0, 2.0]),
                    below: None,
                    steeper: None,
                    gentler: Some([0.5, 0.7]),
                    cover: Some(height),
                    height_offset: Some(noise),
                    ramp: Some(Ramp {
                        asset: 0,
                        low: 0.0,
                        high: 20.0,
                    }),
                }],
            },
        },
        sun: Sun {
            frame: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            azimuth: Curve::Constant(2.0),
            elevation: Curve::Constant(0.3),
            irradiance: [3.0, 2.8, 2.5],
            shadows: true,
        },
        sky: Sky::Air {
            rayleigh: 1.0,
            haze: 1.0,
            visibility: Curve::Constant(8000.0),
            clouds: None,
        },
        assets: vec![AssetRef {
            name: "ramp.png".into(),
            digest: Digest([5; 32]),
            bytes: 1234,
        }],
    }
}

#[test]
fn version_1_still_loads_under_the_same_digest() {
    assert_eq!(digest_of(SAMPLE).to_string(), SAMPLE_DIGEST.trim());
    let scene = Description::from_bytes(SAMPLE).unwrap();
    assert_eq!(scene, sample().canonical());
    assert_eq!(scene.to_bytes().unwrap(), SAMPLE);
}

#[test]
fn bytes_and_back() {
    let mut other = sample();
    other.camera.path = Path::Spline {
        keys: vec![
            PathKey {
                time: 0.0,
                eye: [0.0; 3],
                target: [0.0, 1.0, 0.0],
            },
            PathKey {
                time: 1.0,
                eye: [1.0; 3],
                target: [0.0, 5.0, 0.0],
            },
        ],
        up: [0.0, 0.0, 1.0],
    };
    other.camera.projection = Projection::Orthographic {
        width: Curve::Constant(3.2),
    };
    other.surface.seed = Seed::Plane;
    other.surface.bound = Bound::Slab {
        low: -1.0,
        high: 1.0,
    };
    other.sky = Sky::Plain {
        radiance: [0.5; 3],
        ambient: [0.1; 3],
    };
    let mut third = other.clone();
    third.surface.bound = Bound::Box {
        min: [-1.0; 3],
        max: [1.0; 3],
    };
    third.camera.path = Path::Fixed {
        eye: [0.0, -4.0, 0.0],
        target: [0.0; 3],
        up: [0.0, 0.0, 1.0],
    };
    for scene in [sample(), other, third] {
        let bytes = scene.to_bytes().unwrap();
        let back = Description::from_bytes(&bytes).unwrap();
        assert_eq!(back, scene.clone().canonical());
        assert_eq!(back.digest().unwrap(), scene.digest().unwrap());
    }
}

#[test]
fn dead_nodes_and_the_order_of_making_do_not_show() {
    let scene = sample();
    let canonical = scene.clone().canonical();
    assert_eq!(scene.surface.graph.nodes().len(), 9);
    assert_eq!(canonical.surface.graph.nodes().len(), 7);
    assert_eq!(scene.to_bytes(), canonical.to_bytes());
    assert_eq!(canonical.clone().canonical(), canonical);
}

#[test]
fn minus_zero_is_zero() {
    let mut scene = sample();
    let digest = scene.digest();
    scene.film.exposure = 0.0;
    assert_eq!(scene.digest(), digest);
}

#[test]
fn a_scene_that_breaks_rules_has_no_bytes() {
    let mut scene = sample();
    scene.film.shutter = f64::NAN;
    scene.film.images = 0;
    scene.surface.field = NodeId(4000);
    let Err(NotWritable::Invalid(problems)) = scene.to_bytes() else {
        panic!("it was written")
    };
    let keys: Vec<_> = problems
        .iter()
        .map(|problem| problem.key.as_str())
        .collect();
    assert_eq!(keys, ["film.images", "film.shutter", "surface.field"]);
}

#[test]
fn other_spellings_are_refused() {
    let bytes = sample().to_bytes().unwrap();
    assert_eq!(Description::from_bytes(&[]), Err(NotAScene::Empty));
    assert_eq!(
        Description::from_bytes(&[9, 1, 2]),
        Err(NotAScene::Version(9))
    );
    let long = vec![1; BYTES_MAX + 1];
    assert_eq!(
        Description::from_bytes(&long),
        Err(NotAScene::TooLong(BYTES_MAX + 1))
    );
    let mut longer = bytes.clone();
    longer.push(0);
    assert_eq!(
        Description::from_bytes(&longer),
        Err(NotAScene::NotCanonical)
    );
    // The name's length, 6, as a varint of two bytes.
    assert_eq!(bytes[1], 6);
    let mut padded = vec![1, 0x86, 0x00];
    padded.extend(&bytes[2..]);
    assert_eq!(
        Description::from_bytes(&padded),
        Err(NotAScene::NotCanonical)
    );
    let exposure = bytes
        .windows(8)
        .position(|eight| eight == 0.02f64.to_le_bytes())
        .unwrap()
        + 8;
    let mut minus_zero = bytes.clone();
    minus_zero[exposure + 7] = 0x80;
    assert_eq!(
        Description::from_bytes(&minus_zero),
        Err(NotAScene::NotCanonical)
    );
    let mut infinite = bytes.clone();
    infinite[exposure..exposure + 8].copy_from_slice(&f64::INFINITY.to_le_bytes());
    assert!(matches!(
        Description::from_bytes(&infinite),
        Err(NotAScene::Damaged(_))
    ));
    for end in 0..bytes.len() {
        assert!(
            Description::from_bytes(&bytes[..end]).is_err(),
            "cut at {end}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Whatever is accepted is the only spelling of what it says; nothing panics.
    #[test]
    fn changed_bytes_are_refused_or_canonical(
        changes in prop::collection::vec((0usize..SAMPLE.len(), any::<u8>()), 1..6),
        cut in prop::option::of(0usize..SAMPLE.len()),
    ) {
        let mut bytes = SAMPLE.to_vec();
        for (place, byte) in changes {
            bytes[place] = byte;
        }
        bytes.truncate(cut.unwrap_or(SAMPLE.len()));
        if let Ok(scene) = Description::from_bytes(&bytes) {
            prop_assert_eq!(scene.to_bytes().unwrap(), bytes);
        }
    }

    #[test]
    fn any_bytes_are_refused_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut versioned = vec![1];
        versioned.extend(bytes);
        prop_assert!(Description::from_bytes(&versioned).is_err());
    }
}

#[test]
fn clouds_survive_the_bytes_and_change_the_digest() {
    let plain = sample();
    let mut clouded = plain.clone();
    let depth = clouded.surface.material.variation.unwrap();
    let Sky::Air { clouds, .. } = &mut clouded.sky else {
        panic!("the sample has air");
    };
    *clouds = Some(Clouds {
        height: 2000.0,
        thickness: 150.0,
        depth,
    });
    let bytes = clouded.to_bytes().unwrap();
    assert_ne!(bytes, plain.to_bytes().unwrap());
    assert_eq!(
        Description::from_bytes(&bytes).unwrap(),
        clouded.canonical()
    );
}
