//! Sites as commands print them. Their JSON is these structs' fields.

use std::io::{self, Write};

use cluster::Site;
use cluster::survey::Program;
use serde::Serialize;
use wire::proto::SiteStatus;

use crate::output::{Report, columns};

/// `site list`.
#[derive(Serialize)]
pub(crate) struct Listed {
    /// By name.
    pub(crate) sites: Vec<SiteView>,
}

/// A site, as the running coordinator last saw it, or as the file says it where none runs.
#[derive(Serialize)]
pub(crate) struct SiteView {
    /// Its name.
    name: String,
    /// `slurm`, `gridengine`, `ssh` or `local`.
    kind: String,
    /// `pilot` or `poll`; `auto` until that is known.
    mode: String,
    /// Where ssh logs in; null for this machine, or the coordinator's.
    address: Option<String>,
    /// What a coordinator saw there; null where none runs.
    seen: Option<Seen>,
}

/// What a coordinator saw at a site.
#[derive(Serialize)]
struct Seen {
    /// Allocations that run.
    running: u32,
    /// Allocations that wait in the queue.
    waiting: u32,
    /// Allocations that there should be, those among them.
    wanted: u32,
    /// What is wrong there, as the queue said it, and what to change; null where nothing is.
    trouble: Option<String>,
    /// When its queue was asked last, milliseconds since 1970 (UTC); null is never.
    asked_unix_ms: Option<u64>,
    /// Blocks that were fetched from it in poll mode since the coordinator was started.
    fetched_blocks: u64,
    /// Their bytes.
    fetched_bytes: u64,
    /// Of those blocks the ones that were durable already, and so fetched in vain.
    fetched_again: u64,
}

impl From<&Site> for SiteView {
    fn from(site: &Site) -> Self {
        Self {
            name: site.name.clone(),
            kind: site.kind.name().to_owned(),
            mode: site.mode.name().to_owned(),
            address: site.address.clone(),
            seen: None,
        }
    }
}

impl From<SiteStatus> for SiteView {
    fn from(site: SiteStatus) -> Self {
        let said = |text: String| Some(text).filter(|text| !text.is_empty());
        Self {
            name: site.name,
            kind: site.kind,
            mode: site.mode,
            address: said(site.address),
            seen: Some(Seen {
                running: site.running,
                waiting: site.waiting,
                wanted: site.wanted,
                trouble: said(site.trouble),
                asked_unix_ms: Some(site.asked_unix_ms).filter(|&asked| asked > 0),
                fetched_blocks: site.fetched_blocks,
                fetched_bytes: site.fetched_bytes,
                fetched_again: site.fetched_again,
            }),
        }
    }
}

impl SiteView {
    /// One line for `farm status`.
    pub(crate) fn line(&self) -> String {
        match &self.seen {
            Some(seen) => format!(
                "{}: {} allocations run, {} wait, {} wanted",
                self.name, seen.running, seen.waiting, seen.wanted
            ),
            None => self.name.clone(),
        }
    }

    /// What is wrong there.
    pub(crate) fn trouble(&self) -> Option<&str> {
        self.seen.as_ref()?.trouble.as_deref()
    }
}

impl Report for Listed {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = columns(["site", "kind", "mode", "address", "run", "wait", "wanted"]);
        for site in &self.sites {
            let count = |of: &dyn Fn(&Seen) -> u32| {
                let seen = site.seen.as_ref();
                seen.map_or_else(|| "-".to_owned(), |seen| of(seen).to_string())
            };
            table.add_row([
                site.name.clone(),
                site.kind.clone(),
                site.mode.clone(),
                site.address
                    .clone()
                    .unwrap_or_else(|| "this machine".to_owned()),
                count(&|seen| seen.running),
                count(&|seen| seen.waiting),
                count(&|seen| seen.wanted),
            ]);
        }
        writeln!(out, "{}", table.trim_fmt())?;
        for site in &self.sites {
            if let Some(trouble) = site.trouble() {
                writeln!(out, "{}: {trouble}", site.name)?;
            }
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut sites = self.sites.iter();
        sites.try_for_each(|site| writeln!(out, "{}", site.name))
    }
}

/// `site install`.
#[derive(Serialize)]
pub(crate) struct Installed {
    /// Where.
    site: String,
    /// The program's path there.
    program: String,
    /// Its name and version, as it says them there.
    build: String,
    /// Its renderer's revision.
    revision: u32,
    /// The best instruction set of the machine there.
    simd: String,
}

impl Installed {
    pub(crate) fn new(site: &Site, program: Program) -> Self {
        Self {
            site: site.name.clone(),
            program: site.program.clone(),
            build: program.build,
            revision: program.revision,
            simd: program.simd,
        }
    }
}

impl Report for Installed {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self {
            site,
            program,
            build,
            revision,
            simd,
        } = self;
        writeln!(
            out,
            "{build}, renderer revision {revision}, runs at {site} as {program} ({simd})."
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.program)
    }
}

/// `site clean`.
#[derive(Serialize)]
pub(crate) struct Cleaned {
    /// Where.
    pub(crate) site: String,
    /// Allocations that waited or ran, and were ended.
    pub(crate) allocations_ended: usize,
    /// Those that the queue still shows, on hosts of which it hears nothing.
    pub(crate) allocations_away: Vec<String>,
}

impl Report for Cleaned {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{} allocations were ended; nothing of this farm is left at {}.",
            self.allocations_ended, self.site
        )?;
        match self.allocations_away.is_empty() {
            true => Ok(()),
            false => writeln!(
                out,
                "Its queue still shows {}, on hosts of which it hears nothing: they go when the hosts come back, or an \
                 operator of the queue deletes them.",
                self.allocations_away.join(", ")
            ),
        }
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.allocations_ended)
    }
}
