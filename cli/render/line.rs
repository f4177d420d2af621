//! Which block a thread renders next: one image at a time, the next one begun early enough
//! that no thread waits at an image's end, and the last one's blocks cut so that all end at about the same time.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use model::{ImageNumber, Rect};

/// Images waiting to be rendered, and the blocks left of those begun.
///
/// `W` is whatever a thread needs to render a block of an image. Each block handed out
/// holds it; whoever gives back the last one gets it back for good.
pub(super) struct Line<W> {
    state: Mutex<State<W>>,
    changed: Condvar,
    /// The next image is begun when no more blocks than threads are left to start.
    threads: usize,
}

struct State<W> {
    waiting: VecDeque<ImageNumber>,
    open: VecDeque<Open<W>>,
    opening: bool,
    closed: bool,
}

struct Open<W> {
    work: Arc<W>,
    blocks: VecDeque<Rect>,
    /// Blocks of no more pixels are not cut.
    least: u64,
}

/// What a thread does next.
pub(super) enum Next<W> {
    /// Begin this image, then tell the line by [`Line::opened`].
    Open(ImageNumber),
    /// Render this block, then drop or take back the work by [`last`].
    Block(Arc<W>, Rect),
    /// Nothing is left to start.
    End,
}

/// The work itself, for whoever held it last.
pub(super) fn last<W>(work: Arc<W>) -> Option<W> {
    Arc::into_inner(work)
}

impl<W> Line<W> {
    /// A line of images for so many threads.
    pub(super) fn new(images: impl IntoIterator<Item = ImageNumber>, threads: usize) -> Self {
        Self {
            state: Mutex::new(State {
                waiting: images.into_iter().collect(),
                open: VecDeque::new(),
                opening: false,
                closed: false,
            }),
            changed: Condvar::new(),
            threads,
        }
    }

    /// What to do next; waits while another thread begins the only image that is left.
    pub(super) fn next(&self) -> Next<W> {
        let mut state = self.state();
        loop {
            if state.closed {
                return Next::End;
            }
            let left: usize = state.open.iter().map(|open| open.blocks.len()).sum();
            if left <= self.threads
                && !state.opening
                && let Some(image) = state.waiting.pop_front()
            {
                state.opening = true;
                return Next::Open(image);
            }
            if let Some((work, block)) = state.pop(self.threads) {
                return Next::Block(work, block);
            }
            if !state.opening {
                return Next::End;
            }
            state = self
                .changed
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Takes an image that was begun, with the blocks to render, which may be cut into [halves](Rect::halves) until they have no more than
    /// `least` pixels; returns the work where there are none.
    pub(super) fn opened(&self, work: W, blocks: Vec<Rect>, least: u64) -> Option<W> {
        let mut state = self.state();
        state.opening = false;
        self.changed.notify_all();
        if blocks.is_empty() {
            return Some(work);
        }
        state.open.push_back(Open {
            work: Arc::new(work),
            blocks: blocks.into(),
            least,
        });
        None
    }

    /// Whether no block of any image waits to be started.
    pub(super) fn is_idle(&self) -> bool {
        self.state().open.is_empty()
    }

    /// Whether nothing is left to start.
    pub(super) fn is_empty(&self) -> bool {
        let state = self.state();
        state.waiting.is_empty() && state.open.is_empty() && !state.opening
    }

    /// Hands out nothing more, and forgets what was not started.
    pub(super) fn close(&self) {
        let mut state = self.state();
        state.closed = true;
        state.open.clear();
        self.changed.notify_all();
    }

    fn state(&self) -> MutexGuard<'_, State<W>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<W> State<W> {
    /// The next block of the earliest image; an image with none left is let go.
    ///
    /// Where nothing comes after, it is no more than each of the threads may take twice.
    fn pop(&mut self, threads: usize) -> Option<(Arc<W>, Rect)> {
        let share = self.left() / (2 * threads as u64);
        let is_last = self.waiting.is_empty() && !self.opening && threads > 1;
        let front = self.open.front_mut()?;
        let mut block = front.blocks.pop_front()?;
        let most = if is_last {
            share.max(front.least)
        } else {
            block.area()
        };
        while block.area() > most {
            let [first, second] = block.halves();
            front.blocks.push_front(second);
            block = first;
        }
        if front.blocks.is_empty() {
            let open = self.open.pop_front()?;
            return Some((open.work, block));
        }
        Some((Arc::clone(&front.work), block))
    }

    /// Pixels that are left to start.
    fn left(&self) -> u64 {
        let blocks = self.open.iter().flat_map(|open| &open.blocks);
        blocks.map(|block| block.area()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

    fn blocks(number: u32) -> Vec<Rect> {
        let strip = Rect {
            x0: 0,
            y0: 0,
            x1: 32 * number,
            y1: 32,
        };
        strip.blocks().collect()
    }

    #[test]
    fn every_block_once_and_every_image_taken_back_once() {
        for threads in [1, 2, 7] {
            let line = Line::new((0..5).map(ImageNumber), threads);
            let (rendered, finished) = (AtomicU64::new(0), AtomicUsize::new(0));
            std::thread::scope(|scope| {
                for _ in 0..threads {
                    scope.spawn(|| {
                        loop {
                            let done = match line.next() {
                                Next::End => return,
                                // Image 3 has nothing left to render.
                                Next::Open(image) if image.0 == 3 => line.opened(image, vec![], 1),
                                Next::Open(image) => line.opened(image, blocks(9), 100),
                                Next::Block(work, block) => {
                                    rendered.fetch_add(block.area(), Ordering::Relaxed);
                                    last(work)
                                }
                            };
                            if done.is_some() {
                                finished.fetch_add(1, Ordering::Relaxed);
                            }
                        }
                    });
                }
            });
            assert_eq!(rendered.into_inner(), 4 * 9 * 32 * 32);
            assert_eq!(finished.into_inner(), 5);
        }
    }

    #[test]
    fn the_next_image_is_begun_before_the_last_blocks_are_out() {
        let line = Line::new((0..2).map(ImageNumber), 2);
        let Next::Open(first) = line.next() else {
            panic!("an image must be begun first")
        };
        assert!(line.opened(first, blocks(4), 1).is_none());
        let kinds: Vec<bool> = (0..3)
            .map(|_| matches!(line.next(), Next::Open(_)))
            .collect();
        assert_eq!(kinds, [false, false, true]);
        assert!(!line.is_empty());
        for _ in 0..2 {
            let Next::Block(..) = line.next() else {
                panic!("a block is left")
            };
        }
        assert!(!line.is_empty());
        assert!(line.opened(ImageNumber(1), vec![], 1).is_some());
        assert!(line.is_empty());
    }

    #[test]
    fn the_last_image_s_last_blocks_are_cut() {
        for (threads, last) in [(1, 1024), (2, 32)] {
            let line = Line::new((0..2).map(ImageNumber), threads);
            let mut areas = [Vec::new(), Vec::new()];
            loop {
                match line.next() {
                    Next::End => break,
                    Next::Open(image) => {
                        assert!(line.opened(image, blocks(9), 33).is_none());
                    }
                    Next::Block(image, block) => areas[image.0 as usize].push(block.area()),
                }
            }
            assert_eq!(areas[0], [1024; 9], "more comes after them");
            assert_eq!(areas[1].iter().sum::<u64>(), 9 * 1024);
            assert_eq!(areas[1].first(), Some(&1024));
            assert_eq!(areas[1].last(), Some(&last), "{areas:?}");
        }
    }

    #[test]
    fn a_closed_line_ends() {
        let line = Line::new((0..2).map(ImageNumber), 1);
        assert!(matches!(line.next(), Next::Open(_)));
        assert!(line.opened((), blocks(4), 1).is_none());
        line.close();
        assert!(matches!(line.next(), Next::End));
    }
}
