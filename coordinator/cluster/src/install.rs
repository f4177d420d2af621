//! Bringing the program to a site: over the same way, without root, in its place only when it is whole.

use std::fs::File;
use std::path::Path;

use model::Span;

use crate::error::ClusterError;
use crate::sites::Site;
use crate::survey::{self, Program};
use crate::way::Way;
use crate::words::quote_path;

/// How long the copy may take: a hundred megabytes over a slow line.
const LIMIT: Span = Span::from_secs(1_800);

/// Copies a program to the site and runs it there; only one that runs takes the place of the one before.
pub fn install(site: &Site, way: &Way, program: &Path) -> Result<Program, ClusterError> {
    let failed = |source| ClusterError::File {
        attempted: "read the program",
        path: program.display().to_string(),
        source,
    };
    let file = File::open(program).map_err(failed)?;
    let bytes = file.metadata().map_err(failed)?.len();
    let trial = Site {
        program: format!("{}.trial", site.program),
        ..site.clone()
    };
    way.put(file, bytes, &trial.program, 0o755, LIMIT)?;
    let (from, to) = (quote_path(&trial.program), quote_path(&site.program));
    match survey::program(&trial, way) {
        Ok(found) => {
            way.ask(
                "putting the program in its place",
                "mv",
                &format!("mv -f {from} {to}"),
            )?;
            Ok(found)
        }
        Err(error) => {
            // What does not run there is not left there; that it does not run matters more.
            let _ = way.ask("removing what does not run", "rm", &format!("rm -f {from}"));
            Err(error)
        }
    }
}
