//! The gallery: `index` says what is shown, `size` how large, `record` what was rendered, `page` how it looks.

pub(crate) mod index;
pub(crate) mod page;
pub(crate) mod record;
pub(crate) mod size;
pub(crate) mod telling;
