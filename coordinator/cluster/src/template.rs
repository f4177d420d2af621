//! The scripts that queues run, from `deploy/` or from a file of the user's, and how values are put into them.

use std::fs;
use std::path::Path;

use crate::error::ClusterError;

/// The place of what a task runs.
const SCRIPT: &str = "@script@";

/// Most bytes of a template.
const BYTES_MAX: u64 = 1 << 20;

/// A line that ends scripts where they are handed over; none of them may hold it.
pub(crate) const END: &str = "END_OF_FLYBY_SCRIPT";

/// The script that a queue is given: the usual template or the site's own, with what a task runs in its place.
pub(crate) fn fill(usual: &str, own: Option<&Path>, script: &str) -> Result<String, ClusterError> {
    let own = own
        .map(|path| read(path).map(|text| (path, text)))
        .transpose()?;
    let (name, text) = match &own {
        Some((path, text)) => (path.display().to_string(), text.as_str()),
        None => ("in deploy/".to_owned(), usual),
    };
    let wrong = |what: &str| ClusterError::Template {
        path: name.clone(),
        what: what.to_owned(),
    };
    // Comments may speak of it.
    let is_place = |line: &&str| line.trim() == SCRIPT;
    if text.lines().filter(is_place).count() != 1 {
        return Err(wrong(&format!(
            "it must have one line that is {SCRIPT}, where the work goes"
        )));
    }
    let lines = text
        .lines()
        .map(|line| if is_place(&line) { script } else { line });
    let filled = lines.collect::<Vec<_>>().join("\n") + "\n";
    match filled.lines().any(|line| line == END) {
        true => Err(wrong(&format!("it may not have the line {END}"))),
        false => Ok(filled),
    }
}

fn read(path: &Path) -> Result<String, ClusterError> {
    let failed = |source| ClusterError::File {
        attempted: "read the template",
        path: path.display().to_string(),
        source,
    };
    let bytes = fs::metadata(path).map_err(failed)?.len();
    if bytes > BYTES_MAX {
        return Err(ClusterError::Template {
            path: path.display().to_string(),
            what: format!("it has more than {BYTES_MAX} bytes"),
        });
    }
    fs::read_to_string(path).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_work_goes_into_its_place() {
        let filled = fill("#!/bin/sh\n# @script@ is here:\n@script@\n", None, "a\nb").unwrap();
        assert_eq!(filled, "#!/bin/sh\n# @script@ is here:\na\nb\n");
    }

    #[test]
    fn a_template_without_a_place_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.sh");
        fs::write(&path, "#!/bin/sh\n").unwrap();
        let error = fill("@script@", Some(&path), "a").unwrap_err().to_string();
        assert!(
            error.contains("t.sh") && error.contains("@script@"),
            "{error}"
        );
        let error = fill("@script@", Some(&folder.path().join("none")), "a").unwrap_err();
        assert!(error.to_string().contains("none"), "{error}");
        fill("@script@", None, "a\nEND_OF_FLYBY_SCRIPT").unwrap_err();
    }
}
