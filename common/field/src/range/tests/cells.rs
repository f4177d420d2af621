//! Boxes and cells.

use super::*;
use crate::range::Cell;

#[test]
fn every_field_stays_within_its_ranges_over_boxes_and_cells() {
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        over_cells(&name, &program, 250);
    }
}

/// Boxes, their slopes and cells of three symbols against points, `count` times.
pub(super) fn over_cells(name: &str, program: &Program, count: u32) {
    for i in 0..count {
        let part = |k: u32| number(&[i, k, 41]);
        let size = scale(&[i, 9, 41]);
        let centre = [0, 1, 2].map(|k| 2.0 * part(k));
        let edges = [0, 1, 2].map(|a| [0, 1, 2].map(|k| size * part(10 + 3 * a + k)));
        let cell = Cell::of_edges(centre, edges);
        let form = program.over_cell(&cell);
        let reach = [0, 1, 2].map(|k| {
            let half: f64 = edges.iter().map(|edge| edge[k].abs()).sum();
            Interval::point(centre[k]).expand(half)
        });
        let zero = Interval::point(0.0);
        let over = program.over_box(reach, zero, zero);
        let slopes = program.slopes_over_box(reach, zero, 0.0);
        for j in 0..8u32 {
            let e = [0, 1, 2].map(|k| number(&[i, j, k, 42]));
            let at = [0, 1, 2]
                .map(|k| centre[k] + e[0] * edges[0][k] + e[1] * edges[1][k] + e[2] * edges[2][k]);
            let place = Place {
                at,
                footprint: 0.0,
                time: 0.0,
            };
            let value = program.at(&place);
            let told = || format!("{name} at {place:?} of {centre:?} {edges:?}: {value}");
            assert!(over.contains(value), "{}: {over:?}", told());
            assert!(slopes.value.contains(value), "{}: {slopes:?}", told());
            let blur = 1e-14 / size * form.along.iter().map(|x| x.abs()).sum::<f64>();
            assert!(holds(&form.blurred(blur), e, value), "{}: {form:?}", told());
            let jet = program.jet(&place);
            for (slope, exact) in slopes.slopes.iter().zip(jet.gradient) {
                let room = slope.expand(1e-9 * (1.0 + exact.abs()));
                assert!(
                    !exact.is_finite() || room.contains(exact),
                    "{}: {exact} outside {slope:?}",
                    told()
                );
            }
        }
    }
}

#[test]
fn cells_of_rays_hold_their_rays() {
    let (_, program) = zoo()
        .into_iter()
        .find(|(name, _)| name.starts_with("spheres"))
        .unwrap();
    for i in 0..400u32 {
        let part = |k: u32| number(&[i, k, 51]);
        let origin = [0, 1, 2].map(|k| 3.0 * part(k));
        let direction = [0, 1, 2].map(|k| part(3 + k));
        let [across, up] = [6, 9].map(|from| [0, 1, 2].map(|k| 0.01 * part(from + k)));
        let t = Interval::new(1.0 + part(20), 1.0 + part(20) + 0.3 * (1.0 + part(21)));
        let form = program.over_cell(&Cell::of_rays(
            origin.map(Interval::point),
            [direction, across, up],
            t,
        ));
        for j in 0..10u32 {
            let e = [0, 1, 2].map(|k| number(&[i, j, k, 52]));
            let along = 0.5 * (t.low + t.high) + e[0] * 0.5 * t.width();
            let at = [0, 1, 2]
                .map(|k| origin[k] + along * (direction[k] + e[1] * across[k] + e[2] * up[k]));
            let value = program.at(&Place {
                at,
                footprint: 0.0,
                time: 0.0,
            });
            assert!(holds(&form.blurred(1e-13), e, value), "{value}: {form:?}");
        }
    }
}
