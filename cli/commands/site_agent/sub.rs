//! `flyby site-agent sub`: an order becomes an array.

use std::fs;
use std::path::Path;

use cluster::orders::{Order, Submit, task_script};
use cluster::{Array, Camp, ClusterError};

use super::folder::{Folder, cannot, sync_parent, write};
use super::queue;
use crate::error::Error;

/// Submits an order, once however often it is asked for; answers the queue's number.
pub(super) fn submit(folder: &Folder, request: Submit) -> Result<String, Error> {
    let Submit { there, order } = request;
    there
        .put_template(folder.root())
        .map_err(queue("cannot use the site"))?;
    let camp = there.camp(folder.root());
    let place = folder.array(&order.name)?;
    if let Some(id) = folder.id(&order.name)? {
        return Ok(id);
    }
    if place.exists() {
        // Whoever wrote it was cut off, before or after the queue took it.
        let shown = camp.queue.list(&camp.prefix());
        let shown = shown.map_err(queue("cannot ask the queue"))?;
        if let Some(task) = shown.iter().find(|task| task.name == order.name) {
            return note(&place, &task.id.array);
        }
    } else {
        put(&place, &order)?;
    }
    match hand_over(&camp, &order) {
        Ok(id) => note(&place, &id),
        Err(error) => {
            // What may have been taken nevertheless stays, and the next look finds it by its name.
            if !error.may_pass() {
                fs::remove_dir_all(&place).map_err(cannot("remove", &place))?;
            }
            Err(queue("cannot submit an array")(error))
        }
    }
}

/// Writes an order into a folder of its own, whole or not at all.
fn put(place: &Path, order: &Order) -> Result<(), Error> {
    let fresh = place.with_file_name(format!(".{}.{}", order.name, std::process::id()));
    let text = serde_json::to_vec(order)
        .map_err(|error| Error::failed("cannot write the order").because(error))?;
    fs::create_dir(&fresh).map_err(cannot("make", &fresh))?;
    let put = write(&fresh.join("order.json"), &text).and_then(|()| {
        let moved = fs::rename(&fresh, place).and_then(|()| sync_parent(place));
        moved.map_err(cannot("make", place))
    });
    if put.is_err() {
        // Where there is no room, what is left of it would take some.
        let _ = fs::remove_dir_all(&fresh);
    }
    put
}

fn hand_over(camp: &Camp, order: &Order) -> Result<String, ClusterError> {
    camp.trim_logs()?;
    let array = Array {
        name: order.name.clone(),
        tasks: u32::try_from(order.tasks.len()).unwrap_or(u32::MAX),
        running_max: order.running_max,
        script: task_script(camp, order),
        time_limit: order.time_limit,
        log: camp.log(&order.name),
    };
    camp.queue.submit(&array).map(|id| id.array)
}

/// Notes that the queue took it.
fn note(place: &Path, id: &str) -> Result<String, Error> {
    write(&place.join("id"), id.as_bytes())?;
    Ok(id.to_owned())
}
