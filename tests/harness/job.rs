//! A job as `flyby job show --output json` tells it.

use serde_json::Value;

/// A job at one instant.
#[derive(Debug)]
pub(crate) struct Job(pub(crate) Value);

impl Job {
    /// `running`, `done`, `failed` or `cancelled`.
    #[track_caller]
    pub(crate) fn state(&self) -> &str {
        self.0["state"]
            .as_str()
            .unwrap_or_else(|| panic!("no state: {self:?}"))
    }

    /// Whether it is over.
    #[track_caller]
    pub(crate) fn is_over(&self) -> bool {
        !matches!(self.state(), "running" | "paused")
    }

    /// One of its numbers.
    #[track_caller]
    pub(crate) fn number(&self, name: &str) -> u64 {
        self.0[name]
            .as_u64()
            .unwrap_or_else(|| panic!("no number `{name}`: {self:?}"))
    }

    /// The film digests of its images, in order; all must be done.
    #[track_caller]
    pub(crate) fn film_digests(&self) -> Vec<String> {
        let digest = |image: &Value| {
            let digest = image["film_digest"].as_str();
            digest
                .unwrap_or_else(|| panic!("an image without digest: {self:?}"))
                .to_owned()
        };
        self.images().iter().map(digest).collect()
    }

    /// Its images.
    #[track_caller]
    pub(crate) fn images(&self) -> &[Value] {
        let images = self.0["images"].as_array();
        images.unwrap_or_else(|| panic!("no images: {self:?}"))
    }
}
