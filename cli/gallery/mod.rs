//! The gallery: `index` says what is shown, `record` what was rendered, `page` how it looks.

pub(crate) mod index;
pub(crate) mod page;
pub(crate) mod record;
