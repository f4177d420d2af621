//! Rows made ready: two sides to be timed in turns.

use std::path::Path;

use field::{Interval, Program, SimdLevel};

use super::rows::{Budget, Library, Ours, Row, Shape, What};
use super::{clock, methods, noise, ours, povray};
use crate::bench::thesis::Setting;
use crate::error::Error;
use crate::load::Scene;

/// Two sides of a comparison.
pub(crate) struct Pair<'a> {
    /// The row's name, with the SIMD level of our side where there is one pair for each.
    pub(crate) name: String,
    /// This program's side.
    pub(crate) ours: Side<'a>,
    /// The other one.
    pub(crate) theirs: Side<'a>,
    /// Which ratio is wanted.
    pub(crate) budget: Budget,
}

/// What is timed.
pub(crate) struct Side<'a> {
    /// What it is called.
    pub(crate) called: String,
    /// Does it, and gives its seconds.
    pub(crate) turn: Turn<'a>,
    /// How much of what a turn does, where rates are worth printing.
    pub(crate) amount: Option<Amount>,
}

/// Does the work once, or as often as can be measured well, and gives the seconds of once.
pub(crate) type Turn<'a> = Box<dyn FnMut() -> Result<f64, Error> + 'a>;

/// So many of something.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Amount {
    /// How many.
    pub(crate) count: f64,
    /// Of what.
    pub(crate) of: &'static str,
}

/// So many times as many rays along a side are cast where whole pictures are: they have preparations of their own.
const WHOLE: u32 = 4;

/// Why a row is left out.
pub(crate) type Reason = String;

/// What rows need to be made ready.
pub(crate) struct Place<'a> {
    /// For scene files and pictures.
    pub(crate) folder: &'a Path,
    /// Whether POV-Ray can be run.
    pub(crate) has_povray: bool,
    /// Rays along a side where single methods are timed.
    pub(crate) side: u32,
}

impl<'a> Place<'a> {
    /// The comparisons of a row, or why there are none.
    pub(crate) fn pairs(&self, row: &Row) -> Result<Vec<Pair<'a>>, Reason> {
        let pair = |ours, theirs| {
            vec![Pair {
                name: row.name.to_owned(),
                ours,
                theirs,
                budget: row.budget,
            }]
        };
        match row.what {
            What::PovRay {
                ours,
                twin,
                declarations,
            } => Ok(pair(self.scene(ours)?, self.povray(twin, declarations)?)),
            What::Fidget { ours, shape } => Ok(pair(self.scene(ours)?, fidget(shape)?)),
            What::Scenes { ours, base, called } => {
                let mut base = self.scene(base)?;
                called.clone_into(&mut base.called);
                Ok(pair(self.scene(ours)?, base))
            }
            What::Noise { octaves, library } => levels(row, octaves, library),
            What::Gradient { octaves } => {
                let (plain, gradient) = (noise::program(octaves)?, noise::program(octaves)?);
                let level = SimdLevel::best();
                Ok(pair(
                    points("value and gradient", move || {
                        noise::gradient(&gradient, level)
                    }),
                    points("value", move || noise::value(&plain, level)),
                ))
            }
            What::Guaranteed { thesis } => {
                let [speculative, guaranteed] = methods::sides(thesis, self.side)?;
                Ok(pair(guaranteed, speculative))
            }
            What::Tracer { thesis } => {
                let [speculative, _] = methods::sides(thesis, self.side * WHOLE)?;
                Ok(pair(self.traced(&methods::setting(thesis)?)?, speculative))
            }
            What::Reduced { thesis } => {
                let [point, reduced] = methods::evaluations(thesis)?;
                Ok(pair(reduced, point))
            }
            What::Absent { ours, program, why } => {
                let rate = match ours {
                    Some(ours) => format!(" (ours: {})", self.rate(ours)?),
                    None => String::new(),
                };
                Err(format!("{program} is not compared: {why}{rate}"))
            }
        }
    }

    fn load(&self, ours: Ours, more: &[String]) -> Result<Scene, Reason> {
        ours.load(self.folder, more)
            .map_err(|error| error.to_string())
    }

    fn scene(&self, ours: Ours) -> Result<Side<'a>, Reason> {
        let scene = self.load(ours, &[])?;
        let description = scene.description();
        let rays = f64::from(description.sampling.rays);
        let amount = Amount {
            count: description.film.window.area() as f64 * rays * rays,
            of: "camera rays",
        };
        Ok(Side {
            called: "flyby".to_owned(),
            turn: Box::new(move || clock::seconds(|| ours::render(&scene).map(|_| ()))),
            amount: Some(amount),
        })
    }

    /// The renderer's own search over the surface of a thesis row, for as long as methods take whose rays are
    /// those that meet the bounding sphere: the time of a whole picture, shading included.
    fn traced(&self, setting: &Setting) -> Result<Side<'a>, Reason> {
        let more = [
            format!("surface.field=\"{}\"", setting.field),
            format!("film.resolution=\"{0}x{0}\"", self.side * WHOLE),
            format!("surface.bound.shell=[0, {}]", setting.radius),
        ];
        let scene = self.load(super::rows::SPHERE, &more)?;
        Ok(Side {
            called: "the renderer".to_owned(),
            turn: Box::new(move || clock::seconds(|| ours::render(&scene).map(|_| ()))),
            amount: None,
        })
    }

    fn povray(
        &self,
        twin: &'static str,
        declarations: &'static [&'static str],
    ) -> Result<Side<'a>, Reason> {
        if !self.has_povray {
            return Err(
                "povray is not installed (apt-get install povray povray-includes)".to_owned(),
            );
        }
        let folder = self.folder;
        Ok(Side {
            called: "POV-Ray".to_owned(),
            turn: Box::new(move || povray::trace(twin, folder, declarations)),
            amount: None,
        })
    }

    /// Our rays per second, as text.
    fn rate(&self, ours: Ours) -> Result<String, Reason> {
        let mut side = self.scene(ours)?;
        let seconds = (side.turn)().map_err(|error| error.to_string())?;
        let Amount { count, of } = side.amount.unwrap_or(Amount {
            count: 0.0,
            of: "rays",
        });
        Ok(format!("{:.2} M {of}/s", count / seconds * 1e-6))
    }
}

/// One pair for each SIMD level; the budget is that of the best.
fn levels<'a>(row: &Row, octaves: u32, library: Library) -> Result<Vec<Pair<'a>>, Reason> {
    let best = SimdLevel::best();
    let mut pairs = Vec::new();
    for level in SimdLevel::all_available() {
        let program = noise::program(octaves)?;
        pairs.push(Pair {
            name: format!("{} {level}", row.name),
            ours: points("flyby", move || noise::value(&program, level)),
            theirs: points(noise::called(library), noise::peer(library, octaves)?),
            budget: if level == best {
                row.budget
            } else {
                Budget::Open
            },
        });
    }
    Ok(pairs)
}

/// A side that evaluates [`noise::POINTS`] points in a turn.
fn points<'a>(called: &str, mut once: impl FnMut() + 'a) -> Side<'a> {
    Side {
        called: called.to_owned(),
        turn: Box::new(move || {
            clock::seconds(|| {
                once();
                Ok(())
            })
        }),
        amount: Some(Amount {
            count: noise::POINTS as f64,
            of: "points",
        }),
    }
}

#[cfg(feature = "peers")]
fn fidget<'a>(shape: Shape) -> Result<Side<'a>, Reason> {
    let tree = super::fidget::tree(shape);
    Ok(Side {
        called: "fidget, depth and normals".to_owned(),
        turn: Box::new(move || {
            clock::seconds(|| {
                super::fidget::render(&tree, super::fidget::SIDE);
                Ok(())
            })
        }),
        amount: None,
    })
}

#[cfg(not(feature = "peers"))]
fn fidget<'a>(_: Shape) -> Result<Side<'a>, Reason> {
    Err(super::NOT_BUILT.to_owned())
}

/// The program of one field, alone.
pub(crate) fn compile(field: &str) -> Result<Program, Reason> {
    let alone = scene::expression(field, &[]).map_err(|error| error.to_string())?;
    Program::compile(&alone.graph, &[alone.root], Interval::point(0.0))
        .map_err(|error| error.to_string())
}
