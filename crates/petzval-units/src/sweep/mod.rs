//! Sweeps: a file says what is run and what varies; every combination is a unit of a store, and what came out is one table.
//!
//! ```text
//! Source -> Expansion -> Plan -> units.jsonl in a store -> SweepStatus, Gathered -> SweepView
//! ```

mod estimate;
mod expand;
mod file;
mod files;
mod gather;
mod kept;
mod name;
mod place;
mod plan;
mod script;
mod status;
mod view;

pub use crate::store::State;
pub use estimate::{Estimate, estimate};
pub use expand::{Combination, Expansion, MOST_UNITS, SweptKey, expand};
pub use file::{Level, Source, SweepFile, parse};
pub use files::{RESULTS, keep_results, keep_scripts, log_of};
pub use gather::{Column, FigureColumn, Gathered, GatheredRow, Spread, UnitResult, gather, in_words};
pub use kept::{KeptSweep, KeptUnit, keyed, logs_folder, units_file, usual_store};
pub use name::{names, short_keys};
pub use plan::{DESIGN, Plan, PlannedUnit, plan};
pub use script::{Engine, Submission, USUAL_JOBS, USUAL_TIME};
pub use status::{SweepStatus, UnitStatus, status};
pub use view::{Choice, figures_that_vary, number, view};
