//! `flyby version`: what this program is, for programs too; `site check` asks it at a site.

use std::io::{self, Write};

use clap::Args;
use render::SimdLevel;
use serde::Serialize;

use super::render::processors;
use crate::daemon;
use crate::error::{Ending, Error};
use crate::options::Context;
use crate::output::{self, Report};

#[derive(Args, Debug)]
pub(crate) struct Version {}

/// `version`.
#[derive(Serialize)]
struct About {
    /// Name and version.
    build: String,
    /// Revision of its renderer: two revisions make different pixels.
    revision: u32,
    /// Lowest protocol version that it speaks with coordinators and workers.
    protocol_min: u32,
    /// Highest.
    protocol_max: u32,
    /// What it was built for, such as `linux x86_64 gnu`.
    target: String,
    /// The best instruction set of this machine.
    simd: String,
    /// Processors that it may use here.
    processors: usize,
}

impl Report for About {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{} for {}", self.build, self.target)?;
        writeln!(out, "  renderer revision {}", self.revision)?;
        writeln!(
            out,
            "  protocol {} to {}",
            self.protocol_min, self.protocol_max
        )?;
        writeln!(
            out,
            "  here {} and {} processors",
            self.simd, self.processors
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.build)
    }
}

/// Runs the command.
pub(crate) fn run(context: &Context) -> Result<Ending, Error> {
    let library = match () {
        () if cfg!(target_env = "gnu") => " gnu",
        () if cfg!(target_env = "musl") => " musl",
        () => "",
    };
    let about = About {
        build: daemon::software(),
        revision: render::REVISION,
        protocol_min: wire::version::PROTOCOL_MIN,
        protocol_max: wire::version::PROTOCOL_MAX,
        target: format!(
            "{} {}{library}",
            std::env::consts::OS,
            std::env::consts::ARCH
        ),
        simd: SimdLevel::best().to_string(),
        processors: processors(),
    };
    output::print(context.output, &about)?;
    Ok(Ending::Done)
}
