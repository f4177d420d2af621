//! How a polled site joins the farm: as one worker, with what it still has of before.

use cluster::poll::ARRAY_TASKS;
use model::{Span, WorkerId};
use sched::Queue;
use tokio::sync::oneshot;

use super::line::{Cut, Hello, Line};
use super::{MISSED_MAX, Poller, Trouble, slots};
use crate::input::{AboutWorker, Input, Query};

/// How late what is heard of a task may be, beside the polls that may be missed: file systems of clusters tell a login node
/// late, and each miss takes a while by itself.
const SLACK: Span = Span::from_secs(120);

/// Most threads that are told to the scheduler.
const THREADS_MAX: u32 = 4_096;

impl Poller<'_> {
    /// Joins the farm, with what the site still has of before.
    pub(super) fn connect(&mut self) -> Result<(), Trouble> {
        let site = &self.errand.camp.site;
        let seen = self.desk.see(&self.poll)?;
        self.scenes.are(&seen.files);
        let begun = self.poll.takes_up(&seen);
        let slots = slots(site, &self.limits).unwrap_or(1);
        let array_max = [site.max_array_size, self.limits.array_tasks];
        let array_max = array_max.into_iter().flatten().min();
        let hello = Hello {
            worker: self.worker(),
            revision: self.errand.revision,
            threads: slots.saturating_mul(site.threads).clamp(1, THREADS_MAX),
            queue: Queue {
                min_tile_pixels: site.min_tile_pixels,
                max_array_size: array_max.map_or(ARRAY_TASKS.into(), u64::from),
                lag: site.poll.times(u64::from(MISSED_MAX) + 1) + SLACK,
                patience: site.patience,
            },
            about: AboutWorker {
                name: site.label(),
                build: String::new(),
                simd_level: String::new(),
                memory_bytes: site.memory_bytes.unwrap_or(0),
                labels: site.labels.iter().cloned().chain([site.label()]).collect(),
                time_left: None,
            },
            held: self.poll.held(),
            begun,
        };
        let (inputs, gates) = (self.errand.inputs.clone(), self.errand.gates.clone());
        let (line, live) = Line::open(hello, inputs, gates, self.errand.runtime.clone())?;
        self.poll.keeps(&live);
        // Others may have brought some of it, or a coordinator that was here before.
        let (reply, answer) = oneshot::channel();
        let query = Query::Missing(line.worker(), self.poll.held(), reply);
        let asked = self.errand.inputs.blocking_send(Input::Ask(query));
        asked.map_err(|_| Cut::Stopping)?;
        let Ok(Ok(missing)) = answer.blocking_recv() else {
            return Err(Cut::Stopping.into());
        };
        for (attempt, missing) in missing {
            self.poll.lacks(attempt, &missing);
        }
        self.line = Some(line);
        self.credit = 0;
        self.wants()
    }

    /// The same process for as long as this coordinator runs.
    fn worker(&self) -> WorkerId {
        let digest = blake3::hash(self.errand.camp.prefix().as_bytes());
        let mut id = [0; 8];
        id.copy_from_slice(&digest.as_bytes()[..8]);
        WorkerId {
            id: u64::from_le_bytes(id),
            incarnation: self.errand.epoch.0,
        }
    }
}
