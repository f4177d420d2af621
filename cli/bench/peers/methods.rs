//! Methods of thesis chapter 5 against each other, timed on the surfaces of `bench thesis`.

use std::hint::black_box;

use field::Interval;
use render::methods::{Along as _, FieldAlong, Hit, Method, Optimised, Speculative};

use super::clock;
use super::pairs::{Amount, Reason, Side};
use crate::bench::cast::cast;
use crate::bench::thesis::{Experiment, Setting, lipschitz};

/// Evaluations of one turn.
const EVALUATIONS: u32 = 4096;

/// How long the interval is over which a field is bounded, metres: about what the last steps of a search see.
const STRETCH: f64 = 1.0 / 64.0;

/// The ray along which a field is evaluated: beside the image's middle, through the whole scene.
const PLACE: [f64; 2] = [0.1, 0.07];
const LENGTH: f64 = 8.0;

/// What is cast at in the thesis's tables, by their order.
pub(crate) fn setting(index: usize) -> Result<Setting, Reason> {
    let experiment = Experiment::embedded()?;
    let noise = experiment.noises.get(index);
    noise
        .ok_or_else(|| format!("the thesis's tables have no row {index}"))?
        .setting()
}

/// Speculative sphere tracing with a λ that is a bound, and the guaranteed method.
pub(crate) fn sides<'a>(index: usize, side: u32) -> Result<[Side<'a>; 2], Reason> {
    let Experiment {
        epsilon,
        overshoot,
        noises,
    } = Experiment::embedded()?;
    let bound = noises.get(index).and_then(|noise| noise.lambda.last());
    let bound = *bound.ok_or_else(|| format!("row {index} has no λ"))?;
    let hit = Hit::Converged;
    let speculative = Speculative {
        lipschitz: lipschitz(bound),
        overshoot,
        epsilon,
        hit,
    };
    let optimised = Optimised { epsilon, hit };
    Ok([
        timed(setting(index)?, side, epsilon, speculative),
        timed(setting(index)?, side, epsilon, optimised),
    ])
}

fn timed<'a>(setting: Setting, side: u32, epsilon: f64, method: impl Method + 'a) -> Side<'a> {
    Side {
        called: method.name().to_owned(),
        turn: Box::new(move || {
            clock::seconds(|| {
                black_box(cast(&setting, side, &method, (None, epsilon)));
                Ok(())
            })
        }),
        amount: None,
    }
}

/// Evaluations at points and in reduced affine arithmetic, one after the other along a ray.
pub(crate) fn evaluations<'a>(index: usize) -> Result<[Side<'a>; 2], Reason> {
    let (points, ranges) = (setting(index)?, setting(index)?);
    Ok([
        along("a point", points, |ray, t| {
            black_box(ray.value(t));
        }),
        along("reduced AA", ranges, |ray, t| {
            black_box(ray.reduced(Interval::new(t, t + STRETCH)));
        }),
    ])
}

fn along<'a>(called: &str, setting: Setting, at: impl Fn(&FieldAlong<'_>, f64) + 'a) -> Side<'a> {
    Side {
        called: called.to_owned(),
        turn: Box::new(move || {
            clock::seconds(|| {
                let (origin, direction) = setting.ray(PLACE);
                let ray = FieldAlong {
                    program: &setting.program,
                    origin,
                    direction,
                    time: 0.0,
                };
                for i in 0..EVALUATIONS {
                    let share = f64::from(i) / f64::from(EVALUATIONS);
                    at(&ray, LENGTH * share);
                }
                Ok(())
            })
        }),
        amount: Some(Amount {
            count: f64::from(EVALUATIONS),
            of: "evaluations",
        }),
    }
}
