//! `flyby job`: the user's jobs.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use model::{JobId, Rect};
use serde::Serialize;
use tokio::sync::mpsc;
use wire::proto::job_command::Command as Wanted;
use wire::proto::job_update::Update;
use wire::proto::{
    self, ImageState, ImageStatus, JobRequest, JobSummary, ListJobsRequest, Pause, Remove, Resume,
    Retry,
};

use crate::error::{Ending, Error};
use crate::existing::stem;
use crate::farm::fetch::{Fetched, Fetcher};
use crate::farm::follow::{Follower, ending};
use crate::farm::link::{block_on, refused};
use crate::farm::view::{self, Image, Job, Jobs, Reason, Whole};
use crate::options::{Context, Existing, FarmOptions};
use crate::output::{self, Report, say};
use crate::stop::Stop;
use crate::values;

#[derive(Subcommand, Debug)]
pub(crate) enum JobCommand {
    /// Lists the jobs that the coordinator remembers.
    List(List),
    /// Shows a job and all its frames.
    Show(Named),
    /// Follows a job until it is over; Ctrl-C leaves it alone (exit code 5 if it failed).
    Watch(Watch),
    /// Prints what happened to a job.
    Log(Named),
    /// Ends a job; finished frames stay.
    Cancel(Named),
    /// Says why a job, one of its frames or one of its pixels is not finished.
    Why(Why),
    /// Begins nothing more of a job; what is being rendered is finished.
    Pause(Named),
    /// Goes on with a job that was paused.
    Resume(Named),
    /// Renders the failed frames of a job again.
    Retry(Named),
    /// Renders one frame of a job again, finished or failed.
    Again(Again),
    /// Serves a job before those of lower priority; jobs begin with 0.
    Priority(Priority),
    /// Changes a job's part of the farm against the other jobs of its priority; jobs begin with 1.
    Share(Share),
    /// Renders a part of each frame before the rest.
    Focus(Focus),
    /// Forgets a job, ending it first; finished frames stay on the coordinator's disk unless told otherwise.
    Remove(RemoveJob),
    /// Fetches the finished frames of a job.
    Fetch(Fetch),
}

#[derive(Args, Debug)]
pub(crate) struct Why {
    #[command(flatten)]
    named: Named,

    /// One of its frames.
    #[arg(long, value_name = "N")]
    frame: Option<u32>,

    /// A pixel of that frame, column and row.
    #[arg(long, value_name = "X,Y", requires = "frame", value_parser = values::pixel)]
    pixel: Option<(u32, u32)>,
}

#[derive(Args, Debug)]
pub(crate) struct Again {
    #[command(flatten)]
    named: Named,

    /// Number of the frame.
    frame: u32,
}

#[derive(Args, Debug)]
pub(crate) struct Share {
    #[command(flatten)]
    named: Named,

    /// The share, 1 to 1000: a job of share 2 holds twice as many tiles at a time as one of share 1.
    #[arg(value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    share: u32,
}

#[derive(Args, Debug)]
pub(crate) struct Focus {
    #[command(flatten)]
    named: Named,

    /// The part that comes first: x0,y0,x1,y1 (ends not included) or WxH+X+Y.
    #[arg(value_name = "RECT", value_parser = values::crop, required_unless_present = "none")]
    region: Option<Rect>,

    /// No part comes first any more.
    #[arg(long, conflicts_with = "region")]
    none: bool,
}

#[derive(Args, Debug)]
pub(crate) struct RemoveJob {
    #[command(flatten)]
    named: Named,

    /// Its finished frames on the coordinator's disk go too.
    #[arg(long)]
    frames: bool,
}

#[derive(Args, Debug)]
pub(crate) struct Priority {
    #[command(flatten)]
    named: Named,

    /// The priority; it may be negative.
    #[arg(value_name = "N", allow_negative_numbers = true)]
    priority: i32,
}

#[derive(Args, Debug)]
pub(crate) struct List {
    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Named {
    /// Number of the job.
    job: u64,
    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Watch {
    #[command(flatten)]
    named: Named,

    /// Folder to fetch frames into, as they are finished.
    #[arg(short, long, value_name = "DIR", help_heading = "Results")]
    out: Option<PathBuf>,

    /// What to do about frames that are there already.
    #[arg(long, value_enum, default_value_t, help_heading = "Results")]
    existing: Existing,
}

#[derive(Args, Debug)]
pub(crate) struct Fetch {
    #[command(flatten)]
    named: Named,

    /// Folder for the frames [default: the job's name].
    #[arg(short, long, value_name = "DIR", help_heading = "Results")]
    out: Option<PathBuf>,

    /// What to do about frames that are there already.
    #[arg(long, value_enum, default_value_t, help_heading = "Results")]
    existing: Existing,
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: JobCommand) -> Result<Ending, Error> {
    match command {
        JobCommand::List(options) => block_on(list(context, &options.farm)),
        JobCommand::Show(named) => block_on(show(context, &named)),
        JobCommand::Watch(options) => watch(context, &options),
        JobCommand::Log(named) => block_on(log(context, &named)),
        JobCommand::Cancel(named) => block_on(cancel(context, &named)),
        JobCommand::Why(options) => block_on(why(context, &options)),
        JobCommand::Pause(named) => {
            let wanted = Wanted::Pause(Pause {});
            block_on(want(context, &named, "pause", wanted))
        }
        JobCommand::Resume(named) => {
            let wanted = Wanted::Resume(Resume {});
            block_on(want(context, &named, "resume", wanted))
        }
        JobCommand::Priority(options) => {
            let priority = options.priority;
            let wanted = Wanted::Priority(proto::Priority { priority });
            let attempt = "change the priority of";
            block_on(want(context, &options.named, attempt, wanted))
        }
        JobCommand::Retry(named) => {
            let wanted = Wanted::Retry(Retry {});
            block_on(want(context, &named, "retry", wanted))
        }
        JobCommand::Again(options) => {
            let image = options.frame;
            let wanted = Wanted::Again(proto::Again { image });
            let attempt = format!("render frame {image} again in");
            block_on(want(context, &options.named, &attempt, wanted))
        }
        JobCommand::Share(options) => {
            let share = options.share;
            let wanted = Wanted::Share(proto::Share { share });
            block_on(want(context, &options.named, "change the share of", wanted))
        }
        JobCommand::Focus(options) => {
            let region = options.region.map(Into::into);
            let wanted = Wanted::Focus(proto::Focus { region });
            block_on(want(context, &options.named, "change the focus of", wanted))
        }
        JobCommand::Remove(options) => {
            let frames = options.frames;
            let wanted = Wanted::Remove(Remove { frames });
            block_on(want(context, &options.named, "remove", wanted))
        }
        JobCommand::Fetch(options) => block_on(fetch(context, &options)),
    }
}

async fn list(context: &Context, options: &FarmOptions) -> Result<Ending, Error> {
    let mut farm = context.connect(options).await?;
    let answer = farm
        .list_jobs(ListJobsRequest {})
        .await
        .map_err(|status| refused("cannot list the jobs", status))?;
    let jobs = answer.into_inner().jobs.into_iter().map(Job::from);
    output::print(
        context.output,
        &Jobs {
            jobs: jobs.collect(),
        },
    )?;
    Ok(Ending::Done)
}

/// A job and all its images, as they are now.
async fn whole(context: &Context, named: &Named) -> Result<(JobSummary, Vec<ImageStatus>), Error> {
    let attempt = || format!("cannot show job {}", named.job);
    let mut farm = context.connect(&named.farm).await?;
    let mut parts = farm
        .show_job(JobRequest { job: named.job })
        .await
        .map_err(|status| refused(attempt(), status))?
        .into_inner();
    let (mut summary, mut images) = (None, Vec::new());
    while let Some(part) = parts
        .message()
        .await
        .map_err(|status| refused(attempt(), status))?
    {
        if let Some(Update::Snapshot(part)) = part.update {
            if part.first {
                images.clear();
            }
            summary = part.summary.or(summary);
            images.extend(part.images);
        }
    }
    let summary = wire::convert::require(summary, "summary");
    summary
        .map(|summary| (summary, images))
        .map_err(|bad| refused(attempt(), bad))
}

async fn show(context: &Context, named: &Named) -> Result<Ending, Error> {
    let (summary, images) = whole(context, named).await?;
    let whole = Whole {
        job: summary.into(),
        images: images.into_iter().map(Image::from).collect(),
    };
    output::print(context.output, &whole)?;
    Ok(Ending::Done)
}

fn watch(context: &Context, options: &Watch) -> Result<Ending, Error> {
    let stop = Stop::on_signals()?;
    let target = options.out.as_deref().map(|out| (out, options.existing));
    let job = JobId(options.named.job);
    let (whole, _) = block_on(until_over(context, &options.named.farm, job, &stop, target))?;
    output::print(context.output, &whole.job)?;
    Ok(ending(&whole.job))
}

/// Follows a job to its end; where a folder is given, fetches its frames meanwhile.
pub(crate) async fn until_over(
    context: &Context,
    farm: &FarmOptions,
    job: JobId,
    stop: &Stop,
    target: Option<(&Path, Existing)>,
) -> Result<(Whole, Vec<Fetched>), Error> {
    let (finished, coming) = mpsc::unbounded_channel();
    let follower = Follower {
        context,
        farm,
        job,
        stop,
        finished: target.is_some().then_some(finished),
    };
    let Some((folder, existing)) = target else {
        return Ok((follower.follow().await?, Vec::new()));
    };
    make_folder(folder)?;
    let fetcher = Fetcher {
        context,
        farm,
        job,
        folder,
        existing,
    };
    tokio::try_join!(follower.follow(), fetcher.all(coming))
}

/// Makes a folder for frames, if it is not there.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Error::failed(format!("cannot make the folder `{}`", folder.display())).because(error)
    })
}

/// `job log`.
#[derive(Serialize)]
struct Log {
    /// Lines that were dropped before the first of these.
    dropped: u64,
    /// Oldest first.
    lines: Vec<Line>,
}

/// One thing that happened.
#[derive(Serialize)]
struct Line {
    /// Milliseconds since 1970 (UTC).
    unix_ms: u64,
    /// A sentence.
    text: String,
}

impl Report for Log {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.dropped > 0 {
            writeln!(out, "({} earlier lines were dropped)", self.dropped)?;
        }
        for line in &self.lines {
            writeln!(out, "{} {}", view::clock(line.unix_ms), line.text)?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        self.lines
            .iter()
            .try_for_each(|line| writeln!(out, "{}", line.text))
    }
}

async fn log(context: &Context, named: &Named) -> Result<Ending, Error> {
    let mut farm = context.connect(&named.farm).await?;
    let answer = farm
        .job_log(JobRequest { job: named.job })
        .await
        .map_err(|status| refused(format!("cannot show the log of job {}", named.job), status))?
        .into_inner();
    let lines = answer.lines.into_iter().map(|line| Line {
        unix_ms: line.unix_ms,
        text: line.text,
    });
    let log = Log {
        dropped: answer.dropped,
        lines: lines.collect(),
    };
    output::print(context.output, &log)?;
    Ok(Ending::Done)
}

async fn cancel(context: &Context, named: &Named) -> Result<Ending, Error> {
    let mut farm = context.connect(&named.farm).await?;
    let answer = farm
        .cancel_job(JobRequest { job: named.job })
        .await
        .map_err(|status| refused(format!("cannot cancel job {}", named.job), status))?;
    output::print(context.output, &Job::from(answer.into_inner()))?;
    Ok(Ending::Done)
}

/// Wants something of a job, and shows it as it is then.
async fn want(
    context: &Context,
    named: &Named,
    attempt: &str,
    wanted: Wanted,
) -> Result<Ending, Error> {
    let mut farm = context.connect(&named.farm).await?;
    let answer = farm
        .command_job(proto::JobCommand {
            job: named.job,
            command: Some(wanted),
        })
        .await
        .map_err(|status| refused(format!("cannot {attempt} job {}", named.job), status))?;
    output::print(context.output, &Job::from(answer.into_inner()))?;
    Ok(Ending::Done)
}

/// What `job why` asks about.
#[derive(Serialize)]
struct Asked {
    /// The job.
    job: u64,
    /// The frame asked for; null is the job as a whole.
    frame: Option<u32>,
    /// The pixel asked for, column and row; null is the frame as a whole.
    pixel: Option<(u32, u32)>,
}

async fn why(context: &Context, options: &Why) -> Result<Ending, Error> {
    let job = options.named.job;
    let mut farm = context.connect(&options.named.farm).await?;
    let answer = farm
        .why(proto::WhyRequest {
            job,
            image: options.frame,
            pixel: options.pixel.map(|(x, y)| proto::Pixel { x, y }),
            worker: None,
        })
        .await
        .map_err(|status| refused(format!("cannot say why job {job} waits"), status))?;
    let reason = Reason {
        asked: Asked {
            job,
            frame: options.frame,
            pixel: options.pixel,
        },
        why: answer.into_inner().sentence,
    };
    output::print(context.output, &reason)?;
    Ok(Ending::Done)
}

/// `job fetch`.
#[derive(Serialize)]
struct FetchReport {
    /// The job.
    job: u64,
    /// Where its frames are.
    folder: PathBuf,
    /// Files that were fetched.
    fetched: Vec<PathBuf>,
    /// Files that were there already.
    kept: Vec<PathBuf>,
    /// Frames of the job that are not finished, so that nothing of them was fetched.
    images_missing: u32,
}

impl Report for FetchReport {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{} files fetched into {}, {} kept that were there already",
            self.fetched.len(),
            self.folder.display(),
            self.kept.len()
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut fetched = self.fetched.iter();
        fetched.try_for_each(|path| writeln!(out, "{}", path.display()))
    }
}

async fn fetch(context: &Context, options: &Fetch) -> Result<Ending, Error> {
    let (summary, images) = whole(context, &options.named).await?;
    let folder = match &options.out {
        Some(folder) => folder.clone(),
        None => stem(&summary.name).into(),
    };
    make_folder(&folder)?;
    let fetcher = Fetcher {
        context,
        farm: &options.named.farm,
        job: JobId(summary.job),
        folder: &folder,
        existing: options.existing,
    };
    let mut report = FetchReport {
        job: summary.job,
        folder: folder.clone(),
        fetched: Vec::new(),
        kept: Vec::new(),
        images_missing: summary.images.saturating_sub(summary.images_done),
    };
    for image in images
        .iter()
        .filter(|image| image.state() == ImageState::Done)
    {
        for file in fetcher.image(image).await? {
            match file {
                Fetched::New(path) => report.fetched.push(path),
                Fetched::Kept(path) => report.kept.push(path),
            }
        }
    }
    if report.images_missing > 0 {
        say(format_args!(
            "{} frames are not finished: `flyby job watch {} -o {}` fetches them as they come",
            report.images_missing,
            summary.job,
            folder.display()
        ));
    }
    output::print(context.output, &report)?;
    Ok(Ending::Done)
}
