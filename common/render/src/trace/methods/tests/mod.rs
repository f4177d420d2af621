//! No method misses a root: each against [`reference`], along random rays.
//!
//! No ray is left out. Where the field is within the rounding of its noises of 0 ([`Part::Rough`]), a method may see a root
//! or none; everywhere else it must see what is there.

pub(crate) mod reference;
pub(crate) mod surfaces;

use std::sync::Mutex;

use field::Interval;
use field::hash::{hash, unit};

use self::reference::{Part, Truth, truth};
use self::surfaces::{Surface, surfaces};
use super::{
    Along, FieldAlong, Hit, Method, Mitchell, Optimised, Speculative, SphereTracing, Subdivision,
    Tally, Wanted,
};

const EPSILON: f64 = 1e-6;

fn methods(surface: &Surface) -> Vec<Box<dyn Method>> {
    let (epsilon, hit) = (EPSILON, Hit::Crossing);
    let mut all: Vec<Box<dyn Method>> = vec![
        Box::new(Optimised { epsilon, hit }),
        Box::new(Subdivision::reduced(epsilon, hit)),
        Box::new(Subdivision::interval(epsilon, hit)),
        Box::new(Mitchell { epsilon, hit }),
        Box::new(Subdivision::affine(epsilon, hit)),
    ];
    if let Some(lipschitz) = surface.lipschitz {
        all.push(Box::new(SphereTracing {
            lipschitz,
            epsilon,
            hit,
        }));
        all.push(Box::new(Speculative {
            lipschitz,
            overshoot: 1.46,
            epsilon,
            hit,
        }));
    }
    all
}

/// A ray at the middle of things.
fn ray(surface: &Surface, i: u32) -> FieldAlong<'_> {
    let part = |k: u32| 2.0 * unit(hash(&[i, k, 61])) - 1.0;
    let normed = |v: [f64; 3]| {
        let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt() + 1e-9;
        v.map(|x| x / length)
    };
    let origin = normed([part(0), part(1), part(2)]).map(|x| 2.5 * x);
    let target = [part(3), part(4), part(5)];
    let direction = normed([0, 1, 2].map(|k| target[k] - origin[k]));
    FieldAlong {
        program: &surface.program,
        origin,
        direction,
        time: 0.0,
    }
}

const SPAN: Interval = Interval::new(0.25, 4.75);

/// What was compared.
#[derive(Default, Debug)]
struct Seen {
    rays: u32,
    roots: usize,
    /// Rays along which the exact field's roots cannot be told to 10⁻⁹, as far as they were looked at.
    undecided: Vec<u32>,
    /// Rays along which the field comes within its rounding of 0 before its first certain root.
    rough: Vec<u32>,
    /// Searches for the first root, and for all.
    searches: [u64; 2],
}

impl Seen {
    fn add(&mut self, other: Self) {
        self.rays += other.rays;
        self.roots += other.roots;
        self.undecided.extend(other.undecided);
        self.rough.extend(other.rough);
        for (mine, theirs) in self.searches.iter_mut().zip(other.searches) {
            *mine += theirs;
        }
    }
}

/// Whether a method's root is one with a bracket: it is the near end of an interval shorter than ε.
fn near(root: f64, t: Interval) -> bool {
    root > t.low - 2.0 * EPSILON && root < t.high + 2.0 * EPSILON
}

/// What is known of a ray, and what methods are held against it.
struct Compared<'a> {
    surface: &'a Surface,
    number: u32,
    along: FieldAlong<'a>,
    truth: Truth,
}

impl<'a> Compared<'a> {
    fn new(surface: &'a Surface, number: u32, wanted: Wanted, seen: &mut Seen) -> Self {
        let along = ray(surface, number);
        let truth = truth(&along, SPAN, surface.finest, wanted);
        seen.rays += 1;
        seen.roots += truth.roots().count();
        if truth.exact.is_none() {
            seen.undecided.push(number);
        }
        if let Some(Part::Rough(_)) = truth.parts.first() {
            seen.rough.push(number);
        }
        Self {
            surface,
            number,
            along,
            truth,
        }
    }

    fn told(&self, method: &dyn Method) -> String {
        let Self {
            surface, number, ..
        } = self;
        format!("{}: {} along ray {number}", surface.name, method.name())
    }

    /// The first root that a method finds.
    fn first(&self, method: &dyn Method, seen: &mut Seen) {
        let mut tally = Tally::default();
        let first = method.first(&self.along, SPAN, &mut tally);
        let told = || format!("{}: {first:?} for {:?}", self.told(method), self.truth);
        seen.searches[0] += 1;
        assert_eq!(tally.abandoned, 0, "{}", told());
        if self.truth.begins {
            assert_eq!(first, Some(SPAN.low), "{}", told());
            return;
        }
        let Some(root) = first else {
            assert!(self.truth.roots().next().is_none(), "{}", told());
            return;
        };
        // The first certain root, or a rough part before it.
        let mut before = true;
        let is_it = self.truth.parts.iter().any(|part| match part {
            Part::Rough(t) => before && near(root, *t),
            Part::Root(t) => std::mem::take(&mut before) && near(root, *t),
        });
        assert!(is_it, "{}", told());
    }

    /// All roots that a method finds.
    fn all(&self, method: &dyn Method, seen: &mut Seen) {
        let mut tally = Tally::default();
        let roots = method.search(&self.along, SPAN, Wanted::All, &mut tally);
        let told = || format!("{}: {roots:?} for {:?}", self.told(method), self.truth);
        seen.searches[1] += 1;
        assert_eq!(tally.abandoned, 0, "{}", told());
        let roots = &roots[usize::from(self.truth.begins)..];
        for root in roots {
            let known = self.truth.parts.iter().any(|part| match part {
                Part::Rough(t) | Part::Root(t) => near(*root, *t),
            });
            assert!(known, "{}", told());
        }
        for bracket in self.truth.roots() {
            // Two roots closer than ε are one to a method, or none.
            let close = |part: &Part| match part {
                Part::Rough(t) | Part::Root(t) => {
                    *t != bracket
                        && t.low - bracket.high < 4.0 * EPSILON
                        && bracket.low - t.high < 4.0 * EPSILON
                }
            };
            let alone = !self.truth.parts.iter().any(close);
            let found = roots.iter().filter(|root| near(**root, bracket)).count();
            assert!(!alone || found == 1, "{}", told());
        }
    }
}

#[test]
fn no_method_misses_a_root() {
    for surface in surfaces() {
        let methods = methods(&surface);
        let mut seen = Seen::default();
        for i in 0..240 {
            let compared = Compared::new(&surface, i, Wanted::All, &mut seen);
            for (k, method) in (0..).zip(&methods) {
                // Every eighth ray meets all methods, each other ray one of them.
                if i % 8 == 0 || i % 7 == k {
                    compared.first(method.as_ref(), &mut seen);
                    compared.all(method.as_ref(), &mut seen);
                }
            }
        }
        assert!(seen.roots > 103, "{}: {seen:?}", surface.name);
        assert!(seen.rough.len() < 20, "{}: {seen:?}", surface.name);
        assert!(seen.undecided.is_empty(), "{}: {seen:?}", surface.name);
    }
}

#[test]
fn a_slope_that_is_no_bound_is_found_out() {
    let surface = surfaces().remove(0);
    let wrong: [Box<dyn Method>; 1] = [Box::new(SphereTracing {
        lipschitz: 0.5,
        epsilon: EPSILON,
        hit: Hit::Crossing,
    })];
    let found = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        for i in 0..200 {
            let mut seen = Seen::default();
            Compared::new(&surface, i, Wanted::All, &mut seen).first(wrong[0].as_ref(), &mut seen);
        }
    }));
    assert!(found.is_err(), "the comparison sees no miss");
}

#[test]
fn a_search_without_end_is_given_up() {
    /// A field that is zero all along the ray, by any range.
    struct Flat;
    impl Along for Flat {
        fn value(&self, _: f64) -> f64 {
            1e-300
        }
        fn interval(&self, _: Interval) -> Interval {
            Interval::new(-1.0, 1.0)
        }
        fn slope(&self, t: Interval) -> field::Slope<1> {
            field::Slope {
                value: self.interval(t),
                slopes: [Interval::ALL],
            }
        }
        fn affine(&self, _: Interval) -> field::Reduced<1> {
            field::Reduced {
                centre: 0.0,
                along: [0.0],
                error: 1.0,
            }
        }
        fn reduced(&self, t: Interval) -> field::Reduced<1> {
            self.affine(t)
        }
    }
    let (epsilon, hit) = (1e-12, Hit::Crossing);
    let method = Optimised { epsilon, hit };
    let mut tally = Tally::default();
    assert_eq!(method.first(&Flat, SPAN, &mut tally), None);
    assert_eq!(tally.abandoned, 1);
    assert!(tally.evaluations() < super::EVALUATIONS_MAX + 10);
}

/// Of so many rays one is asked for all of its roots by every method, standard affine arithmetic excepted.
const ALL: u32 = 16;

/// Standard affine arithmetic takes as long as all others together: it meets one ray of so many.
const AFFINE: u32 = 16;

/// Rays that one thread takes at a time.
const TOGETHER: u32 = 500;

/// 100,000 rays at one surface, each by every method, on two threads.
fn many(which: usize) {
    const RAYS: u32 = 100_000;
    let surface = &surfaces()[which];
    let methods = methods_by_name(surface);
    let (next, total) = (Mutex::new(0), Mutex::new(Seen::default()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                let mut seen = Seen::default();
                loop {
                    let begin = {
                        let mut next = next.lock().unwrap();
                        *next += TOGETHER;
                        *next - TOGETHER
                    };
                    if begin >= RAYS {
                        break;
                    }
                    for i in begin..begin + TOGETHER {
                        one(surface, i, &mut seen);
                    }
                }
                total.lock().unwrap().add(seen);
            });
        }
    });
    let mut seen = total.into_inner().unwrap();
    seen.undecided.sort_unstable();
    seen.rough.sort_unstable();
    println!(
        "{}: {methods:?}\n{} rays, {} roots; {} searches for the first, {} for all",
        surface.name, seen.rays, seen.roots, seen.searches[0], seen.searches[1]
    );
    println!(
        "{} rays not decided to 1e-9: {:?}",
        seen.undecided.len(),
        seen.undecided
    );
    println!(
        "{} rays that touch within f32 rounding before their first root: {:?}",
        seen.rough.len(),
        seen.rough
    );
    assert_eq!(seen.rays, RAYS);
    assert!(seen.undecided.len() < 50, "{}", surface.name);
    assert!(seen.rough.len() < 2_000, "{}", surface.name);
}

/// One ray of many.
fn one(surface: &Surface, i: u32, seen: &mut Seen) {
    let wanted = if i.is_multiple_of(ALL) {
        Wanted::All
    } else {
        Wanted::First
    };
    let compared = Compared::new(surface, 1_000 + i, wanted, seen);
    for method in methods(surface) {
        let affine = method.name() == "standard AA";
        if !affine || i.is_multiple_of(AFFINE) {
            compared.first(method.as_ref(), seen);
        }
        if i.is_multiple_of(ALL) && (!affine || i.is_multiple_of(ALL * AFFINE)) {
            compared.all(method.as_ref(), seen);
        }
    }
}

/// What methods a surface meets.
fn methods_by_name(surface: &Surface) -> Vec<&'static str> {
    methods(surface)
        .iter()
        .map(|method| method.name())
        .collect()
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_5_11() {
    many(0);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_5_29() {
    many(1);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_fbm() {
    many(2);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_ridges() {
    many(3);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_balls() {
    many(4);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_waves() {
    many(5);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_sparse_convolution() {
    many(6);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_cells() {
    many(7);
}

#[test]
#[ignore = "long: tests/run --all"]
fn no_miss_in_100_000_rays_at_a_quartic() {
    many(8);
}
