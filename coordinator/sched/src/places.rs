//! Some of a job's images, as the stretches of its frame range that they fill.

use alloc::collections::BTreeMap;

/// Places in a frame range; a million in a row cost as much as one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    /// First place of each stretch, and one past its last. No two touch.
    stretches: BTreeMap<u32, u32>,
    count: u32,
}

impl Places {
    /// The places below `count`.
    pub(crate) fn all(count: u32) -> Self {
        let mut places = Self::default();
        if count > 0 {
            places.stretches.insert(0, count);
            places.count = count;
        }
        places
    }

    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    pub(crate) fn first(&self) -> Option<u32> {
        self.stretches.first_key_value().map(|(&start, _)| start)
    }

    pub(crate) fn contains(&self, place: u32) -> bool {
        let before = self.stretches.range(..=place).next_back();
        before.is_some_and(|(_, &end)| place < end)
    }

    pub(crate) fn insert(&mut self, place: u32) {
        if self.contains(place) {
            return;
        }
        let before = self.stretches.range(..place).next_back();
        let start = before.filter(|&(_, &end)| end == place);
        let start = start.map_or(place, |(&start, _)| start);
        let end = self.stretches.remove(&(place + 1)).unwrap_or(place + 1);
        self.stretches.insert(start, end);
        self.count += 1;
    }

    pub(crate) fn remove(&mut self, place: u32) {
        let before = self.stretches.range(..=place).next_back();
        let Some((start, end)) = before.map(|(&start, &end)| (start, end)) else {
            return;
        };
        if place >= end {
            return;
        }
        self.stretches.remove(&start);
        if start < place {
            self.stretches.insert(start, place);
        }
        if place + 1 < end {
            self.stretches.insert(place + 1, end);
        }
        self.count -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::collections::BTreeSet;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn is_a_set(
            count in 0_u32..20,
            steps in prop::collection::vec((any::<bool>(), 0_u32..20), 0..60),
        ) {
            let mut places = Places::all(count);
            let mut model: BTreeSet<u32> = (0..count).collect();
            for (adds, place) in steps {
                if adds {
                    places.insert(place);
                    model.insert(place);
                } else {
                    places.remove(place);
                    model.remove(&place);
                }
                prop_assert_eq!(places.count() as usize, model.len());
                prop_assert_eq!(places.first(), model.first().copied());
                for place in 0..20 {
                    prop_assert_eq!(places.contains(place), model.contains(&place));
                }
                let stretches: alloc::vec::Vec<_> = places.stretches.iter().collect();
                prop_assert!(stretches.windows(2).all(|pair| pair[0].1 < pair[1].0));
            }
        }
    }
}
