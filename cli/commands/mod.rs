//! The commands: what each is called, and which file runs it.

mod bench;
mod completions;
mod coordinator;
mod demo;
mod farm;
mod gallery;
mod image;
mod job;
mod noise;
mod render;
mod scene;
mod site;
mod site_agent;
mod submit;
mod token;
mod version;
mod worker;

use std::path::PathBuf;

use clap::{CommandFactory as _, Parser, Subcommand};

use crate::error::{Ending, Error};
use crate::options::Context;
use crate::output::Format;

/// What every help page ends with.
fn after_help() -> String {
    format!(
        "{}\nEvery long option of a command has two twins: `flyby render --threads 2` is also \
         FLYBY_RENDER_THREADS=2 in the environment, and `threads = 2` under [render] in the \
         configuration file ($FLYBY_CONFIG, else ~/.config/flyby/config.toml). Options of all \
         commands, such as --state, are FLYBY_STATE, and `state` at the file's top. A flag \
         counts before the environment, which counts before the file.",
        Ending::table()
    )
}

/// A render farm for procedural landscapes.
#[derive(Parser, Debug)]
#[command(name = "flyby", version, max_term_width = 100, after_long_help = after_help())]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,

    /// How results are printed on standard output.
    #[arg(
        long,
        global = true,
        value_enum,
        default_value_t,
        help_heading = "Everywhere"
    )]
    output: Format,

    /// State folder of the farm: token, address, frames of the coordinator
    /// [default: $XDG_STATE_HOME/flyby or ~/.local/state/flyby].
    #[arg(long, global = true, value_name = "DIR", help_heading = "Everywhere")]
    state: Option<PathBuf>,

    /// File of a token (`flyby token create`), by which a coordinator on another machine is reached.
    #[arg(long, global = true, value_name = "FILE", help_heading = "Everywhere")]
    token_file: Option<PathBuf>,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Renders a short flyby with a whole farm on this machine: the first thing to run.
    Demo(demo::Demo),
    /// Renders frames here, in this process; interrupted, it goes on where it was.
    Render(render::Render),
    /// Runs a coordinator until it is told to stop.
    Coordinator(coordinator::Coordinator),
    /// Runs a worker until it is told to stop; with a verb, manages workers.
    Worker(worker::WorkerCommand),
    /// Submits a job to the coordinator.
    Submit(submit::Submit),
    /// Your jobs: how they stand, their frames, their place among others.
    #[command(subcommand)]
    Job(job::JobCommand),
    /// Clusters and hosts that `sites.toml` names: what they are like, the program there.
    #[command(subcommand)]
    Site(site::SiteCommand),
    /// What a coordinator calls on the login node of a site in poll mode, and what the tasks there run.
    #[command(subcommand, hide = true)]
    SiteAgent(site_agent::SiteAgent),
    /// Tokens, by which users and workers on other machines reach the farm.
    #[command(subcommand)]
    Token(token::TokenCommand),
    /// The farm: how it stands, what is wrong with it, what can be cleaned away.
    #[command(subcommand)]
    Farm(farm::FarmCommand),
    /// Scene files: mistakes, contents, schema.
    #[command(subcommand)]
    Scene(scene::SceneCommand),
    /// What frames hold: digests, metadata, differences.
    #[command(subcommand)]
    Image(image::ImageCommand),
    /// Noises: the statistics by which they are judged, as tables and plots.
    #[command(subcommand)]
    Noise(noise::NoiseCommand),
    /// Renders the figures of the thesis into one page with captions and times.
    Gallery(gallery::Gallery),
    /// Measurements beside those of others.
    #[command(subcommand)]
    Bench(bench::BenchCommand),
    /// What this program is and what this machine makes of it.
    Version(version::Version),
    /// Prints a completion script for a shell.
    Completions(completions::Completions),
    /// Writes the manual pages.
    Man(completions::Man),
}

/// Runs what the user asked for; `state` is the state folder where none is named.
pub(crate) fn run(cli: Cli, state: Option<PathBuf>) -> Result<Ending, Error> {
    let context = Context {
        output: cli.output,
        state: cli.state.or(state),
        token_file: cli.token_file,
    };
    match cli.command {
        Command::Demo(options) => demo::run(&context, &options),
        Command::Render(options) => render::run(&context, &options),
        Command::Coordinator(options) => coordinator::run(&context, &options),
        Command::Worker(command) => worker::run(&context, command),
        Command::Submit(options) => submit::run(&context, &options),
        Command::Job(command) => job::run(&context, command),
        Command::Site(command) => site::run(&context, command),
        Command::SiteAgent(command) => site_agent::run(&command),
        Command::Token(command) => token::run(&context, command),
        Command::Farm(command) => farm::run(&context, command),
        Command::Scene(command) => scene::run(&context, command),
        Command::Image(command) => image::run(&context, command),
        Command::Noise(command) => noise::run(&context, command),
        Command::Gallery(options) => gallery::run(&context, &options),
        Command::Bench(command) => bench::run(&context, command),
        Command::Version(_) => version::run(&context),
        Command::Completions(options) => completions::completions(&options, Cli::command()),
        Command::Man(options) => completions::man(&options, Cli::command()),
    }
}
