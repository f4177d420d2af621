//! Boxes and cells.

use super::*;
use crate::Boxes;
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

/// Boxes of all sizes, with footprints from one number to another, as structure of arrays.
struct Many {
    axes: [[f64; 3]; 3],
    centre: [Vec<f64>; 3],
    half: [Vec<f64>; 3],
    footprint: [Vec<f64>; 2],
}

impl Many {
    /// Along the world's axes, and along others.
    const AXES: [[[f64; 3]; 3]; 2] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.6, 0.64, 0.48], [-0.8, 0.48, 0.36], [0.0, -0.6, 0.8]],
    ];

    fn new(count: u32, axes: [[f64; 3]; 3]) -> Self {
        let each = |f: &dyn Fn(u32) -> f64| (0..count).map(f).collect::<Vec<_>>();
        let least = |i: u32| {
            if i.is_multiple_of(3) {
                0.0
            } else {
                0.02 * unit(hash(&[i, 71]))
            }
        };
        let three = [0u32, 1, 2];
        Self {
            axes,
            centre: three.map(|k| each(&|i| 2.0 * number(&[i, k, 72]))),
            half: three.map(|k| each(&|i| scale(&[i, 73]) * unit(hash(&[i, k, 74])))),
            footprint: [
                each(&least),
                each(&|i| least(i) * (1.0 + f64::from(i % 2) * unit(hash(&[i, 75])))),
            ],
        }
    }

    fn boxes(&self) -> Boxes<'_> {
        Boxes {
            centre: self.centre.each_ref().map(Vec::as_slice),
            half: self.half.each_ref().map(Vec::as_slice),
            axes: self.axes,
            footprint: self.footprint.each_ref().map(Vec::as_slice),
            time: Interval::new(0.25, 0.3),
        }
    }

    /// A place of a box, and its footprint.
    fn place(&self, i: usize, e: [f64; 3], share: f64) -> Place {
        let [least, most] = self.footprint.each_ref().map(|part| part[i]);
        Place {
            at: [0, 1, 2].map(|part| {
                let way = |k: usize| e[k] * self.half[k][i] * self.axes[k][part];
                self.centre[part][i] + way(0) + way(1) + way(2)
            }),
            footprint: least + share * (most - least),
            time: 0.25 + 0.05 * share,
        }
    }
}

#[test]
fn every_field_stays_within_its_linear_functions_over_many_boxes() {
    let mut bounded = 0;
    let programs: Vec<_> = zoo().into_iter().chain(noise_zoo()).collect();
    for (axes, (name, program)) in Many::AXES
        .into_iter()
        .flat_map(|axes| programs.iter().map(move |named| (axes, named)))
    {
        let many = Many::new(250, axes);
        let mut forms = vec![Reduced::point(0.0); 250];
        let (boxes, mut scratch) = (many.boxes(), Scratch::new());
        program.over_boxes(SimdLevel::scalar(), &boxes, &mut scratch, &mut forms);
        for level in SimdLevel::all_available() {
            let mut others = vec![Reduced::point(0.0); 250];
            program.over_boxes(level, &boxes, &mut scratch, &mut others);
            assert_eq!(others, forms, "{name} at level {level}");
        }
        for (i, form) in forms.iter().enumerate() {
            bounded += u32::from(form.error.is_finite());
            for j in 0..10u32 {
                let word = u32::try_from(i).unwrap();
                let random = |k: u32| number(&[word, j, k, 76]);
                // Corners, too.
                let e = [0, 1, 2].map(|k| if j < 4 { random(k).signum() } else { random(k) });
                let place = many.place(i, e, unit(hash(&[word, j, 77])));
                let value = program.at(&place);
                // e is good to the rounding of the place.
                let blur: f64 = (0..3)
                    .map(|k| 1e-15 / many.half[k][i] * form.along[k].abs())
                    .sum();
                assert!(
                    holds(&form.blurred(blur), e, value),
                    "{name} at {place:?}: {value} outside {form:?}"
                );
            }
        }
    }
    assert!(bounded > 10_000, "{bounded}");
}

#[test]
fn linear_functions_over_small_boxes_are_about_as_near_as_those_over_cells() {
    let cascades = zoo().into_iter().chain(noise_zoo());
    let cascades = cascades.filter(|(name, _)| {
        ["basis", "ridged multifractal", "cascade of simplex"]
            .iter()
            .any(|part| name.contains(part))
    });
    let mut seen = 0;
    for (name, program) in cascades {
        let (mut lanes, mut cells) = (0.0, 0.0);
        let many = Many::new(400, Many::AXES[1]);
        let boxes = many.boxes();
        let mut forms = vec![Reduced::point(0.0); 400];
        program.over_boxes(SimdLevel::best(), &boxes, &mut Scratch::new(), &mut forms);
        for (i, form) in forms.iter().enumerate() {
            let half = many.half.each_ref().map(|half| half[i]);
            if half.iter().all(|half| *half < 0.02) {
                lanes += form.error;
                cells += program.over_cell(&boxes.cell(i)).error;
            }
        }
        assert!(
            cells > 0.0 && lanes < 4.0 * cells,
            "{name}: {lanes} and {cells}"
        );
        seen += 1;
    }
    assert!(seen >= 4, "{seen}");
}
