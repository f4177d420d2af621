//! The `flyby` program.
fn main() {}
