//! `flyby site-agent del` and `rm`: arrays end, and what is left of them goes.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use cluster::TaskId;
use cluster::orders::{Delete, Remove};

use super::folder::{Folder, cannot};
use super::queue;
use crate::error::Error;

/// Ends arrays or tasks, by name: whatever the queue shows under it.
pub(super) fn delete(folder: &Folder, request: Delete) -> Result<(), Error> {
    let camp = request.there.camp(folder.root());
    let shown = camp.queue.list(&camp.prefix());
    let shown = shown.map_err(queue("cannot ask the queue"))?;
    let live = shown.iter().filter(|task| task.state.is_live());
    let ids: BTreeMap<_, _> = live.map(|task| (&task.name, &task.id.array)).collect();
    let tasks = request.tasks.iter().filter_map(|(name, task)| {
        let array = ids.get(name)?.to_owned().clone();
        Some(TaskId { array, task: *task })
    });
    let tasks: Vec<_> = tasks.collect();
    let deleted = camp.queue.delete(&tasks);
    deleted.map_err(queue("cannot end what nobody needs"))
}

/// Removes arrays and scenes that nobody needs.
pub(super) fn remove(folder: &Folder, request: &Remove) -> Result<(), Error> {
    for name in &request.arrays {
        let path = folder.array(name)?;
        is_gone(&path, fs::remove_dir_all(&path))?;
    }
    for digest in &request.files {
        let path = folder.scene(digest)?;
        is_gone(&path, fs::remove_file(&path))?;
    }
    Ok(())
}

fn is_gone(path: &Path, removed: io::Result<()>) -> Result<(), Error> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed.map_err(cannot("remove", path)),
    }
}
