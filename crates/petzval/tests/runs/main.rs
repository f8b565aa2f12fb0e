//! Designs from the first step to the last: runs, their folders, and what is made of them.

#[path = "../common/mod.rs"]
mod common;

mod apply;
mod compare;
mod curves;
mod design;
mod finite;
mod init;
mod moved;
mod output;
mod resume;
mod segments;
mod studio;
mod units;
