//! The book: its reference pages are those of the program, and its blocks run.

#[path = "../common/mod.rs"]
mod common;

mod blocks;
mod reference;
