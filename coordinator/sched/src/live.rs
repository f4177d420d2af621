//! Live attempts, by number.
//!
//! Numbers only grow, and most attempts live about as long as each other, so those that live lie close
//! together: a page of numbers is kept while one of them does.

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::ops::Index;

use crate::attempt::Attempt;

/// Numbers of one page.
const ROWS: usize = 256;
const PAGE: u64 = ROWS as u64;

/// The mark of a number that does not live.
const NONE: u32 = u32::MAX;

/// Live attempts. Looking one up costs the same however many there are.
#[derive(Clone, Debug, Default)]
pub(crate) struct Live {
    rows: Vec<Option<Attempt>>,
    free: Vec<u32>,
    /// The page of the oldest that lives, and those after it.
    pages: VecDeque<Option<Box<Page>>>,
    /// The number of the first page.
    first: u64,
    count: usize,
}

#[derive(Clone, Debug)]
struct Page {
    rows: [u32; ROWS],
    live: u32,
}

impl Live {
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    fn row(&self, number: u64) -> Option<u32> {
        let page = usize::try_from((number / PAGE).checked_sub(self.first)?).ok()?;
        let page = self.pages.get(page)?.as_ref()?;
        let row = page.rows[(number % PAGE) as usize];
        (row != NONE).then_some(row)
    }

    pub(crate) fn get(&self, number: u64) -> Option<&Attempt> {
        self.rows[self.row(number)? as usize].as_ref()
    }

    pub(crate) fn get_mut(&mut self, number: u64) -> Option<&mut Attempt> {
        let row = self.row(number)?;
        self.rows[row as usize].as_mut()
    }

    /// Adds an attempt with a number larger than that of any before it.
    pub(crate) fn insert(&mut self, number: u64, attempt: Attempt) {
        let row = match self.free.pop() {
            Some(row) => {
                self.rows[row as usize] = Some(attempt);
                row
            }
            None => {
                self.rows.push(Some(attempt));
                u32::try_from(self.rows.len() - 1).expect("attempts are limited by credit")
            }
        };
        if self.pages.is_empty() {
            self.first = number / PAGE;
        }
        let page = usize::try_from(number / PAGE - self.first).expect("pages fit into memory");
        if self.pages.len() <= page {
            self.pages.resize(page + 1, None);
        }
        let page = self.pages[page].get_or_insert_with(|| {
            Box::new(Page {
                rows: [NONE; ROWS],
                live: 0,
            })
        });
        page.rows[(number % PAGE) as usize] = row;
        page.live += 1;
        self.count += 1;
    }

    pub(crate) fn remove(&mut self, number: u64) -> Option<Attempt> {
        let row = self.row(number)?;
        let place = usize::try_from(number / PAGE - self.first).ok()?;
        if let Some(page) = &mut self.pages[place] {
            page.rows[(number % PAGE) as usize] = NONE;
            page.live -= 1;
            if page.live == 0 {
                self.pages[place] = None;
            }
        }
        while let Some(None) = self.pages.front() {
            self.pages.pop_front();
            self.first += 1;
        }
        self.free.push(row);
        self.count -= 1;
        self.rows[row as usize].take()
    }

    /// In the order of their numbers.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u64, &Attempt)> {
        let pages = (self.first..).zip(&self.pages);
        let pages = pages.filter_map(|(number, page)| Some((number, page.as_ref()?)));
        pages.flat_map(move |(number, page)| {
            let rows = (number * PAGE..).zip(&page.rows);
            rows.filter_map(|(number, &row)| Some((number, self.rows.get(row as usize)?.as_ref()?)))
        })
    }
}

impl Index<u64> for Live {
    type Output = Attempt;

    fn index(&self, number: u64) -> &Attempt {
        self.get(number)
            .expect("whoever knows the number of an attempt knows that it lives")
    }
}
