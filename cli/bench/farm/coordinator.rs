//! The coordinator under measurement: a process of its own over a temporary folder.

use std::fs;
use std::net::SocketAddr;
use std::path::Path;
use std::time::Duration;

use tokio::runtime::Runtime;
use tokio::time::timeout;
use tonic::Status;
use wire::auth::Token;
use wire::link::Farm;
use wire::proto::job_update::Update;
use wire::proto::{JobRequest, JobSummary, JobUpdate, ListJobsRequest, WhyRequest};
use wire::way::Way;

use crate::error::Error;
use crate::farm::link::refused;
use crate::farm::local::{ANY_PORT, Process, coordinator};
use crate::stop::Stop;

/// Clock ticks of the system in a second, in which it counts the time of processes.
const TICKS: f64 = 100.0;

/// How long nothing may happen before somebody is asked why.
const PATIENCE: Duration = Duration::from_secs(10);

/// A coordinator that takes the null renderer's pixels; dropping it kills it.
pub(crate) struct Coordinator<'a> {
    runtime: &'a Runtime,
    stop: &'a Stop,
    process: Process,
    pub(crate) address: SocketAddr,
    pub(crate) token: Token,
    farm: Farm,
}

impl<'a> Coordinator<'a> {
    /// Starts one over a state folder that was marked as a measurement's, at an address or anywhere.
    pub(crate) fn start(
        runtime: &'a Runtime,
        stop: &'a Stop,
        state: &Path,
        address: Option<SocketAddr>,
    ) -> Result<Self, Error> {
        let listen = address.unwrap_or(ANY_PORT);
        let (process, address) =
            coordinator(state, listen, &["--null-renderer", "--verify", "0"], stop)?;
        let token = wire::place::token(state)
            .map_err(|error| Error::failed("the coordinator left no token").because(error))?;
        let farm = runtime
            .block_on(wire::link::farm(&Way::local(address, token.clone())))
            .map_err(|error| Error::failed("the coordinator does not answer").because(error))?;
        Ok(Self {
            runtime,
            stop,
            process,
            address,
            token,
            farm,
        })
    }

    /// Ends it as a power cut would, and says where it listened.
    pub(crate) fn kill(self) -> SocketAddr {
        self.address
    }

    /// Processor seconds that it took so far, user's and system's.
    pub(crate) fn cpu_seconds(&self) -> Option<f64> {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.process.id())).ok()?;
        own_time(&stat)
    }

    /// The most memory that it ever had resident, in bytes.
    pub(crate) fn peak_bytes(&self) -> Option<u64> {
        let status = fs::read_to_string(format!("/proc/{}/status", self.process.id())).ok()?;
        peak(&status)
    }

    /// Its only job.
    pub(crate) fn job(&mut self) -> Result<JobSummary, Error> {
        let Self { runtime, farm, .. } = self;
        let jobs = runtime
            .block_on(farm.list_jobs(ListJobsRequest {}))
            .map_err(|status| refused("the coordinator says nothing of its job", status))?;
        let mut jobs = jobs.into_inner().jobs;
        jobs.pop()
            .ok_or_else(|| Error::failed("the coordinator has lost its job"))
    }

    /// Watches until `is_enough` says so of the job; answers with the job as it is then.
    pub(crate) fn wait(
        &mut self,
        mut is_enough: impl FnMut(&JobSummary) -> bool,
    ) -> Result<JobSummary, Error> {
        let job = self.job()?.job;
        let watched = self.farm.watch_job(JobRequest { job });
        let watched = self.runtime.block_on(watched);
        let mut updates = watched.map_err(lost)?.into_inner();
        loop {
            let update = self.runtime.block_on(async {
                tokio::select! {
                    () = self.stop.wait() => Err(Error::interrupted("the measurement was stopped")),
                    said = timeout(PATIENCE, updates.message()) => match said {
                        Ok(said) => said.map_err(lost),
                        // Nothing changed for too long.
                        Err(_) => Ok(None),
                    },
                }
            })?;
            let Some(update) = update else {
                return Err(self.stands_still(job));
            };
            if let Some(summary) = summary(update).filter(&mut is_enough) {
                return Ok(summary);
            }
        }
    }

    fn stands_still(&mut self, job: u64) -> Error {
        let request = WhyRequest {
            job,
            ..WhyRequest::default()
        };
        let why = self.runtime.block_on(self.farm.why(request));
        let error = Error::failed("the farm under measurement stands still");
        match (self.process.ended(), why) {
            (Some(ended), _) => error.because(ended),
            (None, Ok(why)) => error.because(why.into_inner().sentence),
            (None, Err(status)) => error.because(status),
        }
    }
}

fn lost(status: Status) -> Error {
    refused("the job under measurement cannot be watched", status)
}

/// The job as an update tells it.
fn summary(update: JobUpdate) -> Option<JobSummary> {
    match update.update? {
        Update::Snapshot(part) => part.summary,
        Update::Delta(delta) => delta.summary,
    }
}

/// User and system time from the text of `/proc/…/stat`, its fields 14 and 15, in seconds.
fn own_time(stat: &str) -> Option<f64> {
    // The second field is a name in brackets, and may hold anything.
    let (_, fields) = stat.rsplit_once(')')?;
    let mut fields = fields.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / TICKS)
}

/// The peak resident size from the text of `/proc/…/status`, in bytes.
fn peak(status: &str) -> Option<u64> {
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_says_of_a_process() {
        let stat = "42 (a (strange) name) S 1 42 42 0 -1 4194560 100 200 0 0 150 50 9 9 20 0 1 0";
        assert_eq!(own_time(stat), Some(2.0));
        assert_eq!(own_time("42 (flyby) S 1"), None);
        assert_eq!(peak("VmPeak: 9 kB\nVmHWM:\t  16 kB\n"), Some(16_384));
        assert_eq!(peak(""), None);
    }
}
