//! What reports show of finished runs.

mod attribution;
pub mod comparison;
mod pictures;
pub mod run_report;
