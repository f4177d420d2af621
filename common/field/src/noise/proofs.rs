//! The constants of the noises, proven: a bound that holds over every box of a subdivision holds everywhere.

use super::disc::Tile;
use super::gradient::Lattice;
use super::node::NEAR;
use super::sparse::Kernel;
use super::{lattice, simplex};

/// Whether `bound`, which takes a place and a distance around it, is at most `limit` over a cube.
fn holds(bound: &dyn Fn([f64; 3], f64) -> f64, centre: [f64; 3], half: f64, limit: f64) -> bool {
    const HALF_MIN: f64 = 1.0 / 4096.0;
    if bound(centre, half * 1.732_051) <= limit {
        return true;
    }
    if half < HALF_MIN {
        return false;
    }
    (0..8).all(|corner| {
        let part =
            [0, 1, 2].map(|k| centre[k] + half * if corner >> k & 1 == 1 { 0.5 } else { -0.5 });
        holds(bound, part, 0.5 * half, limit)
    })
}

/// Over a lattice cell: by symmetry an eighth of it is enough for what treats all corners alike.
fn over_an_eighth(bound: impl Fn([f64; 3], f64) -> f64, limit: f64) {
    assert!(holds(&bound, [0.25; 3], 0.25, limit), "not below {limit}");
    assert!(
        !holds(&bound, [0.25; 3], 0.25, 0.9 * limit),
        "far below {limit}"
    );
}

/// The most of a function that rises to `peak` and falls after it, between two distances.
fn unimodal(f: impl Fn(f64) -> f64, peak: f64, low: f64, high: f64) -> f64 {
    f(if low > peak {
        low
    } else if high < peak {
        high
    } else {
        peak
    })
}

fn height(kernel: Kernel, d: f64) -> f64 {
    let d = d.clamp(0.0, 1.0);
    match kernel {
        Kernel::Lewis => 0.5 + 0.5 * libm::cos(std::f64::consts::PI * d),
        Kernel::Quintic => 1.0 - d * d * d * (10.0 - 15.0 * d + 6.0 * d * d),
        Kernel::Linear => 1.0 - d,
    }
}

fn slope(kernel: Kernel, d: f64) -> f64 {
    if d >= 1.0 {
        return 0.0;
    }
    match kernel {
        Kernel::Lewis => std::f64::consts::FRAC_PI_2 * libm::sin(std::f64::consts::PI * d),
        Kernel::Quintic => 30.0 * (d * (1.0 - d)) * (d * (1.0 - d)),
        Kernel::Linear => 1.0,
    }
}

/// Where a kernel is steepest; the linear one's slope does not fall before the border.
const STEEPEST: f64 = 0.5;

/// The least and the greatest distance from a place to the cell `step` cells away.
fn to_cell(p: [f64; 3], step: [i8; 3]) -> (f64, f64) {
    let (mut near, mut far) = (0.0, 0.0);
    for k in 0..3 {
        let low = f64::from(step[k]) - p[k];
        let gap = low.max(-low - 1.0).max(0.0);
        near += gap * gap;
        let reach = low.abs().max((low + 1.0).abs());
        far += reach * reach;
    }
    (near.sqrt(), far.sqrt())
}

#[test]
fn one_node_in_each_cell_cannot_exceed_the_kernel_sums() {
    for kernel in Kernel::ALL {
        let range = |p, around: f64| {
            let terms = NEAR.map(|step| height(kernel, to_cell(p, step).0 - around));
            terms.iter().sum()
        };
        over_an_eighth(range, kernel.range());
        let steep = |p, around: f64| {
            let terms = NEAR.map(|step| {
                let (near, far) = to_cell(p, step);
                let low = (near - around).max(0.0);
                unimodal(|d| slope(kernel, d), STEEPEST, low, far + around)
            });
            terms.iter().sum()
        };
        over_an_eighth(steep, kernel.slope());
    }
}

/// The node points near a place of the tile.
fn around(p: [f64; 3]) -> Vec<f64> {
    let mut list = Vec::new();
    for step in NEAR {
        let near = [0, 1, 2].map(|k| p[k].floor() + f64::from(step[k]));
        let wrapped = near.map(|x| super::kind::whole(x.rem_euclid(8.0)));
        for node in Tile::shared().at(wrapped) {
            let d = [0, 1, 2].map(|k| near[k] + f64::from(node[k]) - p[k]);
            list.push((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt());
        }
    }
    list
}

#[test]
fn nodes_that_keep_apart_cannot_exceed_the_kernel_sums() {
    for kernel in Kernel::ALL {
        let range = |p, about: f64| {
            let terms = around(p).into_iter().map(|d| height(kernel, d - about));
            terms.sum()
        };
        let steep = |p, about: f64| {
            let terms = around(p).into_iter().map(|d| {
                unimodal(
                    |d| slope(kernel, d),
                    STEEPEST,
                    (d - about).max(0.0),
                    d + about,
                )
            });
            terms.sum()
        };
        let everywhere = |bound: &dyn Fn([f64; 3], f64) -> f64, limit: f64| {
            (0..512).all(|i| {
                let corner = [i % 8, i / 8 % 8, i / 64].map(f64::from);
                (0..64).all(|j| {
                    let part = [j % 4, j / 4 % 4, j / 16].map(f64::from);
                    let centre = [0, 1, 2].map(|k| corner[k] + 0.25 * part[k] + 0.125);
                    holds(bound, centre, 0.125, limit)
                })
            })
        };
        assert!(everywhere(&range, kernel.disc_range()), "{kernel:?}");
        assert!(!everywhere(&range, 0.9 * kernel.disc_range()), "{kernel:?}");
        assert!(everywhere(&steep, kernel.disc_slope()), "{kernel:?}");
        assert!(
            !everywhere(&steep, 0.85 * kernel.disc_slope()),
            "{kernel:?}"
        );
    }
}

#[test]
fn nodes_of_the_tile_keep_apart() {
    let mut count = 0;
    for i in 0..512u32 {
        let cell = [i % 8, i / 8 % 8, i / 64];
        for node in Tile::shared().at(cell) {
            let p = [0, 1, 2].map(|k| f64::from(cell[k]) + f64::from(node[k]));
            let near: Vec<f64> = around(p).into_iter().filter(|d| *d > 1e-9).collect();
            assert!(
                near.iter()
                    .all(|d| *d > f64::from(super::disc::APART) - 1e-6)
            );
            count += 1;
        }
    }
    assert_eq!(count, 512);
    // Another lattice has another part of the tile first.
    let first = |key| -> Vec<_> {
        let row = (0..8).map(|x| Tile::shared().nodes(Lattice::new(key), [x, 0, 0]));
        row.collect()
    };
    assert_ne!(first(1), first(2));
}

/// The two largest components' sum: what the best of twelve gradients makes of a vector.
fn best(mut v: [f64; 3]) -> f64 {
    v.sort_by(f64::total_cmp);
    v[1] + v[2]
}

#[test]
fn simplex_noise_cannot_exceed_its_constants() {
    // The tetrahedron of u ≥ v ≥ w stands for all six.
    const CORNERS: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0; 3]];
    const SCALE: f64 = 76.0;
    let ways = |q: [f64; 3]| {
        CORNERS.map(|corner| {
            let d = [0, 1, 2].map(|k| q[k] - corner[k]);
            let back = (d[0] + d[1] + d[2]) / 6.0;
            let d = d.map(|d| d - back);
            (d, (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt())
        })
    };
    let outside = |q: [f64; 3], about: f64| q[1] - q[0] > 2.0 * about || q[2] - q[1] > 2.0 * about;
    let m = |d: f64| (0.5 - d * d).max(0.0);
    let range = |q: [f64; 3], about: f64| {
        if outside(q, about) {
            return 0.0;
        }
        let terms = ways(q).map(|(d, length)| {
            let m = m((length - about).max(0.0));
            SCALE * m * m * m * m * best(d.map(|d| d.abs() + about))
        });
        terms.iter().sum()
    };
    assert!(holds(&range, [0.5; 3], 0.5, simplex::RANGE));
    assert!(!holds(&range, [0.5; 3], 0.5, 0.98 * simplex::RANGE));
    // m³ max(m, |m − 8d²|) falls, rises again to 1/27 at m = 1/3, and falls.
    let norm = |d: f64| {
        let m = m(d.max(0.0));
        m * m * m * m.max((m - 8.0 * d * d).abs())
    };
    let steep = |q: [f64; 3], about: f64| {
        if outside(q, about) {
            return 0.0;
        }
        let terms = ways(q).map(|(_, d)| {
            let (low, high) = (d - about, d + about);
            let turn = (0.5f64 - 1.0 / 3.0).sqrt();
            let peak = if low < turn && high > turn {
                1.0 / 27.0
            } else {
                0.0
            };
            std::f64::consts::SQRT_2 * SCALE * norm(low).max(norm(high)).max(peak)
        });
        terms.iter().sum()
    };
    assert!(holds(&steep, [0.5; 3], 0.5, simplex::SLOPE));
    assert!(!holds(&steep, [0.5; 3], 0.5, 0.95 * simplex::SLOPE));
    let bent = |q: [f64; 3], about: f64| {
        if outside(q, about) {
            return 0.0;
        }
        let terms = ways(q).map(|(d, length)| {
            let (low, high) = ((length - about).max(0.0), length + about);
            let (most, least) = (m(low), m(high));
            // ∇w and ∇∇w, whose eigenvalues are −8m³ and −8m³ + 48m²d².
            let first = 8.0 * most * most * most * high;
            let along = (48.0 * most * most * high * high - 8.0 * least * least * least).max(0.0);
            let second = (8.0 * most * most * most).max(along);
            let turn = best(d.map(|d| d.abs() + about));
            SCALE * (2.0 * std::f64::consts::SQRT_2 * first + turn * second)
        });
        terms.iter().sum()
    };
    assert!(holds(&bent, [0.5; 3], 0.5, simplex::BEND));
    assert!(!holds(&bent, [0.5; 3], 0.5, 0.9 * simplex::BEND));
}

#[test]
fn lattice_noises_cannot_bend_more() {
    // The profile and its derivatives over a distance along an axis from a corner, as the most they can be.
    let parts = |t: f64, about: f64| {
        let (low, high) = ((t.abs() - about).max(0.0), (t.abs() + about).min(1.0));
        let bend = |a: f64| 60.0 * a * (1.0 - a) * (1.0 - 2.0 * a).abs();
        let steepest = [0.211_324_9, 0.788_675_1]
            .into_iter()
            .any(|a| low < a && a < high);
        let second = bend(low)
            .max(bend(high))
            .max(if steepest { 5.773_51 } else { 0.0 });
        [
            height(Kernel::Quintic, low),
            unimodal(|d| slope(Kernel::Quintic, d), STEEPEST, low, high),
            second,
        ]
    };
    let sums = |p: [f64; 3], about: f64| {
        let about = about / 1.732_05;
        let (mut value, mut gradient) = (0.0, 0.0);
        for corner in 0..8 {
            let d = [0, 1, 2].map(|k| p[k] - f64::from(corner >> k & 1));
            let h = d.map(|t| parts(t, about));
            let (mut first, mut second) = (0.0, 0.0);
            for i in 0..3 {
                let by_one: f64 = (0..3).map(|k| h[k][usize::from(k == i)]).product();
                first += by_one * by_one;
                for j in 0..3 {
                    let order = |k: usize| usize::from(k == i) + usize::from(k == j);
                    let entry: f64 = (0..3).map(|k| h[k][order(k)]).product();
                    second += entry * entry;
                }
            }
            let (first, second) = (first.sqrt(), second.sqrt());
            value += second;
            gradient +=
                2.0 * std::f64::consts::SQRT_2 * first + best(d.map(|d| d.abs() + about)) * second;
        }
        (value, gradient)
    };
    over_an_eighth(|p, about| sums(p, about).0, lattice::VALUE_BEND);
    over_an_eighth(|p, about| sums(p, about).1, lattice::GRADIENT_BEND);
}
