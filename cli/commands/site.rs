//! `flyby site`: the clusters and hosts that `sites.toml` names.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use cluster::camp::{Camp, farm_of};
use cluster::survey::Nodes;
use cluster::{ClusterError, Site, Sites, SitesError, install, survey};
use miette::Severity;
use wire::proto::{ListSitesRequest, LookBackRequest, SiteStatus};

use crate::caret::Caret;
use crate::error::{Ending, Error};
use crate::farm::link::{block_on, refused};
use crate::options::{Context, FarmOptions};
use crate::output;
use crate::site::check::{Check, Checks, Verdict};
use crate::site::plot::{Busy, Plotted};
use crate::site::view::{Cleaned, Installed, Listed, SiteView};

/// The file of sites inside the state folder.
const SITES_FILE: &str = "sites.toml";

#[derive(Subcommand, Debug)]
pub(crate) enum SiteCommand {
    /// Lists the sites as the running coordinator sees them; those of the file where none runs or one is named.
    List(List),
    /// Logs in to sites and says what they are like: queue, limits, clock, program (exit code 1 if something is wrong).
    Check(CheckOptions),
    /// Copies a program to a site, without root, and runs it there before it takes the place of the one before.
    Install(Install),
    /// Says how busy polled sites were since the coordinator was started, and for how long a slot was free while nothing of the
    /// farm's waited in the queue; draws it where a file is named.
    Plot(PlotOptions),
    /// Ends and removes everything that this farm has at a site, the program aside. A coordinator that runs submits again
    /// what its jobs need: stop it first, or cancel them.
    Clean(Clean),
}

/// Which file of sites.
#[derive(Args, Debug)]
struct SitesOptions {
    /// The file of sites [default: sites.toml in the state folder].
    #[arg(long, value_name = "FILE", help_heading = "Farm")]
    sites: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct List {
    #[command(flatten)]
    file: SitesOptions,

    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct CheckOptions {
    /// The site; else all of them.
    name: Option<String>,

    /// Where workers would dial, such as 192.0.2.7:7359 [default: the site's `coordinator`, else the one that runs over the
    /// state folder].
    #[arg(long, value_name = "ADDR", help_heading = "Farm")]
    coordinator: Option<String>,

    /// Also submits one task, which says whether a host of the queue reaches the coordinator: takes as long as the queue
    /// does, five minutes at most.
    #[arg(long)]
    node: bool,

    #[command(flatten)]
    file: SitesOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Install {
    /// The site.
    name: String,

    /// The program to copy [default: this one].
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,

    #[command(flatten)]
    file: SitesOptions,
}

#[derive(Args, Debug)]
pub(crate) struct PlotOptions {
    /// The sites; else all of them.
    names: Vec<String>,

    /// Where to draw it, as SVG: busy slots in blue, waiting tasks as a grey line, red where a slot was free for nothing.
    #[arg(short, long, value_name = "FILE", help_heading = "Results")]
    out: Option<PathBuf>,

    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Clean {
    /// The site.
    name: String,

    #[command(flatten)]
    file: SitesOptions,
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: SiteCommand) -> Result<Ending, Error> {
    match command {
        SiteCommand::List(options) => list(context, &options),
        SiteCommand::Check(options) => check(context, &options),
        SiteCommand::Install(options) => install_at(context, &options),
        SiteCommand::Plot(options) => plot(context, options),
        SiteCommand::Clean(options) => clean(context, &options),
    }
}

/// Reads a file of sites; every mistake in it is part of the error.
pub(crate) fn read(path: &Path) -> Result<Sites, Error> {
    cluster::sites::read(path).map_err(|error| mistakes(&error))
}

/// Where connections of ssh are shared.
pub(crate) fn sockets(state: &Path) -> PathBuf {
    state.join("ssh")
}

fn mistakes(error: &SitesError) -> Error {
    let mut text = match error.mistakes.len() {
        1 => format!("the file of sites `{}` has a mistake\n", error.file),
        count => format!("the file of sites `{}` has {count} mistakes\n", error.file),
    };
    for mistake in &error.mistakes {
        let caret = Caret {
            file: &error.file,
            text: &error.text,
            span: mistake.span.clone(),
            message: &mistake.message,
            label: &mistake.label,
            help: mistake.help.as_deref(),
        };
        text.push_str(&caret.show(Severity::Error));
    }
    Error::usage(text.trim_end())
}

/// What went wrong at a site, with what to change.
pub(crate) fn failed(site: &Site, attempt: &str, error: ClusterError) -> Error {
    let next = error.next();
    Error::failed(format!("{attempt} site {}", site.name))
        .because(error)
        .next(next)
}

impl SitesOptions {
    fn read(&self, context: &Context) -> Result<Sites, Error> {
        match &self.sites {
            Some(path) => read(path),
            None => read(&context.state()?.join(SITES_FILE)),
        }
    }

    fn site(&self, context: &Context, name: &str) -> Result<Site, Error> {
        let sites = self.read(context)?;
        sites.named(name).cloned().ok_or_else(|| {
            let names: Vec<_> = sites.0.iter().map(|site| site.name.as_str()).collect();
            Error::usage(format!("there is no site `{name}`"))
                .next(format!("there are {}", names.join(", ")))
        })
    }
}

/// What this farm has at a site.
fn camp(context: &Context, site: Site) -> Result<Camp, Error> {
    let state = context.state()?;
    let farm = farm_of(&state).map_err(|error| failed(&site, "cannot name this farm at", error))?;
    Ok(Camp::new(site, farm, &sockets(&state)))
}

fn list(context: &Context, options: &List) -> Result<Ending, Error> {
    let seen = match options.file.sites {
        None => block_on(seen(context, &options.farm))?,
        Some(_) => Vec::new(),
    };
    let sites = match seen.is_empty() {
        true => options
            .file
            .read(context)?
            .0
            .iter()
            .map(SiteView::from)
            .collect(),
        false => seen.into_iter().map(SiteView::from).collect(),
    };
    output::print(context.output, &Listed { sites })?;
    Ok(Ending::Done)
}

/// What the coordinator says of its sites; nothing where none runs.
async fn seen(context: &Context, options: &FarmOptions) -> Result<Vec<SiteStatus>, Error> {
    let runs = options.coordinator.is_some()
        || context
            .state()
            .is_ok_and(|state| wire::place::coordinator(&state).is_ok());
    if !runs {
        return Ok(Vec::new());
    }
    let mut farm = context.connect(options).await?;
    let sites = farm.list_sites(ListSitesRequest {}).await;
    let sites = sites.map_err(|status| refused("cannot list the sites", status))?;
    Ok(sites.into_inner().sites)
}

fn check(context: &Context, options: &CheckOptions) -> Result<Ending, Error> {
    let sites = match &options.name {
        Some(name) => vec![options.file.site(context, name)?],
        None => options.file.read(context)?.0,
    };
    let running = context
        .state()
        .ok()
        .and_then(|state| wire::place::coordinator(&state).ok())
        .map(|coordinator| coordinator.address.to_string());
    let nodes = match options.node {
        true => Nodes::One,
        false => Nodes::No,
    };
    let mut checks = Vec::new();
    for site in sites {
        let camp = camp(context, site)?;
        let asked = options
            .coordinator
            .as_ref()
            .or(camp.site.coordinator.as_ref());
        let coordinator = asked.or(running.as_ref());
        let coordinator = coordinator.map(String::as_str);
        let seen = survey::look(&camp, coordinator, nodes);
        checks.push(Check::new(&camp.site, seen, coordinator));
    }
    let checks = Checks::new(checks);
    output::print(context.output, &checks)?;
    Ok(match checks.verdict {
        Verdict::Bad => Ending::Failed,
        Verdict::Fine | Verdict::Doubtful => Ending::Done,
    })
}

fn install_at(context: &Context, options: &Install) -> Result<Ending, Error> {
    let site = options.file.site(context, &options.name)?;
    let program = match &options.program {
        Some(program) => program.clone(),
        None => std::env::current_exe().map_err(|error| {
            Error::failed("cannot find the file of this program").because(error)
        })?,
    };
    let camp = camp(context, site)?;
    let found = install::install(&camp.site, &camp.way, &program)
        .map_err(|error| failed(&camp.site, "cannot install the program at", error))?;
    let installed = Installed::new(&camp.site, found);
    output::print(context.output, &installed)?;
    Ok(Ending::Done)
}

fn plot(context: &Context, options: PlotOptions) -> Result<Ending, Error> {
    let plotted = Plotted {
        sites: block_on(busy(context, &options))?,
        plot: options.out,
    };
    if let Some(path) = &plotted.plot {
        let cannot = || Error::failed(format!("cannot write the plot `{}`", path.display()));
        let svg = plotted.draw().map_err(|error| cannot().because(error))?;
        fs::write(path, svg).map_err(|error| cannot().because(error))?;
    }
    output::print(context.output, &plotted)?;
    Ok(Ending::Done)
}

/// How busy sites were, as the coordinator saw it.
async fn busy(context: &Context, options: &PlotOptions) -> Result<Vec<Busy>, Error> {
    let mut farm = context.connect(&options.farm).await?;
    let refused = |status| refused("cannot look back at the sites", status);
    let names = match options.names.is_empty() {
        false => options.names.clone(),
        true => {
            let sites = farm.list_sites(ListSitesRequest {}).await;
            let sites = sites.map_err(refused)?.into_inner().sites;
            sites.into_iter().map(|site| site.name).collect()
        }
    };
    let mut all = Vec::new();
    for site in names {
        let request = LookBackRequest { site: site.clone() };
        let looks = farm.look_back(request).await.map_err(refused)?;
        all.push(Busy::new(site, looks.into_inner()));
    }
    Ok(all)
}

fn clean(context: &Context, options: &Clean) -> Result<Ending, Error> {
    let site = options.file.site(context, &options.name)?;
    let camp = camp(context, site)?;
    let ended = camp
        .clean()
        .map_err(|error| failed(&camp.site, "cannot clean", error))?;
    let cleaned = Cleaned {
        site: camp.site.name.clone(),
        allocations_ended: ended,
    };
    output::print(context.output, &cleaned)?;
    Ok(Ending::Done)
}
