//! Lattice noises by their formulas are what operations one by one give.

use super::*;
use crate::noise::Lattice;
use crate::noise::lattice::Corner;
use crate::range::noise::{lattice, reduced};

/// Both forms of a place, and whether they are known at all.
fn both<const N: usize>(corner: Corner, at: &[Reduced<N>; 3]) -> Option<[Reduced<N>; 2]> {
    let own = Lattice::new(5);
    let pair = (reduced::sum(corner, own, at), lattice::sum(corner, own, at));
    match pair {
        (Some(formula), Some(operations)) => Some([formula, operations]),
        (None, None) => None,
        pair => panic!("{corner:?} at {at:?}: {pair:?}"),
    }
}

fn agree<const N: usize>(count: u32) {
    let mut seen = 0;
    for i in 0..count {
        let size = scale(&[i, 90]);
        let at: [Reduced<N>; 3] = [0, 1, 2].map(|k| {
            let mut form = Reduced::point(4.0 * number(&[i, k, 91]));
            for (n, part) in (0..).zip(&mut form.along) {
                *part = size * number(&[i, k, n, 92]);
            }
            // Mostly rounding; sometimes of a warp.
            form.error = if i % 4 == 0 { 0.1 * size } else { 1e-16 };
            form
        });
        for corner in [Corner::Gradient, Corner::Value, Corner::ValueGradient] {
            let Some([formula, operations]) = both(corner, &at) else {
                continue;
            };
            seen += 1;
            let room = 4e-9 * (1.0 + operations.radius());
            let near = |a: f64, b: f64| (a - b).abs() < room;
            assert!(
                near(formula.centre, operations.centre)
                    && near(formula.error, operations.error)
                    && formula
                        .along
                        .iter()
                        .zip(operations.along)
                        .all(|(a, b)| near(*a, b)),
                "{corner:?} at {at:?}: {formula:?} {operations:?}"
            );
        }
    }
    assert!(seen > count, "{seen}");
}

#[test]
fn lattice_noises_by_formula_are_what_their_operations_give() {
    agree::<1>(20_000);
    agree::<3>(10_000);
}
