//! Many jobs: each is a unit of work with a key of its own in a store that several processes share.

pub mod jobs;
pub mod runs;
pub mod store;
pub mod sweep;
pub mod unit;

pub use jobs::{rows, table};
pub use store::{Outcome, RunOptions, Store, Summary, UnitState, run_all, run_unit};
pub use unit::{Key, Shard, Unit, UnitFile};
