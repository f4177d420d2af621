//! Methods of thesis chapter 5 against each other, timed on the surfaces of `bench thesis`.

use std::hint::black_box;

use field::{Interval, Program};
use render::methods::{Along as _, FieldAlong, Hit, Method, Optimised, Speculative};

use super::clock;
use super::pairs::{Amount, Reason, Side, compile};
use crate::bench::cast::cast;
use crate::bench::thesis::{self, Row};

/// ε of both methods, metres; that of `bench thesis`.
const EPSILON: f64 = 1e-7;

/// Evaluations of one turn.
const EVALUATIONS: u32 = 4096;

/// How long the interval is over which a field is bounded, metres: about what the last steps of a search see.
const STRETCH: f64 = 1.0 / 64.0;

/// A row of the thesis's tables.
pub(crate) fn row(index: usize) -> Result<&'static Row, Reason> {
    thesis::ROWS
        .get(index)
        .ok_or_else(|| format!("the thesis's tables have no row {index}"))
}

/// Speculative sphere tracing with a λ that is a bound where there is one, and the guaranteed method.
pub(crate) fn sides<'a>(index: usize, side: u32) -> Result<[Side<'a>; 2], Reason> {
    let row = row(index)?;
    let hit = Hit::Converged;
    let speculative = Speculative {
        lipschitz: Row::lipschitz(row.lipschitz_true.unwrap_or(row.lipschitz_thesis)),
        overshoot: thesis::OVERSHOOT,
        epsilon: EPSILON,
        hit,
    };
    let optimised = Optimised {
        epsilon: EPSILON,
        hit,
    };
    Ok([timed(row, side, speculative)?, timed(row, side, optimised)?])
}

fn timed<'a>(row: &'static Row, side: u32, method: impl Method + 'a) -> Result<Side<'a>, Reason> {
    let program = compile(&row.field())?;
    let settings = (None, EPSILON);
    Ok(Side {
        called: method.name().to_owned(),
        turn: Box::new(move || {
            clock::seconds(|| {
                black_box(cast(&program, row.radius(), side, &method, settings));
                Ok(())
            })
        }),
        amount: None,
    })
}

/// Evaluations at points and in reduced affine arithmetic, one after the other along a ray.
pub(crate) fn evaluations<'a>(index: usize) -> Result<[Side<'a>; 2], Reason> {
    let row = row(index)?;
    let points = compile(&row.field())?;
    let ranges = compile(&row.field())?;
    Ok([
        along("a point", points, |ray, t| {
            black_box(ray.value(t));
        }),
        along("reduced AA", ranges, |ray, t| {
            black_box(ray.reduced(Interval::new(t, t + STRETCH)));
        }),
    ])
}

fn along<'a>(called: &str, program: Program, at: impl Fn(&FieldAlong<'_>, f64) + 'a) -> Side<'a> {
    Side {
        called: called.to_owned(),
        turn: Box::new(move || {
            clock::seconds(|| {
                let ray = FieldAlong {
                    program: &program,
                    origin: [0.3, -thesis::DISTANCE, 0.2],
                    direction: [0.0, 1.0, 0.0],
                    time: 0.0,
                };
                for i in 0..EVALUATIONS {
                    let share = f64::from(i) / f64::from(EVALUATIONS);
                    at(&ray, 2.0 * thesis::DISTANCE * share);
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
