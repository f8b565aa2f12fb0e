//! Bad input, data sets, files, and what a command says of itself.

#[path = "../common/mod.rs"]
mod common;

mod bad_input;
mod data;
mod defaults;
mod detect;
mod files;
mod machine;
mod names;
mod schema;
mod sweep;
