//! Sites: clusters with a queue of their own (Slurm, Grid Engine), plain ssh hosts, this machine.
//!
//! It blocks, on threads that others give it, and it knows no farm: it reads `sites.toml`, gives a queue
//! arrays of allocations, says what became of them, and decides how many there should be.
//!
//! - [`sites`]: what `sites.toml` says of each site, and what is wrong with the file.
//! - [`way`]: scripts run at a site, here or over the system's ssh; every one has limits of time and output.
//! - [`queue`]: what all queues have in common; `slurm`, `gridengine` and `processes` are the kinds. Each makes
//!   scripts and reads what they print; both are pure, and tested with what real engines said.
//! - `template`: the scripts of `deploy/`, and how values are put into them.
//! - [`camp`]: what one farm has at one site.
//! - [`survey`]: what a site is like, for `flyby site check`; [`install`]: the program brought there.
//! - [`pilot`]: how many allocations a site should have, a function of what was seen.
//! - [`orders`]: what the coordinator and `flyby site-agent` on a login node say to each other in poll mode;
//!   [`poll`]: which arrays a polled site should have, a function of what was seen; [`busy`]: whether a slot was free meanwhile.
//!
//! `tests/clusters` shows it whole on real engines.

pub mod busy;
pub mod camp;
mod error;
mod gridengine;
pub mod install;
pub mod orders;
pub mod pilot;
pub mod poll;
mod processes;
pub mod queue;
pub mod sites;
mod slurm;
pub mod survey;
mod tasks;
mod template;
pub mod way;
mod words;

pub use camp::Camp;
pub use error::{ClusterError, Refusal};
pub use queue::{About, Array, Limits, Queue, Task, TaskId, TaskState};
pub use sites::{Cancelled, Kind, Mode, Site, Sites, SitesError};
pub use way::Way;
