//! Cellular noise along a line: its forms hold the distances to all nodes, and are no wider than those ask for.

use super::*;
use crate::noise::Lattice;
use crate::noise::cellular::{Cellular, ORDERS, Options, REACH};
use crate::range::noise::Near;

const NODES: i32 = 4;

/// The four least distances from a place near the origin.
fn nearest(cellular: &Cellular, at: [f64; 3]) -> [f64; ORDERS] {
    let mut all = vec![REACH; ORDERS];
    let cell = at.map(f64::floor);
    let up = if cellular.is_planar() {
        0..=0
    } else {
        -NODES..=NODES
    };
    for z in up {
        for y in -NODES..=NODES {
            for x in -NODES..=NODES {
                let step = [f64::from(x), f64::from(y), f64::from(z)];
                let corner = [0, 1, 2].map(|k| cell[k] + step[k]);
                let number = corner.map(|k| crate::noise::split(k).0);
                for node in cellular.nodes(number) {
                    let way = [0, 1, 2].map(|k| at[k] - corner[k] - node[k]);
                    all.push(crate::arithmetic::length(way));
                }
            }
        }
    }
    all.sort_by(f64::total_cmp);
    [all[0], all[1], all[2], all[3]]
}

/// Lines in every direction, of every length up to three cells, and some of one that is a place.
#[test]
fn distances_along_lines_are_held_by_forms_as_narrow_as_they_can_be() {
    const SAMPLES: i32 = 200;
    for i in 0..400u32 {
        let part = |k: u32| number(&[i, k, 95]);
        let planar = i % 5 == 0;
        let exponent = if i % 3 == 0 { 2.0 } else { 1.0 };
        let cellular = Cellular::new(
            Lattice::new(i),
            Options {
                norm: 2.0,
                density: [0.25, 1.0, 4.0][i as usize % 3],
                weights: [1.0; ORDERS],
                exponent,
                planar,
                unbiased: false,
            },
        );
        let half = if i % 50 == 0 {
            0.0
        } else {
            1.5 * part(0).abs()
        };
        let along = [part(1), part(2), if planar { 0.0 } else { part(3) }];
        let size = half / crate::arithmetic::length(along);
        let along = along.map(|k| k * size * (1.0 - 1e-9));
        let middle = [
            3.0 * part(4),
            3.0 * part(5),
            if planar { 0.0 } else { 3.0 * part(6) },
        ];
        let at = [0, 1, 2].map(|k| Reduced::of_symbols(middle[k], [along[k]]));
        let Some(near) = Near::new(&at, 2, 343) else {
            panic!("{at:?} is near");
        };
        let cap = libm::pow(REACH, exponent);
        let mut sorted = [Reduced::<1>::point(cap); ORDERS];
        Arithmetic::nearest(&cellular, &near, &mut sorted);
        let mut beside = [Interval::new(f64::INFINITY, f64::NEG_INFINITY); ORDERS];
        let mut values = beside;
        for sample in -SAMPLES..=SAMPLES {
            let e = f64::from(sample) / f64::from(SAMPLES);
            let place = [0, 1, 2].map(|k| middle[k] + e * along[k]);
            for (order, distance) in nearest(&cellular, place).into_iter().enumerate() {
                let value = libm::pow(distance, exponent);
                let form = &sorted[order];
                assert!(
                    holds(form, [e], value),
                    "{i}: order {order} at {e} is {value}, {form:?}"
                );
                beside[order] = beside[order].hull(Interval::point(value - form.along[0] * e));
                values[order] = values[order].hull(Interval::point(value));
            }
        }
        for order in 0..ORDERS {
            // Where some place has fewer nodes in reach the greatest distance takes part, as a form.
            if values[order].high < cap {
                let samples = 0.5 * beside[order].width() + half / f64::from(SAMPLES) * 2.0 * cap;
                let form = &sorted[order];
                assert!(
                    form.error <= samples + 1e-9,
                    "{i}: order {order}, {form:?} instead of {samples}"
                );
            }
        }
    }
}
