//! How each site stands and how busy it was, for whoever asks.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex, PoisonError};

use cluster::Site;
use cluster::busy::{Look, Looks};
use wire::proto::{SiteLook, SiteLooks, SiteStatus};

/// Shared by the sites' threads, which write, and whoever asks. Nobody holds it for longer than a copy takes.
#[derive(Clone, Debug)]
pub(crate) struct Board(Arc<Mutex<Vec<Known>>>);

/// What is known of a site.
#[derive(Debug)]
struct Known {
    status: SiteStatus,
    /// By the site's word.
    ahead: u32,
    /// Tasks that may run at a time; 0 where nobody says.
    slots: u32,
    looks: Looks,
}

impl Board {
    pub(crate) fn new(sites: &[Site]) -> Self {
        let known = |site: &Site| Known {
            status: SiteStatus {
                name: site.name.clone(),
                kind: site.kind.name().to_owned(),
                address: site.address.clone().unwrap_or_default(),
                mode: site.mode.name().to_owned(),
                ..SiteStatus::default()
            },
            ahead: site.ahead,
            slots: 0,
            looks: Looks::default(),
        };
        Self(Arc::new(Mutex::new(sites.iter().map(known).collect())))
    }

    pub(crate) fn all(&self) -> Vec<SiteStatus> {
        let sites = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        sites.iter().map(|site| site.status.clone()).collect()
    }

    /// Changes how one stands.
    pub(crate) fn change(&self, name: &str, change: impl FnOnce(&mut SiteStatus)) {
        self.of(name, |site| change(&mut site.status));
    }

    /// So many tasks may run there at a time, where anybody says.
    pub(crate) fn has_slots(&self, name: &str, slots: Option<u32>) {
        self.of(name, |site| site.slots = slots.unwrap_or(0));
    }

    /// Its queue was looked at.
    pub(crate) fn saw(&self, name: &str, look: Look) {
        self.of(name, |site| {
            site.status.asked_unix_ms = look.at_unix_ms;
            site.looks.saw(look);
        });
    }

    /// How busy one was; `None` where there is no such site.
    pub(crate) fn looks(&self, name: &str) -> Option<SiteLooks> {
        self.of(name, |site| SiteLooks {
            slots: site.slots,
            ahead: site.ahead,
            looks: site.looks.iter().map(message).collect(),
        })
    }

    fn of<T>(&self, name: &str, ask: impl FnOnce(&mut Known) -> T) -> Option<T> {
        let mut sites = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let site = sites.iter_mut().find(|site| site.status.name == name);
        site.map(ask)
    }

    /// What to say of the sites to somebody whose job waits for workers; empty where there are none.
    pub(crate) fn sentences(&self) -> String {
        let mut text = String::new();
        for site in self.all() {
            let name = &site.name;
            let _ = match (site.trouble.as_str(), site.waiting, site.running) {
                ("", 0, 0) if site.asked_unix_ms == 0 => {
                    write!(text, "; site {name} was not asked yet")
                }
                ("", waiting, running) => write!(
                    text,
                    "; at site {name} {running} allocations run and {waiting} wait in the queue"
                ),
                (trouble, ..) => write!(text, "; site {name}: {trouble}"),
            };
        }
        text
    }
}

fn message(look: &Look) -> SiteLook {
    SiteLook {
        at_unix_ms: look.at_unix_ms,
        running: look.running,
        waiting: look.waiting,
        submitted: look.submitted,
        has_more: look.has_more,
    }
}
