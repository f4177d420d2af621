//! A few large results kept for whoever asks next: the same recipe or file serves every image.

use std::sync::{Arc, Mutex, PoisonError};

/// The last results, by name; the oldest goes when there are too many.
#[derive(Debug)]
pub struct Kept<K, V> {
    most: usize,
    entries: Mutex<Vec<(K, Arc<V>)>>,
}

impl<K: PartialEq, V> Kept<K, V> {
    /// Keeps at most `most` results.
    pub const fn new(most: usize) -> Self {
        Self {
            most,
            entries: Mutex::new(Vec::new()),
        }
    }

    /// The result of that name, made now if it is not kept. Two who ask at once may both make it.
    pub fn get<E>(&self, name: K, make: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        if let Some(known) = self.find(&name) {
            return Ok(known);
        }
        let made = Arc::new(make()?);
        // What a thread that panicked left here is whole: entries are pushed and removed at once.
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        while entries.len() >= self.most.max(1) {
            entries.remove(0);
        }
        entries.push((name, made.clone()));
        Ok(made)
    }

    fn find(&self, name: &K) -> Option<Arc<V>> {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let place = entries.iter().position(|(known, _)| known == name)?;
        let entry = entries.remove(place);
        let found = entry.1.clone();
        entries.push(entry);
        Some(found)
    }
}
