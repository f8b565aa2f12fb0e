//! Captures that mislead: each either is an error, or gives a warning and leaves the numbers right.

mod captures;
#[path = "../common/mod.rs"]
mod common;
mod levels;
mod lists;
mod noise;
mod points;
