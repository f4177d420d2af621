//! Sites as commands print them. Their JSON is these structs' fields.

use std::io::{self, Write};

use cluster::survey::Program;
use cluster::{Site, Sites};
use serde::Serialize;

use crate::output::{Report, columns};

/// `site list`.
#[derive(Serialize)]
pub(crate) struct Listed {
    /// By name.
    sites: Vec<ListedSite>,
}

/// A site of the file.
#[derive(Serialize)]
struct ListedSite {
    /// Its name.
    name: String,
    /// `slurm`, `gridengine`, `ssh` or `local`.
    kind: &'static str,
    /// `pilot`, `poll` or `auto`.
    mode: &'static str,
    /// Where ssh logs in; null for this machine.
    address: Option<String>,
    /// Render threads of an allocation.
    threads: u32,
    /// Most allocations at a time; null where there is no limit.
    max_running: Option<u32>,
}

impl From<&Sites> for Listed {
    fn from(sites: &Sites) -> Self {
        let listed = |site: &Site| ListedSite {
            name: site.name.clone(),
            kind: site.kind.name(),
            mode: site.mode.name(),
            address: site.address.clone(),
            threads: site.threads,
            max_running: site.max_running,
        };
        Self {
            sites: sites.0.iter().map(listed).collect(),
        }
    }
}

impl Report for Listed {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = columns(["site", "kind", "mode", "address", "threads", "most"]);
        for site in &self.sites {
            table.add_row([
                site.name.clone(),
                site.kind.to_owned(),
                site.mode.to_owned(),
                site.address
                    .clone()
                    .unwrap_or_else(|| "this machine".to_owned()),
                site.threads.to_string(),
                site.max_running
                    .map_or_else(|| "any".to_owned(), |most| most.to_string()),
            ]);
        }
        writeln!(out, "{}", table.trim_fmt())
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
}

impl Report for Cleaned {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{} allocations were ended; nothing of this farm is left at {}.",
            self.allocations_ended, self.site
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.allocations_ended)
    }
}
