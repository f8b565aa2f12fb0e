//! Sweeps: a file says what is run and what varies; every combination is a unit of a store, and what came out is one table.
//!
//! ```text
//! Source -> Expansion -> Plan -> units.jsonl in a store -> SweepStatus, Gathered -> SweepView
//! ```

mod expand;
mod file;
mod name;
mod plan;
mod script;

pub use expand::{Combination, Expansion, MOST_UNITS, SweptKey, expand};
pub use file::{Level, Source, SweepFile, parse};
pub use name::{names, short_keys};
pub use plan::{DESIGN, Plan, PlannedUnit, plan};
pub use script::{Engine, Submission, USUAL_JOBS, USUAL_TIME};
