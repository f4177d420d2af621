//! Which versions of the protocol two sides can speak.

/// Lowest protocol version that this program speaks.
pub const PROTOCOL_MIN: u32 = 1;

/// Highest protocol version that this program speaks.
pub const PROTOCOL_MAX: u32 = 1;

/// The highest version that both sides speak; `None` if there is none.
///
/// `theirs` is the other side's lowest and highest version, this program's are
/// [`PROTOCOL_MIN`] and [`PROTOCOL_MAX`].
pub fn agree(theirs: core::ops::RangeInclusive<u32>) -> Option<u32> {
    let highest = PROTOCOL_MAX.min(*theirs.end());
    (highest >= PROTOCOL_MIN.max(*theirs.start())).then_some(highest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_common_version_wins() {
        assert_eq!(agree(PROTOCOL_MIN..=PROTOCOL_MAX), Some(PROTOCOL_MAX));
        assert_eq!(agree(0..=PROTOCOL_MAX + 5), Some(PROTOCOL_MAX));
        assert_eq!(agree(PROTOCOL_MAX + 1..=PROTOCOL_MAX + 5), None);
        assert_eq!(agree(0..=PROTOCOL_MIN - 1), None);
    }
}
