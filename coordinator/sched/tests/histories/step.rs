//! What may happen to a scheduler, at random.

use model::{Rect, Span};
use proptest::prelude::*;
use proptest::sample::Index;
use sched::{Command, Needs, TileShape};

/// One thing that happens; an index picks among what there is at that moment.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    Submit {
        images: u32,
        tiles: TileShape,
        revision: u32,
        priority: i32,
        share: u32,
        needs: Needs,
        after: Option<Index>,
    },
    Command(Index, Wish),
    /// A worker dials, and still holds those of its attempts that are picked.
    Join {
        worker: u64,
        held: u64,
    },
    LinkBreaks(u64),
    Credit {
        worker: u64,
        credit: u32,
    },
    Heartbeat(u64),
    /// A block of some attempt that was ever leased, sent by its worker.
    Block {
        attempt: Index,
        block: Index,
        pixels: u8,
    },
    /// All blocks of it.
    Tile(Index),
    Fails(Index),
    GivesBack(Index),
    Goodbye(u64),
    Encoded(Index),
    ImageFails(Index),
    Wait(u64),
    /// Something that was told before is told again.
    Again(Index),
}

/// What a user wants; an index picks an image.
#[derive(Clone, Debug)]
pub(crate) enum Wish {
    Just(Command),
    Again(Index),
}

pub(crate) fn step() -> impl Strategy<Value = Step> {
    let worker = 0..4_u64;
    let index = any::<Index>;
    let pixels = prop_oneof![19 => Just(1), 1 => Just(2)];
    prop_oneof![
        2 => submit(),
        4 => (index(), wish()).prop_map(|(job, wish)| Step::Command(job, wish)),
        6 => (worker.clone(), any::<u64>()).prop_map(|(worker, held)| Step::Join { worker, held }),
        3 => worker.clone().prop_map(Step::LinkBreaks),
        8 => (worker.clone(), 0..5_u32).prop_map(|(worker, credit)| Step::Credit { worker, credit }),
        6 => worker.clone().prop_map(Step::Heartbeat),
        20 => (index(), index(), pixels).prop_map(|(attempt, block, pixels)| {
            Step::Block { attempt, block, pixels }
        }),
        20 => index().prop_map(Step::Tile),
        3 => index().prop_map(Step::Fails),
        3 => index().prop_map(Step::GivesBack),
        1 => worker.prop_map(Step::Goodbye),
        4 => index().prop_map(Step::Encoded),
        1 => index().prop_map(Step::ImageFails),
        6 => (0..3_000_u64).prop_map(Step::Wait),
        1 => (0..400_000_u64).prop_map(Step::Wait),
        6 => index().prop_map(Step::Again),
    ]
}

fn wish() -> impl Strategy<Value = Wish> {
    let just = |command| Just(Wish::Just(command));
    prop_oneof![
        just(Command::Pause),
        just(Command::Resume),
        just(Command::Cancel),
        just(Command::Retry),
        just(Command::Remove),
        just(Command::Focus(None)),
        (0..60_u32, 0..40_u32).prop_map(|(x0, y0)| {
            let focus = Rect {
                x0,
                y0,
                x1: x0 + 9,
                y1: y0 + 9,
            };
            Wish::Just(Command::Focus(Some(focus)))
        }),
        (-1..2).prop_map(|priority| Wish::Just(Command::Priority(priority))),
        (0..3_u32).prop_map(|share| Wish::Just(Command::Share(share))),
        any::<Index>().prop_map(Wish::Again),
    ]
}

fn shape() -> impl Strategy<Value = TileShape> {
    let size = (10..70_u32, 10..70_u32);
    prop_oneof![
        size.prop_map(|(width, height)| TileShape::Size { width, height }),
        (0..100_000_u64).prop_map(|micros| TileShape::Time {
            aim: Some(Span(micros))
        }),
        Just(TileShape::Time { aim: None }),
        Just(TileShape::Rule {
            min_tile_pixels: Some(500)
        }),
    ]
}

fn needs() -> impl Strategy<Value = Needs> {
    let labels = prop_oneof![3 => Just(None), 1 => Just(Some("fast".to_owned()))];
    (labels, 0..3_u32, 0..2_u64).prop_map(|(label, threads, memory_bytes)| Needs {
        labels: label.into_iter().collect(),
        threads,
        memory_bytes,
    })
}

fn submit() -> impl Strategy<Value = Step> {
    let after = prop::option::weighted(0.2, any::<Index>());
    let rank = (0..2_u32, -1..2_i32, 1..4_u32);
    (1..4_u32, shape(), rank, needs(), after).prop_map(|(images, tiles, rank, needs, after)| {
        let (revision, priority, share) = rank;
        Step::Submit {
            images,
            tiles,
            revision,
            priority,
            share,
            needs,
            after,
        }
    })
}
