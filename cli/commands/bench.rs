//! `flyby bench`: measurements beside those of the reference documents.

mod peers;
mod techniques;
mod threads;

use clap::{Args, Subcommand};
use field::{Interval, Program};
use render::methods::{Hit, Method, Mitchell, Optimised, Speculative, SphereTracing, Subdivision};

use crate::bench::cast::{Count, cast};
use crate::bench::report::{Measured, Tables, Thesis};
use crate::bench::thesis::{self, Row};
use crate::error::{Ending, Error};
use crate::options::Context;
use crate::output;

#[derive(Subcommand, Debug)]
pub(crate) enum BenchCommand {
    /// Evaluations per ray of the methods of thesis chapter 5, beside its tables 5.1 to 5.5.
    Thesis(Options),
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
    #[arg(long, value_name = "N", default_value_t = 64,
          value_parser = clap::value_parser!(u32).range(2..=800))]
    side: u32,

    /// ε in metres: steps and intervals below it end a search. The thesis does not say its own.
    #[arg(long, value_name = "METRES", default_value = "1e-7", value_parser = epsilon)]
    epsilon: f64,
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
            output::print(context.output, &tables(&options))?;
            Ok(Ending::Done)
        }
        BenchCommand::Peers(options) => peers::run(context, &options),
        BenchCommand::Techniques(options) => techniques::run(context, &options),
        BenchCommand::Threads(options) => threads::run(context, &options),
    }
}

fn tables(options: &Options) -> Tables {
    let mut tables = Tables {
        side: options.side,
        epsilon: options.epsilon,
        noises: Vec::new(),
        left_out: Vec::new(),
    };
    for row in &thesis::ROWS {
        match program(row) {
            Ok(program) => tables.noises.push(measured(row, &program, options)),
            Err(reason) => tables
                .left_out
                .push(format!("{} noise: {reason}", row.noise)),
        }
    }
    tables
}

fn program(row: &Row) -> Result<Program, String> {
    let alone = scene::expression(&row.field(), &[]).map_err(|error| error.to_string())?;
    Program::compile(&alone.graph, &[alone.root], Interval::point(0.0))
        .map_err(|error| error.to_string())
}

fn measured(row: &Row, program: &Program, options: &Options) -> Measured {
    let hit = Hit::Converged;
    let run = |method: &dyn Method, lipschitz: Option<f64>, epsilon: f64| {
        cast(
            program,
            row.radius(),
            options.side,
            method,
            (lipschitz, epsilon),
        )
    };
    let speculative = |noise: f64, epsilon: f64| {
        let lipschitz = Row::lipschitz(noise);
        let method = Speculative {
            lipschitz,
            overshoot: thesis::OVERSHOOT,
            epsilon,
            hit,
        };
        run(&method, Some(lipschitz), epsilon)
    };
    let epsilon = options.epsilon;
    let mut tracing: Vec<Count> = Vec::new();
    let differing = row
        .lipschitz_true
        .filter(|exact| *exact != row.lipschitz_thesis);
    for noise in [Some(row.lipschitz_thesis), differing]
        .into_iter()
        .flatten()
    {
        let lipschitz = Row::lipschitz(noise);
        let method = SphereTracing {
            lipschitz,
            epsilon,
            hit,
        };
        tracing.push(run(&method, Some(lipschitz), epsilon));
        tracing.push(speculative(noise, epsilon));
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
    for epsilon in [1e-3, 1e-4, 1e-5, 1e-6, 1e-7] {
        sensitivity.push(speculative(row.lipschitz_thesis, epsilon));
        sensitivity.push(run(&Optimised { epsilon, hit }, None, epsilon));
    }
    Measured {
        noise: row.noise,
        field: row.field(),
        normalisation: row.normalisation,
        tracing,
        casting,
        sensitivity,
        thesis: Thesis::new(row),
    }
}
