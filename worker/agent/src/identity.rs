//! Who a worker is: a number for its place, kept in its state folder, and one for each start.

use std::fs;
use std::io;
use std::path::Path;

use model::WorkerId;

use crate::RunError;

/// The file of the state folder that keeps the worker's number.
const FILE: &str = "worker";

/// The worker of a state folder, at a new start; without a folder, nobody seen before.
pub(crate) fn worker(state: Option<&Path>) -> Result<WorkerId, RunError> {
    let id = match state {
        None => draw()?,
        Some(state) => kept(state)?,
    };
    Ok(WorkerId {
        id,
        incarnation: draw()?,
    })
}

fn kept(state: &Path) -> Result<u64, RunError> {
    let failed = |attempted, path: &Path| {
        let path = path.to_owned();
        move |source| RunError::State {
            attempted,
            path,
            source,
        }
    };
    fs::create_dir_all(state).map_err(failed("make the folder", state))?;
    let path = state.join(FILE);
    match fs::read_to_string(&path) {
        Ok(text) => {
            if let Ok(id) = u64::from_str_radix(text.trim(), 16) {
                return Ok(id);
            }
            tracing::warn!(path = %path.display(), "the worker's number cannot be read: it gets a new one");
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(failed("read", &path)(error)),
    }
    let id = draw()?;
    fs::write(&path, format!("{id:016x}\n")).map_err(failed("write", &path))?;
    Ok(id)
}

/// A number that nobody has drawn before.
pub(crate) fn draw() -> Result<u64, RunError> {
    let mut bytes = [0; 8];
    getrandom::fill(&mut bytes).map_err(|error| RunError::Random(error.to_string()))?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_keeps_its_number_and_starts_anew() {
        let state = tempfile::tempdir().unwrap();
        let state = state.path().join("deep");
        let first = worker(Some(&state)).unwrap();
        let second = worker(Some(&state)).unwrap();
        assert_eq!(first.id, second.id);
        assert_ne!(first.incarnation, second.incarnation);
        fs::write(state.join(FILE), "what?").unwrap();
        assert_ne!(worker(Some(&state)).unwrap().id, first.id);
    }
}
