//! How each site stands, for whoever asks.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex, PoisonError};

use cluster::Site;
use wire::proto::SiteStatus;

/// Shared by the sites' threads, which write, and whoever asks. Nobody holds it for longer than a copy takes.
#[derive(Clone, Debug)]
pub(crate) struct Board(Arc<Mutex<Vec<SiteStatus>>>);

impl Board {
    pub(crate) fn new(sites: &[Site]) -> Self {
        let status = |site: &Site| SiteStatus {
            name: site.name.clone(),
            kind: site.kind.name().to_owned(),
            address: site.address.clone().unwrap_or_default(),
            mode: site.mode.name().to_owned(),
            ..SiteStatus::default()
        };
        Self(Arc::new(Mutex::new(sites.iter().map(status).collect())))
    }

    pub(crate) fn all(&self) -> Vec<SiteStatus> {
        let sites = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        sites.clone()
    }

    /// Changes what is known of one.
    pub(crate) fn change(&self, name: &str, change: impl FnOnce(&mut SiteStatus)) {
        let mut sites = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(site) = sites.iter_mut().find(|site| site.name == name) {
            change(site);
        }
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
