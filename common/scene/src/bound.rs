//! Where a surface can be, found from its field by range estimates.
//!
//! A shell or slab is shrunk as long as the field is proven positive outside of
//! it, and negative inside where the surface is a terrain.

use field::{Interval, Op, Program, Region, Surroundings};

use crate::description::{Bound, Description, Seed};
use crate::rules::{LENGTH_MAX, Problem};
use crate::show;

/// A bound is found to this part of its thickness.
const PRECISION: f64 = 1.0 / 256.0;

/// Farthest from its seed that a surface may be: where the world ends, everything has some bound.
const FAR: f64 = LENGTH_MAX / 16.0;

/// The instants at which a scene can be seen.
pub(crate) fn time_of(scene: &Description) -> Interval {
    let film = &scene.film;
    Interval::new(0.0, f64::from(film.images) / film.fps + film.shutter)
}

/// The least bound that can be proven; its problem if there is none.
pub(crate) fn derive(scene: &Description) -> Result<Bound, Problem> {
    let prover = Prover::new(scene)?;
    let found = match scene.surface.seed {
        Seed::Sphere { radius } => prover.shell(radius),
        Seed::Plane => prover.slab().or_else(|| prover.shell(0.0)),
    };
    found.ok_or_else(|| Problem {
        key: "surface.field".into(),
        message: match prover.unbounded_term() {
            Some(term) => format!("the surface has no end: nothing bounds `{term}` far away"),
            None => "the surface may have no end: the field is not proven positive far away".into(),
        },
        help: Some(
            "let the field grow with distance, as `seed` does, or give a bound: \
             [surface.bound] shell = [inner, outer], slab = [low, high] or box = { min, max }"
                .into(),
        ),
    })
}

struct Prover<'a> {
    scene: &'a Description,
    program: Program,
}

impl<'a> Prover<'a> {
    fn new(scene: &'a Description) -> Result<Self, Problem> {
        let surface = &scene.surface;
        let program = Program::compile(&surface.graph, &[surface.field], time_of(scene));
        match program {
            Ok(program) => Ok(Self { scene, program }),
            Err(error) => Err(Problem {
                key: "surface.field".into(),
                message: error.to_string(),
                help: None,
            }),
        }
    }

    fn range(&self, region: Region) -> Interval {
        let ranges = self.program.range(&around(self.scene, region));
        ranges.first().copied().unwrap_or(Interval::ALL)
    }

    fn positive(&self, region: Region) -> bool {
        self.range(region).low > 0.0
    }

    fn negative(&self, region: Region) -> bool {
        self.range(region).high < 0.0
    }

    /// The shell around a sphere of that radius (0: around anything about the origin).
    fn shell(&self, radius: f64) -> Option<Bound> {
        let empty = |r: f64| {
            self.positive(Region::Shell {
                inner: r,
                outer: f64::INFINITY,
            })
        };
        let solid = |r: f64| {
            self.negative(Region::Shell {
                inner: 0.0,
                outer: r,
            })
        };
        let outer = radius + first(|d| empty(radius + d))?;
        let depth = first(|d| d < radius && solid(radius - d));
        let inner = depth.map_or(0.0, |depth| radius - depth);
        let outer = last(inner, outer, |r| !empty(r)).1;
        let inner = if inner > 0.0 {
            last(inner, outer, solid).0
        } else {
            0.0
        };
        Some(Bound::Shell { inner, outer })
    }

    /// The slab around a terrain on the plane.
    fn slab(&self) -> Option<Bound> {
        let empty = |z: f64| {
            self.positive(Region::Slab {
                low: z,
                high: f64::INFINITY,
            })
        };
        let solid = |z: f64| {
            self.negative(Region::Slab {
                low: f64::NEG_INFINITY,
                high: z,
            })
        };
        let high = first(empty)?;
        let low = -first(|d| solid(-d))?;
        let high = last(low, high, |z| !empty(z)).1;
        let low = last(low, high, solid).0;
        Some(Bound::Slab { low, high })
    }

    /// A summand of the field that nothing bounds far from the origin.
    fn unbounded_term(&self) -> Option<String> {
        let surface = &self.scene.surface;
        let nodes = surface.graph.nodes();
        let mut terms = vec![(surface.field, false)];
        let mut summands = Vec::new();
        while let Some((id, negated)) = terms.pop() {
            let node = &nodes[id.index()];
            match node.op {
                Op::Add => terms.extend(node.args.iter().rev().map(|arg| (*arg, negated))),
                Op::Sub => terms.extend([(node.args[1], !negated), (node.args[0], negated)]),
                Op::Neg => terms.push((node.args[0], !negated)),
                _ => summands.push((id, negated)),
            }
            if summands.len() + terms.len() > 64 {
                return None;
            }
        }
        let far = match surface.seed {
            Seed::Sphere { .. } => Region::Shell {
                inner: LENGTH_MAX / 2.0,
                outer: f64::INFINITY,
            },
            Seed::Plane => Region::Slab {
                low: LENGTH_MAX / 2.0,
                high: f64::INFINITY,
            },
        };
        summands.into_iter().find_map(|(id, negated)| {
            let program = Program::compile(&surface.graph, &[id], time_of(self.scene)).ok()?;
            let range = *program.range(&around(self.scene, far)).first()?;
            let least = if negated { -range.high } else { range.low };
            (least <= -FAR).then(|| show::node(&surface.graph, id, 60))
        })
    }
}

fn around(scene: &Description, region: Region) -> Surroundings {
    Surroundings {
        region,
        footprint: Interval::new(0.0, f64::INFINITY),
        time: time_of(scene),
        footprint_slope: 0.0,
    }
}

/// A distance for which `holds`, if there is one up to [`FAR`]; it doubles from a millimetre on.
fn first(holds: impl Fn(f64) -> bool) -> Option<f64> {
    let mut distance = 1e-3;
    while distance <= FAR {
        if holds(distance) {
            return Some(distance);
        }
        distance *= 2.0;
    }
    None
}

/// Two numbers close together between `low` and `high`: `holds` up to the first, no more at the second.
///
/// It holds at `low` and not at `high`, or both are given back.
fn last(low: f64, high: f64, holds: impl Fn(f64) -> bool) -> (f64, f64) {
    let precision = PRECISION * (high - low);
    let (mut low, mut high) = (low, high);
    while high - low > precision {
        let middle = low + (high - low) / 2.0;
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Overrides, Source, parse};

    fn bound_of(surface: &str) -> Result<Bound, String> {
        let text = format!(
            "camera.fixed = {{ eye = [0, -900, 50], target = [0, 0, 0] }}\n[surface]\n{surface}"
        );
        let source = Source {
            name: "test".into(),
            text,
        };
        match parse(source, "test", Path::new("."), &Overrides::default()) {
            Ok(loaded) => Ok(loaded.description.surface.bound),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn bounds_are_tight_around_what_is_known() {
        let bound = bound_of("sphere.radius = 100\nfield = \"seed - 8 - 4*noise(base)\"");
        let Ok(Bound::Shell { inner, outer }) = bound else {
            panic!("{bound:?}")
        };
        assert!(
            (103.5..104.0).contains(&inner) && (112.0..112.6).contains(&outer),
            "{bound:?}"
        );
        let bound = bound_of("plane = {}\nfield = \"p.z - 10 - 2*sin(p.x)\"");
        let Ok(Bound::Slab { low, high }) = bound else {
            panic!("{bound:?}")
        };
        assert!(
            (7.5..8.0).contains(&low) && (12.0..12.5).contains(&high),
            "{bound:?}"
        );
    }

    #[test]
    fn things_without_a_ground_get_a_shell() {
        let bound = bound_of("plane = {}\nfield = \"length(p) - 3\"");
        let Ok(Bound::Shell { inner, outer }) = bound else {
            panic!("{bound:?}")
        };
        assert!(inner == 0.0 && (3.0..3.1).contains(&outer), "{bound:?}");
    }

    #[test]
    fn what_has_no_end_is_named() {
        for (surface, term) in [
            (
                "plane = {}\nfield = \"p.x - noise(p)\"",
                "nothing bounds `p.x`",
            ),
            (
                "sphere.radius = 1\nfield = \"seed + 3*p.z\"",
                "nothing bounds `(3*p.z)`",
            ),
            (
                "sphere.radius = 1\nfield = \"noise(p)\"",
                "not proven positive far away",
            ),
        ] {
            let error = bound_of(surface).unwrap_err();
            assert!(error.contains(term), "{surface}: {error}");
        }
    }
}
