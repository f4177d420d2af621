//! How long an allocation may run: as the site says, else as long as its queue lets those run that do not ask; longer where
//! that is no use, since no block would be done in it (thesis §C.5: nobody has to guess `h_rt`).

use model::Span;

/// An allocation runs for so many times what the dearest block takes…
const FACTOR: u64 = 2;

/// …and so much for its start and its end.
const BESIDE: Span = Span::from_secs(60);

/// How often the usual time is doubled, at most, while nothing was measured.
const DOUBLED_MAX: u32 = 10;

/// What the site and its queue say.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Times {
    /// By the site's word.
    pub asked: Option<Span>,
    /// What the queue gives those who ask for nothing.
    pub usual: Option<Span>,
    /// The queue's own limit.
    pub most: Option<Span>,
}

impl Times {
    /// How long an allocation asks for, where the dearest block that was measured took so long, and so many in a row have ended
    /// before anything was; `None`: no limit.
    pub(super) fn limit(&self, dearest: Span, barren: u32) -> Option<Span> {
        let limit = self.asked.or_else(|| {
            let longer = self.usual?.times(1 << barren.min(DOUBLED_MAX));
            Some(longer.max(needed(dearest)))
        });
        match (limit, self.most) {
            (Some(limit), Some(most)) => Some(limit.min(most)),
            (limit, _) => limit,
        }
    }

    /// What to say where not even the longest that may be asked for is long enough.
    pub(super) fn too_short(&self, dearest: Span) -> Option<String> {
        let seconds = |span: Span| span.0.div_ceil(1_000_000);
        let limit = self.limit(dearest, DOUBLED_MAX)?;
        let is_short = limit < dearest.times(FACTOR);
        is_short.then(|| {
            let next = match self.asked {
                Some(asked) if self.most.is_none_or(|most| asked < most) => {
                    "raise the site's `time_limit`"
                }
                _ => "name another `queue`, which lets allocations run for longer",
            };
            format!(
                "an allocation runs for {} s, and the dearest block took {} s: {next}",
                seconds(limit),
                seconds(dearest)
            )
        })
    }
}

/// What an allocation needs for one block.
fn needed(dearest: Span) -> Span {
    match dearest {
        Span(0) => Span(0),
        some => some.times(FACTOR) + BESIDE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn minutes(count: u64) -> Span {
        Span::from_secs(60 * count)
    }

    #[test]
    fn the_site_s_word_counts_and_else_what_a_block_needs() {
        let queue = Times {
            asked: None,
            usual: Some(minutes(10)),
            most: Some(minutes(60)),
        };
        assert_eq!(queue.limit(Span(0), 0), Some(minutes(10)));
        assert_eq!(queue.limit(minutes(4), 0), Some(minutes(10)));
        assert_eq!(queue.limit(minutes(20), 0), Some(minutes(41)));
        assert_eq!(queue.limit(minutes(50), 0), Some(minutes(60)));
        // Nobody knows yet what a block takes.
        let longer = [1, 2, 3, 99].map(|barren| queue.limit(Span(0), barren));
        assert_eq!(longer, [20, 40, 60, 60].map(|count| Some(minutes(count))));
        let asked = Times {
            asked: Some(minutes(5)),
            ..queue
        };
        assert_eq!(asked.limit(minutes(20), 3), Some(minutes(5)));
        assert_eq!(Times::default().limit(minutes(20), 3), None);
    }

    #[test]
    fn what_is_too_short_for_one_block_is_said() {
        let times = Times {
            asked: Some(minutes(5)),
            usual: None,
            most: Some(minutes(60)),
        };
        assert_eq!(times.too_short(Span(0)), None);
        assert_eq!(times.too_short(minutes(2)), None);
        let said = times.too_short(minutes(3)).unwrap();
        assert!(
            said.contains("300 s") && said.contains("180 s") && said.contains("`time_limit`"),
            "{said}"
        );
        let queue = Times {
            asked: None,
            usual: Some(minutes(5)),
            ..times
        };
        assert_eq!(queue.too_short(minutes(30)), None);
        assert!(
            queue
                .too_short(minutes(31))
                .unwrap()
                .contains("another `queue`")
        );
    }
}
