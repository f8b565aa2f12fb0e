//! The built-in lens files are possible lenses and keep their bits in a round trip; errors of bad files name place and reason.

#[path = "../../../petzval-optics/tests/common/mod.rs"]
mod common;
mod contents;
mod errors;
mod sizes;
mod special_surfaces;
mod support;
mod variables;
