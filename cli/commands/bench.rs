//! `flyby bench`: measurements beside those of the reference documents.

mod farm;
mod peers;
mod techniques;
mod threads;

use clap::{Args, Subcommand};
use render::methods::{Hit, Method, Mitchell, Optimised, Speculative, SphereTracing, Subdivision};

use crate::bench::cast::{Count, cast, cast_by};
use crate::bench::cells::{Cells, Known};
use crate::bench::report::{Measured, Tables, Thesis};
use crate::bench::thesis::{Experiment, NAMES, Noise, Setting, lipschitz};
use crate::error::{Ending, Error};
use crate::options::Context;
use crate::output;

#[derive(Subcommand, Debug)]
pub(crate) enum BenchCommand {
    /// Evaluations per ray of the methods of thesis chapter 5, beside its tables 5.1 to 5.5.
    Thesis(Options),
    /// What the farm itself costs: scheduler, coordinator, store and links, with a renderer that renders nothing.
    Farm(farm::Options),
    /// Times of one thread beside other programs' on the same surfaces, in turns.
    Peers(peers::Options),
    /// The tracer without each of its techniques in turn: equal pixels by more work.
    Techniques(techniques::Options),
    /// Threads of one process beside as many processes of one thread at the same time.
    Threads(threads::Options),
}

#[derive(Args, Debug)]
pub(crate) struct Options {
    /// Pixels along a side of the grid of rays that samples the thesis's 800×800.
    #[arg(long, value_name = "N", default_value_t = 40,
          value_parser = clap::value_parser!(u32).range(2..=800))]
    side: u32,

    /// Noises to measure [default: all].
    #[arg(long, value_name = "NOISE", value_delimiter = ',',
          value_parser = clap::builder::PossibleValuesParser::new(NAMES))]
    noise: Vec<String>,

    /// ε in metres instead of that of the experiment, a thousandth of a pixel.
    #[arg(long, value_name = "METRES", value_parser = epsilon)]
    epsilon: Option<f64>,
}

fn epsilon(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if (1e-9..=0.1).contains(&number) => Ok(number),
        Ok(number) => Err(format!("{number} is not between 1e-9 and 0.1")),
        Err(_) => Err(format!("`{text}` is no number")),
    }
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: BenchCommand) -> Result<Ending, Error> {
    match command {
        BenchCommand::Thesis(options) => {
            output::print(context.output, &tables(&options)?)?;
            Ok(Ending::Done)
        }
        BenchCommand::Farm(options) => farm::run(context, &options),
        BenchCommand::Peers(options) => peers::run(context, &options),
        BenchCommand::Techniques(options) => techniques::run(context, &options),
        BenchCommand::Threads(options) => threads::run(context, &options),
    }
}

fn tables(options: &Options) -> Result<Tables, Error> {
    let experiment = Experiment::embedded()
        .map_err(|reason| Error::failed("the experiment has a mistake").because(reason))?;
    let epsilon = options.epsilon.unwrap_or(experiment.epsilon);
    let mut tables = Tables {
        side: options.side,
        epsilon,
        noises: Vec::new(),
        left_out: Vec::new(),
    };
    for noise in &experiment.noises {
        if !options.noise.is_empty() && !options.noise.contains(&noise.name) {
            continue;
        }
        let grain = Grain {
            side: options.side,
            epsilon,
            overshoot: experiment.overshoot,
        };
        let measured = noise.setting().and_then(|setting| {
            let measured = measured(noise, &setting, grain)?;
            measured.ok_or_else(|| "the thesis has no row of it".to_owned())
        });
        match measured {
            Ok(measured) => tables.noises.push(measured),
            Err(reason) => tables
                .left_out
                .push(format!("{} noise: {reason}", noise.name)),
        }
    }
    Ok(tables)
}

/// How finely is measured.
#[derive(Clone, Copy)]
struct Grain {
    side: u32,
    epsilon: f64,
    overshoot: f64,
}

fn measured(noise: &Noise, setting: &Setting, grain: Grain) -> Result<Option<Measured>, String> {
    let Some(found) = noise.found() else {
        return Ok(None);
    };
    let hit = Hit::Converged;
    let Grain {
        side,
        epsilon,
        overshoot,
    } = grain;
    let run = |method: &dyn Method, lipschitz: Option<f64>, epsilon: f64| {
        cast(setting, side, method, (lipschitz, epsilon))
    };
    let speculative = |noise: f64, epsilon: f64| {
        let lipschitz = lipschitz(noise);
        let method = Speculative {
            lipschitz,
            overshoot,
            epsilon,
            hit,
        };
        run(&method, Some(lipschitz), epsilon)
    };
    let mut tracing: Vec<Count> = Vec::new();
    for &lambda in &noise.lambda {
        let lipschitz = lipschitz(lambda);
        let method = SphereTracing {
            lipschitz,
            epsilon,
            hit,
        };
        tracing.push(run(&method, Some(lipschitz), epsilon));
        tracing.push(speculative(lambda, epsilon));
    }
    let mut cells = Vec::new();
    if noise.cells {
        let (_, direction) = setting.ray([0.0; 2]);
        for (name, known) in [
            ("λ_N of each cell", Known::Length),
            ("the fall of each cell along the ray", Known::Fall),
        ] {
            let table = Cells::new(direction, known)?;
            cells.push(cast_by(setting, side, name, |ray, span, tally| {
                table.first(ray, span, epsilon, tally)
            }));
        }
    }
    let methods: [&dyn Method; 5] = [
        &Subdivision::interval(epsilon, hit),
        &Subdivision::affine(epsilon, hit),
        &Subdivision::reduced(epsilon, hit),
        &Optimised { epsilon, hit },
        &Mitchell { epsilon, hit },
    ];
    let casting = methods
        .into_iter()
        .map(|method| run(method, None, epsilon))
        .collect();
    let mut sensitivity = Vec::new();
    for epsilon in [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8] {
        sensitivity.push(speculative(noise.lambda[0], epsilon));
        sensitivity.push(run(&Subdivision::reduced(epsilon, hit), None, epsilon));
        sensitivity.push(run(&Optimised { epsilon, hit }, None, epsilon));
    }
    Ok(Some(Measured {
        noise: noise.name.clone(),
        field: setting.field.clone(),
        overshoot,
        lambda: noise.lambda.clone(),
        normalisation: noise.normalisation.clone(),
        tracing,
        cells,
        casting,
        sensitivity,
        thesis: Thesis::new(found),
    }))
}
