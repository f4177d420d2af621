//! Ranges and moduli against what evaluation gives: no pair of places may break any level.

use crate::hash::{hash, unit};
use crate::program::tests::{fig_5_6, noise_zoo, planet, scaled, values, zoo};
use crate::{
    BATCH, Graph, Interval, NodeId, Op, Outlook, Points, Program, Prospect, Region, Scratch, Sides,
    SimdLevel, Surroundings,
};

/// Pairs of places in a region: near and far, with the footprints of a camera at `eye`.
struct Pairs {
    eye: [f64; 3],
    columns: [[Vec<f64>; 5]; 2],
    around: Surroundings,
}

const PIXEL_ANGLE: f64 = 2e-3;

fn inside(region: Region, p: [f64; 3]) -> bool {
    let length = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    match region {
        Region::All => true,
        Region::Shell { inner, outer } => (inner..=outer).contains(&length),
        Region::Slab { low, high } => (low..=high).contains(&p[2]),
        Region::Box { min, max } => (0..3).all(|i| (min[i]..=max[i]).contains(&p[i])),
    }
}

/// How wide a pixel is at a place.
fn footprint(eye: [f64; 3], place: [f64; 3]) -> f64 {
    let away = [0, 1, 2].map(|k| place[k] - eye[k]);
    PIXEL_ANGLE * (away[0] * away[0] + away[1] * away[1] + away[2] * away[2]).sqrt()
}

impl Pairs {
    /// `place` draws a place of the region from three numbers in [−1, 1].
    fn new(
        region: Region,
        eye: [f64; 3],
        reach: f64,
        pairs: u32,
        place: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Self {
        let mut columns: [[Vec<f64>; 5]; 2] = Default::default();
        let mut footprints = Interval::point(0.0);
        for i in 0..pairs {
            let number = |k: u32| 2.0 * unit(hash(&[99, i, k])) - 1.0;
            let p = place([number(0), number(1), number(2)]);
            let distance = reach * libm::exp2(-15.0 + 15.0 * number(3));
            let q = [0, 1, 2].map(|k| p[k] + distance * number([4, 5, 6][k]));
            let q = if inside(region, q) {
                q
            } else {
                place([number(7), number(8), number(9)])
            };
            let t = number(10).abs();
            for (place, columns) in [p, q].into_iter().zip(&mut columns) {
                assert!(inside(region, place), "{place:?}");
                let footprint = footprint(eye, place);
                let row = [place[0], place[1], place[2], footprint, t];
                for (column, value) in columns.iter_mut().zip(row) {
                    column.push(value);
                }
                footprints = if i == 0 {
                    Interval::point(footprint)
                } else {
                    footprints.hull(Interval::point(footprint))
                };
            }
        }
        let around = Surroundings {
            region,
            footprint: footprints,
            time: Interval::new(0.0, 1.0),
            footprint_slope: PIXEL_ANGLE,
        };
        Self {
            eye,
            columns,
            around,
        }
    }

    fn points(&self, end: usize) -> Points<'_> {
        let [x, y, z, footprint, time] = self.columns[end].each_ref().map(Vec::as_slice);
        Points {
            x,
            y,
            z,
            footprint,
            time,
        }
    }

    /// Checks every pair against the range and against every level; gives the least slack seen at the first.
    fn check(&self, name: &str, program: &Program) -> f64 {
        let level = SimdLevel::best();
        let (f, g) = (
            values(program, level, &self.points(0)),
            values(program, level, &self.points(1)),
        );
        let range = program.range(&self.around)[0];
        let modulus = program.modulus(&self.around);
        assert!(modulus.levels.len() <= crate::modulus::LEVELS_MAX);
        for pair in modulus.levels.windows(2) {
            assert!(
                pair[0].offset < pair[1].offset && pair[0].slope > pair[1].slope,
                "{name}: {modulus:?}"
            );
        }
        let mut steepest = 0.0f64;
        for i in 0..f.len() {
            let part = |k: usize| self.columns[0][k][i] - self.columns[1][k][i];
            let distance = (part(0) * part(0) + part(1) * part(1) + part(2) * part(2)).sqrt();
            let change = (f[i] - g[i]).abs();
            assert!(
                range.contains(f[i]) && range.contains(g[i]),
                "{name}: {} {} outside {range:?}",
                f[i],
                g[i]
            );
            for level in &modulus.levels {
                let most = level.offset + level.slope * distance;
                assert!(
                    change <= most,
                    "{name}: {change} over {distance} is above {level:?}"
                );
            }
            steepest = steepest.max(
                (change - modulus.levels.first().map_or(0.0, |level| level.offset)) / distance,
            );
        }
        self.check_cuts(name, program, &f);
        self.check_taylor(name, program, &f, &g);
        self.check_ahead(name, program, &f);
        steepest / modulus.lipschitz()
    }

    /// Checks the tangent bound from the first place of every pair to the second.
    fn check_taylor(&self, name: &str, program: &Program, f: &[f64], g: &[f64]) {
        let Some(taylor) = program.taylor(&self.around) else {
            return;
        };
        let n = f.len();
        let part = |end: usize, k: usize, i: usize| self.columns[end][k][i];
        let way = |i: usize| [0, 1, 2].map(|k| part(1, k, i) - part(0, k, i));
        let distance = |i: usize| {
            let [x, y, z] = way(i);
            (x * x + y * y + z * z).sqrt()
        };
        let direction = [0, 1, 2].map(|k| {
            (0..n)
                .map(|i| way(i)[k] / distance(i).max(1e-300))
                .collect::<Vec<_>>()
        });
        let [dx, dy, dz] = &direction;
        let (mut value, mut slope) = (vec![0.0; n], vec![0.0; n]);
        program.evaluate_along(
            SimdLevel::best(),
            &self.points(0),
            [dx, dy, dz],
            &mut Scratch::new(),
            [&mut value, &mut slope],
        );
        assert!(
            f.iter()
                .zip(&value)
                .all(|(f, v)| f.to_bits() == v.to_bits())
        );
        for i in 0..n {
            let s = distance(i);
            let within = (1..16).all(|step| {
                let share = f64::from(step) / 16.0;
                inside(
                    self.around.region,
                    [0, 1, 2].map(|k| part(0, k, i) + share * way(i)[k]),
                )
            });
            let least = value[i] + (slope[i] - taylor.slope) * s
                - taylor.offset
                - 0.5 * taylor.curvature * s * s;
            assert!(
                !within || taylor.curvature.is_infinite() || g[i] >= least,
                "{name}: {} after {s} is below {least}: {} {} {taylor:?}",
                g[i],
                value[i],
                slope[i]
            );
        }
    }
}

/// What is asked about stretches: from where, along which directions, how far, and above which values.
struct Asked<'a> {
    points: Points<'a>,
    direction: [&'a [f64]; 3],
    guess: &'a [f64],
    bend: &'a [f64],
    limit: &'a [f64],
    offset: &'a [f64],
    slope: &'a [f64],
    sides: Sides,
}

impl Pairs {
    /// Leaves noises out of the program: it gives no value farther from the whole one's than it says, at any level.
    fn check_cuts(&self, name: &str, program: &Program, f: &[f64]) {
        for share in [0.75, 0.5, 0.25, 0.0] {
            let Some(cut) = program.cut(share, &self.around) else {
                continue;
            };
            let coarse = program.coarse(&cut).unwrap();
            let [left, all] =
                [&coarse, program].map(|program| program.noise_evaluations(0.0) as f64);
            // Gradients of noises are never left out.
            assert!(
                left <= share * all || name.starts_with("gradient of"),
                "{name}"
            );
            let moved = program.moved_by(&cut, &self.around);
            for level in [SimdLevel::scalar(), SimdLevel::best()] {
                let c = values(&coarse, level, &self.points(0));
                for (f, c) in f.iter().zip(&c).filter(|(f, _)| f.is_finite()) {
                    assert!(
                        (f - c).abs() <= moved,
                        "{name}, {share}: {f} and {c} are farther apart than {moved}"
                    );
                }
            }
        }
    }
}

/// How far ahead the program is above what is asked, and how far behind, batch by batch.
fn clear(program: &Program, level: SimdLevel, asked: &Asked<'_>) -> [Vec<f64>; 2] {
    let mut ahead = vec![f64::NAN; asked.guess.len()];
    let mut behind = ahead.clone();
    let mut scratch = Scratch::new();
    let Points {
        x,
        y,
        z,
        footprint,
        time,
    } = asked.points;
    for start in (0..ahead.len()).step_by(BATCH) {
        let batch = start..(start + BATCH).min(ahead.len());
        let n = batch.len();
        let part = |all: &'_ [f64]| all[batch.clone()].to_vec();
        let [x, y, z, footprint, time] = [x, y, z, footprint, time].map(part);
        let [dx, dy, dz] = asked.direction.map(part);
        let [offset, slope, limit] = [asked.offset, asked.slope, asked.limit].map(part);
        let (most, mut bend) = (part(asked.guess), part(asked.bend));
        let least = vec![1e-9; n];
        let points = Points {
            x: &x,
            y: &y,
            z: &z,
            footprint: &footprint,
            time: &time,
        };
        let outlook = Outlook {
            offset: &offset,
            slope: &slope,
            limit: &limit,
            least: &least,
            most: &most,
            footprint_slope: PIXEL_ANGLE,
            sides: asked.sides,
        };
        let (mut value, mut along) = (vec![0.0; n], vec![0.0; n]);
        let (ahead, behind) = (&mut ahead[batch.clone()], &mut behind[batch]);
        if program.walks() {
            let (offset, limit) = (&offset[..], &limit[..]);
            let prospect = Prospect { offset, limit };
            program.walk(
                level,
                &points,
                [&dx, &dy, &dz],
                prospect,
                &mut scratch,
                ahead,
            );
            behind.fill(0.0);
            continue;
        }
        let out = [&mut value[..], &mut along, ahead, behind, &mut bend];
        program.evaluate_ahead(level, &points, [&dx, &dy, &dz], outlook, &mut scratch, out);
    }
    [ahead, behind]
}

impl Pairs {
    /// Checks stretches ahead of the first place of every pair, towards the second, and behind it: nowhere on them may the
    /// field fall below the value that they are asked about.
    fn check_ahead(&self, name: &str, program: &Program, f: &[f64]) {
        for sides in [Sides::Ahead, Sides::Both] {
            self.check_sides(name, program, f, sides);
        }
    }

    fn check_sides(&self, name: &str, program: &Program, f: &[f64], sides: Sides) {
        let Some(taylor) = program.taylor(&self.around) else {
            return;
        };
        if !program.looks_ahead() && !program.walks() {
            return;
        }
        let n = f.len().min(4_000);
        let at = |i: usize, s: f64, direction: &[Vec<f64>; 3]| {
            [0, 1, 2].map(|k| self.columns[0][k][i] + s * direction[k][i])
        };
        let way = |i: usize| [0, 1, 2].map(|k| self.columns[1][k][i] - self.columns[0][k][i]);
        let distance = |i: usize| way(i).iter().map(|part| part * part).sum::<f64>().sqrt();
        let direction = [0, 1, 2].map(|k| {
            let part = |i: usize| way(i)[k] / distance(i).max(1e-300);
            (0..n).map(part).collect::<Vec<_>>()
        });
        let number = |i: usize, k: u32| unit(hash(&[7, u32::try_from(i).unwrap(), k]));
        let each = |of: &dyn Fn(usize) -> f64| (0..n).map(of).collect::<Vec<_>>();
        let guess = each(&|i| distance(i) * libm::exp2(6.0 * number(i, 0) - 3.0));
        // Of every second stretch the length is guessed.
        let bend = each(&|i| (i % 2) as f64 * libm::exp2(20.0 * number(i, 3) - 10.0));
        let limit = each(&|i| guess[i] * libm::exp2(4.0 * number(i, 2)));
        let floor = each(&|i| f[i] - libm::exp2(20.0 * number(i, 1) - 16.0));
        let offset = each(&|i| taylor.offset + floor[i]);
        let [dx, dy, dz] = &direction;
        let [x, y, z, footprints, time] = &self.columns[0];
        let asked = Asked {
            points: Points {
                x: &x[..n],
                y: &y[..n],
                z: &z[..n],
                footprint: &footprints[..n],
                time: &time[..n],
            },
            direction: [dx, dy, dz],
            guess: &guess,
            bend: &bend,
            limit: &limit,
            offset: &offset,
            slope: &vec![taylor.slope; n],
            sides,
        };
        let [ahead, behind] = clear(program, SimdLevel::best(), &asked);
        for level in SimdLevel::all_available() {
            let bits = |all: &[f64]| all.iter().map(|a| a.to_bits()).collect::<Vec<_>>();
            let [forth, back] = clear(program, level, &asked);
            let same = bits(&forth) == bits(&ahead) && bits(&back) == bits(&behind);
            assert!(same, "{name} at {level}");
        }
        if sides == Sides::Ahead {
            assert!(behind.iter().all(|back| *back == 0.0), "{name}");
        }
        for (seen, sign) in [(&ahead, 1.0), (&behind, -1.0)] {
            let mut outside = vec![false; n];
            for step in 1..=16 {
                let mut columns: [Vec<f64>; 5] = Default::default();
                for i in 0..n {
                    let place = at(i, sign * seen[i] * f64::from(step) / 16.0, &direction);
                    outside[i] |= !inside(self.around.region, place);
                    let row = [
                        place[0],
                        place[1],
                        place[2],
                        footprint(self.eye, place),
                        time[i],
                    ];
                    for (column, value) in columns.iter_mut().zip(row) {
                        column.push(value);
                    }
                }
                let [x, y, z, footprint, time] = &columns;
                let points = Points {
                    x,
                    y,
                    z,
                    footprint,
                    time,
                };
                let there = values(program, SimdLevel::best(), &points);
                for i in 0..n {
                    assert!(
                        outside[i] || seen[i] == 0.0 || there[i] > floor[i],
                        "{name}: {} is below {} after {} of {}",
                        there[i],
                        floor[i],
                        sign * f64::from(step) / 16.0,
                        seen[i]
                    );
                }
            }
        }
        // Values that are finite and asked about something below them see some way.
        let seen = ahead.iter().filter(|a| **a > 0.0).count();
        assert!(
            2 * seen > n || taylor.offset > 1e-4,
            "{name}: {seen} of {n}"
        );
    }
}

fn program(build: impl Fn(&mut Graph) -> NodeId) -> Program {
    let mut graph = Graph::new();
    let root = build(&mut graph);
    Program::compile(&graph, &[root], Interval::new(0.0, 1.0)).unwrap()
}

#[test]
fn no_pair_in_a_box_breaks_a_bound() {
    let region = Region::Box {
        min: [-3.0, -2.0, 0.25],
        max: [3.0, 1.0, 2.5],
    };
    let pairs = Pairs::new(region, [0.5, 0.5, 6.0], 3.0, 20_000, |[x, y, z]| {
        [3.0 * x, 1.5 * y - 0.5, 1.375 + 1.125 * z]
    });
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        pairs.check(&name, &program);
    }
}

#[test]
fn no_pair_in_a_shell_breaks_a_bound() {
    let region = Region::Shell {
        inner: 0.5,
        outer: 2.0,
    };
    let pairs = Pairs::new(region, [1.2, 0.0, 0.3], 2.0, 20_000, |[x, y, z]| {
        let length = (x * x + y * y + z * z).sqrt().max(1e-9);
        let radius = 0.5001 + 1.4998 * (x * 1e3).rem_euclid(1.0);
        [x, y, z].map(|part| part / length * radius)
    });
    for (name, program) in zoo().into_iter().chain(noise_zoo()) {
        pairs.check(&name, &program);
    }
}

#[test]
fn no_pair_on_a_planet_breaks_a_bound() {
    const R: f64 = 6_371_000.0;
    let region = Region::Shell {
        inner: R - 20.0,
        outer: R + 50.0,
    };
    let eye = [R + 25.0, 0.0, 0.0];
    let pairs = Pairs::new(region, eye, 30.0, 100_000, |[x, y, z]| {
        let p = [R, 2e3 * y * y * y, 2e3 * z * z * z];
        let length = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        p.map(|part| part / length * (R + 15.0 + 34.0 * x))
    });
    for cell in [1000.0, 30.0, 3.0] {
        let program = program(|g| planet(g, cell));
        let share = pairs.check(&format!("planet of cells of {cell} m"), &program);
        assert!(
            share > 0.02,
            "the bound is {} times what was seen",
            1.0 / share
        );
        let rounding = program.modulus(&pairs.around).levels[0].offset;
        assert!(rounding < 1e-3, "rounding moves the ground by {rounding} m");
    }
}

#[test]
fn the_bound_of_the_spheres_is_the_derived_one() {
    // 1 + 0.3·4·3.75 + 0.15·8·3.75 + 0.05·16·3.75 = 13: thesis eq. (5.12) with the constant that is one.
    let program = program(fig_5_6);
    let around = Surroundings {
        region: Region::Shell {
            inner: 0.3,
            outer: 1.7,
        },
        footprint: Interval::new(0.0, 1.0),
        time: Interval::point(0.0),
        footprint_slope: 1e-3,
    };
    let modulus = program.modulus(&around);
    assert!((modulus.lipschitz() - 13.0).abs() < 1e-6);
    assert!(modulus.levels[0].offset < 1e-5);
    // 1/0.3 · the distance bends up only; (0.3·16 + 0.15·64 + 0.05·256) · 14.48 = 393.9.
    let taylor = program.taylor(&around).unwrap();
    assert!((taylor.curvature - 393.856).abs() < 1e-3, "{taylor:?}");
    assert!(taylor.slope < 2e-3 && taylor.offset < 2e-5, "{taylor:?}");
    // Far away only the distance itself counts as slope: the noises are at most 1.037.
    let far = modulus.levels[modulus.levels.len() - 2];
    assert!(
        (far.slope - 1.0).abs() < 1e-6 && (far.offset - 2.0 * 0.5 * 1.037).abs() < 1e-5,
        "{far:?}"
    );
    assert!(modulus.levels.len() >= 4);
    let range = program.range(&around)[0];
    assert!(
        range.low > -1.219 && range.low < -1.218 && range.high > 1.218 && range.high < 1.219,
        "{range:?}"
    );
}

#[test]
fn scaled_noise_knows_no_diagonal() {
    let program = program(|g| {
        let p = scaled(g, 4.0);
        g.push(Op::Noise, &[p], &[1.0]).unwrap()
    });
    let around = Surroundings {
        region: Region::Slab {
            low: -1.0,
            high: 1.0,
        },
        footprint: Interval::point(0.0),
        time: Interval::point(0.0),
        footprint_slope: 0.0,
    };
    assert!((program.modulus(&around).lipschitz() - 15.0).abs() < 1e-9);
}

#[test]
fn a_field_without_a_bound_says_so() {
    let program = program(|g| {
        let p = g.push(Op::Position, &[], &[]).unwrap();
        let x = g.push(Op::X, &[p], &[]).unwrap();
        let one = g.constant(1.0).unwrap();
        g.push(Op::Div, &[one, x], &[]).unwrap()
    });
    let around = Surroundings {
        region: Region::All,
        footprint: Interval::point(0.0),
        time: Interval::point(0.0),
        footprint_slope: 0.0,
    };
    assert_eq!(program.range(&around), [Interval::ALL]);
    assert_eq!(program.modulus(&around).clear_radius(1e9), 0.0);
}
