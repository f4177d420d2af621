//! Where a surface can be, found from its field by range estimates.
//!
//! A shell or slab is shrunk as long as the field is proven positive outside of
//! it, and negative inside where the surface is a terrain.

use field::{Interval, Op, Program, Region, Surroundings};

use crate::description::{Bound, Description, Seed};
use crate::rules::{LENGTH_MAX, Problem};
use crate::show;

/// The bound is found to this part of its distance from the seed.
const PRECISION: f64 = 1.0 / 256.0;

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
        let outside = |d: f64| Region::Shell {
            inner: radius + d,
            outer: f64::INFINITY,
        };
        let inside = |d: f64| Region::Shell {
            inner: 0.0,
            outer: radius - d,
        };
        let out = least(scale_of(radius), LENGTH_MAX, |d| self.positive(outside(d)))?;
        let depth = if radius > 0.0 {
            least(scale_of(radius), radius, |d| self.negative(inside(d)))
        } else {
            None
        };
        Some(Bound::Shell {
            inner: depth.map_or(0.0, |depth| radius - depth),
            outer: radius + out,
        })
    }

    /// The slab around a terrain on the plane.
    fn slab(&self) -> Option<Bound> {
        let above = |d: f64| Region::Slab {
            low: d,
            high: f64::INFINITY,
        };
        let below = |d: f64| Region::Slab {
            low: f64::NEG_INFINITY,
            high: -d,
        };
        let high = least(scale_of(0.0), LENGTH_MAX, |d| self.positive(above(d)))?;
        let low = least(scale_of(0.0), LENGTH_MAX, |d| self.negative(below(d)))?;
        Some(Bound::Slab { low: -low, high })
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
                inner: LENGTH_MAX,
                outer: f64::INFINITY,
            },
            Seed::Plane => Region::Slab {
                low: LENGTH_MAX,
                high: f64::INFINITY,
            },
        };
        summands.into_iter().find_map(|(id, negated)| {
            let program = Program::compile(&surface.graph, &[id], time_of(self.scene)).ok()?;
            let range = *program.range(&around(self.scene, far)).first()?;
            let least = if negated { -range.high } else { range.low };
            (least == f64::NEG_INFINITY).then(|| show::node(&surface.graph, id, 60))
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

/// The smallest distance worth looking at: a millionth of the seed's size, or of a metre.
fn scale_of(radius: f64) -> f64 {
    if radius > 0.0 { radius * 1e-9 } else { 1e-6 }
}

/// The least distance from `start` to `limit` for which `holds`, which is then true of all larger ones;
/// a little larger where `holds` wavers.
fn least(start: f64, limit: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let mut low = 0.0;
    let mut high = start;
    while !holds(high) {
        low = high;
        high *= 2.0;
        if high > limit {
            return None;
        }
    }
    while high - low > PRECISION * high {
        let middle = low + (high - low) / 2.0;
        if holds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}
