//! Verbs on lenses and glasses.

#[path = "../common/mod.rs"]
mod common;

mod analyze;
mod convert;
mod glass;
mod lens_figures;
mod operands;
mod optimize;
mod show;
mod tolerance;
mod wide_fields;
