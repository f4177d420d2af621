//! Calls of `flyby site-agent` at a site.

use std::collections::BTreeSet;

use cluster::camp::Camp;
use cluster::orders::{Delete, End, Frame, Look, Order, Remove, Seen, Submit, There, call};
use cluster::poll::Poll;
use cluster::{ClusterError, way};
use model::Span;
use serde::Serialize;
use wire::proto::Delivery;
use wire::spool::{self, Entry};

/// How long a call that brings blocks may take: 16 MiB over a slow line.
const FETCH_LIMIT: Span = Span::from_secs(600);

/// The agent of a site.
pub(super) struct Desk<'a> {
    camp: &'a Camp,
    there: There,
}

/// What a look gave.
pub(super) struct Looked {
    /// How everything stands; `None` where not even that has arrived.
    pub(super) seen: Option<Seen>,
    /// Blocks that arrived whole, in the order in which they stand in their files.
    pub(super) blocks: Vec<Fetched>,
    /// Whether there is more, or why not all has arrived.
    pub(super) end: Result<End, ClusterError>,
}

/// An entry of a task's file.
pub(super) struct Fetched {
    pub(super) array: String,
    pub(super) task: u32,
    /// Where it ends in the file.
    pub(super) end: u64,
    /// How many bytes it has; none where it was not wanted.
    pub(super) bytes: u64,
    /// The block; `None` where it was damaged or not wanted.
    pub(super) delivery: Option<Delivery>,
}

impl<'a> Desk<'a> {
    pub(super) fn new(camp: &'a Camp) -> Result<Self, ClusterError> {
        Ok(Self {
            there: There::of(camp)?,
            camp,
        })
    }

    /// Asks how everything stands, for somebody who cannot take blocks yet.
    pub(super) fn see(&self, poll: &Poll) -> Result<Seen, ClusterError> {
        let request = Look {
            there: self.there.clone(),
            known: poll.known(),
            wants: Vec::new(),
            room: false,
        };
        let attempt = "looking at arrays";
        let said = self.ask(attempt, "ls", &request)?;
        let line = said.lines().next().unwrap_or_default();
        serde_json::from_str(line).map_err(|error| nonsense(attempt, &error.to_string()))
    }

    /// Asks how everything stands, and for the blocks that are there and wanted, in one call.
    pub(super) fn look(&self, poll: &Poll) -> Result<Looked, ClusterError> {
        let wants = poll.wants();
        let request = Look {
            there: self.there.clone(),
            known: poll.known(),
            wants,
            room: poll.asks_for_room(),
        };
        let script = call(self.camp, "get", &request)?;
        let attempt = "looking at arrays";
        let (bytes, ended) = self.camp.way.fetch(attempt, &script, FETCH_LIMIT);
        let line = bytes.iter().position(|&byte| byte == b'\n');
        let Some(line) = line else {
            return match ended {
                Err(error) => Err(error),
                Ok(()) => Err(nonsense(attempt, "it has no first line")),
            };
        };
        let seen = serde_json::from_slice::<Seen>(&bytes[..line])
            .map_err(|error| nonsense(attempt, &error.to_string()))?;
        let mut rest = &bytes[line + 1..];
        let (mut blocks, mut end) = (Vec::new(), None);
        while let Some((frame, after)) = Frame::read(rest) {
            rest = after;
            end = frame.end();
            if end.is_some() {
                break;
            }
            let place = usize::try_from(frame.array).unwrap_or(usize::MAX);
            let Some(wants) = request.wants.get(place) else {
                return Err(nonsense(attempt, "it brings what nobody asked for"));
            };
            blocks.push(Fetched {
                array: wants.array.clone(),
                task: frame.task,
                end: frame.end,
                bytes: frame.entry.len() as u64,
                delivery: match spool::read(frame.entry) {
                    Entry::Block(delivery, _) => Some(*delivery),
                    Entry::Damaged(_) | Entry::End => None,
                },
            });
        }
        let end = match (ended, end) {
            (Err(error), _) => Err(error),
            (Ok(()), Some(end)) => Ok(end),
            (Ok(()), None) => Err(nonsense(attempt, "it is cut off")),
        };
        Ok(Looked {
            seen: Some(seen),
            blocks,
            end,
        })
    }

    pub(super) fn submit(&self, order: &Order) -> Result<String, ClusterError> {
        let request = Submit {
            there: self.there.clone(),
            order: order.clone(),
        };
        let id = self.ask(&format!("submitting {}", order.name), "sub", &request)?;
        Ok(id.trim().to_owned())
    }

    pub(super) fn delete(&self, tasks: Vec<(String, Option<u32>)>) -> Result<(), ClusterError> {
        let request = Delete {
            there: self.there.clone(),
            tasks,
        };
        self.ask("ending what nobody needs", "del", &request)
            .map(|_| ())
    }

    pub(super) fn remove(
        &self,
        arrays: Vec<String>,
        files: BTreeSet<String>,
    ) -> Result<(), ClusterError> {
        let request = Remove {
            arrays,
            files: files.into_iter().collect(),
        };
        self.ask("removing what nobody needs", "rm", &request)
            .map(|_| ())
    }

    fn ask(
        &self,
        attempt: &str,
        verb: &str,
        request: &impl Serialize,
    ) -> Result<String, ClusterError> {
        let script = call(self.camp, verb, request)?;
        let limit = way::LIMIT.times(2);
        let (bytes, ended) = self.camp.way.fetch(attempt, &script, limit);
        ended.map(|()| String::from_utf8_lossy(&bytes).into_owned())
    }
}

fn nonsense(attempt: &str, what: &str) -> ClusterError {
    ClusterError::Nonsense {
        attempt: attempt.to_owned(),
        what: what.to_owned(),
        said: String::new(),
    }
}
