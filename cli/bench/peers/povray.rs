//! Runs POV-Ray on a scene and reads its times.

use std::fs;
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::error::Error;

/// Pixels along both sides.
const SIDE: u32 = 512;

/// Whether the program is there.
pub(crate) fn is_there() -> bool {
    Command::new("povray")
        .arg("--version")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok()
}

/// Renders a scene on one thread; gives the CPU time of tracing alone, in seconds.
pub(crate) fn trace(scene: &str, folder: &Path, declarations: &[&str]) -> Result<f64, Error> {
    let file = folder.join("peer.pov");
    fs::write(&file, scene).map_err(|error| {
        Error::failed(format!("cannot write `{}`", file.display())).because(error)
    })?;
    let mut picture = std::ffi::OsString::from("+O");
    picture.push(folder.join("povray.png"));
    let output = Command::new("povray")
        .args(["-D", "-V", "-A", "+WT1", "+FN"])
        .args([format!("+W{SIDE}"), format!("+H{SIDE}")])
        .arg(picture)
        .args(declarations.iter().map(|text| format!("Declare={text}")))
        .arg(file)
        .stdin(Stdio::null())
        .output()
        .map_err(|error: io::Error| Error::failed("cannot run povray").because(error))?;
    let log = String::from_utf8_lossy(&output.stderr);
    let seconds = output
        .status
        .success()
        .then(|| trace_seconds(&log))
        .flatten();
    seconds.ok_or_else(|| {
        let last = log.trim_end().lines().next_back().unwrap_or_default();
        Error::failed("povray did not say how long it took")
            .because(format!("its last line is `{last}`"))
            .next("install its include files too: apt-get install povray povray-includes")
    })
}

/// The CPU seconds in the line after `Trace Time`.
fn trace_seconds(log: &str) -> Option<f64> {
    let mut lines = log.lines().skip_while(|line| !line.contains("Trace Time:"));
    lines.next()?;
    let (_, after) = lines.next()?.split_once(" with ")?;
    let (number, _) = after.split_once(" CPU-seconds")?;
    number.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_tracing() {
        let log = "Render Time:\n  Photon Time:      No photons\n  Radiosity Time:   No radiosity\n  \
                   Trace Time:       0 hours  0 minutes  2 seconds (2.666 seconds)\n              \
                   using 1 thread(s) with 2.077 CPU-seconds total\nPOV-Ray finished\n";
        assert_eq!(trace_seconds(log), Some(2.077));
        assert_eq!(trace_seconds("Cannot open input file.\n"), None);
    }
}
